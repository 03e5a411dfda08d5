"""`warpgait export`: files, messages, exit codes, certificates."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import WALK

import crawl
import warpgait
from warpgait.commands.export import main
from warpgait.commands.validate import main as validate
from warpgait.errors import error_report
from warpgait.motions import FORMATS, motion_of_plan, motion_of_replay
from warpgait.plan import read_plan


@pytest.fixture
def plan(walk_plan: Path, tmp_path: Path) -> Path:
    """A copy of the walk in a folder of its own."""
    path = tmp_path / "walk.plan.npz"
    path.write_bytes(walk_plan.read_bytes())
    return path


@pytest.fixture(scope="module")
def replayed(walk_plan: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The walk with its report and its replay beside it."""
    path = tmp_path_factory.mktemp("replayed") / "walk.plan.npz"
    path.write_bytes(walk_plan.read_bytes())
    assert validate([str(path), "--quick", "--no-pictures", "--quiet"]) == 0
    return path


@pytest.fixture(scope="module")
def rigid_plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan of a robot that is one rigid body."""
    path = tmp_path_factory.mktemp("rigid") / "rigid.plan.npz"
    warpgait.solve(WALK, overrides={"robot.name": "anymal_towr"}).save(path)
    return path


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line with which a command is refused."""
    capsys.readouterr()
    assert main(words) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1, said.err
    return said.err


def test_formats_are_listed_and_unknown_ones_are_named(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--list"]) == 0
    listed = capsys.readouterr().out
    error = refused([str(plan), "--to", "bvh"], capsys)
    for name in FORMATS:
        assert name in listed and name in error
    assert "--to is missing" in refused([str(plan)], capsys)
    assert "the plan is missing" in refused(["--to", "csv"], capsys)


def test_a_robot_without_joints_is_refused_where_they_are_needed(
    rigid_plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, each in FORMATS.items():
        if each.joints:
            said = refused([str(rigid_plan), "--to", name, "-o", str(tmp_path / "out")], capsys)
            assert "anymal_towr is planned as one rigid body" in said and "csv" in said
    assert list(tmp_path.iterdir()) == []
    assert main([str(rigid_plan), "--to", "json", "-o", str(tmp_path / "out.json"), "--quiet"]) == 0
    data = json.loads((tmp_path / "out.json").read_text())
    plan = read_plan(rigid_plan)
    assert data["joint_names"] == [] and "joint_torque" not in data["certificate"]["margins"]
    np.testing.assert_allclose(data["base_position"], plan.base_position, atol=1e-12)
    np.testing.assert_allclose(data["foot_position"], plan.foot_position, atol=1e-12)


def test_bad_input_is_one_clear_line_and_writes_nothing(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(plan.parent.iterdir())
    none = plan.with_name("none.plan.npz")
    assert "no such file" in refused([str(none), "--to", "csv"], capsys)
    for rate in ("0.5", "1e9", "nan", "-3"):
        assert "--rate" in refused([str(plan), "--to", "csv", "--rate", rate], capsys)
    assert "whole number" in refused([str(plan), "--to", "isaaclab", "--rate", "33.3"], capsys)
    assert "replay the plan first" in refused([str(plan), "--to", "csv", "--from", "replay"], capsys)
    assert "this command reads" in refused([str(plan), "--to", "csv", "-o", str(plan)], capsys)
    assert "name a file" in refused([str(plan), "--to", "csv", "-o", str(plan.parent)], capsys)
    assert sorted(plan.parent.iterdir()) == before
    crawl.altered(plan, none, lambda a: a.pop("foot_force"))
    assert "member foot_force: is missing" in refused([str(none), "--to", "csv"], capsys)
    none.write_bytes(plan.read_bytes()[:3000])
    assert "damaged" in refused([str(none), "--to", "csv"], capsys)


def test_feet_out_of_reach_have_no_joint_angles(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    far = plan.with_name("far.plan.npz")
    crawl.altered(plan, far, lambda a: a.update(base_position=a["base_position"] + [0.0, 0.0, 0.6]))
    assert "is out of reach of anymal_c at 0.00 s" in refused([str(far), "--to", "csv"], capsys)


def test_a_missing_package_is_named(plan: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for name, module in (("parquet", "pyarrow"), ("lerobot", "pyarrow"), ("mcap", "mcap.writer"), ("usd", "pxr.Usd")):
        monkeypatch.setitem(sys.modules, module, None)
        assert 'pip install "warpgait[export]"' in refused([str(plan), "--to", name], capsys)
        assert not list(plan.parent.glob(f"walk{FORMATS[name].ending}*")) or name == "lerobot"


def test_a_format_without_its_package_leaves_no_folder(plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    assert main([str(plan), "--to", "rosbag2"]) == 2
    assert [path.name for path in plan.parent.iterdir()] == [plan.name]
    assert main([str(plan), "--to", "csv", "--rate", "0"]) == 2


def test_what_is_there_is_replaced_only_by_the_rule_of_every_output(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = plan.with_name("walk.csv")
    target.write_text("old")
    target.chmod(0o444)
    assert "read-only" in refused([str(plan), "--to", "csv"], capsys)
    assert target.read_text() == "old"
    target.chmod(0o600)
    assert main([str(plan), "--to", "csv", "--quiet"]) == 0
    assert target.stat().st_mode & 0o777 == 0o600 and target.read_text().startswith("# name")


def test_the_replay_is_exported_with_its_verdict(replayed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(replayed), "--to", "json", "--from", "replay", "-o", str(tmp_path / "a.json"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["certificate"]["replay"]["verdict"] == "pass" and told["rate_hz"] == 250
    data = json.loads((tmp_path / "a.json").read_text())
    with np.load(replayed.with_name("walk.replay.npz")) as replay:
        np.testing.assert_array_equal(data["joint_position"], replay["q"])
        np.testing.assert_array_equal(data["joint_torque"], replay["tau"])
        np.testing.assert_array_equal(data["base_position"], replay["base_position"])
        np.testing.assert_allclose(data["foot_position"], replay["foot_position"], atol=1e-6)
        at = motion_of_replay(read_plan(replayed), 100.0)
        np.testing.assert_allclose(at.joint_position[::2], replay["q"][::5], atol=1e-12)
        np.testing.assert_allclose(
            at.joint_position[1::2], (replay["q"][2::5] + replay["q"][3::5])[: len(at.t) // 2] / 2, atol=5e-4
        )


def test_a_report_or_replay_of_another_plan_does_not_count(
    replayed: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    other = tmp_path / "walk.plan.npz"
    for end in (".report.json", ".replay.npz"):
        other.with_name(f"walk{end}").write_bytes(replayed.with_name(f"walk{end}").read_bytes())
    crawl.altered(replayed, other, lambda a: a.update(history_seconds=a["history_seconds"] + 1))
    assert "is the replay of another plan" in refused([str(other), "--to", "csv", "--from", "replay"], capsys)
    certificate: Any = motion_of_plan(read_plan(other)).certificate
    assert certificate["replay"]["verdict"] is None and "another version" in certificate["replay"]["note"]
    report = error_report(other.name, "the replay was interrupted")
    other.with_name("walk.report.json").write_text(json.dumps(report))
    certificate = motion_of_plan(read_plan(other)).certificate
    assert certificate["replay"]["note"] == "the last replay ended with an error: the replay was interrupted"


def test_the_certificate_tells_a_bad_plan_from_a_good_one(plan: Path) -> None:
    weak = plan.with_name("weak.plan.npz")
    crawl.altered(plan, weak, lambda a: a.update(foot_force=0.5 * a["foot_force"]))
    certificate: Any = motion_of_plan(read_plan(weak)).certificate
    assert certificate["all_laws_hold"] is False
    assert "newton_rms" in [law["name"] for law in certificate["laws"] if not law["passed"]]
    steep = plan.with_name("steep.plan.npz")

    def sideways(a: dict[str, Any]) -> None:
        force = a["foot_force"].copy()
        force[..., 1] += 2.0 * np.abs(force[..., 2])
        a["foot_force"] = force

    crawl.altered(plan, steep, sideways)
    good, bad = (motion_of_plan(read_plan(p)).certificate["margins"]["friction"] for p in (plan, steep))
    assert good > -0.05 and bad < -1.0


def test_the_example_follows_a_motion(plan: Path) -> None:
    assert main([str(plan), "--to", "mujoco", "--quiet"]) == 0
    example = runpy.run_path(str(Path(__file__).parents[1] / "examples/follow.py"))
    scene = plan.with_name("walk.scene.xml")
    reward, seconds = example["run"](scene, 5)
    assert reward > 0.5 and seconds > 0.3
    world = example["Follow"](scene)
    world.reset(0)
    # Without its legs the robot falls off the motion.
    limp, done = np.array([0.0, 1.0, -1.5] * 4), False
    while not done:
        _, _, done = world.step(limp)
    assert world.k < len(world.t) - 1
