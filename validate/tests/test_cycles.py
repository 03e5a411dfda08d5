"""Cyclic plans, one cycle after the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import warpgait
from warpgait.cycles import Cycle, repeated
from warpgait.errors import InputError
from warpgait.motions import motion_of_plan
from warpgait.plan import read_plan

CYCLE = """
horizon = 0.8
[robot]
name = "anymal_c"
[terrain]
kind = "flat"
extent = [-2.0, 4.0, -2.0, 2.0]
[start]
position = [0.0, 0.0]
[goal]
position = [0.3, 0.0]
yaw = 0.1
[gait]
kind = "trot"
cycle = 0.8
duty = 0.6
periodic = true
"""


@pytest.fixture(scope="module")
def trot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cycle of a trot that turns."""
    path = tmp_path_factory.mktemp("cycles") / "trot.plan.npz"
    plan = warpgait.solve(CYCLE)
    assert plan.passed
    plan.save(path)
    return path


def test_cycles_join_without_a_jump(trot: Path) -> None:
    """Positions, velocities and forces of four cycles change from sample to sample as within one."""
    one, four = read_plan(trot), repeated(read_plan(trot), 4)
    assert len(four.t) == 4 * (len(one.t) - 1) + 1
    np.testing.assert_allclose(np.diff(four.t), one.t[1], atol=1e-12)
    for name in ("base_position", "base_linear_velocity", "foot_position", "foot_velocity", "foot_force", "foot_normal"):
        within = np.abs(np.diff(getattr(one, name), axis=0)).max()
        between = np.abs(np.diff(getattr(four, name), axis=0)).max()
        assert between <= 1.01 * within * np.sqrt(2) + 1e-6, name
    q = four.base_quaternion_wxyz
    turned = 2 * np.arctan2(q[-1, 3], q[-1, 0]) - 2 * np.arctan2(q[0, 3], q[0, 0])
    assert turned == pytest.approx(0.4, abs=0.01)
    # The second cycle is the first, turned and moved.
    turn = Cycle(0.1, one.base_position[0], one.base_position[-1] - one.base_position[0])
    np.testing.assert_allclose(four.foot_position[len(one.t) + 3], turn.moved(one.foot_position[4:5], 1)[0], atol=1e-3)


def test_motions_between_the_samples_are_those_of_the_repeated_samples(trot: Path) -> None:
    """At a rate that misses the plan's samples, splines are used; they agree with the samples next to them."""
    four = repeated(read_plan(trot), 4)
    motion = motion_of_plan(four, 130.0)
    assert motion.t[-1] == pytest.approx(4 * 0.8, abs=1 / 130)
    for c in range(3):
        between = np.interp(motion.t, four.t, four.base_position[:, c])
        np.testing.assert_allclose(motion.center_of_mass[:, c], between, atol=1e-3)


def test_only_cyclic_plans_are_repeated(trot: Path, standing_plan: Path) -> None:
    """Others are refused, and so are counts that make no motion."""
    with pytest.raises(InputError, match=r"not cyclic; set gait\.periodic"):
        repeated(read_plan(standing_plan), 2)
    for count in (0, 10_000):
        with pytest.raises(InputError, match=r"--repeat \d+: must be from 1 to 750"):
            repeated(read_plan(trot), count)
