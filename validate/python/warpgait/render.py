"""The rendering process of `film.py`: `python -m warpgait.render JOB`. Imports little, for it starts anew for every film."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]


def png(image: Image) -> bytes:
    """An RGB image (rows, columns, 3) as PNG."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    rows, columns, _ = image.shape
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), image.reshape(rows, -1)], axis=1)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines.tobytes(), 9)) + chunk(b"IEND", b"")


class _VideoWriter:
    """Feeds raw frames to ffmpeg."""

    def __init__(self, target: Path, size: tuple[int, int], ffmpeg: str, frames_per_second: int) -> None:
        self.target, self.temporary = target, target.with_name(f".{target.stem}.{os.getpid()}.mp4")
        picture = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", str(frames_per_second), "-i", "-"]
        command = [
            ffmpeg,
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
            raise SystemExit("ffmpeg failed")
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
    """`job_text` is JSON: `model` and `frames` (files), `size` (width, height), `output` (an .mp4, or a folder), `ffmpeg`, `frames_per_second`."""
    job = json.loads(job_text)
    model, frames = mujoco.MjModel.from_binary_path(job["model"]), np.load(job["frames"])
    output, size = Path(job["output"]), (int(job["size"][0]), int(job["size"][1]))
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 2.2, 125.0, -18.0
    writer = _VideoWriter(output, size, job["ffmpeg"], job["frames_per_second"]) if output.suffix == ".mp4" else None
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
