"""Bad plans and wrong worlds do not pass, and the right metric says so."""

from pathlib import Path

import numpy as np
import pytest

from warpgait import criteria
from warpgait.calibrate import SPOILINGS, Spoiling, measure, swap_contacts
from warpgait.criteria import Metric, Verdict
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
}


@pytest.mark.parametrize("spoiling", [*SPOILINGS, DIAGONAL_SWAPPED], ids=lambda s: s.name)
def test_a_spoiled_plan_or_world_does_not_pass(ripple_plan: Path, spoiling: Spoiling) -> None:
    found = failing(measure(read_plan(ripple_plan), spoiling))
    for criterion in EXPECTED[spoiling.name]:
        assert criterion.name in found, found


def test_noise_and_pushes_are_the_same_for_the_same_seed(standing_plan: Path) -> None:
    plan, push = read_plan(standing_plan), (0.3, 0.1, 0.0, 60.0, 0.0)
    disturbances = [Disturbance(noise=1.0, push=push, seed=seed) for seed in (1, 1, 2)]
    replays = [validate(plan, Settings(check=False, robust=False, disturbance=d)).trials[0].replay for d in disturbances]
    assert np.array_equal(replays[0].qpos, replays[1].qpos)
    assert not np.array_equal(replays[0].qpos, replays[2].qpos)
