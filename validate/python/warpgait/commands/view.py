"""`warpgait view P.plan.npz`: a page of the plan, to look at and to send to others; it needs no network.

With `--live`, the file is a scenario: it is planned, and the page shows the iterates as they come, then the plan.

Exit code 0: written; 1: with `--live`, the plan is not solved or fails a check; 2: bad input, something needed is missing, or a file or standard output cannot be written.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import webbrowser
from pathlib import Path

from ..arguments import Parser
from ..console import answer, emit, run
from ..errors import InputError
from ..files import ensure_outputs, stem_of, write_text
from ..settings import without_opengl
from ..text import visible

_DISPLAYS = "DISPLAY", "WAYLAND_DISPLAY"  # without one of them, there is no browser to open on Linux


def _parser() -> Parser:
    parser = Parser(
        prog="warpgait view",
        description="Writes a page of a plan, and of its replay if that lies beside it, and opens it in the browser.",
    )
    parser.add_argument("plan", type=Path, help="NAME.plan.npz; with --live NAME.toml")
    parser.add_argument(
        "--html",
        type=Path,
        metavar="OUT.html",
        help="write this file, and open nothing (default: NAME.view.html beside the plan, opened)",
    )
    planning = parser.add_argument_group("while a scenario is planned")
    planning.add_argument(
        "--live", action="store_true", help="the file is a scenario: plan it, and show the iterates as they come"
    )
    planning.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a value of the scenario")
    planning.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="the plan to write (default: NAME.plan.npz in the working folder)"
    )
    planning.add_argument(
        "--port", type=int, default=0, help="of the address that is served to this machine only (default: one that is free)"
    )
    planning.add_argument("--no-browser", action="store_true", help="open nothing, only print the address")
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


def opened(address: str) -> bool:
    """Open an address in the browser, if there is one; programs are not looked for in the working folder."""
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in (*_DISPLAYS, "BROWSER")):
        return False
    folders = os.environ.get("PATH", "").split(os.pathsep)
    os.environ["PATH"] = os.pathsep.join(folder for folder in folders if os.path.isabs(folder))
    try:
        return webbrowser.open(address)
    except (webbrowser.Error, OSError):
        return False


def _main(options: argparse.Namespace) -> int:
    if options.live:
        from .live import live

        code, written = live(options)
        if options.json:
            emit(json.dumps(written))
        return code
    if options.set or options.output or options.port or options.no_browser:
        raise InputError("--set, --output, --port and --no-browser are for --live")
    target = options.html or options.plan.with_name(f"{stem_of(options.plan)}.view.html")
    write_page(options.plan, target)
    shown = options.html is None and opened(target.resolve().as_uri())
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
