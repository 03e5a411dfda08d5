"""Files that are written whole or not at all, by one rule for every output. `src/files/output.rs` does the same.

A file is written under a temporary name in its folder and then renamed. What is there is replaced only if it is a regular file that may be
written; its permissions stay. A symbolic link is followed: its target is replaced. Nobody can foresee the temporary name. It is locked while
its process runs, so that a later run can tell what a killed one left, and clear it.
"""

from __future__ import annotations

import fcntl
import os
import re
import secrets
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from .errors import InputError

_TEMPORARY = re.compile(r"\.warpgait-[0-9a-f]{16}\.part")
_MOST_LINKS = 40  # links that are followed until they count as a circle
_OLD = 24 * 3600.0  # s; where files cannot be locked, older temporary files count as left behind
_KINDS = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket"}


def stem_of(plan: Path) -> str:
    """NAME of a NAME.plan.npz: what is made from a plan is called after it."""
    return plan.name.removesuffix(".npz").removesuffix(".plan")


def kind(about: os.stat_result) -> str:
    """What something is that is not a regular file."""
    return _KINDS.get(stat.S_IFMT(about.st_mode), "a device")


def _refusal(shown: Path, why: object) -> InputError:
    return InputError(f"{shown}: cannot be written: {why}")


def _identity(about: os.stat_result) -> tuple[int, int]:
    return about.st_dev, about.st_ino


@dataclass(frozen=True)
class _Target:
    """Where an output goes once links are followed."""

    path: Path
    about: os.stat_result | None  # what is there now

    @property
    def place(self) -> tuple[tuple[int, int] | None, tuple[tuple[int, int], str]]:
        """What tells whether two paths are one file: device and inode of the file, if it exists, and of its folder, with its name there."""
        file = None if self.about is None else _identity(self.about)
        return file, (_identity(self.path.parent.stat()), self.path.name)


def _target(shown: Path) -> _Target:
    """Follow links, and refuse what must not be replaced."""
    if not shown.name:
        raise _refusal(shown, "this is not the name of a file")
    path = shown
    try:
        if shown.exists() and not shown.is_file():
            raise _refusal(shown, f"this is {kind(shown.stat())}; name a file")
        for _ in range(_MOST_LINKS):
            try:
                about = path.lstat()
            except FileNotFoundError:
                if not path.parent.is_dir():
                    raise _refusal(shown, f"there is no folder {path.parent}; create it first") from None
                return _Target(path, None)
            if not stat.S_ISLNK(about.st_mode):
                if not about.st_mode & 0o222:
                    raise _refusal(shown, "it is read-only; name another file, or allow writing (chmod u+w)")
                os.close(os.open(path, os.O_WRONLY))  # changes nothing, and finds what permissions do not tell
                return _Target(path, about)
            path = path.parent / os.readlink(path)
    except OSError as error:
        raise _refusal(shown, error.strerror) from error
    raise _refusal(shown, "its symbolic links form a circle")


def ensure_outputs(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Refuse outputs that cannot be written, are an input of the same command, or are the same file as another output.

    Files count as the same by device and inode, however they are spelled. What is there stays untouched. Raises `InputError`.
    """
    read = {_identity(path.stat()): path for path in inputs if path.exists()}
    places: list[tuple[_Target, Path]] = []
    for output in outputs:
        target = _target(output)
        file, entry = target.place
        if file in read:
            raise _refusal(output, f"it is {read[file]}, which this command reads; name another file or folder")
        for other, shown in places:
            if entry == other.place[1] or (file is not None and file == other.place[0]):
                raise _refusal(output, f"this command writes {shown} there as well; name another file or folder")
        places.append((target, output))
        descriptor, temporary = _open_temporary(output, target)
        os.close(descriptor)
        temporary.unlink()


def _open_temporary(shown: Path, target: _Target) -> tuple[int, Path]:
    """Create a file with a name that did not exist, and lock it."""
    _clear_left_behind(target.path.parent)
    mode = 0o666 if target.about is None else stat.S_IMODE(target.about.st_mode) & 0o777
    try:
        while True:
            path = target.path.parent / f".warpgait-{secrets.token_hex(8)}.part"
            try:
                descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, mode)
            except FileExistsError:
                continue
            with suppress(OSError):  # where files cannot be locked, age alone tells what was left behind
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            if os.fstat(descriptor).st_nlink == 0:  # another process took it for one left behind before it was locked
                os.close(descriptor)
                continue
            if target.about is not None:
                with suppress(OSError):  # only root may give a file away
                    os.fchown(descriptor, target.about.st_uid, target.about.st_gid)
                os.fchmod(descriptor, mode)
            return descriptor, path
    except OSError as error:
        raise _refusal(shown, error.strerror) from error


def _clear_left_behind(folder: Path) -> None:
    """Remove the temporary files in a folder whose processes were killed."""
    with suppress(OSError):
        for entry in os.scandir(folder):
            if _TEMPORARY.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                with suppress(OSError):
                    _clear(entry)


def _clear(entry: os.DirEntry[str]) -> None:
    descriptor = os.open(entry.path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:  # its process runs
        return
    except OSError:
        if time.time() - entry.stat().st_mtime < _OLD:
            return
    finally:
        os.close(descriptor)
    os.unlink(entry.path)


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A temporary file to open and write, renamed to `target` at the end. A killed process leaves no partial file under its name.

    If the block raises, the new file is removed and `target` stays as it was.
    """
    found = _target(target)
    descriptor, temporary = _open_temporary(target, found)
    try:
        yield temporary
        os.fsync(descriptor)
        temporary.replace(found.path)
    except OSError as error:
        raise _refusal(target, f"{error.strerror}; nothing was replaced") from error
    finally:
        os.close(descriptor)
        temporary.unlink(missing_ok=True)


def write_bytes(target: Path, content: bytes) -> None:
    """Write a whole file."""
    with replacing(target) as temporary:
        temporary.write_bytes(content)


def write_text(target: Path, text: str) -> None:
    """Write a whole text file in UTF-8."""
    write_bytes(target, text.encode(errors="backslashreplace"))
