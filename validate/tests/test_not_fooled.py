"""A verdict is worth something only if bad plans and a wrong world are caught, and by the right metric."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crawl import altered
from warpgait.metrics import Verdict
from warpgait.plan import load
from warpgait.scene import Disturbance
from warpgait.validation import Settings, Validation, validate


def judged(path: Path, **disturbance: Any) -> Validation:
    settings = Settings(second_opinion=False, disturbance=Disturbance(**disturbance))
    return validate(load(path), settings)


def blamed(found: Validation) -> set[str]:
    """Names of all metrics that do not pass."""
    lines = found.metrics + [m for t in found.trials if t.counts for m in t.metrics]
    return {m.name for m in lines if m.verdict is not Verdict.PASS}


def test_a_good_plan_passes(ripple_plan: Path) -> None:
    found = judged(ripple_plan)
    assert found.verdict is Verdict.PASS, blamed(found)
    assert found.first_failure is None


def scale_forces(a: dict[str, Any]) -> None:
    a["foot_force"] = a["foot_force"] * 0.6


def raise_base(a: dict[str, Any]) -> None:
    a["base_position"] = a["base_position"] + [0, 0, 0.08]


def swap_contacts(a: dict[str, Any]) -> None:
    a["foot_contact"] = a["foot_contact"][:, [3, 1, 2, 0]]


@pytest.mark.parametrize(
    ("change", "metric"),
    [
        (scale_forces, "plan: unexplained force, rms"),
        (scale_forces, "net force, rms"),
        (raise_base, "plan: unexplained torque, rms"),
        (swap_contacts, "plan: unexplained force, rms"),
        (swap_contacts, "contact mismatch"),
    ],
)
def test_a_bad_plan_is_caught(ripple_plan: Path, tmp_path: Path, change: Callable[[dict[str, Any]], None], metric: str) -> None:
    found = judged(altered(ripple_plan, tmp_path / "bad.plan.npz", change))
    assert found.verdict is not Verdict.PASS
    assert metric in blamed(found), blamed(found)


@pytest.mark.parametrize(
    ("world", "metric"),
    [
        ({"mass_factor": 1.3}, "net force, rms"),
        ({"friction": 0.25}, "slip per step"),
        ({"terrain_shift": (0.1, 0.0, 0.0)}, "feet, rms"),
    ],
)
def test_a_wrong_world_is_caught(ripple_plan: Path, world: dict[str, Any], metric: str) -> None:
    found = judged(ripple_plan, **world)
    assert found.verdict is not Verdict.PASS
    assert metric in blamed(found), blamed(found)


def test_noise_and_pushes_are_the_same_for_the_same_seed(standing_plan: Path) -> None:
    replays = [
        judged(standing_plan, noise=1.0, push=(0.3, 0.1, 0.0, 60.0, 0.0), seed=seed).trials[0].replay for seed in (1, 1, 2)
    ]
    assert np.array_equal(replays[0].qpos, replays[1].qpos)
    assert not np.array_equal(replays[0].qpos, replays[2].qpos)
