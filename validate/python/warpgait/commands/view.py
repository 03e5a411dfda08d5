"""`warpgait view P.plan.npz`: a page of the plan, to look at and to send to others; it needs no network.

Exit code 0: written; 2: bad input, something needed is missing, or a file or standard output cannot be written.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import webbrowser
from pathlib import Path

from ..console import answer, emit, run
from ..errors import InputError
from ..files import ensure_outputs, stem_of, write_text
from ..settings import without_opengl
from ..text import visible

_DISPLAYS = "DISPLAY", "WAYLAND_DISPLAY"  # without one of them, there is no browser to open on Linux


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="warpgait view",
        description="Writes a page of a plan, and of its replay if that lies beside it, and opens it in the browser.",
    )
    parser.add_argument("plan", type=Path, help="NAME.plan.npz")
    parser.add_argument(
        "--html",
        type=Path,
        metavar="OUT.html",
        help="write this file, and open nothing (default: NAME.view.html beside the plan, opened)",
    )
    parser.add_argument("--json", action="store_true", help="print the path as JSON")
    parser.add_argument("-q", "--quiet", action="store_true", help="print errors only")
    return parser


def page_text(plan: Path) -> str:
    """The page of a plan; raises `InputError`."""
    try:
        with without_opengl():
            from ..viewer.page import page_of
    except ImportError as error:
        raise InputError(f"a Python package is missing: {error}. Run: pip install mujoco numpy scipy") from error
    return page_of(plan)


def write_page(plan: Path, target: Path) -> None:
    """Write the page of a plan; raises `InputError`."""
    ensure_outputs([target], [plan])
    write_text(target, page_text(plan))


def opened(page: Path) -> bool:
    """Open a page in the browser, if there is one; programs are not looked for in the working folder."""
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in (*_DISPLAYS, "BROWSER")):
        return False
    folders = os.environ.get("PATH", "").split(os.pathsep)
    os.environ["PATH"] = os.pathsep.join(folder for folder in folders if os.path.isabs(folder))
    try:
        return webbrowser.open(page.resolve().as_uri())
    except (webbrowser.Error, OSError):
        return False


def _main(options: argparse.Namespace) -> int:
    target = options.html or options.plan.with_name(f"{stem_of(options.plan)}.view.html")
    write_page(options.plan, target)
    shown = options.html is None and opened(target)
    if options.json:
        emit(json.dumps({"written": str(target), "opened": shown}))
    elif not options.quiet:
        emit(visible(target))
        if options.html is None and not shown:
            print("view: there is no browser to open it with; open this file in one", file=sys.stderr)
    return 0


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(words)
    return answer("view", options.json, lambda: _main(options))


if __name__ == "__main__":
    raise SystemExit(run(main))
