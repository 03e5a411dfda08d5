"""Scenarios and plans in Python."""

from __future__ import annotations

import json
import pickle
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import WALK

import warpgait
from warpgait import InputError, Plan, Robot, Scenario, Terrain
from warpgait.commands.export import formats
from warpgait.settings import Settings
from warpgait.toml import table_text


@pytest.fixture(scope="module")
def plan() -> Plan:
    return Scenario.from_text(WALK).solve()


def test_scenarios_are_made_of_keywords_dicts_texts_and_files(tmp_path: Path) -> None:
    ground = Terrain.formula("0.04*sin(5*x)*cos(4*y)", extent=(-1.5, 1.5, -1.5, 1.5), spacing=0.02)
    made = Scenario(
        formulation="direct", horizon=3.0, robot="anymal_c", terrain=ground, start=(0.0, 0.0), goal=np.array([0.3, 0.0])
    )
    told = Scenario.from_text(WALK)
    assert made.to_dict() == {"schema": 1, **told.to_dict()}
    assert Scenario.from_dict(made.to_dict()) == made and made != told
    (tmp_path / "walk.toml").write_text(WALK)
    assert Scenario.read(tmp_path / "walk.toml") == told
    made.save(tmp_path / "made.toml")
    assert Scenario.read(tmp_path / "made.toml") == made and tomllib.loads(made.text()) == made.to_dict()


def test_set_returns_another_scenario(tmp_path: Path) -> None:
    first = Scenario.from_text(WALK)
    second = first.set({"gait.kind": "trot", "goal": [0.4, 0.1]}).set("horizon", 2.0)
    assert first.to_dict()["goal"]["position"] == [0.3, 0.0] and "gait" not in first.to_dict()
    values = second.to_dict()
    assert values["gait"] == {"kind": "trot"} and values["goal"]["position"] == [0.4, 0.1] and values["horizon"] == 2.0
    third = second.set("terrain", Terrain.shape("flat", extent=[-1.0, 1.0, -1.0, 1.0])).set(
        "robot", Robot("anymal_b", adhesive_feet=["LF"])
    )
    assert third.to_dict()["terrain"] == {"kind": "flat", "extent": [-1.0, 1.0, -1.0, 1.0]}
    assert third.to_dict()["robot"] == {"name": "anymal_b", "adhesive_feet": ["LF"]} and third.to_dict()["gait"] == {
        "kind": "trot"
    }


def test_what_is_set_is_planned(plan: Plan) -> None:
    seen: list[int] = []
    trot = Scenario.from_text(WALK).set({"goal": [0.2, 0.0], "horizon": 2.0, "solver.max_iterations": 3})
    found = warpgait.solve(trot, overrides={"gait.kind": "trot"}, progress=lambda iteration, *_: seen.append(iteration))
    assert found.duration == 2.0 and seen[:2] == [0, 1] and tomllib.loads(found.meta["scenario"])["gait"]["kind"] == "trot"
    assert plan.duration == 3.0 and plan.solved and plan.passed and plan.robot == "anymal_c"


def test_an_array_is_a_ground(tmp_path: Path) -> None:
    y, x = np.mgrid[-1.5:1.5:61j, -1.5:1.5:61j]
    heights = 0.05 * np.sin(2 * x) + 0.02 * y
    for path in (None, tmp_path / "kept.npz"):
        ground = Terrain.array(heights, spacing=0.05, layout="y-up", path=path)
        base = Scenario(formulation="direct", horizon=3.0, robot="anymal_c", start=(0.0, 0.0), goal=(0.2, 0.0), terrain=ground)
        found = base.set("solver.max_iterations", 2).solve()
        points = np.array([[0.3, -0.4], [-0.2, 0.5]])
        exact = 0.05 * np.sin(2 * points[:, 0]) + 0.02 * points[:, 1]
        np.testing.assert_allclose(found.terrain.height(points), exact, atol=2e-3)
    assert (tmp_path / "kept.npz").is_file()
    with pytest.raises(InputError, match="two dimensions"):
        Terrain.array(np.zeros(5), spacing=0.1)


def test_paths_in_a_scenario_file_are_relative_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").mkdir()
    warpgait.write_terrain(tmp_path / "a" / "flat.npz", np.zeros((40, 40)), spacing=0.1)
    text = 'formulation = "direct"\nhorizon = 3.0\n[terrain]\nkind = "heightmap"\nfile = "flat.npz"\n[start]\nposition = [0.0, 0.0]\n[goal]\nposition = [0.2, 0.0]\n'
    (tmp_path / "a" / "s.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    scenario = Scenario.read("a/s.toml").set("solver.max_iterations", 1)
    assert scenario.to_dict()["terrain"]["file"] == str(tmp_path / "a" / "flat.npz")
    monkeypatch.chdir("/")
    assert scenario.solve().duration == 3.0
    assert Scenario.from_dict(scenario.to_dict()).solve().duration == 3.0


def test_bad_values_are_refused_with_their_key(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gait\.kind"):
        Scenario.from_text(WALK).set("gait.kind", "moonwalk").solve()
    with pytest.raises(InputError, match="hurizon"):
        Scenario.from_text(WALK).set("hurizon", 2.0).solve()
    with pytest.raises(InputError, match="horizon: nan"):
        Scenario(horizon=float("nan"))
    with pytest.raises(InputError, match=r"start\.position: .*object"):
        Scenario(start=object())  # type: ignore[arg-type]
    with pytest.raises(InputError, match="either a name or a file"):
        Scenario(robot=Robot())
    with pytest.raises(InputError, match="there is no such file"):
        Scenario.read(tmp_path / "none.toml")
    with pytest.raises(InputError, match="not TOML"):
        Scenario.from_text("a = = 1").to_dict()
    with pytest.raises(InputError, match="is a value, not a table"):
        Scenario(horizon=2.0).set("horizon.length", 3.0).to_dict()


def test_an_error_says_where_its_cause_is(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(f"{WALK}[gait]\nkind = 'moonwalk'\n")
    with pytest.raises(InputError) as caught:
        warpgait.solve(tmp_path / "s.toml")
    error = caught.value
    assert (error.file, error.line, error.key) == (str(tmp_path / "s.toml"), WALK.count("\n") + 2, "gait.kind")
    assert str(error).startswith(f"{error.file}:{error.line}: gait.kind: ")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.file, again.line, again.key) == (str(error), error.file, error.line, error.key)
    with pytest.raises(InputError) as caught:
        warpgait.solve(tmp_path / "s.toml", overrides={"gait.kind": "slide"})
    assert (caught.value.file, caught.value.line, caught.value.key) == ('--set gait.kind="slide"', None, "gait.kind")
    with pytest.raises(InputError) as caught:
        warpgait.load(tmp_path / "none.plan.npz")
    assert caught.value.file == str(tmp_path / "none.plan.npz") and caught.value.key is None


def test_a_terrain_is_evaluated_before_and_after_planning(plan: Plan, tmp_path: Path) -> None:
    points = np.array([[0.3, -0.4], [-0.2, 0.5]])
    made = Terrain.formula("0.04*sin(5*x)*cos(4*y)", extent=(-1.5, 1.5, -1.5, 1.5), spacing=0.02)
    assert made.extent == (-1.5, 1.5, -1.5, 1.5)
    np.testing.assert_allclose(made.height(points), 0.04 * np.sin(5 * points[:, 0]) * np.cos(4 * points[:, 1]), atol=1e-4)
    for other in (plan.terrain, Scenario.from_text(WALK).terrain):
        np.testing.assert_array_equal(other.height(points), made.height(points))
        np.testing.assert_array_equal(other.normal(points), made.normal(points))
    # That of a plan is a terrain for other scenarios.
    assert Scenario(terrain=plan.terrain).to_dict()["terrain"] == {
        **Scenario.from_text(WALK).to_dict()["terrain"],
        **plan.terrain.values,
    }
    array = Terrain.array(np.tile(np.linspace(0.0, 1.0, 41), (21, 1)), spacing=0.05, layout="y-up", origin=(5.0, 0.0))
    np.testing.assert_allclose(array.height([[5.0, 0.0], [4.5, 0.2]]), [0.5, 0.25], atol=1e-9)
    assert "steepest" in made._repr_html_() and "27°" in array._repr_html_()
    with pytest.raises(InputError, match=r"terrain\.expression"):
        Terrain.formula("0.1*", extent=(-1, 1, -1, 1)).height(points)


def test_the_keys_of_scenarios_are_those_of_the_schema() -> None:
    found = warpgait.keys()
    names = {key.name for key in found}
    assert {"horizon", "robot.name", "gait.duty", "terrain.expression", "start.position", "solver.effort"} <= names
    (kind,) = warpgait.keys("gait.kind")
    assert kind.default == "walk" and "trot" in kind.value and not kind.required
    (place,) = warpgait.keys("start.position")
    assert place.required and place.value.startswith("2 values: number")
    expression = warpgait.keys("terrain.expression")
    assert [key.variant for key in expression] == ["formula"]
    assert {key.name for key in warpgait.keys("map")} <= names and all(key.meaning or key.name == "terrain.kind" for key in found)
    assert "gait.kind" in repr(warpgait.keys("gait")) and warpgait.keys("gait")._repr_html_().count("<tr>") > 3
    with pytest.raises(InputError, match=r"gait\.speed: there is no such key"):
        warpgait.keys("gait.speed")


def test_toml_is_read_as_it_was_written() -> None:
    values: dict[str, Any] = {
        "a": True,
        "b": -3,
        "c": 1e-30,
        "d": 'quotes " and \\ and \n and \x7f and é and 😀',
        "e": [[1.5, 2], ["x"]],
        "f g": {"h.i": {"j": 0.1}, "k": []},
        "l": {},
    }
    assert tomllib.loads(table_text(values)) == values
    assert table_text({"a": None}) == ""


def test_a_plan_is_checked_replayed_exported_and_shown(plan: Plan, tmp_path: Path) -> None:
    assert isinstance(plan, warpgait.Trajectory)
    found = plan.check()
    assert found.passed and found["newton_rms"].value < 0.5 and found.broken == []
    with pytest.raises(KeyError):
        _ = found["gravity"]
    path = tmp_path / "walk.plan.npz"
    plan.save(path)
    again = warpgait.load(path)
    assert again.path == path and repr(again) == repr(plan)
    np.testing.assert_array_equal(again.samples.foot_force, plan.samples.foot_force)
    np.testing.assert_array_equal(warpgait.check(path).laws[3].value, found.laws[3].value)
    motion = again.motion(50.0)
    assert motion.joint_position.shape == motion.joint_torque.shape == (151, 12)
    assert again.to_json(tmp_path / "a.json", rate=10.0) == again.to("json", tmp_path / "a.json", 10.0) == [tmp_path / "a.json"]
    np.testing.assert_allclose(
        json.loads((tmp_path / "a.json").read_text())["joint_position"], motion.joint_position[::5], atol=1e-12
    )
    for name in formats():
        assert callable(getattr(again, f"to_{name}"))
    with pytest.raises(AttributeError, match="to_bvh"):
        _ = again.to_bvh
    with pytest.raises(InputError, match="expected plan or replay"):
        again.motion(source="dream")
    report = again.validate(Settings(quick=True), folder=tmp_path)
    assert report.verdict == "pass" and report.trackable and report.first_failure is None
    assert report.to_dict()["plan_sha256"] == again.samples.sha256
    assert again.motion(source="replay").certificate["replay"]["verdict"] == "pass"
    page = again.view(tmp_path / "walk.html")
    assert (tmp_path / "walk.html").read_text() == page.text


def test_a_plan_that_was_not_saved_has_a_file_of_its_own() -> None:
    plan = Scenario.from_text(WALK).set("solver.max_iterations", 1).solve()
    place = plan.path
    assert place.is_file() and not plan.check().passed and "broken" in repr(plan.check())
    del plan
    assert not place.exists()


def test_notebooks_show_plans_checks_and_reports(plan: Plan) -> None:
    shown = plan._repr_html_()
    assert "anymal_c" in shown and "every check holds" in shown
    assert "newton_rms" in plan.check()._repr_html_()
    frame = plan.view()._repr_html_()
    assert frame.startswith("<iframe srcdoc=") and frame.count('"') == 2 + 2 + 2 + 2 and "<!doctype html>" in frame
    bad = Scenario.from_text(WALK).set("solver.max_iterations", 1).solve()
    assert "fail: " in bad._repr_html_()


def test_the_package_is_imported_without_mujoco() -> None:
    import subprocess
    import sys

    code = "import sys, warpgait; print('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "False"


def test_a_plan_or_what_it_is_exported_to_is_a_guess(plan: Plan, tmp_path: Path) -> None:
    plan.to_csv(tmp_path / "walk.csv", rate=100.0)
    for guess in (plan, tmp_path / "walk.csv"):
        seen: list[warpgait.Iterate] = []
        found = warpgait.solve(WALK, guess=guess, watch=seen.append)
        first = seen[0]
        np.testing.assert_allclose(first.base_position, plan.base(first.t).position, atol=2e-3)
        np.testing.assert_allclose(first.foot_position, plan.feet(first.t).position, atol=1e-2)
        assert found.solved and found.meta["solver"]["iterations"] < plan.meta["solver"]["iterations"]
        assert seen[0].stage == "solve" and seen[0].violation < 0.05
    text = (tmp_path / "walk.csv").read_text().replace("LF_contact_position_y", "LF")
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError, match=r"bad\.csv:\d+: LF_contact_position_y: there is no such column"):
        warpgait.solve(WALK, guess=tmp_path / "bad.csv")
    with pytest.raises(InputError, match=r"lasts 3.* s, the motion 2"):
        Scenario.from_text(WALK).set({"horizon": 2.0, "guess.file": str(tmp_path / "walk.csv")}).solve()
