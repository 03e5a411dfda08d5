"""The parts of a replay: terrain, contact forces, adhesion, falls."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import crawl
from crawl import GRAVITY
from warpgait import report
from warpgait.collision import SelfCollision
from warpgait.criteria import Verdict
from warpgait.model import find_model, foot_names, indices, load_spec, stand
from warpgait.openloop import centroidal_residual
from warpgait.plan import Heightfield, read_plan
from warpgait.scene import build_world
from warpgait.settings import Disturbance, Settings
from warpgait.validation import validate


@pytest.mark.parametrize("spacing", [0.02, 0.1])
def test_the_ground_is_where_the_plan_has_it(spacing: float) -> None:
    x, y = np.arange(-1, 1.5, spacing), np.arange(-0.8, 0.4, spacing)
    heights = crawl.ripple(x[None, :], y[:, None]) - 0.3
    terrain = Heightfield(heights, np.array([x[0], y[0]]), np.array([spacing, spacing]))
    world = build_world(find_model("anymal_c"), terrain, 0.6, GRAVITY)
    data = mujoco.MjData(world)
    data.qpos[2] = 50.0
    mujoco.mj_forward(world, data)
    hit = np.zeros(1, np.int32)
    for p in np.random.default_rng(0).uniform([-0.9, -0.7], [1.3, 0.3], (100, 2)):
        down = mujoco.mj_ray(world, data, np.array([*p, 5.0]), np.array([0.0, 0.0, -1.0]), None, 1, -1, hit, None)
        assert 5.0 - down == pytest.approx(crawl.ripple(*p) - 0.3, abs=2e-3)


def test_forces_of_a_standing_robot_carry_its_weight(standing_plan: Path) -> None:
    found = validate(read_plan(standing_plan), Settings(check=False, robust=False))
    assert found.verdict is Verdict.PASS
    force = found.trials[0].replay.force[100:].sum(1).mean(0)
    assert force == pytest.approx([0, 0, found.plan.weight], abs=0.01 * found.plan.weight)


def test_the_plans_own_laws_hold_and_an_unexplained_rotation_is_found(ripple_plan: Path) -> None:
    plan = read_plan(ripple_plan)
    assert np.abs(centroidal_residual(plan)).max() < 0.01 * plan.weight
    shaken = plan.base_quaternion_wxyz.copy()
    angle = 0.02 * np.sin(2 * np.pi * 2.0 * plan.t)  # a 2 Hz roll that no force explains
    shaken[:, 1] += angle / 2
    shaken /= np.linalg.norm(shaken, axis=1, keepdims=True)
    plan = replace(plan, base_quaternion_wxyz=shaken)
    expected = plan.robot.inertia[0, 0] * 0.02 * (2 * np.pi * 2.0) ** 2
    assert np.abs(centroidal_residual(plan)[:, 3]).max() == pytest.approx(expected, rel=0.05)


@pytest.fixture(scope="module")
def steep_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Standing on 45° with friction 0.6: impossible without adhesion."""
    path = tmp_path_factory.mktemp("plans") / "steep.plan.npz"
    return crawl.make(path, height=crawl.slope(45.0), steps=0, tilt=np.deg2rad(45.0), adhesive=("LF", "RF"))


def test_adhesive_feet_hold_on_a_slope_where_others_slide(steep_plan: Path, tmp_path: Path) -> None:
    plan = read_plan(steep_plan)
    found = validate(plan, Settings(check=False, robust=False))
    assert found.trials[0].verdict is Verdict.PASS, [m for m in found.trials[0].metrics if m.verdict]
    total = found.trials[0].replay.force[100:].sum(1).mean(0)  # without the adhesion, the rest carries the weight
    assert total == pytest.approx([0, 0, plan.weight], abs=0.02 * plan.weight)

    plain = crawl.altered(steep_plan, tmp_path / "plain.plan.npz", lambda a: a.update(foot_adhesive=np.zeros(4, bool)))
    assert validate(read_plan(plain), Settings(check=False, robust=False)).verdict is Verdict.FAIL


@pytest.fixture(scope="module")
def wall_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four steps up 50°, all feet adhesive."""
    path = tmp_path_factory.mktemp("plans") / "wall.plan.npz"
    feet, angle = ("LF", "RF", "LH", "RH"), 50.0
    box = (-1.0, 1.0, -1.0, 1.0)
    return crawl.make(path, height=crawl.slope(angle), steps=4, stride=0.06, tilt=np.deg2rad(angle), adhesive=feet, extent=box)


def test_a_pulling_foot_reaches_a_wall_3_mm_deeper_than_planned(wall_plan: Path) -> None:
    """The controller must not rely on its pull before it touches; that would throw the leg away from the wall."""
    plan = read_plan(wall_plan)
    pull = (plan.foot_force[:, 0] * plan.foot_normal[:, 0]).sum(-1)
    assert pull.min() < -100.0  # N, of LF, which steps last
    ground, hold = plan.terrain, plan.foot_position[-1, 0]
    rows, columns = ground.heights.shape
    x = ground.origin[0] + ground.spacing[0] * np.arange(columns) - hold[0]
    y = ground.origin[1] + ground.spacing[1] * np.arange(rows) - hold[1]
    dent = 0.003 / plan.foot_normal[-1, 0, 2] * np.exp(-(x**2 + y[:, None] ** 2) / 0.08**2)
    dented = Heightfield(ground.heights - dent, ground.origin, ground.spacing)
    found = validate(replace(plan, terrain=dented), Settings(check=False, robust=False))
    assert found.trials[0].incidents == []
    assert found.trials[0].verdict is not Verdict.FAIL
    end = found.trials[0].replay.force[-100:, 0].mean(0) @ plan.foot_normal[-1, 0]
    assert end == pytest.approx(pull[-1], abs=0.05 * plan.weight)  # it pulls in the end


def test_a_hard_push_makes_the_robot_fall_and_the_report_says_when(standing_plan: Path) -> None:
    push = (0.4, 0.5, 0.0, 900.0, 0.0)
    found = validate(read_plan(standing_plan), Settings(check=False, robust=False, disturbance=Disturbance(push=push)))
    assert found.verdict is Verdict.FAIL
    first = found.first_failure
    assert first is not None and first.time is not None and 0.4 < first.time < 1.0


@pytest.mark.parametrize("force", [3000.0, 1e12])
def test_a_robot_that_falls_before_the_motion_begins_is_a_failure_with_all_files(
    force: float, standing_plan: Path, tmp_path: Path
) -> None:
    disturbance = Disturbance(push=(-0.5, 0.4, 0.0, force, 0.0))
    found = validate(read_plan(standing_plan), Settings(check=False, robust=False, disturbance=disturbance))
    assert found.verdict is Verdict.FAIL
    assert found.first_failure is not None and found.first_failure.time == 0.0
    report.write_replay(found, tmp_path / "replay.npz")
    with np.load(tmp_path / "replay.npz") as members:
        assert len(members["t"]) == 1 and members["tau"].shape == members["q"].shape == (1, 12)
        assert all(np.isfinite(members[name]).all() for name in ("q", "qd", "foot_force"))


def test_a_simulation_that_blows_up_is_a_failure_not_a_crash(
    standing_plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    disturbance = Disturbance(push=(0.4, 0.1, 0.0, 1e12, 0.0))
    found = validate(read_plan(standing_plan), Settings(check=False, robust=False, disturbance=disturbance))
    assert found.verdict is Verdict.FAIL
    assert found.first_failure is not None and "blew up" in found.first_failure.what
    assert list(tmp_path.iterdir()) == []  # no log file of MuJoCo


def test_a_rough_raw_terrain_is_replayed_and_counts(standing_plan: Path) -> None:
    plan = read_plan(standing_plan)
    rough = plan.terrain.heights + 0.03 * np.sign(np.random.default_rng(0).standard_normal(plan.terrain.heights.shape))
    raw = Heightfield(rough, plan.terrain.origin, plan.terrain.spacing)
    found = validate(replace(plan, terrain_raw=raw), Settings(check=False, robust=False))
    assert [t.name for t in found.trials] == ["closed loop", "closed loop, steps of 1 ms", "closed loop, raw terrain"]
    assert found.trials[0].verdict is Verdict.PASS
    assert found.verdict is not Verdict.PASS
    assert found.shown is found.trials[2]  # pictures and plots show the worse trial


def test_a_foot_steps_over_an_edge_that_the_plan_does_not_know(tmp_path: Path) -> None:
    """7 cm high, 5 cm in front of the foot. A foot that only follows its path stays 15 cm behind."""
    plan = read_plan(crawl.make(tmp_path / "edge.plan.npz", steps=2, stride=0.16, spacing=0.01))
    ground, e = plan.terrain, plan.foot_names.index("RF")
    rows, columns = ground.heights.shape
    x = ground.origin[0] + ground.spacing[0] * np.arange(columns) - plan.foot_position[0, e, 0]
    y = ground.origin[1] + ground.spacing[1] * np.arange(rows) - plan.foot_position[0, e, 1]
    edge = (abs(x - 0.06) < 0.01) & (abs(y[:, None]) < 0.06)
    with_edge = Heightfield(ground.heights + 0.07 * edge, ground.origin, ground.spacing)
    trial = validate(replace(plan, terrain_raw=with_edge), Settings(check=False, quick=True)).trials[1]
    assert not trial.incidents
    behind = trial.replay.foot[-1, e] - trial.reference.foot[-1, e]
    assert np.linalg.norm(behind) < 0.02


def test_crossed_legs_are_a_collision_and_a_stance_is_none() -> None:
    spec = load_spec(find_model("anymal_c"))
    model = spec.compile()
    data = mujoco.MjData(model)
    stand(model, data)
    index = indices(model, foot_names(model))
    qpos = np.stack([data.qpos.copy(), data.qpos.copy()])
    qpos[1, index.qpos[0, 0]], qpos[1, index.qpos[1, 0]] = -0.6, 0.6  # the front legs swing inward
    found = SelfCollision(spec, index).find(np.array([0.0, 0.02]), qpos)
    assert [incident.time for incident in found] == [0.02]
    assert "hits" in found[0].what and found[0].foot in ("LF", "RF")
