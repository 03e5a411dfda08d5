"""Pictures and films of a replay.

Rendering runs in a process of its own (`python -m warpgait.film`): MuJoCo chooses its OpenGL at import, and a driver that crashes must not
take the report with it. EGL is tried first, then OSMesa; neither needs a display.
"""

from __future__ import annotations

import importlib
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from .plan import Heightfield
from .scene import build
from .validation import Validation

PICTURES, FRAMES_PER_SECOND = 6, 30
STRIP_SIZE, FILM_SIZE = (480, 270), (640, 360)  # pixels
CELL, AROUND = 0.05, 1.5  # m: terrain as drawn, and how far around the robot's way
PACKAGES = "On Debian: apt install libegl1 libgl1-mesa-dri (or libosmesa6) for pictures, and ffmpeg for films."

Image = npt.NDArray[np.uint8]


class FilmError(Exception):
    """No pictures, and why."""


def png(image: Image) -> bytes:
    """An RGB image (rows, columns, 3) as PNG."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    rows, columns, _ = image.shape
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), image.reshape(rows, -1)], axis=1)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines.tobytes(), 9)) + chunk(b"IEND", b"")


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
    terrain = v.plan.terrain
    rows, columns = terrain.heights.shape
    low = v.plan.base_position[:, :2].min(0) - AROUND
    high = v.plan.base_position[:, :2].max(0) + AROUND
    first = np.clip(np.floor((low - terrain.origin) / terrain.spacing).astype(int), 0, [columns - 2, rows - 2])
    last = np.clip(np.ceil((high - terrain.origin) / terrain.spacing).astype(int), first + 1, [columns - 1, rows - 1])
    every = np.minimum(np.maximum(1, np.floor(CELL / terrain.spacing + 1e-9).astype(int)), last - first)
    heights = terrain.heights[first[1] : last[1] + 1 : every[1], first[0] : last[0] + 1 : every[0]]
    return Heightfield(heights, terrain.origin + first * terrain.spacing, every * terrain.spacing)


def _render(v: Validation, times: npt.NDArray[np.float64], size: tuple[int, int], output: Path, seconds: float) -> None:
    """Render the counted replay at `times` to `output` (an .mp4, or a folder of PNG files), in another process."""
    trial = v.trials[0]
    r = trial.replay
    at = np.minimum(np.searchsorted(r.t, times), len(r.t) - 1)
    with tempfile.TemporaryDirectory() as folder:
        model, frames = Path(folder) / "world.mjb", Path(folder) / "frames.npz"
        world = build(v.model_path, _drawn_terrain(v), v.plan.robot.friction, v.plan.robot.gravity, cell=CELL)
        mujoco.mj_saveModel(world, str(model), None)
        points = trial.reference.foot[at] - v.index.radius * trial.reference.normal[at]
        np.savez(
            frames, qpos=r.qpos[at], look=trial.reference.com[at], point=points, force=trial.reference.force[at] / v.plan.weight
        )
        job = json.dumps({"model": str(model), "frames": str(frames), "size": size, "output": str(output)})
        complaint = ""
        for backend in [b] if (b := os.environ.get("MUJOCO_GL")) else ["egl", "osmesa"]:
            environment = dict(os.environ, MUJOCO_GL=backend, PYTHONPATH=os.pathsep.join(sys.path))
            try:
                done = subprocess.run(
                    [sys.executable, "-m", "warpgait.film", job],
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
    """A few pictures of the counted replay, (time, PNG)."""
    end = float(v.trials[0].replay.t[-1])
    times = np.linspace(0.02, 0.98, PICTURES) * end
    with tempfile.TemporaryDirectory() as folder:
        _render(v, times, STRIP_SIZE, Path(folder), 60.0)
        return [(float(t), (Path(folder) / f"{i}.png").read_bytes()) for i, t in enumerate(times)]


def video(v: Validation, target: Path) -> None:
    """The counted replay as an MP4 at its natural speed."""
    if ffmpeg() is None:
        raise FilmError(f"No film: ffmpeg was not found. {PACKAGES} Or: pip install imageio-ffmpeg")
    end = float(v.trials[0].replay.t[-1])
    _render(v, np.arange(int(end * FRAMES_PER_SECOND) + 1) / FRAMES_PER_SECOND, FILM_SIZE, target, 60.0 + 30.0 * end)


class _VideoWriter:
    """Feeds raw frames to ffmpeg."""

    def __init__(self, target: Path, size: tuple[int, int]) -> None:
        self.target, self.temporary = target, target.with_name(f".{target.stem}.{os.getpid()}.mp4")
        picture = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", str(FRAMES_PER_SECOND), "-i", "-"]
        command = [
            ffmpeg() or "ffmpeg",
            "-y",
            "-loglevel",
            "error",
            *picture,
            "-pix_fmt",
            "yuv420p",
            "-movflags",
            "+faststart",
            str(self.temporary),
        ]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE)

    def add(self, image: Image) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(image.tobytes())

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        if self.process.wait() != 0:
            self.temporary.unlink(missing_ok=True)
            raise FilmError("ffmpeg failed")
        self.temporary.replace(self.target)


def _arrows(scene: Any, points: npt.NDArray[np.float64], forces: npt.NDArray[np.float64]) -> None:
    """Planned forces as green arrows, 0.8 m for the robot's weight."""
    color = np.array([0.1, 0.8, 0.2, 1.0], np.float32)
    for point, force in zip(points, forces, strict=True):
        if np.linalg.norm(force) > 0.01 and scene.ngeom < scene.maxgeom:
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.zeros(9), color)
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, 0.02, point, point + 0.8 * force)
            scene.ngeom += 1


def main(job_text: str) -> None:
    """The rendering process."""
    job = json.loads(job_text)
    model, frames = mujoco.MjModel.from_binary_path(job["model"]), np.load(job["frames"])
    output, size = Path(job["output"]), (int(job["size"][0]), int(job["size"][1]))
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 2.2, 125.0, -18.0
    writer = _VideoWriter(output, size) if output.suffix == ".mp4" else None
    with mujoco.Renderer(model, size[1], size[0]) as renderer:
        for i in range(len(frames["qpos"])):
            data.qpos[:] = frames["qpos"][i]
            mujoco.mj_forward(model, data)
            camera.lookat[:] = frames["look"][i] - [0, 0, 0.2]
            renderer.update_scene(data, camera)
            _arrows(renderer.scene, frames["point"][i], frames["force"][i])
            image = renderer.render()
            if writer is not None:
                writer.add(image)
            else:
                (output / f"{i}.png").write_bytes(png(image))
    if writer is not None:
        writer.close()


if __name__ == "__main__":
    main(sys.argv[1])
