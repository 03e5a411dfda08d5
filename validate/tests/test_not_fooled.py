"""Bad plans and wrong worlds do not pass, and the right metric says so."""

from pathlib import Path

import numpy as np
import pytest

import warpgait
from warpgait import criteria
from warpgait.calibrate import GOOD, SPOILINGS, Spoiling, measure, swap_contacts
from warpgait.criteria import Metric, Verdict
from warpgait.laws import CHECK
from warpgait.plan import read_plan
from warpgait.settings import Disturbance, Settings
from warpgait.validation import validate


def failing(metrics: list[Metric]) -> set[str]:
    """Names of the metrics that do not pass."""
    return {m.name for m in metrics if m.verdict is not Verdict.PASS}


def test_a_good_plan_passes(ripple_plan: Path) -> None:
    found = validate(read_plan(ripple_plan), Settings(check=False, robust=False))
    assert found.verdict is Verdict.PASS, failing(found.all_metrics)
    assert found.first_failure is None


DIAGONAL_SWAPPED = Spoiling("contacts of LF and RH swapped", lambda plan: swap_contacts(plan, 0, 3))
EXPECTED = {
    "forces × 0.6": (criteria.PLAN_FORCE, criteria.NET_FORCE),
    "base 8 cm up": (criteria.PLAN_TORQUE,),
    "contacts swapped": (criteria.PLAN_FORCE,),
    "contacts of LF and RH swapped": (criteria.PLAN_FORCE, criteria.CONTACT_MISMATCH),
    "mass × 1.3": (criteria.NET_FORCE,),
    "friction 0.25": (criteria.SLIP,),
    "ground 10 cm off": (criteria.FEET_RMS,),
    "forces 20 ms late": (criteria.PLAN_FORCE,),
    "forces 60 ms late": (criteria.PLAN_FORCE, criteria.PLAN_FORCE_MAX),
    "mass × 0.88": (criteria.NET_FORCE,),
    "contacts of one step swapped": (criteria.PLAN_FORCE_MAX,),
    "ground tilted by 3°": (criteria.CONTACT_WORST,),
}


@pytest.mark.parametrize("spoiling", [s for s in (*SPOILINGS, DIAGONAL_SWAPPED) if s.name in EXPECTED], ids=lambda s: s.name)
def test_a_spoiled_plan_or_world_does_not_pass(ripple_plan: Path, spoiling: Spoiling) -> None:
    found = failing(measure(read_plan(ripple_plan), spoiling))
    for criterion in EXPECTED[spoiling.name]:
        assert criterion.name in found, found


def spoiling_of(name: str) -> Spoiling:
    return next(s for s in SPOILINGS if s.name == name)


def test_every_spoiling_is_tested() -> None:
    apart = {"friction 0.6", "foot accelerations zeroed"}
    assert {s.name for s in SPOILINGS} <= EXPECTED.keys() | apart


SLOPE = """
formulation = "direct"
horizon = 2.4
[robot]
name = "anymal_c"
[terrain]
kind = "formula"
expression = "0.55*x"
extent = [-1.5, 1.5, -1.5, 1.5]
[start]
position = [0.0, 0.0]
[goal]
position = [0.1, 0.0]
"""


def test_a_plan_that_needs_its_friction_does_not_pass_with_less(tmp_path: Path) -> None:
    """Up a slope of 0.55, planned with 0.75."""
    path = tmp_path / "slope.plan.npz"
    warpgait.solve(SLOPE, overrides={"contact.friction_margin": 0.0}).save(path)
    assert criteria.SLIP.name not in failing(measure(read_plan(path), GOOD))
    assert criteria.SLIP.name in failing(measure(read_plan(path), spoiling_of("friction 0.6")))


def test_accelerations_that_do_not_belong_to_the_feet_fail_the_check(walk_plan: Path) -> None:
    plan = read_plan(walk_plan)
    assert max(m.verdict for m in measure(plan, GOOD, check=True)) is Verdict.PASS
    metrics = measure(plan, spoiling_of("foot accelerations zeroed"), check=True)
    assert any(m.layer == CHECK and m.verdict is Verdict.FAIL for m in metrics)


def test_noise_and_pushes_are_the_same_for_the_same_seed(standing_plan: Path) -> None:
    plan, push = read_plan(standing_plan), (0.3, 0.1, 0.0, 60.0, 0.0)
    disturbances = [Disturbance(noise=1.0, push=push, seed=seed) for seed in (1, 1, 2)]
    replays = [validate(plan, Settings(check=False, robust=False, disturbance=d)).trials[0].replay for d in disturbances]
    assert np.array_equal(replays[0].qpos, replays[1].qpos)
    assert not np.array_equal(replays[0].qpos, replays[2].qpos)
