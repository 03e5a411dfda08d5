"""Writes 16-bit PNG images with the standard library alone."""

import struct
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path

WHITE = 65535  # largest 16-bit value
COLOR_TYPES = {1: 0, 2: 4}  # of PNG, by the number of channels: gray, gray + alpha


def write_png(path: Path, lines: Sequence[Sequence[Iterable[int]]]) -> None:
    """A PNG without filters of lines of pixels from the top; a pixel is (gray,) or (gray, alpha)."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = (b"\0" + b"".join(struct.pack(">H", v) for pixel in line for v in pixel) for line in lines)
    color_type = COLOR_TYPES[len(tuple(lines[0][0]))]
    header = struct.pack(">IIBBBBB", len(lines[0]), len(lines), 16, color_type, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"".join(rows), 9)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)
