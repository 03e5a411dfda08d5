"""Archives that would take all memory or time are refused at once."""

import io
import os
import struct
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warpgait.archive import MAX_UNPACKED, Archive
from warpgait.errors import InputError


def _npy(header: str, data: bytes = b"", version: int = 1) -> bytes:
    text = header.encode()
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version == 1 else "<I", len(text)) + text + data


def _archive(path: Path, members: dict[str, bytes]) -> Archive:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return Archive(path)


def test_what_numpy_writes_is_read(tmp_path: Path) -> None:
    arrays: dict[str, Any] = {
        "scalar": np.float64(2.5),
        "vector": np.arange(3.0),
        "matrix": np.arange(6.0).reshape(2, 3),
        "columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
        "empty": np.zeros((0, 3)),
        "flags": np.array([True, False]),
        "words": np.array(["LF", "Fuß"]),
    }
    np.savez_compressed(tmp_path / "a.npz", **arrays)
    found = Archive(tmp_path / "a.npz")
    assert set(found) == set(arrays) and "none" not in found
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype and found[name].shape == array.shape and (found[name] == array).all()


@pytest.mark.parametrize(
    "content",
    [
        _npy("{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,), }"),
        _npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"),
        _npy("{'descr': '<f8', 'fortran_order': False, 'shape': (0, 99999999999999999), }"),
        _npy("{'descr': '<U99999999', 'fortran_order': False, 'shape': (2,), }"),
        _npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"cos\nsystem\n(S'true'\ntR."),
        _npy("[" * 60000),
        _npy("{'descr': '<f8', 'fortran_order': False, 'shape': (" + "1, " * 20000 + "), }"),
        _npy(" " * 70000, version=2),
        _npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }", bytes(8)),
        _npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }", bytes(24)),
        _npy("{'descr': '|b1', 'fortran_order': False, 'shape': (1,), }", b"\x02"),
        _npy("{'descr': '<U1', 'fortran_order': False, 'shape': (1,), }", b"\xff\xff\xff\xff"),
        b"\x93NUMPY",
        b"",
    ],
)
def test_a_bad_member_is_refused_at_once(tmp_path: Path, content: bytes) -> None:
    archive = _archive(tmp_path / "bad.npz", {"t": content})
    start = time.perf_counter()
    with pytest.raises(InputError, match=r"bad\.npz: member t: "):
        _ = archive["t"]
    assert time.perf_counter() - start < 1


def test_members_that_unpack_to_gigabytes_are_refused(tmp_path: Path) -> None:
    half = MAX_UNPACKED // 16 + 1  # elements of a little more than half of what is allowed
    header = _npy(f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({half},), }}")
    with zipfile.ZipFile(tmp_path / "big.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in "ab":
            with archive.open(f"{name}.npy", "w") as file:
                file.write(header)
                for _ in range(half // (1 << 20)):
                    file.write(bytes(8 << 20))
                file.write(bytes(8 * (half % (1 << 20))))
    found = Archive(tmp_path / "big.npz")
    assert len(found["a"]) == half
    with pytest.raises(InputError, match="too large"):
        _ = found["b"]


def test_special_files_and_doubles_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, what in ((tmp_path / "pipe", "a pipe"), (Path("/dev/zero"), "a device"), (tmp_path, "a folder")):
        with pytest.raises(InputError, match=what):
            Archive(path)
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(1))
    with zipfile.ZipFile(tmp_path / "two.npz", "w") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("t.npy", buffer.getvalue())
        archive.writestr("t.npy", buffer.getvalue())
    with pytest.raises(InputError, match="one name"):
        Archive(tmp_path / "two.npz")
