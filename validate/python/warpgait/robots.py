"""`python -m warpgait.robots [NAME…]`: derives `robots/NAME.toml` (what the planner knows) from `robots/NAME.xml` (what the replay uses).

Mass, centre of mass and inertia are those of the model frozen in its keyframe `stand`; the nominal feet are that stance's contact
points; the torso is the box around the trunk's collision shapes; reach boxes are found by `warpgait.reach`.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .errors import InputError
from .kinematics import Leg, legs
from .model import Array, Composite, available_models, check_mujoco, composite, find_model, foot_names, indices, load_spec, stand
from .reach import Box, ReachRules, reach_box, reached

LEAST_BOX = np.array([0.30, 0.20, 0.20])
"""Least edges of a reach box, m: those of TOWR's ANYmal. The largest box of all is only 0.16 m high, too little for rough ground."""


@dataclass(frozen=True)
class CentroidalRobot:
    """What a robot file holds. Everything relative to the centre of mass, base frame, SI."""

    name: str
    body: Composite
    torso: Box
    feet: tuple[str, ...]
    nominal: Array  # (E, 3) contact points
    reach: tuple[Box, ...]
    shank: ShankShape
    legs: tuple[Leg, ...]  # hips relative to the base's origin, as the model has them
    radius: float  # m, of the feet
    speed_limit: float  # rad/s
    gait_cycle: float | None  # s, where the model names one
    torque_limit: Array  # (E, 3) N m


@dataclass(frozen=True)
class ShankShape:
    """What of a shank could hit the ground, in the plane of the leg, m."""

    knee_radius: float  # of the parts around the KFE axis
    corner: tuple[float, float]  # the outermost corner from there: along the line to the foot's centre, and across it


def shank_shape(model: Any, leg: Leg) -> ShankShape:
    """Read off the collision shapes of the body that carries the foot of `leg`, and of the thigh above it."""
    body = model.geom_bodyid[model.geom(leg.name).id]
    radius, corner = 0.0, (0.0, 0.0)
    foot = np.array([np.sin(leg.shank_zero), -np.cos(leg.shank_zero)])  # from the knee, x and z at zero joint angles
    outward = leg.bend * np.array([-foot[1], foot[0]])
    for g in np.flatnonzero(model.geom_bodyid == body):
        if g == model.geom(leg.name).id:
            continue
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        R = rotation.reshape(3, 3)
        center = model.geom_pos[g] + R @ model.geom_aabb[g, :3]
        half = np.abs(R) @ model.geom_aabb[g, 3:]
        corners = center[[0, 2]] + half[[0, 2]] * np.array(list(product([-1, 1], repeat=2)))
        if (np.abs(center[[0, 2]]) <= half[[0, 2]]).all():  # around the axis: the far end belongs to the corner
            radius = max(radius, float(half[2]))
        furthest = corners[np.argmax(corners @ outward)]
        if furthest @ outward > corner[1]:
            corner = (float(furthest @ foot), float(furthest @ outward))
    # The lower end of the thigh turns about the same axis.
    axis = model.body_pos[body]
    for g in np.flatnonzero(model.geom_bodyid == model.body_parentid[body]):
        if np.hypot(*(model.geom_pos[g] - axis)[[0, 2]]) < 0.01:
            radius = max(radius, float(model.geom_size[g][0]))
    return ShankShape(radius, corner)


def trunk_box(model: Any) -> Box:
    """The box around the collision shapes of the base body, base frame."""
    base = model.body("base").id
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for g in np.flatnonzero(model.geom_bodyid == base):
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        R = rotation.reshape(3, 3)
        center = model.geom_pos[g] + R @ model.geom_aabb[g, :3]
        half = np.abs(R) @ model.geom_aabb[g, 3:]
        low, high = np.minimum(low, center - half), np.maximum(high, center + half)
    return Box((low + high) / 2, (high - low) / 2)


def derive(path: Path, rules: ReachRules | None = None, resolution: float = 0.01) -> CentroidalRobot:
    """Everything the planner needs, from the model at `path`.

    The reach box is found for the first foot and mirrored to the others; every mirrored box is then checked on a random sample.
    """
    rules = rules or ReachRules()
    model = load_spec(path).compile()
    data = mujoco.MjData(model)
    stand(model, data)
    feet = foot_names(model)
    index = indices(model, feet)
    body = composite(model, data)
    trunk = trunk_box(model)
    all_legs = legs(model, feet)
    first = reach_box(all_legs[0], index.radius, trunk, rules, LEAST_BOX, resolution)
    boxes = []
    for leg in all_legs:
        mirror = np.append(np.sign(leg.hip[:2] * all_legs[0].hip[:2]), 1.0)
        box = Box(first.center * mirror, first.half_size)
        sample = box.center + np.random.default_rng(0).uniform(-1, 1, (20_000, 3)) * box.half_size
        share = float(reached(leg, sample, index.radius, trunk, rules).mean())
        if share < 0.999:
            raise InputError(f"{path}: leg {leg.name} is no mirror image of {feet[0]}: it reaches only {share:.1%} of the box")
        boxes.append(Box(box.center - body.center_of_mass, box.half_size))
    base = data.xpos[index.base] + body.center_of_mass
    nominal = data.site_xpos[index.site] - np.array([0, 0, index.radius]) - base
    torso = Box(trunk.center - body.center_of_mass, trunk.half_size)
    names = {model.numeric(i).name for i in range(model.nnumeric)}
    return CentroidalRobot(
        name=path.stem,
        body=body,
        torso=torso,
        feet=feet,
        nominal=nominal,
        reach=tuple(boxes),
        shank=shank_shape(model, all_legs[0]),
        legs=tuple(all_legs),
        radius=index.radius,
        speed_limit=index.speed_limit,
        gait_cycle=float(model.numeric("gait_cycle").data[0]) if "gait_cycle" in names else None,
        torque_limit=index.torque_limit,
    )


def _row(values: Array, digits: int = 3) -> str:
    return "[" + ", ".join(f"{v + 0.0:.{digits}f}" for v in np.round(values, digits)) + "]"


def to_toml(robot: CentroidalRobot) -> str:
    """The robot file's text."""
    c = robot.body.center_of_mass
    lines = [
        f"# Derived from robots/{robot.name}.xml by `python -m warpgait.robots {robot.name}`; change the model and run it again.",
        "# Base frame: x forward, y left, z up; everything is relative to the centre of mass, which lies in the model's base frame",
        f"# at {_row(c, 4)} m in the nominal stance. Feet are contact points, one foot radius ({robot.radius:g} m) below the foot's centre.",
        f'name = "{robot.name}"',
        'source = "ANYbotics\' URDF (BSD-3), through the MJCF model of the same name"',
        f"mass = {robot.body.mass:.6g}                                # kg",
        "inertia = [                                    # kg m², about the centre of mass, nominal stance",
        *(f"  {_row(row, 6)}," for row in robot.body.inertia),
        "]",
        *([] if robot.gait_cycle is None else [f"gait_cycle = {robot.gait_cycle:.2f}                              # s, default"]),
        "# The box around the trunk's collision shapes, m.",
        f"torso = {{ center = {_row(robot.torso.center)}, half_size = {_row(robot.torso.half_size)} }}",
        "",
        "# Reach: the largest box of contact points within joint limits, the knee bent by 0.35–2.6 rad, |HFE| ≤ 100°, the foot clear of the",
        f"# trunk, on ground tilted by up to 30°, with edges of at least {_row(LEAST_BOX, 2)} m.",
    ]
    lines += [
        "# Legs: hip is x of the flexion axis, y and z of the abduction axis; lengths to the foot's centre, in the plane of the leg.",
    ]
    for name, nominal, box, leg, torque in zip(
        robot.feet, robot.nominal, robot.reach, robot.legs, robot.torque_limit, strict=True
    ):
        hip = leg.hip + np.array([leg.flexion_offset, 0, 0]) - c
        lines += [
            "",
            "[[feet]]",
            f'name = "{name}"',
            f"nominal = {_row(nominal)}              # m",
            f"reach = {{ center = {_row(box.center)}, half_size = {_row(box.half_size)} }}   # m",
            "[feet.leg]",
            f"hip = {_row(hip, 4)}                  # m",
            f"lateral = {leg.lateral:.4f}                            # m",
            f"thigh = {leg.thigh:.4f}                              # m",
            f"shank = {leg.shank:.4f}                              # m",
            f"knee_radius = {robot.shank.knee_radius:.4f}                        # m",
            f"corner = {_row(np.array(robot.shank.corner), 4)}                  # m, of the shank, from the knee",
            f"bend = {leg.bend:.1f}                                  # the knee bends the shank forward (1) or back (-1)",
            f"foot_radius = {robot.radius:g}                         # m",
            f"speed_limit = {robot.speed_limit:.1f}                           # rad/s, each joint",
            f"torque_limit = {_row(torque, 1)}           # N m, HAA, HFE, KFE",
        ]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Write the robot files; 0 on success, 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m warpgait.robots", description=__doc__)
    parser.add_argument("names", nargs="*", help="models (default: all that are found)")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a robot file differs from its model")
    options = parser.parse_args(arguments)
    try:
        check_mujoco()
        stale = []
        for name in options.names or available_models():
            path = find_model(name)
            target = path.with_suffix(".toml")
            text = to_toml(derive(path))
            if not options.check:
                target.write_text(text, encoding="utf-8")
                print(f"wrote {target}")
            elif not target.is_file() or target.read_text(encoding="utf-8") != text:
                stale.append(name)
        if stale:
            raise InputError(f"robot files differ from their models: {', '.join(stale)}; run python -m warpgait.robots")
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
