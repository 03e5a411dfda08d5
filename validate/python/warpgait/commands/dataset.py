"""`warpgait dataset --robot NAME --count N --to FORMAT`: motions over random ground that obey every law, for training, with a card.

Each is planned, checked, replayed on the full robot in MuJoCo, and kept if the robot tracks it. README.md in the folder says what the motions
are, how they were made, and how many attempts failed and why. The command resumes where it was interrupted. Exit code 0: there are as many
as asked for; 1: fewer, because attempts ran out; 2: bad input, or a file or standard output cannot be written; 130: interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from ..arguments import Parser
from ..console import INTERRUPTED, answer, emit, run
from ..sweeps.dataset import dataset
from ..sweeps.spec import Case
from ..text import visible
from .overrides import assigned


def _parser() -> Parser:
    parser = Parser(prog="warpgait dataset", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the data set")
    parser.add_argument("--robot", metavar="NAME", default="anymal_c", help="the robot (default %(default)s)")
    parser.add_argument("--count", type=int, default=10, metavar="N", help="motions (default %(default)s)")
    parser.add_argument("--to", metavar="FORMAT", default="isaaclab", help="format, as of warpgait export (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn (default %(default)s)")
    parser.add_argument("--gaits", default="walk,trot", metavar="A,B", help="gaits to draw from (default %(default)s)")
    parser.add_argument(
        "--distance", type=float, nargs=2, default=[0.4, 1.2], metavar="M", help="least and greatest, m (default 0.4 1.2)"
    )
    parser.add_argument(
        "--roughness",
        type=float,
        nargs=2,
        default=[0.0, 0.04],
        metavar="M",
        help="standard deviation of the ground, m (default 0 0.04)",
    )
    parser.add_argument("--horizon", type=float, default=6.0, metavar="S", help="duration of a motion, s (default %(default)g)")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="a value of the scenario; may be repeated"
    )
    parser.add_argument("--no-replay", action="store_true", help="keep what obeys every law, without a replay")
    parser.add_argument("--attempts", type=int, metavar="N", help="at most so many (default: three for each motion, and ten)")
    parser.add_argument("--time-limit", type=float, default=300.0, metavar="S", help="of an attempt, s (default %(default)g)")
    parser.add_argument("--workers", type=int, metavar="N", help="processes at once (default: as many as there are cores)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="work on the workers of a Dask scheduler, such as tcp://host:8786")
    parser.add_argument("--json", action="store_true", help="print the outcome as JSON")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress on standard error")
    return parser


def _main(options: argparse.Namespace) -> int:
    def progress(finished: int, count: int, case: Case, result: dict[str, Any]) -> None:
        if not options.quiet:
            how = result.get("verdict") or result["status"]
            reason = result.get("first_failure") or result.get("reason") or ""
            print(f"dataset: attempt {finished} of {count}: {how}{f': {visible(reason)}' if reason else ''}", file=sys.stderr)

    found = dataset(
        options.robot,
        folder=options.output,
        count=options.count,
        export=options.to,
        seed=options.seed,
        gaits=options.gaits.split(","),
        distance=tuple(options.distance),
        roughness=tuple(options.roughness),
        horizon=options.horizon,
        replay=not options.no_replay,
        most_attempts=options.attempts,
        values=assigned(options.set),
        time_limit=options.time_limit,
        workers=options.workers,
        scheduler=options.scheduler,
        progress=progress,
    )
    if found.attempts.interrupted:
        print("dataset: interrupted; the same command goes on from here", file=sys.stderr)
    if options.json:
        written = [str(path) for path in found.written]
        emit(json.dumps({"motions": len(found.rows), "attempts": len(found.attempts.rows), "written": written}))
    else:
        told = f"{len(found.rows)} of {options.count} motions, {len(found.attempts.rows)} attempts"
        emit("\n".join([told, *(visible(path) for path in found.written)]))
    if found.attempts.interrupted:
        return INTERRUPTED
    return 0 if found.complete else 1


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(words)
    return answer("dataset", options.json, lambda: _main(options))


if __name__ == "__main__":
    raise SystemExit(run(main))
