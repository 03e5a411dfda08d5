"""Robots with legs of four to seven joints: imported, planned, checked, replayed and exported."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from warpgait import Plan, Robot, Scenario, Terrain, importer
from warpgait.kinematics import legs
from warpgait.model import foot_names, indices, load_spec
from warpgait.serial import SerialLeg
from warpgait.settings import Settings

SIDES = {"fl": (1, 1), "fr": (1, -1), "rl": (-1, 1), "rr": (-1, -1)}
# Of a leg: axis, place from the joint before, range, mass, length and radius of its link, torque.
FOUR = [
    ("1 0 0", "{x} {y} 0", "-0.8 0.8", 0.7, 0.0, 0.0, 60),
    ("0 1 0", "0 {side} 0", "-1.6 2.6", 1.2, 0.22, 0.025, 60),
    ("0 1 0", "0 0 -0.22", "-2.5 -0.3", 0.35, 0.22, 0.018, 60),
    ("0 1 0", "0 0 -0.22", "-0.4 1.6", 0.16, 0.12, 0.012, 40),
]
# As in a humanoid: yaw, roll, pitch, pitch, and an ankle that pitches and rolls.
SIX = [
    ("0 0 1", "{x} {y} 0", "-0.6 0.6", 0.5, 0.0, 0.0, 60),
    ("1 0 0", "0 0 -0.02", "-0.6 0.6", 0.4, 0.0, 0.0, 60),
    ("0 1 0", "0 {side} 0", "-1.6 2.0", 1.0, 0.22, 0.025, 60),
    ("0 1 0", "0 0 -0.22", "-2.5 -0.1", 0.5, 0.22, 0.018, 60),
    ("0 1 0", "0 0 -0.22", "-1.2 1.4", 0.1, 0.0, 0.0, 40),
    ("1 0 0", "0 0 -0.02", "-0.5 0.5", 0.15, 0.06, 0.012, 40),
]
# Without the roll of the ankle; with another turn of the shank about its own axis.
FIVE = [*SIX[:4], ("0 1 0", "0 0 -0.22", "-1.2 1.4", 0.2, 0.08, 0.012, 40)]
SEVEN = [
    *SIX[:4],
    ("0 0 1", "0 0 -0.12", "-0.5 0.5", 0.1, 0.0, 0.0, 40),
    ("0 1 0", "0 0 -0.1", "-1.2 1.4", 0.1, 0.0, 0.0, 40),
    SIX[5],
]


def leg(name: str, links: list[tuple[str, str, str, float, float, float, int]]) -> str:
    """The bodies of a leg in MJCF."""
    x, y = SIDES[name]
    text = ""
    for k, (axis, place, limits, mass, length, radius, torque) in enumerate(links):
        where = place.format(x=0.26 * x, y=0.06 * y, side=0.07 * y)
        i = mass * 0.1**2 / 6
        text += (
            f'<body name="{name}_{k}" pos="{where}"><joint name="{name}_j{k}" axis="{axis}" range="{limits}" actuatorfrcrange="-{torque} {torque}"/>'
            f'<inertial pos="0 0 {-length / 2}" mass="{mass}" diaginertia="{i} {i} {i}"/>'
        )
        if radius:
            text += f'<geom type="capsule" size="{radius}" fromto="0 0 -0.02 0 0 {0.03 - length}"/>'
    foot = f'<geom name="{name}_foot" type="sphere" size="0.02" pos="0 0 {-links[-1][4]}"/>'
    return text + foot + "</body>" * len(links)


def mjcf(links: list[tuple[str, str, str, float, float, float, int]]) -> str:
    """A quadruped of about 20 kg."""
    return (
        '<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="trunk"><freejoint/>'
        '<geom type="box" size="0.25 0.11 0.07"/><inertial pos="0 0 0" mass="11" diaginertia="0.06 0.25 0.27"/>'
        + "".join(leg(name, links) for name in SIDES)
        + "</body></worldbody></mujoco>"
    )


def imported(folder: Path, name: str, links: list[tuple[str, str, str, float, float, float, int]]) -> Path:
    """The files of a robot, without their ending."""
    (folder / f"{name}_in.xml").write_text(mjcf(links))
    words = [str(folder / f"{name}_in.xml"), "-o", str(folder / name), "--speed-limit", "15", "--quiet"]
    assert importer.main(words) == 0
    return folder / name


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return imported(tmp_path_factory.mktemp("four"), "four", FOUR)


def test_postures_are_the_nearest_to_the_stance(four: Path) -> None:
    model = load_spec(four.with_suffix(".xml")).compile()
    index = indices(model, foot_names(model))
    assert index.qpos.shape == (4, 4) and index.is_redundant
    random = np.random.default_rng(1)
    for found in legs(model, index.feet):
        assert isinstance(found, SerialLeg)
        q = found.stance + random.uniform(-0.3, 0.3, (200, 4))
        feet = found.place(q)[0]
        nearest, reached = found.inverse(feet)
        assert reached.all() and found.place(nearest)[0] == pytest.approx(feet, abs=1e-6)
        assert found.inverse(found.place(found.stance[None])[0])[0][0] == pytest.approx(found.stance, abs=1e-6)

        def distance(q: np.ndarray, leg: SerialLeg = found) -> np.ndarray:
            return np.asarray(((q - leg.stance) ** 2 / ((leg.upper - leg.lower) / 2) ** 2).sum(1))

        assert (distance(nearest) <= distance(q) + 1e-3).all()
        # The motion of the joints that leaves the foot where it is leads no nearer.
        at, points, axes = found.place(nearest)
        J = np.cross(axes, at[:, None] - points).transpose(0, 2, 1)
        free = np.linalg.svd(J)[2][:, 3]
        pull = (nearest - found.stance) / ((found.upper - found.lower) / 2) ** 2
        assert np.abs((free * pull).sum(1)).max() < 2e-3


def test_the_import_keeps_upper_links_clear_of_the_ground(four: Path) -> None:
    robot = tomllib.loads(four.with_suffix(".toml").read_text())
    assert robot["mass"] == pytest.approx(11 + 4 * (0.7 + 1.2 + 0.35 + 0.16))
    for foot in robot["feet"]:
        joints = foot["leg"]["joints"]
        assert len(joints) == 4 == len(foot["leg"]["stance"])
        assert [joint.get("radius") for joint in joints] == [None, None, pytest.approx(0.018, abs=2e-3), None]
        assert all(low < q < high for q, (low, high) in zip(foot["leg"]["stance"], (j["range"] for j in joints), strict=True))
        assert min(foot["reach"]["half_size"]) > 0.05


def plan_on(robot: Path, terrain: Terrain) -> Plan:
    """A plan of a short walk."""
    return Scenario(
        horizon=4.0, robot=Robot(file=robot.with_suffix(".toml")), terrain=terrain, start=(0.0, 0.0), goal=(0.4, 0.0)
    ).solve()


def test_four_joints_are_planned_checked_replayed_and_exported(four: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WARPGAIT_ROBOTS", str(four.parent))
    ground = Terrain.formula("0.015*sin(6*x)*cos(5*y)", extent=(-1.0, 1.5, -1.0, 1.0), spacing=0.02)
    plan = plan_on(four, ground)
    assert plan.solved and plan.passed
    report = plan.validate(Settings(quick=True))
    assert report.verdict in ("pass", "marginal"), report
    motion = plan.motion(50.0)
    assert motion.joint_position.shape[1] == 16


@pytest.mark.parametrize("links", [FIVE, SIX, SEVEN], ids=["five", "six", "seven"])
def test_more_joints_are_planned_checked_and_replayed(
    links: list[tuple[str, str, str, float, float, float, int]], tmp_path: Path
) -> None:
    robot = imported(tmp_path, "robot", links)
    plan = plan_on(robot, Terrain.shape("flat"))
    assert plan.solved and plan.passed
    report = plan.validate(Settings(quick=True, model=str(robot.with_suffix(".xml"))))
    assert report.verdict in ("pass", "marginal"), report


def test_more_than_seven_joints_and_wheels_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.xml"
    wheel = ("0 1 0", "0 0 -0.12", "-3 3", 0.2, 0.0, 0.0, 20)
    for links, words in (
        ([*SIX, *FOUR[1:]], "has 9 joints"),
        ([*FOUR, wheel], "on the spot, as that of a wheel does"),
    ):
        path.write_text(mjcf(links))
        assert importer.main([str(path), "-o", str(tmp_path / "out"), "--speed-limit", "15"]) == 2
        message = capsys.readouterr().err
        assert re.search(words, message) and message.count("\n") == 1, message
