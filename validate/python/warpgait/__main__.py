"""`warpgait …` and `python -m warpgait …`: the command line of the compiled part, in this process."""

from __future__ import annotations

import signal
import sys

from . import _native
from .console import keep_standard_streams


def main() -> int:
    """Run the command; returns the exit code."""
    keep_standard_streams()
    # Until the compiled part handles Ctrl-C, it ends the process; Python's own handler would wait for the end of the call.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.run_command(["warpgait", *sys.argv[1:]], sys.executable, _native.__file__)


if __name__ == "__main__":
    raise SystemExit(main())
