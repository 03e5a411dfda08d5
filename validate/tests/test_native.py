"""The compiled part: exact evaluation of plans, terrain, and solving with progress, Ctrl-C and clear errors."""

import ast
import inspect
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpgait
from crawl import altered
from warpgait import _native
from warpgait.plan import read_plan

# A short trot over ripples. A few iterations give a motion with stances, swings and forces that is not solved.
SCENARIO = """
schema = 1
formulation = "direct"
horizon = 2.0
[terrain]
kind = "rippled"
extent = [-1.5, 2.0, -1.0, 1.0]
[map]
cells = [16, 12, 8]
[start]
position = [0.0, 0.0]
[goal]
position = [0.3, 0.0]
[gait]
kind = "trot"
[solver]
continuation = "off"
"""


@pytest.fixture(scope="module", params=["direct", "warped"])
def trajectory(request: pytest.FixtureRequest) -> warpgait.Trajectory:
    return warpgait.solve(SCENARIO, overrides={"formulation": request.param, "solver.max_iterations": 4})


def test_the_exact_motion_goes_through_the_samples_of_the_file(trajectory: warpgait.Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "a.plan.npz"
    trajectory.save(path)
    plan, exact = read_plan(path), warpgait.load(path)
    assert exact.foot_names == plan.foot_names == ("LF", "RF", "LH", "RH")
    assert exact.duration == pytest.approx(plan.duration) == 2.0
    assert (exact.t == plan.t).all()
    assert exact.meta.keys() == plan.meta.keys()
    assert exact.meta["scenario"] == plan.meta["scenario"] == trajectory.meta["scenario"]
    assert exact.solved == plan.solved
    assert exact.passed == all(row["passed"] for row in plan.meta["checks"])
    base, feet = exact.base(plan.t), exact.feet(plan.t)
    for name in (
        "position",
        "quaternion_wxyz",
        "linear_velocity",
        "linear_acceleration",
        "angular_velocity",
        "angular_acceleration",
    ):
        np.testing.assert_allclose(getattr(base, name), getattr(plan, f"base_{name}"), rtol=1e-9, atol=1e-9)
    for name in ("position", "velocity", "acceleration", "force", "normal"):
        np.testing.assert_allclose(getattr(feet, name), getattr(plan, f"foot_{name}"), rtol=1e-9, atol=1e-8)
    assert (feet.contact == plan.foot_contact).all()
    assert not feet.contact.all()


def test_shapes_follow_the_times(trajectory: warpgait.Trajectory) -> None:
    many = np.linspace(0.0, 2.0, 6).reshape(2, 3)
    for t, outer in ((0.5, ()), ([0.1, 0.2], (2,)), (many, (2, 3)), (1, ()), ([], (0,)), (many.T[::2], (2, 2))):
        base, feet = trajectory.base(t), trajectory.feet(t)
        assert base.position.shape == base.angular_acceleration.shape == (*outer, 3)
        assert base.quaternion_wxyz.shape == (*outer, 4)
        assert feet.position.shape == feet.force.shape == (*outer, 4, 3)
        assert feet.contact.shape == (*outer, 4)
        assert feet.contact.dtype == bool
    assert (trajectory.base(many.T).position[2, 1] == trajectory.base(many[1, 2]).position).all()


def test_between_the_samples_velocities_are_those_of_the_positions(trajectory: warpgait.Trajectory) -> None:
    t, step = np.array([0.1234, 0.777, 1.0403]), 1e-5
    for of, name in ((trajectory.base, "linear_velocity"), (trajectory.feet, "velocity")):
        slope = (of(t + step).position - of(t - step).position) / (2 * step)
        np.testing.assert_allclose(getattr(of(t), name), slope, atol=1e-5)


@pytest.mark.parametrize("t", [-0.1, 2.1, float("nan"), [0.5, 3.0]])
def test_times_outside_the_plan_are_refused(trajectory: warpgait.Trajectory, t: Any) -> None:
    for of in (trajectory.base, trajectory.feet):
        with pytest.raises(ValueError, match="the plan lasts from 0 to 2 s"):
            of(t)
    with pytest.raises((ValueError, TypeError)):
        trajectory.base("soon")


def test_the_terrain_at_points(trajectory: warpgait.Trajectory) -> None:
    terrain = trajectory.terrain
    assert terrain.extent == pytest.approx((-1.5, 2.0, -1.0, 1.0))
    points = np.stack(np.meshgrid(np.linspace(-1, 1.5, 7), np.linspace(-0.8, 0.8, 5)), axis=-1)
    height, gradient, normal = terrain.height(points), terrain.gradient(points), terrain.normal(points)
    assert (height.shape, gradient.shape, normal.shape) == ((5, 7), (5, 7, 2), (5, 7, 3))
    assert np.ptp(height) > 0.02
    step = 1e-6
    for d, move in enumerate(step * np.eye(2)):
        slope = (terrain.height(points + move) - terrain.height(points - move)) / (2 * step)
        np.testing.assert_allclose(gradient[..., d], slope, atol=1e-6)
    expected = np.concatenate([-gradient, np.ones((5, 7, 1))], axis=-1)
    np.testing.assert_allclose(normal, expected / np.linalg.norm(expected, axis=-1, keepdims=True), atol=1e-12)
    assert terrain.height([0.1, 0.2]).shape == ()
    for bad, words in ((np.zeros((4, 3)), "expected"), (0.0, "expected"), ([0.0, np.nan], "not finite")):
        with pytest.raises(warpgait.InputError, match=words):
            terrain.height(bad)
    assert np.isfinite(terrain.height([[1e300, -1e300], [3.0, 0.0]])[1])


def test_a_feasible_plan_with_progress(tmp_path: Path) -> None:
    rows: list[tuple[int, float, float]] = []
    scenario = tmp_path / "flat.toml"
    scenario.write_text(SCENARIO.replace("rippled", "flat"))
    trajectory = warpgait.solve(scenario, overrides={"solver.effort": "feasible"}, progress=lambda *row: rows.append(row))
    assert trajectory.solved
    assert [row[0] for row in rows] == list(range(len(rows)))
    assert rows[-1][1] < 1e-3 < rows[0][1]
    assert trajectory.meta["inputs"].keys() == {"flat.toml"}
    # The plan's scenario contains the overrides, so it gives the same problem again.
    assert 'effort = "feasible"' in trajectory.meta["scenario"]


def test_overrides_of_every_kind() -> None:
    values = {
        "goal.position": np.array([0.2, 0.0]),
        "horizon": 1,
        "gait.kind": "stand",
        "gait.optimize_durations": False,
        "solver.tolerance": 0.002,
        "solver.max_iterations": np.int64(1),
    }
    meta = warpgait.solve(SCENARIO, overrides=values).meta
    for line in ("position = [0.2, 0.0]", 'kind = "stand"', "optimize_durations = false", "tolerance = 0.002"):
        assert line in meta["scenario"]
    for bad, words in (
        ({"gait.kind": "gallop"}, "gait.kind"),
        ({"gait.kind": None}, "no bool"),
        ({"gait": {}}, "no bool"),
        ({1: 2}, "no string"),
    ):
        with pytest.raises(warpgait.InputError, match=words):
            warpgait.solve(SCENARIO, overrides=bad)  # type: ignore[arg-type]


def test_what_cannot_be_used_is_refused(standing_plan: Path, tmp_path: Path) -> None:
    for scenario, words in (
        (tmp_path / "missing.toml", "missing.toml"),
        ("schema = 1\n", "terrain"),
        ("schema = \n", "scenario:1: not TOML"),
        (SCENARIO.replace("rippled", "lava"), "lava"),
        (SCENARIO.replace("[0.3, 0.0]", "[9.0, 0.0]"), "goal.position"),
    ):
        with pytest.raises(ValueError, match=words):
            warpgait.solve(scenario)
    with pytest.raises(TypeError):
        warpgait.solve(3)  # type: ignore[arg-type]
    with pytest.raises(warpgait.InputError, match=r"missing\.plan"):
        warpgait.load(tmp_path / "missing.plan.npz")
    half = tmp_path / "half.plan.npz"
    half.write_bytes(standing_plan.read_bytes()[:1000])
    with pytest.raises(warpgait.InputError, match="half"):
        warpgait.load(half)
    with pytest.raises(warpgait.InputError, match=r"save\.npz|no/such"):
        warpgait.solve(SCENARIO, overrides={"solver.max_iterations": 1}).save(tmp_path / "no/such/save.npz")


def test_a_plan_without_splines_is_refused_by_member(trajectory: warpgait.Trajectory, tmp_path: Path) -> None:
    trajectory.save(tmp_path / "a.plan.npz")
    bad = altered(tmp_path / "a.plan.npz", tmp_path / "bad.plan.npz", lambda a: a.pop("spline/LF_force_nodes"))
    with pytest.raises(warpgait.InputError, match=r"bad\.plan\.npz: member spline/LF_force_nodes: is missing"):
        warpgait.load(bad)


class EnoughError(Exception):
    pass


def test_an_exception_in_progress_ends_the_solve() -> None:
    rows: list[int] = []

    def progress(iteration: int, violation: float, objective: float) -> None:
        rows.append(iteration)
        if iteration == 2:
            raise EnoughError

    with pytest.raises(EnoughError):
        warpgait.solve(SCENARIO, progress=progress)
    assert rows == [0, 1, 2]


@pytest.fixture
def default_ctrl_c() -> Iterator[None]:
    """Python's own handler of Ctrl-C; a shell that starts tests in the background makes them ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("default_ctrl_c")
def test_ctrl_c_ends_the_solve_and_the_next_one_works() -> None:
    def progress(iteration: int, violation: float, objective: float) -> None:
        if iteration == 1:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        warpgait.solve(SCENARIO, progress=progress)
    assert warpgait.solve(SCENARIO, overrides={"solver.max_iterations": 1}).duration == pytest.approx(2.0)


def test_other_threads_run_during_a_solve() -> None:
    spans: list[float] = []
    done = threading.Event()

    def count() -> None:
        last = time.perf_counter()
        while not done.wait(0.005):
            now = time.perf_counter()
            spans.append(now - last)
            last = now

    started = time.perf_counter()
    thread = threading.Thread(target=count)
    thread.start()
    warpgait.solve(SCENARIO, overrides={"solver.max_iterations": 10})
    done.set()
    thread.join()
    # If the solve held the interpreter lock, the thread would have waited for its end.
    assert max(spans) < 0.5 * (time.perf_counter() - started)


def test_the_stub_file_has_the_compiled_documentation() -> None:
    """`help` shows the one, editors show the other."""
    stub = ast.parse((Path(warpgait.__file__).parent / "_native.pyi").read_text(encoding="utf-8"))
    compared = 0
    for item in stub.body:
        if not isinstance(item, ast.ClassDef | ast.FunctionDef):
            continue
        found = getattr(_native, item.name)
        assert inspect.getdoc(found) == ast.get_docstring(item), item.name
        members = [m for m in item.body if isinstance(m, ast.FunctionDef)] if isinstance(item, ast.ClassDef) else []
        for member in members:
            assert inspect.getdoc(getattr(found, member.name)) == ast.get_docstring(member), f"{item.name}.{member.name}"
        if isinstance(item, ast.ClassDef):
            assert {m.name for m in members} == {name for name in dir(found) if not name.startswith("_")}
        compared += 1 + len(members)
    assert compared > 25
