"""Other processes of this package: how they are started, isolated from the working folder, and that they end with their parents."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from contextlib import suppress

_PARENT = "WARPGAIT_PARENT"  # as in src/replay.rs
_SIGNAL_OF_PARENTS_DEATH = 1  # PR_SET_PDEATHSIG
_ORPHAN = 143  # 128 + SIGTERM, an exit code that no process is left to read


def child(module: str, opengl: str) -> tuple[list[str], dict[str, str]]:
    """The command that runs `module` of this package in another Python with the same modules, and its environment.

    `opengl` is what MuJoCo draws with, or "disable". The module calls `end_with_parent`; the thread that starts it must wait for it.
    """
    # An empty entry of the path would be the working folder.
    path = os.pathsep.join(folder for folder in sys.path if os.path.isabs(folder))
    environment = dict(os.environ, MUJOCO_GL=opengl, PYTHONPATH=path) | {_PARENT: str(os.getpid())}
    return [sys.executable, "-P", "-m", module], environment


def end_with(parent: int) -> None:
    """From now on the system (Linux) ends this process with its parent, the process `parent`; at once if that is gone already."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_SIGNAL_OF_PARENTS_DEATH, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(_ORPHAN)


def end_with_parent() -> None:
    """`end_with` the process that started this one for warpgait, if one did. A script in between, as `WARPGAIT_PYTHON`, ends by itself."""
    parent = os.environ.pop(_PARENT, "")
    if not parent.isdigit():
        return
    if int(parent) == os.getppid():
        end_with(int(parent))
        return
    try:
        os.kill(int(parent), 0)
    except ProcessLookupError:
        os._exit(_ORPHAN)
    except OSError:  # it is there, and not ours
        return
