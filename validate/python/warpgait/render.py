"""The rendering process of `film.py`: `python -m warpgait.render JOB`. It imports little, because it is started for each film."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from .arrays import Array
from .children import end_with_parent
from .files import replacing, write_bytes

Image = npt.NDArray[np.uint8]

CAMERA_DISTANCE, CAMERA_AZIMUTH, CAMERA_ELEVATION = 2.2, 125.0, -18.0  # m, degrees
EXTENT = 1.5  # m, the ANYmals' `statistic extent`; the camera's distance goes by that of the model
CAMERA_DROP = 0.2  # m: the camera looks this far below the center of mass, so that the ground is in the picture
ARROW_LENGTH, ARROW_RADIUS = 0.8, 0.02  # m; the length is that of a force of m g
ARROW_COLOR = np.array([0.1, 0.8, 0.2, 1.0], np.float32)  # green
LEAST_FORCE = 0.01  # of m g: smaller forces have no arrow


def png(image: Image) -> bytes:
    """An RGB image (rows, columns, 3) as PNG."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    rows, columns, _ = image.shape
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), image.reshape(rows, -1)], axis=1)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines.tobytes(), 9)) + chunk(b"IEND", b"")


def _encoder(target: Path, size: tuple[int, int], ffmpeg: str, frames_per_second: int) -> subprocess.Popen[bytes]:
    """An ffmpeg that makes an MP4 of raw frames from its standard input."""
    frames = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", str(frames_per_second), "-i", "-"]
    film = ["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(target)]
    return subprocess.Popen([ffmpeg, "-y", "-loglevel", "error", *frames, *film], stdin=subprocess.PIPE)


def _arrows(scene: Any, points: Array, forces: Array, size: float) -> None:
    """Planned forces (E, 3), as fractions of m g, as arrows at `points` (E, 3) of a robot of a size in ANYmals."""
    arrow = mujoco.mjtGeom.mjGEOM_ARROW
    for point, force in zip(points, forces, strict=True):
        if np.linalg.norm(force) > LEAST_FORCE and scene.ngeom < scene.maxgeom:
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(geom, arrow, np.zeros(3), np.zeros(3), np.zeros(9), ARROW_COLOR)
            mujoco.mjv_connector(geom, arrow, size * ARROW_RADIUS, point, point + size * ARROW_LENGTH * force)
            scene.ngeom += 1


def _renderer(job: dict[str, Any], model: Any) -> Any:
    width, height = job["size"]
    return mujoco.Renderer(model, height, width)


def _images(job: dict[str, Any]) -> Iterator[Image]:
    """The frames of a job, rendered by a camera that follows the robot."""
    model, frames = mujoco.MjModel.from_binary_path(job["model"]), np.load(job["frames"])
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    size = model.stat.extent / EXTENT
    camera.distance, camera.azimuth, camera.elevation = size * CAMERA_DISTANCE, CAMERA_AZIMUTH, CAMERA_ELEVATION
    with _renderer(job, model) as renderer:
        for qpos, look, points, forces in zip(*(frames[name] for name in ("qpos", "look", "point", "force")), strict=True):
            data.qpos[:] = qpos
            mujoco.mj_forward(model, data)
            camera.lookat[:] = look - [0, 0, size * CAMERA_DROP]
            renderer.update_scene(data, camera)
            _arrows(renderer.scene, points, forces, size)
            yield renderer.render()


def _together(job: dict[str, Any]) -> Image:
    """All frames of a job in one picture, by a camera that stands still."""
    model, frames = mujoco.MjModel.from_binary_path(job["model"]), np.load(job["frames"])
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    for name, value in job["camera"].items():
        setattr(camera, name, value)
    with _renderer(job, model) as renderer:
        for number, qpos in enumerate(frames["qpos"]):
            data.qpos[:] = qpos
            mujoco.mj_forward(model, data)
            if number == 0:
                renderer.update_scene(data, camera)
            else:
                robot = mujoco.mjtCatBit.mjCAT_DYNAMIC
                mujoco.mjv_addGeoms(model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), robot, renderer.scene)
        return np.asarray(renderer.render())


def _write_film(job: dict[str, Any], target: Path) -> None:
    with replacing(target) as temporary:
        encoder = _encoder(temporary, job["size"], job["ffmpeg"], job["frames_per_second"])
        assert encoder.stdin is not None
        for image in _images(job):
            encoder.stdin.write(image.tobytes())
        encoder.stdin.close()
        if encoder.wait() != 0:
            raise SystemExit("ffmpeg failed")


def main(job_text: str) -> None:
    """`job_text` is JSON: `model` and `frames` (files), `size` [width, height], `output` (an .mp4, a .png of all frames together, or a
    folder), `ffmpeg`, `frames_per_second`, and `camera` for a .png."""
    job = json.loads(job_text)
    output = Path(job["output"])
    if output.suffix == ".mp4":
        _write_film(job, output)
    elif output.suffix == ".png":
        write_bytes(output, png(_together(job)))
    else:
        for i, image in enumerate(_images(job)):
            (output / f"{i}.png").write_bytes(png(image))


if __name__ == "__main__":
    end_with_parent()
    main(sys.argv[1])
