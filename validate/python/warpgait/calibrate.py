"""`python -m warpgait.calibrate PLAN…`: what every metric comes to for good plans, and for the same ones spoiled in six ways.

The limits in `metrics.py` are to lie between the two. Prints two Markdown tables: every metric's values, and how each spoiling was judged;
`--csv` keeps every value.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .errors import InputError
from .metrics import Metric, Verdict
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
    """Of two feet: those whose schedules differ most, for those of a trot's diagonal pair are the same."""
    contact = plan.foot_contact
    differ = (contact[:, :, None] != contact[:, None, :]).mean(0)
    pair = list(np.unravel_index(differ.argmax(), differ.shape))
    order = np.arange(len(plan.foot_names))
    order[pair] = order[pair[::-1]]
    return replace(plan, foot_contact=contact[:, order])


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


Judged = dict[str, list[tuple[str, list[str]]]]  # by spoiling, for every plan: the verdict and the metrics that object to it


def verdicts(judged: Judged) -> list[str]:
    """Lines of Markdown: how often each spoiling passed, was marginal, failed; and which metrics object to how many of the plans."""
    lines = ["| spoiling | pass | marginal | fail | objections |", "| --- " * 5 + "|"]
    for name, plans in judged.items():
        counts = [sum(verdict == v.word for verdict, _ in plans) for v in Verdict]
        objections = Counter(metric for _, metrics in plans for metric in metrics)
        words = ", ".join(f"{metric} ({count})" for metric, count in objections.most_common(5))
        lines.append(f"| {name} | {' | '.join(map(str, counts))} | {words} |")
    return lines


def main(words: list[str] | None = None) -> int:
    """Run the command; 0, or 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m warpgait.calibrate", description=__doc__)
    parser.add_argument("plans", nargs="+", type=Path, metavar="NAME.plan.npz")
    parser.add_argument("--csv", type=Path, help="write every value to this file")
    options = parser.parse_args(words)
    values: Values = defaultdict(lambda: defaultdict(list))
    limits: dict[tuple[str, str], Metric] = {}
    judged: Judged = {s.name: [] for s in (GOOD, *SPOILINGS)}
    rows = []
    try:
        for path in options.plans:
            plan = load(path)
            for spoiling in (GOOD, *SPOILINGS):
                metrics = measure(plan, spoiling)
                verdict = max(m.verdict for m in metrics)
                judged[spoiling.name].append((verdict.word, [m.name for m in metrics if m.verdict is not Verdict.PASS]))
                print(f"calibrate: {path.name}: {spoiling.name}: {verdict.word}", file=sys.stderr)
                for metric in metrics:
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
    print("\n".join([*table(values, limits), "", *verdicts(judged)]))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
