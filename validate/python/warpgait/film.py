"""Pictures and films of a replay.

Rendering runs in a process of its own (`render.py`), because MuJoCo chooses its OpenGL at import, and because a driver that crashes must
not end the validation. EGL is tried first, then OSMesa; neither needs a display.
"""

from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from .children import child
from .plan import Heightfield
from .scene import build_world
from .validation import Validation

PICTURES, FRAMES_PER_SECOND = 6, 30
PICTURE_SPAN = 0.02, 0.98  # fractions of the replay at the first and the last picture
MOMENTS = 3  # of the walk, together in the still
PICTURE_SIZE, FILM_SIZE, STILL_SIZE = (480, 270), (640, 360), (1280, 560)  # pixels
DRAWN_CELL, FINE_CELL = 0.05, 0.02  # m, of the terrain as drawn, and as drawn in the still
DRAWN_MARGIN = 1.5  # m of terrain that is drawn around the robot's path
SHADOW_SIZE, STILL_SHADOW_SIZE = 1024, 4096  # pixels, of the square shadow map: without a GPU, 4096 take as long as all the rest
STILL_AZIMUTH, STILL_ELEVATION = (
    66.0,
    -18.0,
)  # degrees, from the direction of the walk, so that the camera is behind it, to the right
STILL_DROP = 0.35  # m that the camera of the still looks below the path of the center of mass
STILL_DISTANCE, LEAST_DISTANCE = 0.55, 1.5  # of that camera: by the length of the walk, and this, m, more
TIME_LIMIT, TIME_LIMIT_OF_FILM = 60.0, 30.0  # s, and s more for each second of a film
PACKAGES = "On Debian: apt install libegl1 libgl1-mesa-dri (or libosmesa6) for pictures, and ffmpeg for films."


class FilmError(Exception):
    """Pictures or a film could not be made; the message says why."""


def ffmpeg() -> str | None:
    """The path of the system's ffmpeg, or of the one in the Python package imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found and os.path.isabs(found):  # a relative one lies in the working folder
        return found
    try:
        return str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return None


def _drawn_terrain(v: Validation, cell: float) -> Heightfield:
    """The terrain around the robot's path, on a coarser grid: without a GPU, a film of half a million triangles takes minutes."""
    terrain = v.shown.terrain
    rows, columns = terrain.heights.shape
    low = v.plan.base_position[:, :2].min(0) - DRAWN_MARGIN
    high = v.plan.base_position[:, :2].max(0) + DRAWN_MARGIN
    first = np.clip(np.floor((low - terrain.origin) / terrain.spacing).astype(int), 0, [columns - 2, rows - 2])
    last = np.clip(np.ceil((high - terrain.origin) / terrain.spacing).astype(int), first + 1, [columns - 1, rows - 1])
    every = np.minimum(np.maximum(1, np.floor(cell / terrain.spacing + 1e-9).astype(int)), last - first)
    heights = terrain.heights[first[1] : last[1] + 1 : every[1], first[0] : last[0] + 1 : every[0]]
    return Heightfield(heights, terrain.origin + first * terrain.spacing, every * terrain.spacing)


@dataclass(frozen=True)
class _Job:
    """What `render.py` is to draw of the trial to look at."""

    times: npt.NDArray[np.float64]  # s
    size: tuple[int, int]  # pixels
    output: Path  # an .mp4, a .png of all times together, or a folder of PNG files
    seconds: float  # that it may take
    cell: float = DRAWN_CELL  # m, of the terrain
    shadow_size: int = SHADOW_SIZE
    camera: dict[str, Any] | None = None  # distance, azimuth, elevation and lookat; else it follows the robot


def _render(v: Validation, job: _Job) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write_scene(v, job, folder)
        text = json.dumps(
            {
                "model": str(folder / "world.mjb"),
                "frames": str(folder / "frames.npz"),
                "size": job.size,
                "output": str(job.output),
                "ffmpeg": ffmpeg(),
                "frames_per_second": FRAMES_PER_SECOND,
                "camera": job.camera,
            }
        )
        errors = ""
        for backend in [b] if (b := os.environ.get("MUJOCO_GL")) else ["egl", "osmesa"]:
            error = _render_with(backend, text, job.seconds)
            if error is None:
                return
            errors += f" {backend}: {error}."
    raise FilmError(f"No pictures: neither EGL nor OSMesa could render.{errors} {PACKAGES}")


def _write_scene(v: Validation, job: _Job, folder: Path) -> None:
    """The model and the frames of the trial to look at, for `render.py`."""
    trial, robot = v.shown, v.plan.robot
    world = build_world(
        v.model_path,
        _drawn_terrain(v, job.cell),
        robot.friction,
        robot.gravity,
        disturbance=v.settings.disturbance,
        cell=job.cell,
    )
    world.vis.quality.shadowsize = job.shadow_size
    world.vis.global_.offwidth, world.vis.global_.offheight = job.size
    mujoco.mj_saveModel(world, str(folder / "world.mjb"), None)
    at = np.minimum(np.searchsorted(trial.replay.t, job.times), len(trial.replay.t) - 1)
    np.savez(
        folder / "frames.npz",
        qpos=trial.replay.qpos[at],
        look=trial.reference.com[at],
        point=trial.reference.foot[at] - v.index.radius * trial.reference.normal[at],
        force=trial.reference.force[at] / v.plan.weight,
    )


def _render_with(backend: str, job: str, seconds: float) -> str | None:
    """Run `render.py` with one OpenGL; returns the last line of its error, or None."""
    command, environment = child("warpgait.render", backend)
    try:
        done = subprocess.run([*command, job], env=environment, capture_output=True, text=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        raise FilmError(f"Rendering timed out after {seconds:.0f} s.") from None
    if done.returncode == 0:
        return None
    return (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]


def pictures(v: Validation) -> list[tuple[float, bytes]]:
    """A few pictures of the trial to look at, (time s, PNG)."""
    end = float(v.shown.replay.t[-1])
    times = np.linspace(*PICTURE_SPAN, PICTURES) * end
    with tempfile.TemporaryDirectory() as folder:
        _render(v, _Job(times, PICTURE_SIZE, Path(folder), TIME_LIMIT))
        return [(float(t), (Path(folder) / f"{i}.png").read_bytes()) for i, t in enumerate(times)]


def still(v: Validation, target: Path) -> None:
    """The trial to look at in one picture: the robot at a few moments."""
    path = v.plan.base_position
    # At equal distances along the walk.
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    times = np.interp(np.linspace(0, way[-1], MOMENTS), way, v.plan.t) + (v.shown.replay.t[-1] - v.plan.t[-1])
    step = path[-1] - path[0]
    camera = {
        "distance": STILL_DISTANCE * float(np.hypot(*step[:2])) + LEAST_DISTANCE,
        "azimuth": STILL_AZIMUTH + float(np.degrees(np.arctan2(step[1], step[0]))),
        "elevation": STILL_ELEVATION,
        "lookat": list((path[0] + path[-1]) / 2 - [0, 0, STILL_DROP]),
    }
    _render(v, _Job(times, STILL_SIZE, target, TIME_LIMIT, FINE_CELL, STILL_SHADOW_SIZE, camera))


def video(v: Validation, target: Path) -> None:
    """The trial to look at, as an MP4 at real speed."""
    if ffmpeg() is None:
        raise FilmError(f"No film: ffmpeg was not found. {PACKAGES} Or: pip install imageio-ffmpeg")
    end = float(v.shown.replay.t[-1])
    times = np.arange(int(end * FRAMES_PER_SECOND) + 1) / FRAMES_PER_SECOND
    _render(v, _Job(times, FILM_SIZE, target, TIME_LIMIT + TIME_LIMIT_OF_FILM * end))
