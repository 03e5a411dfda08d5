"""`python -m warpgait.calibrate PLAN…`: the values of every metric for good plans, and for the same plans spoiled in several ways.

The limits in `criteria.py` must lie between the two. Prints two Markdown tables: the values of every metric, and how each spoiling was
judged. `--csv` writes every value to a file.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from .arrays import runs
from .console import ERROR, complain, emit, run
from .criteria import Criterion, Metric, Verdict
from .errors import InputError
from .files import ensure_outputs, replacing
from .laws import CHECK
from .plan import Plan, read_plan
from .settings import Disturbance, Settings
from .validation import validate


def _same(plan: Plan) -> Plan:
    return plan


def _weak(plan: Plan) -> Plan:
    return replace(plan, foot_force=0.6 * plan.foot_force)


def _raised(plan: Plan) -> Plan:
    return replace(plan, base_position=plan.base_position + np.array([0.0, 0.0, 0.08]))


def swap_contacts(plan: Plan, first: int, second: int) -> Plan:
    """Swap the planned contacts of two feet."""
    order = np.arange(len(plan.foot_names))
    order[[first, second]] = second, first
    return replace(plan, foot_contact=plan.foot_contact[:, order])


def _swapped(plan: Plan) -> Plan:
    """Swap the contacts of the two feet whose schedules differ most; diagonal feet of a trot have the same schedule."""
    contact = plan.foot_contact
    differ = (contact[:, :, None] != contact[:, None, :]).mean(0)
    first, second = np.unravel_index(differ.argmax(), differ.shape)
    return swap_contacts(plan, int(first), int(second))


def _late(seconds: float) -> Callable[[Plan], Plan]:
    """The forces come later than the motion that they belong to."""

    def change(plan: Plan) -> Plan:
        shift = round(seconds / plan.t[1])
        at = np.maximum(np.arange(len(plan.t)) - shift, 0)
        return replace(plan, foot_force=plan.foot_force[at])

    return change


def swap_one_step(plan: Plan) -> Plan:
    """In the step in the middle of the plan, another foot is said to swing: one that stands then."""
    contact = plan.foot_contact.copy()
    swings = [(abs(first + end - len(contact)), e, first, end) for e, c in enumerate(contact.T) for first, end in runs(~c)]
    if not swings:
        return plan
    _, e, first, end = min(swings)
    other = int(contact[first:end].sum(0).argmax())
    contact[first:end, e], contact[first:end, other] = True, False
    return replace(plan, foot_contact=contact)


def _without_accelerations(plan: Plan) -> Plan:
    return replace(plan, foot_acceleration=0 * plan.foot_acceleration)


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
    Spoiling("friction 0.6", world=Disturbance(friction=0.6)),
    Spoiling("forces 20 ms late", _late(0.02)),
    Spoiling("forces 60 ms late", _late(0.06)),
    Spoiling("mass × 0.88", world=Disturbance(body_factor=0.88)),
    Spoiling("contacts of one step swapped", swap_one_step),
    Spoiling("ground tilted by 3°", world=Disturbance(terrain_tilt=(3.0, 0.0))),
    Spoiling("foot accelerations zeroed", _without_accelerations),
)


def measure(plan: Plan, spoiling: Spoiling, check: bool = False) -> list[Metric]:
    """The metrics of a spoiled plan, with the laws of `warpgait check` if asked for; those judge files."""
    settings = Settings(check=check, quick=True, raw=False, disturbance=spoiling.world)
    spoiled = spoiling.change(plan)
    if not check or spoiled is plan:
        return validate(spoiled, settings).all_metrics
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / plan.path.name
        _write(spoiled, file)
        return validate(read_plan(file), settings).all_metrics


def _write(plan: Plan, target: Path) -> None:
    """The file of `plan` with the arrays that it has now."""
    with np.load(plan.path) as archive:
        members = dict(archive)
    members |= {key: value for key in members if isinstance(value := getattr(plan, key, None), np.ndarray)}
    np.savez(target, **members)


Key = tuple[str, str]  # layer, metric
Values = dict[Key, dict[str, list[float]]]  # of every metric, by the name of the spoiling


def table(values: Values, criteria: dict[Key, Criterion]) -> list[str]:
    """Lines of Markdown: limits, the good plans' median and worst, the median of each spoiling."""
    lines = [
        f"| metric | unit | pass | marginal | as planned: median | worst | {' | '.join(s.name for s in SPOILINGS)} |",
        "| --- " * (6 + len(SPOILINGS)) + "|",
    ]
    for key, by_spoiling in values.items():
        criterion, good = criteria[key], by_spoiling[GOOD.name]
        worst = min(good) if criterion.at_least else max(good)
        cells = [f"{np.nanmedian(by_spoiling[s.name]):.3g}" if by_spoiling[s.name] else "–" for s in SPOILINGS]
        figures = [f"{criterion.passes:g}", f"{criterion.marginal:g}", f"{np.median(good):.3g}", f"{worst:.3g}", *cells]
        lines.append(f"| {key[0]}: {key[1]} | {criterion.unit} | {' | '.join(figures)} |")
    return lines


# By the name of the spoiling, for every plan: the verdict, and the metrics that do not pass.
Judged = dict[str, list[tuple[str, list[str]]]]


def verdicts(judged: Judged) -> list[str]:
    """Lines of Markdown: how often each spoiling passed, was marginal or failed, and the metrics that most often do not pass."""
    lines = ["| spoiling | pass | marginal | fail | metrics that do not pass |", "| --- " * 5 + "|"]
    for name, plans in judged.items():
        counts = [sum(verdict == v.word for verdict, _ in plans) for v in Verdict]
        objections = Counter(metric for _, metrics in plans for metric in metrics)
        words = ", ".join(f"{metric} ({count})" for metric, count in objections.most_common(5))
        lines.append(f"| {name} | {' | '.join(map(str, counts))} | {words} |")
    return lines


@dataclass
class Measurements:
    """Metrics of every plan, as it is and spoiled."""

    values: Values = field(default_factory=lambda: defaultdict(lambda: defaultdict(list)))
    judged: Judged = field(default_factory=lambda: {s.name: [] for s in (GOOD, *SPOILINGS)})
    criteria: dict[Key, Criterion] = field(default_factory=dict)
    rows: list[list[object]] = field(default_factory=list)  # of the CSV file

    def add(self, plan: Plan, spoiling: Spoiling) -> Verdict:
        """Measure one plan under one spoiling."""
        metrics = measure(plan, spoiling, check=True)
        verdict = max(m.verdict for m in metrics)
        self.judged[spoiling.name].append((verdict.word, [m.name for m in metrics if m.verdict is not Verdict.PASS]))
        for metric in metrics:
            if metric.layer == CHECK:
                continue
            key = metric.layer, metric.name
            self.criteria.setdefault(key, metric.criterion)
            self.values[key][spoiling.name].append(metric.value)
            self.rows.append([plan.path.name, spoiling.name, *key, metric.value, metric.criterion.unit, metric.verdict.word])
        return verdict

    def write_csv(self, target: Path) -> None:
        """Every value, one in a row."""
        head = ["plan", "spoiling", "layer", "metric", "value", "unit", "verdict"]
        with replacing(target) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([head, *self.rows])


def main(words: list[str] | None = None) -> int:
    """Run the command; returns 0, or 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m warpgait.calibrate", description=__doc__)
    parser.add_argument("plans", nargs="+", type=Path, metavar="NAME.plan.npz")
    parser.add_argument("--csv", type=Path, help="write every value to this file")
    options = parser.parse_args(words)
    found = Measurements()
    try:
        ensure_outputs([options.csv] if options.csv else [], options.plans)
        for path in options.plans:
            plan = read_plan(path)
            for spoiling in (GOOD, *SPOILINGS):
                verdict = found.add(plan, spoiling)
                print(f"calibrate: {path.name}: {spoiling.name}: {verdict.word}", file=sys.stderr)
        if options.csv:
            found.write_csv(options.csv)
    except (InputError, OSError) as error:
        complain(error)
        return ERROR
    emit("\n".join([*table(found.values, found.criteria), "", *verdicts(found.judged)]))
    return 0


if __name__ == "__main__":
    raise SystemExit(run(main))
