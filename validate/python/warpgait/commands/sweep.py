"""`warpgait sweep SWEEP.toml`: many scenarios, each planned in a process of its own; tables and a page of how they ended.

What was done is not done again: the command resumes where it was interrupted. Exit code 0: every case has a result; 2: bad input, or a file
or standard output cannot be written; 130: interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from ..arguments import Parser
from ..console import INTERRUPTED, answer, emit, run
from ..errors import InputError
from ..sweeps import spec
from ..sweeps.run import run as run_sweep
from ..text import visible


def _parser() -> Parser:
    parser = Parser(
        prog="warpgait sweep",
        description="Plans many scenarios that differ in some values, here or on a cluster, and resumes where it was interrupted.",
        epilog=spec.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("sweep", type=Path, help="SWEEP.toml")
    parser.add_argument("-o", "--output", type=Path, help="folder for the results (default: NAME.sweep beside the file)")
    parser.add_argument("--workers", type=int, help="processes at once (default: as many as there are cores)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="plan on the workers of a Dask scheduler, such as tcp://host:8786")
    parser.add_argument("--shard", metavar="I/N", help="only the I-th of N parts, from 1; all can share a folder")
    parser.add_argument("--again", action="store_true", help="plan cases again that timed out or were killed")
    parser.add_argument("--list", action="store_true", help="show the cases, and plan nothing")
    parser.add_argument("--json", action="store_true", help="print the outcome as JSON")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress on standard error")
    return parser


def _shard(text: str | None) -> tuple[int, int]:
    """Which of how many parts, from 0."""
    if text is None:
        return 0, 1
    part, _, parts = text.partition("/")
    if not (part.isascii() and part.isdigit() and parts.isascii() and parts.isdigit()) or not 1 <= int(part) <= int(parts):
        raise InputError(f"--shard {text}: expected I/N with I from 1 to N, such as 2/8")
    return int(part) - 1, int(parts)


def _line(case: spec.Case, result: dict[str, Any]) -> str:
    values = ", ".join(
        f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}" for key, value in case.values.items()
    )
    reason = f": {result['reason']}" if result.get("reason") else ""
    return f"{result['status']} in {result['wall_seconds']:.1f} s ({values}){reason}"


def _main(options: argparse.Namespace) -> int:
    sweep = spec.read(options.sweep)
    shard = _shard(options.shard)
    if options.list:
        mine = [case for case in sweep.cases() if case.number % shard[1] == shard[0]]
        emit("\n".join(f"{case.number} {case.name} {visible(json.dumps(dict(case.values)))}" for case in mine))
        return 0

    def begin(finished: int, count: int) -> None:
        if finished and not options.quiet:
            print(f"sweep: {finished} of {count} cases have results", file=sys.stderr)

    def progress(finished: int, count: int, case: spec.Case, result: dict[str, Any]) -> None:
        if not options.quiet:
            print(f"sweep: {finished} of {count}: {visible(_line(case, result))}", file=sys.stderr)

    found = run_sweep(
        sweep,
        options.output or options.sweep.with_name(f"{options.sweep.stem}.sweep"),
        title=f"{options.sweep.stem}: a sweep",
        workers=options.workers,
        scheduler=options.scheduler,
        shard=shard,
        again=options.again,
        begin=begin,
        progress=progress,
    )
    if found.interrupted:
        print("sweep: interrupted; the same command goes on from here", file=sys.stderr)
    if options.json:
        written = [str(path) for path in found.written]
        emit(json.dumps({"cases": found.total, "outcomes": found.counts, "written": written}))
    else:
        outcomes = ", ".join(f"{count} {status}" for status, count in found.counts.items()) or "none has a result"
        emit("\n".join([f"{found.total} cases: {outcomes}", *(visible(path) for path in found.written)]))
    return INTERRUPTED if found.interrupted else 0


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(words)
    return answer("sweep", options.json, lambda: _main(options))


if __name__ == "__main__":
    raise SystemExit(run(main))
