"""Pictures and films of a replay.

Rendering runs in a process of its own (`render.py`): MuJoCo chooses its OpenGL at import, and a driver that crashes must not
take the report with it. EGL is tried first, then OSMesa; neither needs a display.
"""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import numpy.typing as npt

from .plan import Heightfield
from .scene import build
from .validation import Validation

PICTURES, FRAMES_PER_SECOND = 6, 30
STRIP_SIZE, FILM_SIZE = (480, 270), (640, 360)  # pixels
CELL, AROUND = 0.05, 1.5  # m: terrain as drawn, and how far around the robot's way
SHADOW = 1024  # pixels a side of the shadow's picture: without a GPU the usual 4096 take as long as all the rest
PACKAGES = "On Debian: apt install libegl1 libgl1-mesa-dri (or libosmesa6) for pictures, and ffmpeg for films."


class FilmError(Exception):
    """No pictures, and why."""


def ffmpeg() -> str | None:
    """The ffmpeg of the system, or that of the Python package imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return None


def _drawn_terrain(v: Validation) -> Heightfield:
    """The terrain around the way, coarse: without a GPU a film of half a million triangles takes minutes."""
    terrain = v.shown.terrain
    rows, columns = terrain.heights.shape
    low = v.plan.base_position[:, :2].min(0) - AROUND
    high = v.plan.base_position[:, :2].max(0) + AROUND
    first = np.clip(np.floor((low - terrain.origin) / terrain.spacing).astype(int), 0, [columns - 2, rows - 2])
    last = np.clip(np.ceil((high - terrain.origin) / terrain.spacing).astype(int), first + 1, [columns - 1, rows - 1])
    every = np.minimum(np.maximum(1, np.floor(CELL / terrain.spacing + 1e-9).astype(int)), last - first)
    heights = terrain.heights[first[1] : last[1] + 1 : every[1], first[0] : last[0] + 1 : every[0]]
    return Heightfield(heights, terrain.origin + first * terrain.spacing, every * terrain.spacing)


def _render(v: Validation, times: npt.NDArray[np.float64], size: tuple[int, int], output: Path, seconds: float) -> None:
    """Render the replay to look at, at `times` to `output` (an .mp4, or a folder of PNG files), in another process."""
    trial = v.shown
    r = trial.replay
    at = np.minimum(np.searchsorted(r.t, times), len(r.t) - 1)
    with tempfile.TemporaryDirectory() as folder:
        model, frames = Path(folder) / "world.mjb", Path(folder) / "frames.npz"
        robot, disturbance = v.plan.robot, v.settings.disturbance
        world = build(v.model_path, _drawn_terrain(v), robot.friction, robot.gravity, disturbance=disturbance, cell=CELL)
        world.vis.quality.shadowsize = SHADOW
        mujoco.mj_saveModel(world, str(model), None)
        points = trial.reference.foot[at] - v.index.radius * trial.reference.normal[at]
        np.savez(
            frames, qpos=r.qpos[at], look=trial.reference.com[at], point=points, force=trial.reference.force[at] / v.plan.weight
        )
        job = json.dumps(
            {
                "model": str(model),
                "frames": str(frames),
                "size": size,
                "output": str(output),
                "ffmpeg": ffmpeg(),
                "frames_per_second": FRAMES_PER_SECOND,
            }
        )
        complaint = ""
        for backend in [b] if (b := os.environ.get("MUJOCO_GL")) else ["egl", "osmesa"]:
            environment = dict(os.environ, MUJOCO_GL=backend, PYTHONPATH=os.pathsep.join(sys.path))
            try:
                done = subprocess.run(
                    [sys.executable, "-m", "warpgait.render", job],
                    env=environment,
                    capture_output=True,
                    text=True,
                    timeout=seconds,
                    check=False,
                )
            except subprocess.TimeoutExpired:
                raise FilmError(f"Rendering took longer than {seconds:.0f} s and was stopped.") from None
            if done.returncode == 0:
                return
            last = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
            complaint += f" {backend}: {last[0]}."
        raise FilmError(f"No pictures: neither EGL nor OSMesa could render.{complaint} {PACKAGES}")


def strip(v: Validation) -> list[tuple[float, bytes]]:
    """A few pictures of the replay to look at, (time, PNG)."""
    end = float(v.shown.replay.t[-1])
    times = np.linspace(0.02, 0.98, PICTURES) * end
    with tempfile.TemporaryDirectory() as folder:
        _render(v, times, STRIP_SIZE, Path(folder), 60.0)
        return [(float(t), (Path(folder) / f"{i}.png").read_bytes()) for i, t in enumerate(times)]


def video(v: Validation, target: Path) -> None:
    """The replay to look at, as an MP4 at its natural speed."""
    if ffmpeg() is None:
        raise FilmError(f"No film: ffmpeg was not found. {PACKAGES} Or: pip install imageio-ffmpeg")
    end = float(v.shown.replay.t[-1])
    _render(v, np.arange(int(end * FRAMES_PER_SECOND) + 1) / FRAMES_PER_SECOND, FILM_SIZE, target, 60.0 + 30.0 * end)
