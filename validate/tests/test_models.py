"""Compares models with their sources, closed-form kinematics with MuJoCo, and boxes with brute force."""

import sysconfig
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warpgait import InputError
from warpgait.arrays import Array
from warpgait.kinematics import PlanarLeg, legs
from warpgait.model import available_models, find_model, foot_names, indices, load_spec, stand
from warpgait.reach import Box, ReachRules, largest_cuboid, reach_box
from warpgait.robots import derive, to_toml
from warpgait.serial import SerialLeg

NAMES = ("anymal_b", "anymal_c")
URDF = {
    "anymal_b": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
}


def urdf_of(name: str) -> Path:
    """The URDF in the package example-robot-data; skips the test if it is not installed."""
    site = Path(sysconfig.get_paths()["purelib"])
    found = [*site.glob(f"cmeel.prefix/share/example-robot-data/robots/{URDF[name]}")]
    if not found:
        pytest.skip(
            "example-robot-data is not installed (pip install 'warpgait[urdf]', 131 MB): models are not compared with the URDF"
        )
    return found[0]


class Urdf:
    """A URDF at zero joint angles, with rigidly connected links merged: mass, center and inertia of moving links, places and limits of joints."""

    def __init__(self, path: Path) -> None:
        root = ET.parse(path).getroot()
        links = {e.attrib["name"]: e for e in root.findall("link")}
        pose: dict[str, tuple[Array, Array]] = {"base": (np.zeros(3), np.eye(3))}
        carrier = {"base": "base"}
        self.joints: dict[str, dict[str, Any]] = {}
        todo = root.findall("joint")
        while todo:
            waiting = []
            for joint in todo:
                parent, child = (joint.find(k).attrib["link"] for k in ("parent", "child"))  # type: ignore[union-attr]
                if parent not in pose:
                    waiting.append(joint)
                    continue
                place, turn = self.origin(joint)
                p, R = pose[parent]
                pose[child] = (p + R @ place, R @ turn)
                carrier[child] = carrier[parent]
                if joint.attrib["type"] != "fixed":
                    carrier[child] = child
                    limit = joint.find("limit")
                    axis = joint.find("axis")
                    assert limit is not None and axis is not None
                    self.joints[joint.attrib["name"]] = {
                        "link": child,
                        "place": pose[child][0],
                        "axis": pose[child][1] @ self.vector(axis.attrib["xyz"]),
                        "range": [float(limit.attrib["lower"]), float(limit.attrib["upper"])],
                        "speed": float(limit.attrib["velocity"]),
                        "torque": float(limit.attrib.get("command_effort", limit.attrib["effort"])),
                    }
            assert len(waiting) < len(todo)
            todo = waiting
        self.spheres: dict[str, tuple[Array, float]] = {}
        parts: dict[str, list[tuple[float, Array, Array]]] = {}
        for name, link in links.items():
            p, R = pose[name]
            for collision in link.findall("collision"):
                sphere = collision.find("geometry/sphere")
                if sphere is not None:
                    place, _ = self.origin(collision)
                    self.spheres[name[:2]] = (p + R @ place, float(sphere.attrib["radius"]))
            inertial = link.find("inertial")
            mass = 0.0 if inertial is None else float(inertial.find("mass").attrib["value"])  # type: ignore[union-attr]
            if inertial is None or mass <= 0:
                continue
            place, turn = self.origin(inertial)
            entries = {k: float(v) for k, v in inertial.find("inertia").attrib.items()}  # type: ignore[union-attr]
            tensor = np.array([[entries["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
            parts.setdefault(carrier[name], []).append((mass, p + R @ place, (R @ turn) @ tensor @ (R @ turn).T))
        self.bodies = {name: self.merge(list_) for name, list_ in parts.items()}

    @staticmethod
    def vector(text: str) -> Array:
        return np.array([float(x) for x in text.split()])

    def origin(self, element: ET.Element) -> tuple[Array, Array]:
        o = element.find("origin")
        attributes = {} if o is None else o.attrib
        rpy = self.vector(attributes.get("rpy", "0 0 0"))
        return self.vector(attributes.get("xyz", "0 0 0")), Rotation.from_euler("xyz", rpy).as_matrix()

    @staticmethod
    def merge(parts: list[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
        mass = sum(m for m, _, _ in parts)
        center = sum((m * c for m, c, _ in parts), np.zeros(3)) / mass
        inertia = np.zeros((3, 3))
        for m, c, tensor in parts:
            r = c - center
            inertia += tensor + m * (r @ r * np.eye(3) - np.outer(r, r))
        return mass, center, inertia


@pytest.mark.parametrize("name", NAMES)
def test_the_model_has_the_facts_of_the_urdf(name: str) -> None:
    urdf = Urdf(urdf_of(name))
    model = load_spec(find_model(name)).compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    mujoco.mj_forward(model, data)
    assert len(urdf.joints) == 12
    assert model.body_mass.sum() == pytest.approx(sum(b[0] for b in urdf.bodies.values()), rel=1e-6)
    for link, (mass, center, inertia) in urdf.bodies.items():
        body = model.body(link).id
        R = data.ximat[body].reshape(3, 3)
        assert model.body_mass[body] == pytest.approx(mass, rel=1e-6)
        assert data.xipos[body] == pytest.approx(center, abs=2e-6)
        assert R @ np.diag(model.body_inertia[body]) @ R.T == pytest.approx(inertia, abs=1e-7)
    for joint, facts in urdf.joints.items():
        mine = model.joint(joint)
        assert data.xanchor[mine.id] == pytest.approx(facts["place"], abs=1e-6)
        assert data.xaxis[mine.id] == pytest.approx(facts["axis"], abs=1e-6)
        assert mine.range == pytest.approx(facts["range"], abs=1e-4)
        assert model.actuator(joint).ctrlrange[1] == facts["torque"]
        assert model.numeric("joint_speed_limit").data[0] == facts["speed"]
    for foot, (center, radius) in urdf.spheres.items():
        assert data.site(foot).xpos == pytest.approx(center, abs=1e-5)
        assert model.geom(foot).size[0] == radius


@pytest.mark.parametrize("name", available_models())
def test_inverse_kinematics_returns_the_angles_it_was_given(name: str) -> None:
    model = load_spec(find_model(name)).compile()
    data = mujoco.MjData(model)
    feet = foot_names(model)
    index = indices(model, feet)
    stand(model, data)
    rest = data.qpos[index.qpos].copy()
    rng = np.random.default_rng(3)
    for _ in range(50):
        data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        angles = rest + rng.uniform(-0.35, 0.35, rest.shape)
        data.qpos[index.qpos] = angles
        mujoco.mj_kinematics(model, data)
        for e, leg in enumerate(legs(model, feet)):
            q, possible = leg.inverse(data.site_xpos[index.site[e]])
            assert possible
            assert q == pytest.approx(angles[e], abs=1e-9)
    for leg in legs(model, feet):
        assert not leg.inverse(leg.hip - np.array([0, 0, 2.0]))[1]
        if isinstance(leg, PlanarLeg) and abs(leg.lateral) > 0.01:  # HyQ's is zero
            assert not leg.inverse(leg.hip + np.array([0, leg.lateral / 2, 0]))[1]  # inside the hip's offset


def test_angles_of_knee_and_thigh_are_those_of_the_links() -> None:
    for name in ("anymal_c", "hexapod"):
        model = load_spec(find_model(name)).compile()
        data = mujoco.MjData(model)
        feet = foot_names(model)
        index = indices(model, feet)
        rng = np.random.default_rng(5)
        for _ in range(20):
            stand(model, data)
            q = data.qpos[index.qpos] + rng.uniform(-0.4, 0.4, (len(feet), 3))
            data.qpos[index.qpos] = q
            mujoco.mj_kinematics(model, data)
            for e, leg in enumerate(legs(model, feet)):
                joints = [model.joint(joint).id for joint in index.joints_of[e]]
                second, third = data.xanchor[joints[1]], data.xanchor[joints[2]]
                axis = data.xaxis[joints[2]]
                thigh, shank = third - second, data.site_xpos[index.site[e]] - third
                across = [v - axis * (axis @ v) for v in (thigh, shank)]
                cosine = across[0] @ across[1] / (np.linalg.norm(across[0]) * np.linalg.norm(across[1]))
                assert leg.knee_angle(q[e]) == pytest.approx(np.arccos(cosine), abs=1e-6)


@pytest.mark.parametrize("least", [(1, 1, 1), (3, 2, 2)])
@pytest.mark.parametrize("held", [None, ((2, 1, 3), (2, 2, 4))])
def test_the_largest_cuboid_is_the_largest(
    least: tuple[int, int, int], held: tuple[tuple[int, int, int], tuple[int, int, int]] | None
) -> None:
    rng = np.random.default_rng(0)
    hold = None if held is None else (np.array(held[0]), np.array(held[1]))
    for _ in range(20):
        mask = rng.random((5, 4, 6)) < 0.85
        best = 0
        for low in product(range(5), range(4), range(6)):
            for end in product(*(range(a + n, size + 1) for a, n, size in zip(low, least, mask.shape, strict=True))):
                cells = tuple(slice(a, b) for a, b in zip(low, end, strict=True))
                holds = hold is None or bool((np.array(low) <= hold[0]).all() and (hold[1] < np.array(end)).all())
                if holds and mask[cells].all():
                    best = max(best, int(np.prod(np.subtract(end, low))))
        found = largest_cuboid(mask, least, hold)
        assert (found is None) == (best == 0)
        if found is not None:
            first, last = found
            assert mask[tuple(slice(a, b + 1) for a, b in zip(first, last, strict=True))].all()
            assert (last - first + 1 >= least).all() and np.prod(last - first + 1) == best
            assert hold is None or ((first <= hold[0]).all() and (hold[1] <= last).all())
    assert largest_cuboid(np.zeros((2, 2, 2), bool)) is None


@pytest.mark.parametrize("first", [(0, 0, 1), (0.6, 0, 0.8), (0, 0.6, 0.8)])
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("room", [0.0, 1.5])
def test_the_closed_form_of_what_a_leg_may_reach_leaves_out_no_posture(first: tuple[float, ...], sense: int, room: float) -> None:
    model = load_spec(find_model("hexapod")).compile()
    random = np.random.default_rng(0)
    for found in legs(model, foot_names(model))[:3]:
        assert isinstance(found, SerialLeg)
        axes = np.array([first, found.axes[1], sense * found.axes[2]])
        leg = replace(found, axes=axes, lower=found.lower - room, upper=found.upper + room)
        q = random.uniform(leg.lower, leg.upper, (5000, 3))
        assert leg.may_reach(leg.place(q)[0])[leg.is_regular(q)].all()
        around = leg.hip + leg.span * random.uniform(-1, 1, (5000, 3))
        angles, reached = leg.inverse(around)
        good, may = reached & leg.within_limits(angles) & leg.is_regular(angles), leg.may_reach(around)
        assert not (good & ~may).any() and good.mean() < may.mean() < 0.6


def test_a_leg_that_reaches_nothing_has_no_box() -> None:
    model = load_spec(find_model("hexapod")).compile()
    leg = replace(legs(model, foot_names(model))[0], lower=np.full(3, 3.0), upper=np.full(3, 3.1))
    trunk = Box(np.zeros(3), np.array([0.1, 0.1, 0.02]))
    rules = ReachRules(side=0.01)
    assert reach_box(leg, 0.02, trunk, rules, np.array([[0.1, 0.1, 0.1], [0.04, 0.04, 0.04]]), 0.02) is None


@pytest.mark.parametrize("name", available_models())
def test_the_robot_file_is_derived_from_the_model(name: str) -> None:
    path = find_model(name)
    assert path.with_suffix(".toml").read_text(encoding="utf-8") == to_toml(derive(path))


@pytest.mark.parametrize("name", available_models())
def test_the_nominal_feet_stand_well_inside_their_boxes(name: str) -> None:
    robot = tomllib.loads(find_model(name).with_suffix(".toml").read_text(encoding="utf-8"))
    for foot in robot["feet"]:
        off = np.abs(np.subtract(foot["nominal"], foot["reach"]["center"])) / foot["reach"]["half_size"]
        assert (off < 0.5).all(), foot["name"]
    torso = robot["torso"]
    assert torso["center"][2] - torso["half_size"][2] > 0.5 * robot["feet"][0]["nominal"][2]  # the trunk is clear of the ground


def test_a_robot_without_a_model_is_refused_and_the_message_names_alternatives() -> None:
    with pytest.raises(InputError) as caught:
        find_model("anymal_towr")
    for word in ("anymal_towr", "anymal_b", "anymal_c", "--model"):
        assert word in str(caught.value)
