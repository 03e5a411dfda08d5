"""Worlds that differ from the plan's: what the controller finds out about them, and how they are judged."""

import math
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import crawl
from warpgait import criteria
from warpgait.adhesion import BUILD_UP, RESERVE, adhesion
from warpgait.closedloop import ClosedLoop, robot_of, world_of
from warpgait.controllers import Gains, WholeBody, gains_for
from warpgait.criteria import Criterion, Metric, Verdict
from warpgait.metrics import ROBUST
from warpgait.model import adhesion_name, find_model, load_spec
from warpgait.openloop import postures
from warpgait.plan import Plan, read_plan
from warpgait.reference import Reference, sample
from warpgait.robust import Attempt, attempt_all, judge, size_of, worlds
from warpgait.rolling import no_rolling
from warpgait.settings import Disturbance, Settings
from warpgait.simulation import Simulation
from warpgait.validation import validate


def loop_of(plan: Plan) -> ClosedLoop:
    """A plan ready to replay."""
    robot = robot_of(plan, None)
    start = postures(plan, robot.model, robot.index, no_rolling(plan)).qpos[0]
    return ClosedLoop(plan, robot, sample(plan, 250.0, robot.index.radius), start)


def value(metrics: list[Metric], criterion: Criterion) -> float:
    """Of the metric with this criterion."""
    return next(m.value for m in metrics if m.criterion is criterion)


def test_gains_follow_the_time_in_which_a_robot_falls() -> None:
    anymal, small = gains_for(1.0), gains_for(0.25)
    assert anymal == Gains()
    for of_anymal, of_small in [(anymal.trunk, small.trunk), (anymal.swing, small.swing)]:
        assert of_small == (4 * of_anymal[0], 2 * of_anymal[1])


def test_a_standing_robot_stays_level_under_a_load_that_tipped_it_before(standing_plan: Path) -> None:
    """0.5 kg at 10 cm turned the trunk by 7 degrees as long as the controller did not know of it."""
    plan = read_plan(standing_plan)
    found = validate(plan, Settings(check=False, quick=True, disturbance=Disturbance(payload=(0.5, 0.0, 0.1, 0.0))))
    assert value(found.trials[0].metrics, criteria.ROTATION_MAX) < 0.3


def test_the_controller_finds_the_center_of_mass(standing_plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, controllers = loop_of(read_plan(standing_plan)), []

    def keep(self: WholeBody, *arguments: Any, original: Any = WholeBody.__init__, **options: Any) -> None:
        original(self, *arguments, **options)
        controllers.append(self)

    monkeypatch.setattr(WholeBody, "__init__", keep)
    disturbance = Disturbance(payload=(2.0, 0.1, -0.05, 0.0))
    outcome = loop.run("", world_of(loop.plan, loop.robot, loop.plan.terrain, disturbance), disturbance)
    observer, mass = controllers[0].observer, loop.plan.robot.mass
    assert observer.generalized[2] == pytest.approx(-2.0 * crawl.G, rel=0.02)
    load = np.add(outcome.replay.qpos[-1, :2], [0.1, -0.05])
    assert observer.center[:2] == pytest.approx(2.0 / mass * (load - loop.reference.com[-1, :2]), abs=3e-4)
    assert np.abs(outcome.replay.com[-1] - loop.reference.com[-1])[:2].max() < 1e-3


def test_a_walk_is_tracked_with_the_center_of_mass_off_to_the_side(ripple_plan: Path) -> None:
    disturbance = Disturbance(com_shift=(0.0, 0.01, 0.0))
    found = validate(read_plan(ripple_plan), Settings(check=False, quick=True, disturbance=disturbance))
    assert found.verdict is Verdict.PASS, [m for m in found.all_metrics if m.verdict]


def test_the_worlds_are_scaled_by_the_robot() -> None:
    models = [load_spec(find_model(name)).compile() for name in ("anymal_b", "anymal_c")]
    shifts = [worlds(model, 0.75)[0].disturbance.com_shift[0] for model in models]
    loads = [next(w.disturbance.payload for w in worlds(model, 0.75) if w.disturbance.payload) for model in models]
    assert shifts[1] == pytest.approx(0.010, abs=2e-4)
    assert loads[1] is not None and loads[1][0] == pytest.approx(2.0, abs=0.1)
    assert loads[0] is not None and loads[0][0] / loads[1][0] == pytest.approx(
        models[0].body_mass.sum() / models[1].body_mass.sum()
    )
    assert shifts[0] / shifts[1] == pytest.approx(size_of(models[0]) / size_of(models[1]))
    inertia, friction = worlds(models[1], 0.75)[-1].disturbance.drives
    assert inertia == pytest.approx(0.0076, rel=0.03) and friction == pytest.approx(0.4, rel=0.03)
    assert len({w.name for w in worlds(models[0], 0.75)}) == 12


def test_the_mass_and_the_center_of_a_world_are_those_asked_for(standing_plan: Path) -> None:
    loop = loop_of(read_plan(standing_plan))

    def build(**values: Any) -> tuple[float, Any]:
        world = world_of(loop.plan, loop.robot, loop.plan.terrain, Disturbance(**values))
        data = mujoco.MjData(world)
        data.qpos[:] = loop.start
        mujoco.mj_forward(world, data)
        return float(world.body_mass.sum()), data.subtree_com[1].copy()

    mass, center = build()
    assert build(body_factor=1.1)[0] == pytest.approx(1.1 * mass)
    assert build(body_factor=1.1)[1] == pytest.approx(center)
    assert build(com_shift=(0.01, -0.02, 0.03))[1] - center == pytest.approx([0.01, -0.02, 0.03], abs=1e-6)
    loaded = build(payload=(2.0, 0.1, 0.0, 0.0))
    assert loaded[0] == pytest.approx(mass + 2.0)
    load = np.add(loop.start[:3], [0.1, 0.0, 0.0])
    assert loaded[1] == pytest.approx((mass * center + 2.0 * load) / (mass + 2.0))


def test_a_world_is_tracked_within_the_wider_limits_and_the_worst_metric_is_named() -> None:
    fine = Metric(ROBUST, criteria.COM_RMS, 0.9 * criteria.COM_RMS.marginal)
    close = Metric(ROBUST, criteria.FORCE_CORRELATION, 0.951)
    fallen = Metric(ROBUST, criteria.FALL, 1.0)
    unknown = Metric(ROBUST, criteria.SLIP, math.nan)
    assert Attempt("a", [fine, close]).tracked and Attempt("a", [fine, close]).worst is close
    assert not Attempt("b", [fine, fallen]).tracked and Attempt("b", [fine, fallen]).worst is fallen
    assert not Attempt("c", [fine, unknown]).tracked and Attempt("c", [fine, unknown]).worst is unknown
    attempts = [Attempt("good", [fine])] * 11 + [Attempt("slippery", [fallen])]
    assert judge(attempts).verdict is Verdict.PASS  # 92 %
    metric = judge([*attempts[1:], attempts[-1]])
    assert metric.verdict is Verdict.MARGINAL and "slippery" in metric.reason


def test_other_processes_end_with_the_error_and_with_an_interruption(
    standing_plan: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop, started = loop_of(read_plan(standing_plan)), []
    popen = subprocess.Popen

    def keep(*arguments: Any, **options: Any) -> Any:
        started.append(popen(*arguments, **options))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", keep)
    with pytest.raises(RuntimeError, match="other world"):
        attempt_all(ClosedLoop(loop.plan, loop.robot, loop.reference, np.zeros(3)), None, lambda _: None)

    def interrupt(text: str) -> None:
        if "1 of" in text:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt_all(loop, None, interrupt)
    assert started and all(process.poll() is not None for process in started)


def _reference(plan: Plan) -> Reference:
    return sample(plan, 250.0, 0.03)


def test_adhesion_is_what_the_plan_needs_and_a_reserve_built_up_and_released(tmp_path: Path) -> None:
    path = crawl.make(
        tmp_path / "steep.plan.npz", height=crawl.slope(30.0), steps=2, tilt=np.deg2rad(30.0), adhesive=("LF", "RF")
    )
    plan = read_plan(path)
    reference, pull = _reference(plan), plan.pull_limit * plan.weight
    found = adhesion(reference, plan.foot_adhesive, 0.5, pull, plan.weight)
    along = (reference.force * reference.normal).sum(-1)
    across = np.linalg.norm(reference.force - along[..., None] * reference.normal, axis=-1)
    needed = np.maximum(across / 0.5 - along, 0)
    assert (found[~reference.contact] == 0).all() and (found[:, 2:] == 0).all()
    assert (found <= needed + RESERVE * plan.weight + 1e-9).all() and found[:, :2].max() > RESERVE * plan.weight / 2
    most, step = pull + RESERVE * plan.weight, reference.t[1]
    changes = np.diff(found[:, :2], axis=0)
    forces = np.abs(np.diff(needed[:, :2], axis=0))
    assert (np.abs(changes) <= np.maximum(forces, most * step / BUILD_UP) + 1e-6).all()


def test_only_the_foot_sticks_not_its_shank(tmp_path: Path) -> None:
    plan = read_plan(crawl.make(tmp_path / "flat.plan.npz", steps=0, adhesive=("LF",)))
    loop = loop_of(plan)
    world = world_of(plan, loop.robot, plan.terrain, Disturbance())
    body = world.actuator(adhesion_name("LF")).trnid[0]
    assert [world.geom(i).name for i in range(world.ngeom) if world.geom_bodyid[i] == body] == ["LF"]
    assert world.body_mass.sum() == pytest.approx(loop.robot.model.body_mass.sum())


def test_torques_act_a_control_step_after_the_measurement(standing_plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop, computed, applied = loop_of(read_plan(standing_plan)), [], []

    def torque(self: WholeBody, *arguments: Any, original: Any = WholeBody.torque) -> Any:
        computed.append(original(self, *arguments))
        return computed[-1]

    def control(self: Simulation, step: int, original: Any = Simulation._control) -> Any:
        applied.append(original(self, step))
        return applied[-1]

    monkeypatch.setattr(WholeBody, "torque", torque)
    monkeypatch.setattr(Simulation, "_control", control)
    short = replace(loop.plan)
    loop.run("", world_of(short, loop.robot, short.terrain, Disturbance()), Disturbance())
    assert len(applied) > 100
    assert all(np.array_equal(a, c) for a, c in zip(applied[1:], computed, strict=False))
