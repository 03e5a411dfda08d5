"""What commands print: results on standard output, everything else on standard error."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable
from types import FrameType

from .children import end_with_parent
from .errors import InputError
from .text import visible

ERROR, INTERRUPTED = 2, 130  # exit codes
_ONE_CTRL_C = 0.5  # s, within which it comes from the terminal and from the program that started this one


class OutputError(Exception):
    """Standard output cannot be written. What the command wrote to files stays."""


def emit(text: str) -> None:
    """Print a result; raises `OutputError` if it cannot be written. A reader who has closed the output, as in `… | head`, is no failure."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _discard()
    except OSError as error:
        _discard()
        raise OutputError(f"standard output: {error.strerror}") from error


def complain(text: object) -> None:
    """Print an error, on one line."""
    print(f"error: {visible(text)}", file=sys.stderr)


def _discard() -> None:
    """From now on, nothing more goes to standard output, not even what is buffered."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def answer(name: str, as_json: bool, work: Callable[[], int]) -> int:
    """The exit code of a command's work. Bad input is one line, with `--json` an object as well; Ctrl-C is said and ends the command."""
    try:
        return work()
    except (InputError, OSError) as error:
        complain(error)
        if as_json:
            emit(json.dumps({"error": visible(error)}))
        return ERROR
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return INTERRUPTED


def keep_standard_streams() -> None:
    """See to it that no file takes the place of a standard stream that is closed."""
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def _count_ctrl_c_once() -> None:
    """Ctrl-C from the terminal and passed on (`src/cli/python.rs`) interrupts once. Where SIGINT is ignored, it stays so."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return
    last = -_ONE_CTRL_C

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal last
        before, last = last, time.monotonic()
        if last - before > _ONE_CTRL_C:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)


def run(main: Callable[[], int]) -> int:
    """Run a command; returns its exit code, or 2 if its output cannot be written. It ends with the program that started it."""
    end_with_parent()
    _count_ctrl_c_once()
    keep_standard_streams()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    try:
        code = main()
    except OutputError as error:
        complain(error)
        return ERROR
    except SystemExit as end:  # of argparse
        code = end.code if isinstance(end.code, int) else ERROR
    if code == INTERRUPTED:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # it may still be passed on
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        _discard()
    except OSError as error:
        _discard()
        complain(f"standard output: {error.strerror}")
        return ERROR
    return code
