"""`warpgait atlas GROUND --robot NAME`: where on a ground a robot can start, in which direction, and with which gait.

Plans from places all over the ground, straight ahead in several directions, and draws a map colored by how each case ended and one by the
law that binds. What was done is not done again: the command resumes where it was interrupted. Exit code 0: every case has a result; 2: bad
input, or a file or standard output cannot be written; 130: interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from ..arguments import Parser
from ..console import INTERRUPTED, answer, emit, run
from ..scenario import Scenario
from ..surface import Terrain
from ..sweeps.atlas import atlas
from ..sweeps.spec import Case
from ..text import visible
from .overrides import assigned


def _parser() -> Parser:
    parser = Parser(prog="warpgait atlas", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ground", type=Path, help="a file of heights (image, array, grid or mesh), or a scenario (.toml)")
    parser.add_argument("--robot", metavar="NAME", help="the robot (default: that of the scenario)")
    parser.add_argument("--spacing", type=float, metavar="M", help="of a file of heights: distance between neighboring cells, m")
    parser.add_argument(
        "--height-scale", type=float, metavar="M", help="height from black to white of an image, m; factor to m of others"
    )
    parser.add_argument("--layout", metavar="NAME", help="which way the indices run: picture, y-up, x-y or grid-map")
    parser.add_argument("--step", type=float, default=0.5, metavar="M", help="distance between places, m (default %(default)g)")
    parser.add_argument("--headings", type=int, default=8, metavar="N", help="directions at each place (default %(default)s)")
    parser.add_argument("--gaits", default="walk", metavar="A,B", help="gaits (default %(default)s)")
    parser.add_argument(
        "--distance", type=float, default=0.6, metavar="M", help="how far straight ahead, m (default %(default)g)"
    )
    parser.add_argument("--horizon", type=float, metavar="S", help="duration, s (default: the scenario's, or 4 s for 0.6 m)")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="a value of the scenario; may be repeated"
    )
    parser.add_argument("--time-limit", type=float, default=60.0, metavar="S", help="of a case, s (default %(default)g)")
    parser.add_argument("--keep-plans", action="store_true", help="keep the plans")
    parser.add_argument("-o", "--output", type=Path, help="folder for the results (default: NAME.atlas beside the ground)")
    parser.add_argument("--workers", type=int, metavar="N", help="processes at once (default: as many as there are cores)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="plan on the workers of a Dask scheduler, such as tcp://host:8786")
    parser.add_argument("--again", action="store_true", help="plan cases again that timed out or were killed")
    parser.add_argument("--json", action="store_true", help="print the outcome as JSON")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress on standard error")
    return parser


def _base(options: argparse.Namespace) -> Scenario:
    """The scenario that all cases share."""
    if options.ground.suffix.lower() == ".toml":
        base = Scenario.read(options.ground)
    else:
        base = Scenario(terrain=Terrain.file(options.ground), start=(0.0, 0.0), goal=(0.0, 0.0))
    read_as = {"terrain.spacing": options.spacing, "terrain.height_scale": options.height_scale, "terrain.layout": options.layout}
    return base.set({key: value for key, value in read_as.items() if value is not None} | assigned(options.set))


def _main(options: argparse.Namespace) -> int:
    def begin(finished: int, count: int) -> None:
        if not options.quiet:
            print(f"atlas: {count} cases" + (f", {finished} have results" if finished else ""), file=sys.stderr)

    def progress(finished: int, count: int, case: Case, result: dict[str, Any]) -> None:
        if not options.quiet and (finished % max(count // 100, 1) == 0 or finished == count):
            print(f"atlas: {finished} of {count}", file=sys.stderr)

    found = atlas(
        _base(options),
        options.robot,
        folder=options.output or options.ground.with_name(f"{options.ground.stem}.atlas"),
        step=options.step,
        headings=options.headings,
        gaits=options.gaits.split(","),
        distance=options.distance,
        horizon=options.horizon,
        time_limit=options.time_limit,
        keep_plans=options.keep_plans,
        workers=options.workers,
        scheduler=options.scheduler,
        again=options.again,
        begin=begin,
        progress=progress,
    )
    counts = found.sweep.counts
    if found.sweep.interrupted:
        print("atlas: interrupted; the same command goes on from here", file=sys.stderr)
    if options.json:
        emit(json.dumps({"cases": found.sweep.total, "outcomes": counts, "written": [str(path) for path in found.written]}))
    else:
        outcomes = ", ".join(f"{count} {status}" for status, count in counts.items()) or "none has a result"
        emit("\n".join([f"{found.sweep.total} cases: {outcomes}", *(visible(path) for path in found.written)]))
    return INTERRUPTED if found.sweep.interrupted else 0


def main(words: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    options = _parser().parse_args(words)
    return answer("atlas", options.json, lambda: _main(options))


if __name__ == "__main__":
    raise SystemExit(run(main))
