"""Rolling feet."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpgait.arrays import runs
from warpgait.plan import read_plan
from warpgait.rolling import roll


def test_a_turning_shank_rolls_the_foot_by_radius_times_angle(ripple_plan: Path) -> None:
    plan = read_plan(ripple_plan)
    E = plan.foot_contact.shape[1]
    angle = 0.4 * plan.t / plan.duration  # pitching forward, about +y
    shank = np.repeat(Rotation.from_rotvec(angle[:, None] * [0.0, 1.0, 0.0]).as_matrix()[:, None], E, axis=1)
    rolling = roll(plan, shank, 0.03)
    for e in range(E):
        stances = runs(plan.foot_contact[:, e])
        assert len(stances) == 2
        for first, end in stances:
            # ω × r n for ω along y: only the part of the normal across the axis matters.
            n = plan.foot_normal[first, e]
            expected = 0.03 * (angle[end - 1] - angle[first]) * np.array([n[2], 0.0, -n[0]])
            assert rolling.offset[end - 1, e] - rolling.offset[first, e] == pytest.approx(expected, abs=1e-9)
            assert rolling.offset[(first + end) // 2, e] == pytest.approx(np.zeros(3), abs=1e-4)
    assert np.abs(np.diff(rolling.offset, axis=0)).max() < 0.001  # no jumps, swings included
    moved = np.gradient(rolling.offset, plan.t, axis=0)
    assert np.abs(moved - rolling.velocity)[5:-5].max() < 0.02
