"""The images in scenarios/data are what the scripts beside them make."""

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

DATA = Path(__file__).parents[2] / "scenarios/data"


def _content(image: Path) -> dict[bytes, bytes]:
    """The chunks of a PNG, the pixels decompressed: zlib may compress differently elsewhere."""
    data, at, chunks = image.read_bytes(), 8, {}
    while at < len(data):
        (length,) = struct.unpack_from(">I", data, at)
        chunks[data[at + 4 : at + 8]] = data[at + 8 : at + 8 + length]
        at += 12 + length
    return chunks | {b"IDAT": zlib.decompress(chunks[b"IDAT"])}


@pytest.mark.parametrize(
    ("script", "images"), [("make_rubble.py", ["rubble.png"]), ("make_grounds.py", ["stairs.png", "stepping_stones.png"])]
)
def test_the_scripts_make_the_images(script: str, images: list[str], tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-B", DATA / script, tmp_path], check=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == images
    for image in images:
        assert _content(tmp_path / image) == _content(DATA / image)
