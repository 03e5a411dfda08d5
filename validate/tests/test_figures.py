"""Figures by which walks are compared."""

import math
from pathlib import Path

import numpy as np
import pytest

from warpgait.figures import support_margin, sway_of
from warpgait.plan import read_plan
from warpgait.settings import Settings
from warpgait.validation import validate

SQUARE = np.array([[[-0.3, -0.2], [-0.3, 0.2], [0.3, -0.2], [0.3, 0.2]]])


def margin(x: float, y: float, *contact: bool) -> float:
    """Of one point over feet at the corners of 0.6 m by 0.4 m."""
    return float(support_margin(np.array([[x, y]]), SQUARE, np.array([contact]))[0])


def test_the_margin_of_support_is_the_distance_from_the_nearest_edge() -> None:
    four = (True, True, True, True)
    assert margin(0.0, 0.05, *four) == pytest.approx(0.15)
    assert margin(0.25, 0.0, *four) == pytest.approx(0.05)
    assert margin(0.0, 0.3, *four) == pytest.approx(-0.1)
    assert margin(0.0, 0.0, True, True, True, False) == pytest.approx(0.0)  # on the diagonal
    assert margin(-0.2, -0.1, True, True, True, False) == pytest.approx(0.1)
    line = (True, False, False, True)
    assert margin(0.0, 0.0, *line) == pytest.approx(0.0)
    assert margin(0.0, 0.1, *line) == margin(0.0, -0.1, *line) == pytest.approx(-0.3 * 0.1 / math.hypot(0.3, 0.2))
    assert math.isnan(margin(0.0, 0.0, True, False, False, False))


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_sway_is_to_the_side_of_the_way_whatever_its_direction(heading: float) -> None:
    t = np.arange(0, 10, 0.004)
    ahead = 0.2 * t + 0.05 * np.sin(2 * np.pi * t)
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    com = np.column_stack([np.stack([ahead, 0.03 * np.sin(2 * np.pi * t)], 1) @ turn.T, 0 * t])
    assert sway_of(com, 0.004, 1.0) == pytest.approx(0.06, rel=0.02)
    assert math.isnan(sway_of(com, 0.004, math.nan))


def test_figures_of_a_walk_and_of_a_stand(ripple_plan: Path, standing_plan: Path) -> None:
    found = validate(read_plan(ripple_plan), Settings(check=False, quick=True))
    value = {f.key: f.value for f in found.figures}
    assert len(value) == len(found.figures)
    assert math.isnan(value.pop("sway"))  # no foot steps twice
    assert all(math.isfinite(v) for v in value.values()), value
    assert 0 < value["torque_use_95"] < value["torque_use_max"] < 1
    assert 0 < value["friction_use_95"] <= value["friction_use_max"] <= 1.01
    assert value["pressure_margin_min"] > -1e-3  # forces that push have their center inside
    plan = found.plan
    assert value["foot_speed_max"] == pytest.approx(np.linalg.norm(plan.foot_velocity, axis=-1).max(), rel=0.1)
    still = {f.key: f.value for f in validate(read_plan(standing_plan), Settings(check=False, quick=True)).figures}
    assert math.isnan(still["cost_of_transport"]) and math.isnan(still["foot_speed_max"])
    assert still["center_margin_min"] > 0.1 and still["acceleration_rms"] < 0.1
