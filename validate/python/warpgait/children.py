"""Other processes of this package: how they are started, isolated from the working folder."""

from __future__ import annotations

import os
import sys


def child(module: str, opengl: str) -> tuple[list[str], dict[str, str]]:
    """The command that runs `module` of this package in another Python with the same modules, and its environment.

    `opengl` is what MuJoCo draws with, or "disable".
    """
    # An empty entry of the path would be the working folder.
    path = os.pathsep.join(folder for folder in sys.path if os.path.isabs(folder))
    return [sys.executable, "-P", "-m", module], dict(os.environ, MUJOCO_GL=opengl, PYTHONPATH=path)
