"""Feet that roll."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpgait.plan import load
from warpgait.rolling import roll, runs


def test_a_turning_shank_rolls_the_foot_by_radius_times_angle(ripple_plan: Path) -> None:
    plan = load(ripple_plan)
    E = plan.foot_contact.shape[1]
    angle = 0.4 * plan.t / plan.duration  # pitching forward, about +y
    shank = np.repeat(Rotation.from_rotvec(angle[:, None] * [0.0, 1.0, 0.0]).as_matrix()[:, None], E, axis=1)
    rolling = roll(plan, shank, 0.03)
    for e in range(E):
        phases = runs(plan, e)
        assert [stance for stance, _, _ in phases] == [True, False, True]
        for stance, a, b in phases:
            if stance:
                # ω × r n for ω along y: the part of the normal across the axis counts.
                n = plan.foot_normal[a, e]
                expected = 0.03 * (angle[b - 1] - angle[a]) * np.array([n[2], 0.0, -n[0]])
                assert rolling.offset[b - 1, e] - rolling.offset[a, e] == pytest.approx(expected, abs=1e-9)
                assert rolling.offset[(a + b) // 2, e] == pytest.approx(np.zeros(3), abs=1e-4)
    assert np.abs(np.diff(rolling.offset, axis=0)).max() < 0.001  # no jumps, swings included
    moved = np.gradient(rolling.offset, plan.t, axis=0)
    assert np.abs(moved - rolling.velocity)[5:-5].max() < 0.02
