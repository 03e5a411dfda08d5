"""Archives of NumPy arrays, read within bounds: what a member says about its size is judged before anything is allocated for it."""

from __future__ import annotations

import math
import os
import re
import stat
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import InputError
from .files import kind

MAX_FILE = MAX_UNPACKED = 512 << 20  # bytes, of the file, and of the elements of all members that are read
_MOST_MEMBERS = 1000
_MOST_AXES = 32
_MAX_HEADER = 1 << 16  # bytes

_START, _SIGNATURE = b"PK\x03\x04", b"\x93NUMPY"  # of archives and of arrays
# As NumPy writes it, of arrays of numbers, booleans and strings.
_HEADER = re.compile(
    r"\{'descr': '([<>|][fiubU][0-9]{1,8})', 'fortran_order': (True|False), 'shape': \(((?:[0-9]{1,18}, ?)*(?:[0-9]{1,18})?)\), \} *\n?"
)
_LAST_CHARACTER, _SURROGATES = 0x10FFFF, (0xD800, 0xDFFF)


class Archive(Mapping[str, npt.NDArray[Any]]):
    """The members of an archive, each read when it is asked for. Raises `InputError` with the name of a damaged one."""

    def __init__(self, path: Path) -> None:
        """Read the file, and find its members."""
        self.path, self._left = path, MAX_UNPACKED
        self._read: dict[str, npt.NDArray[Any]] = {}
        _ensure_archive(path)
        try:
            self._zip = zipfile.ZipFile(path)
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
            raise InputError(f"{path}: damaged: truncated, or not an .npz archive") from error
        names = [name.removesuffix(".npy") for name in self._zip.namelist()]
        if len(names) > _MOST_MEMBERS or len(set(names)) < len(names):
            raise InputError(f"{path}: damaged: more than {_MOST_MEMBERS} members, or two with one name")
        self._names = dict(zip(names, self._zip.infolist(), strict=True))

    def __iter__(self) -> Iterator[str]:
        """The names of the members."""
        return iter(self._names)

    def __len__(self) -> int:
        """How many members there are."""
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        """Whether there is such a member; it is not read."""
        return name in self._names

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """A member; raises `KeyError` if there is none."""
        if name not in self._read:
            try:
                with self._zip.open(self._names[name]) as file:
                    self._read[name] = self._array(file)
            except (
                zipfile.BadZipFile,
                zlib.error,
                ValueError,
                TypeError,
                EOFError,
                OSError,
                NotImplementedError,
                RuntimeError,
            ) as error:
                raise InputError(
                    f"{self.path}: member {name}: not readable as a plan (damaged or not an .npz archive): {error}"
                ) from error
        return self._read[name]

    def _array(self, file: Any) -> npt.NDArray[Any]:
        """Read one `.npy` file; raises `ValueError` with what is wrong."""
        dtype, shape, order = _header(file)
        size = math.prod(shape) * dtype.itemsize
        if size > self._left or max(shape, default=0) > MAX_UNPACKED:
            raise ValueError(f"{shape} of {dtype} is too large; all members together may take {MAX_UNPACKED >> 20} MiB")
        data = bytearray(file.read(size))
        if len(data) != size or file.read(1):  # at the end, the checksum is compared
            raise ValueError(f"the bytes of data do not make {shape} of {dtype}")
        self._left -= size
        if dtype.kind == "b" and size and max(data) > 1:
            raise ValueError("an element is neither true nor false")
        if dtype.kind == "U":
            codes = np.frombuffer(data, "<u4")
            if (codes > _LAST_CHARACTER).any() or ((codes >= _SURROGATES[0]) & (codes <= _SURROGATES[1])).any():
                raise ValueError("an element is no text")
        return np.frombuffer(data, dtype).reshape(shape, order=order)


def _ensure_archive(path: Path) -> None:
    """Refuse what is no regular file, too large, or does not begin like an archive."""
    try:
        about = os.stat(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: there is no such file") from error
    if not stat.S_ISREG(about.st_mode):
        raise InputError(f"{path}: {kind(about)}, not a plan (NAME.plan.npz)")
    if about.st_size > MAX_FILE:
        raise InputError(f"{path}: too large: more than the {MAX_FILE} bytes that are read")
    with path.open("rb") as file:
        start = file.read(len(_SIGNATURE))
    if start == _SIGNATURE:
        raise InputError(f"{path}: a single NumPy array, not a plan (an .npz archive)")
    if not start.startswith(_START):
        what = "an empty file" if not start else "not an .npz archive"
        raise InputError(f"{path}: {what}; a plan is a NAME.plan.npz that `warpgait solve` writes")


def _header(file: Any) -> tuple[np.dtype[Any], tuple[int, ...], Any]:
    """Type, shape and order of an array."""
    start = file.read(len(_SIGNATURE) + 2)
    if start[:-2] != _SIGNATURE or start[-2] not in (1, 2, 3):
        raise ValueError("it does not start like an array")
    length = int.from_bytes(file.read(2 if start[-2] == 1 else 4), "little")
    if length > _MAX_HEADER:
        raise ValueError(f"a header of {length} bytes; at most {_MAX_HEADER} are read")
    text = file.read(length)
    found = _HEADER.fullmatch(text.decode("latin1"))
    if len(text) < length or found is None:
        raise ValueError("its header is not one of an array of numbers, booleans or strings")
    name, fortran, axes = found.groups()
    dtype, shape = np.dtype(name), tuple(int(n) for n in axes.replace(",", " ").split())
    if dtype.itemsize == 0 or len(shape) > _MOST_AXES or (dtype.kind == "U" and name[0] != "<"):
        raise ValueError(f"{shape} of {name} is no array that a plan has")
    return dtype, shape, "F" if fortran == "True" else "C"
