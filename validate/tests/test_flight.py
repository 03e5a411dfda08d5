"""Gaits whose feet are all in the air at times."""

from pathlib import Path

import warpgait
from warpgait import criteria
from warpgait.criteria import Verdict
from warpgait.plan import read_plan
from warpgait.settings import Settings
from warpgait.validation import validate

BOUND = """
horizon = 3.0
time_step = 0.025
[robot]
name = "a1"
[terrain]
kind = "flat"
extent = [-1.5, 2.5, -1.5, 1.5]
[start]
position = [0.0, 0.0]
[goal]
position = [0.3, 0.0]
[gait]
kind = "bound"
cycle = 0.4
duty = 0.4
[physics]
legs = "massive"
"""


def test_a_bound_with_flight_is_tracked(tmp_path: Path) -> None:
    """Two feet of a row cannot turn the trunk on the spot; it fell when the controller asked them to."""
    plan = warpgait.solve(BOUND)
    assert plan.passed
    plan.save(tmp_path / "bound.plan.npz")
    read = read_plan(tmp_path / "bound.plan.npz")
    assert (~read.foot_contact.any(axis=1)).mean() > 0.1  # it does fly
    found = validate(read, Settings(quick=True))
    assert found.verdict is Verdict.PASS
    center = next(m for m in found.trials[0].metrics if m.criterion.name == criteria.COM_RMS.name)
    assert center.value < 2.5  # mm
