"""`python -m warpgait.calibrate PLAN…`: what every metric comes to for good plans, and for the same ones spoiled in six ways.

The limits in `metrics.py` are to lie between the two. Prints a Markdown table; `--csv` keeps every value.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .errors import InputError
from .metrics import Metric
from .plan import Plan, load
from .scene import Disturbance
from .validation import Settings, validate


def _same(plan: Plan) -> Plan:
    return plan


def _weak(plan: Plan) -> Plan:
    return replace(plan, foot_force=0.6 * plan.foot_force)


def _raised(plan: Plan) -> Plan:
    return replace(plan, base_position=plan.base_position + np.array([0.0, 0.0, 0.08]))


def _swapped(plan: Plan) -> Plan:
    order = np.arange(len(plan.foot_names))
    order[[0, -1]] = order[[-1, 0]]
    return replace(plan, foot_contact=plan.foot_contact[:, order])


@dataclass(frozen=True)
class Spoiling:
    """A change for the worse, of the plan or of the world."""

    name: str
    change: Callable[[Plan], Plan] = _same
    world: Disturbance = field(default_factory=Disturbance)


GOOD = Spoiling("as planned")
SPOILINGS = (
    Spoiling("forces × 0.6", _weak),
    Spoiling("base 8 cm up", _raised),
    Spoiling("contacts swapped", _swapped),
    Spoiling("mass × 1.3", world=Disturbance(mass_factor=1.3)),
    Spoiling("friction 0.25", world=Disturbance(friction=0.25)),
    Spoiling("ground 10 cm off", world=Disturbance(terrain_shift=(0.1, 0.0, 0.0))),
)


def measure(plan: Plan, spoiling: Spoiling) -> list[Metric]:
    """All metrics that count."""
    settings = Settings(second_opinion=False, raw=False, disturbance=spoiling.world)
    found = validate(spoiling.change(plan), settings)
    return found.metrics + [m for t in found.trials if t.counts for m in t.metrics]


Values = dict[tuple[str, str], dict[str, list[float]]]  # by (layer, metric), by spoiling


def table(values: Values, limits: dict[tuple[str, str], Metric]) -> list[str]:
    """Lines of Markdown: limits, good plans' median and worst, each spoiling's median."""
    lines = [
        f"| metric | unit | pass | marginal | as planned: median | worst | {' | '.join(s.name for s in SPOILINGS)} |",
        "| --- " * (6 + len(SPOILINGS)) + "|",
    ]
    for key, by_spoiling in values.items():
        metric, good = limits[key], by_spoiling[GOOD.name]
        worst = min(good) if metric.at_least else max(good)
        cells = [f"{np.nanmedian(by_spoiling[s.name]):.3g}" if by_spoiling[s.name] else "–" for s in SPOILINGS]
        figures = [f"{metric.passes:g}", f"{metric.marginal:g}", f"{np.median(good):.3g}", f"{worst:.3g}", *cells]
        lines.append(f"| {key[0]}: {key[1]} | {metric.unit} | {' | '.join(figures)} |")
    return lines


def main(words: list[str] | None = None) -> int:
    """Run the command; 0, or 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m warpgait.calibrate", description=__doc__)
    parser.add_argument("plans", nargs="+", type=Path, metavar="NAME.plan.npz")
    parser.add_argument("--csv", type=Path, help="write every value to this file")
    options = parser.parse_args(words)
    values: Values = defaultdict(lambda: defaultdict(list))
    limits: dict[tuple[str, str], Metric] = {}
    rows = []
    try:
        for path in options.plans:
            plan = load(path)
            for spoiling in (GOOD, *SPOILINGS):
                print(f"calibrate: {path.name}: {spoiling.name}", file=sys.stderr)
                for metric in measure(plan, spoiling):
                    key = metric.layer, metric.name
                    limits.setdefault(key, metric)
                    values[key][spoiling.name].append(metric.value)
                    rows.append([path.name, spoiling.name, *key, metric.value, metric.unit, metric.verdict.word])
        if options.csv:
            with options.csv.open("w", newline="", encoding="utf-8") as file:
                csv.writer(file).writerows([["plan", "spoiling", "layer", "metric", "value", "unit", "verdict"], *rows])
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join(table(values, limits)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
