"""`python -m warpgait.sweep SWEEP.toml`: many scenarios, each planned in a process of its own; tables and a page of how they ended.

What was done is not done again: the command resumes where it was interrupted. Exit code 0: every case has a result; 2: bad input, or a file
or standard output cannot be written; 130: interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

from .console import INTERRUPTED, answer, emit, run
from .errors import InputError
from .files import ensure_outputs
from .sweeps import pool, results, spec
from .text import visible

_MOST_WORKERS = 1024


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="warpgait sweep",
        description="Plans many scenarios that differ in some values, and resumes where it was interrupted.",
        epilog=spec.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("sweep", type=Path, help="SWEEP.toml")
    parser.add_argument("-o", "--output", type=Path, help="folder for the results (default: NAME.sweep beside the file)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes at once (default %(default)s)")
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


def _folder(options: argparse.Namespace) -> Path:
    folder: Path = options.output or options.sweep.with_name(f"{options.sweep.stem}.sweep")
    try:
        (folder / "cases").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot make this folder ({error.strerror}); name another with --output") from error
    return folder


def _line(case: spec.Case, result: dict[str, Any]) -> str:
    values = ", ".join(
        f"{key} = {value:.4g}" if isinstance(value, float) else f"{key} = {value}" for key, value in case.values.items()
    )
    reason = f": {result['reason']}" if result.get("reason") else ""
    return f"{result['status']} in {result['wall_seconds']:.1f} s ({values}){reason}"


def _main(options: argparse.Namespace) -> int:
    sweep = spec.read(options.sweep)
    part, parts = _shard(options.shard)
    if not 1 <= options.workers <= _MOST_WORKERS:
        raise InputError(f"--workers {options.workers}: must be from 1 to {_MOST_WORKERS}")
    cases = sweep.cases()
    mine = [case for case in cases if case.number % parts == part]
    if options.list:
        emit("\n".join(f"{case.number} {case.name} {visible(json.dumps(dict(case.values)))}" for case in mine))
        return 0
    folder = _folder(options)
    ensure_outputs([folder / name for name in results.FILES], [options.sweep, sweep.scenario])
    unlucky = (pool.TIMED_OUT, pool.KILLED)
    done = {case.name: pool.result_of(folder, case) for case in mine}
    left = [case for case in mine if (found := done[case.name]) is None or (options.again and found["status"] in unlucky)]
    finished = len(mine) - len(left)

    def tell(case: spec.Case, result: dict[str, Any]) -> None:
        nonlocal finished
        finished += 1
        if not options.quiet:
            print(f"sweep: {finished} of {len(mine)}: {visible(_line(case, result))}", file=sys.stderr)

    if finished and not options.quiet:
        print(f"sweep: {finished} of {len(mine)} cases have results", file=sys.stderr)
    interrupted = False
    try:
        pool.run(sweep, folder, left, options.workers, tell)
    except KeyboardInterrupt:
        interrupted = True
        print("sweep: interrupted; the same command goes on from here", file=sys.stderr)
    written = results.write(folder, f"{options.sweep.stem}: a sweep", cases, list(sweep.values))
    told = results.counts(results.rows_of(folder, mine))
    if options.json:
        emit(json.dumps({"cases": len(mine), "outcomes": dict(told), "written": [str(path) for path in written]}))
    else:
        outcomes = ", ".join(f"{count} {status}" for status, count in told.most_common()) or "none has a result"
        emit("\n".join([f"{len(mine)} cases: {outcomes}", *(visible(path) for path in written)]))
    return INTERRUPTED if interrupted else 0


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(words)
    return answer("sweep", options.json, lambda: _main(options))


if __name__ == "__main__":
    raise SystemExit(run(main))
