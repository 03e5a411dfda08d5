"""Solo 8, whose legs have two joints: planned, checked, replayed and exported."""

from __future__ import annotations

import numpy as np
import pytest

from warpgait import InputError, Plan, Report, Scenario, Terrain
from warpgait.geometry import rotation_from_wxyz
from warpgait.settings import Settings

WAY = Scenario(
    horizon=5.0,
    robot="solo8",
    terrain=Terrain.formula("0.01*sin(8*x)*cos(5*y)", extent=(-1.0, 1.0, -1.0, 1.0), spacing=0.02),
    start=(0.0, 0.0),
    goal=(0.25, 0.0),
)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return WAY.solve()


def test_the_feet_keep_to_their_planes(plan: Plan) -> None:
    assert plan.solved and plan.passed
    samples = plan.samples
    turns = rotation_from_wxyz(samples.base_quaternion_wxyz)
    in_base = np.einsum("nji,nej->nei", turns.as_matrix(), samples.foot_position - samples.base_position[:, None])
    assert np.ptp(in_base[..., 1], axis=0).max() < 2.5e-3
    # The base rolls over its feet, by legs of different lengths, but does not turn.
    assert np.ptp(turns.as_euler("ZYX")[:, 0]) < 0.01
    assert np.ptp(samples.foot_position[..., 0], axis=0).min() > 0.2


def test_on_cross_slopes_the_centers_of_feet_keep_to_their_planes() -> None:
    plan = WAY.set("terrain.expression", "0.12*y*sin(8*x)").solve()
    assert plan.solved and plan.passed
    samples = plan.samples
    radius = samples.meta["robot"]["sagittal"][0]
    turns = rotation_from_wxyz(samples.base_quaternion_wxyz).as_matrix()
    across = [
        np.einsum("nj,nej->ne", turns[:, :, 1], points - samples.base_position[:, None])
        for points in (samples.foot_position, samples.foot_position + radius * samples.foot_normal)
    ]
    contact, center = [
        max(np.ptp(places[stands]) for places, stands in zip(by_foot.T, samples.foot_contact.T, strict=True))
        for by_foot in across
    ]
    assert center < 2.5e-3 and contact > 2.5e-3, (center, contact)


def test_it_is_replayed_with_eight_motors(plan: Plan) -> None:
    report = plan.validate(Settings(quick=True))
    assert report.verdict in ("pass", "marginal"), report
    motion = plan.motion(50.0)
    assert motion.joint_position.shape[1] == 8 and np.abs(motion.joint_torque).max() > 0.05


def test_on_a_slope_to_the_side_the_trunk_leans_as_planned() -> None:
    plan = WAY.set("terrain.expression", "0.15*y").solve()
    assert plan.solved and plan.passed
    report = plan.validate(Settings(quick=True))
    assert report.verdict == "pass", report
    # Nothing but the structure bears what the slope does to the side. Taken for a load, it made the trunk lean by more than a degree.
    assert _metric(report, "rotation, rms") < 0.4


def test_it_stays_on_its_line() -> None:
    flat = WAY.set("terrain.expression", "0.0").set("gait.kind", "trot").set("horizon", 8.0)
    plan = flat.set("start.position", [-0.5, 0.0]).set("goal.position", [0.5, 0.0]).solve()
    assert plan.solved and plan.passed
    report = plan.validate(Settings(quick=True))
    assert report.verdict == "pass", report
    # Where plans turned by what the reach boxes leave, 2 mm.
    assert _metric(report, "feet, rms") < 1.0


def _metric(report: Report, name: str) -> float:
    return next(metric.value for metric in report.metrics if metric.name == name)


def test_a_goal_to_the_side_is_refused() -> None:
    with pytest.raises(InputError, match="straight ahead or back"):
        WAY.set("start.yaw", 0.5).solve()
