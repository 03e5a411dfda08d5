"""`python -m warpgait.robots [NAME…]`: derives `robots/NAME.toml` (for the planner) from `robots/NAME.xml` (for the replay).

Mass, center of mass and inertia are those of the model frozen in its keyframe `stand`. The nominal feet are the contact points of that
stance. The torso is the box around the trunk's collision shapes. `warpgait.reach` finds the reach boxes.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .arrays import Array
from .chain import Chain, Joint, chains
from .console import ERROR, complain, emit, run
from .errors import InputError
from .files import write_text
from .kinematics import Leg, is_redundant, legs
from .model import (
    Composite,
    available_models,
    check_mujoco,
    composite,
    find_model,
    foot_names,
    indices,
    load_spec,
    numeric,
    stand,
)
from .reach import Box, ReachRules, reach_box, reached
from .serial import SerialLeg

LEAST_BOX = np.array([0.30, 0.20, 0.20])
"""Least edges of a reach box, m, for a robot of ANYmal's size: those of TOWR's. Without them, the largest box is only 0.16 m high, too little for
rough ground."""
LEAST_FRACTIONS = (1.0, 0.8, 0.6, 0.4)  # of these edges, in this order, until the leg reaches such a box
LEAST_ROOM = 0.01  # m, for a robot of ANYmal's size: of the nominal foot inside its box
RESOLUTION, SIDE = 0.01, 0.03  # m, for a robot of ANYmal's size: of the grid of the reach set; of a foot inside its quadrant
PLAY = 0.0025  # m, for a robot of ANYmal's size: of the foot of a leg of two joints to each side of its plane
SERIAL_CELLS, REDUNDANT_CELLS = (
    36,
    22,
)  # along the span of a leg whose inverse kinematics is numeric; of one of more than three joints

MIRROR_SAMPLES, MIRROR_FRACTION = (
    20_000,
    0.999,
)  # a quarter of them for a leg of more than three joints: random points in a mirrored reach box, and the fraction that the leg must reach
KNEE_DISTANCE = 0.01  # m: a shape of the thigh this close to the KFE axis is part of the knee


@dataclass(frozen=True)
class CentroidalRobot:
    """The contents of a robot file. Everything is relative to the center of mass; base frame, SI."""

    name: str
    source: str
    body: Composite
    torso: Box
    feet: tuple[str, ...]
    nominal: Array  # (E, 3) contact points
    reach: tuple[Box, ...]
    shanks: tuple[ShankShape, ...]
    legs: tuple[Chain, ...]  # the first joints relative to the base's origin, as the model has them
    radius: float  # m, of the feet
    gait_cycle: float | None  # s, if the model has one
    rules: ReachRules  # of the reach boxes
    size: float  # in ANYmals


@dataclass(frozen=True)
class ShankShape:
    """The parts of a shank that could hit the ground, in the plane of the leg, m."""

    knee_radius: float  # of the shapes around the KFE axis
    corner: tuple[float, float]  # of the shank, from that axis: along the line to the foot's center, and across it
    tube: tuple[
        float, float
    ]  # the upper end of the axis of the shank's longest round shape, which leads to the foot; the same way
    tube_radius: float


def geom_box(model: Any, geom: int) -> Box:
    """The axis-aligned box around a shape, in the frame of its body."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    R = rotation.reshape(3, 3)
    center = model.geom_pos[geom] + R @ model.geom_aabb[geom, :3]
    return Box(center, np.abs(R) @ model.geom_aabb[geom, 3:])


def shank_shape(model: Any, leg: Leg) -> ShankShape:
    """Read from the collision shapes of the body that carries the foot of `leg`, and of the thigh above it."""
    body = model.geom_bodyid[model.geom(leg.name).id]
    radius, corner = 0.0, (0.0, 0.0)
    foot, outward = leg.along, leg.outward
    for g in np.flatnonzero(model.geom_bodyid == body):
        if g == model.geom(leg.name).id:
            continue
        box = geom_box(model, int(g))
        center, half = leg.plane @ box.center, np.abs(leg.plane) @ box.half_size
        corners = center + half * np.array(list(product([-1, 1], repeat=2)))
        radius = max(radius, _around_axis(center, half))  # its far end counts as a corner
        furthest = corners[np.argmax(corners @ outward)]
        if furthest @ outward > corner[1]:
            corner = (float(furthest @ foot), float(furthest @ outward))
    tube, tube_radius = _tube(model, leg, foot, outward)
    # The lower end of the thigh turns about the same axis.
    axis = model.body_pos[body]
    for g in np.flatnonzero(model.geom_bodyid == model.body_parentid[body]):
        if np.hypot(*(leg.plane @ (model.geom_pos[g] - axis))) < KNEE_DISTANCE:
            radius = max(radius, float(model.geom_size[g][0]))
        elif int(model.geom_type[g]) == int(mujoco.mjtGeom.mjGEOM_BOX):
            box = geom_box(model, int(g))
            radius = max(radius, _around_axis(leg.plane @ (box.center - axis), np.abs(leg.plane) @ box.half_size))
    return ShankShape(radius, corner, tube, tube_radius)


def _around_axis(center: Array, half: Array) -> float:
    """Radius of a ball around the last axis that stands for the part of a box there; from the axis, in the leg's plane (2,). 0 if the box is
    elsewhere. A long box, as of a link, counts with its thickness."""
    if (np.abs(center) > half + 1e-9).any():
        return 0.0
    return float(min(half[1], max(half[1] - abs(center[1]), half[0] + abs(center[0]))))


def _tube(model: Any, leg: Leg, foot: Array, outward: Array) -> tuple[tuple[float, float], float]:
    """Upper end, along `foot` and `outward`, and radius of the longest cylinder or capsule of a shank.

    Without one, the line from the knee to the foot, as thick as the foot.
    """
    foot_geom = model.geom(leg.name).id
    round_shapes = [int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_CAPSULE)]
    longest, end, radius = 0.0, (0.0, 0.0), float(model.geom_size[foot_geom][0])
    for g in np.flatnonzero(model.geom_bodyid == model.geom_bodyid[foot_geom]):
        half = float(model.geom_size[g][1])
        if g == foot_geom or int(model.geom_type[g]) not in round_shapes or half <= longest:
            continue
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[g])
        axis = rotation.reshape(3, 3)[:, 2]
        ends = [leg.plane @ (model.geom_pos[g] + side * half * axis) for side in (-1, 1)]
        if np.linalg.norm(leg.plane @ axis) < 0.87:  # across the leg, as the knee's drive
            continue
        upper = min(ends, key=lambda p: float(p @ foot))
        longest, end, radius = half, (float(upper @ foot), float(upper @ outward)), float(model.geom_size[g][0])
    return end, radius


def trunk_box(model: Any) -> Box:
    """The box around the collision shapes of the base body, base frame."""
    base = model.body("base").id
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for g in np.flatnonzero(model.geom_bodyid == base):
        box = geom_box(model, int(g))
        low, high = np.minimum(low, box.center - box.half_size), np.maximum(high, box.center + box.half_size)
    return Box((low + high) / 2, (high - low) / 2)


def derive(path: Path) -> CentroidalRobot:
    """Everything the planner needs, from the model at `path`."""
    return derive_from(path.stem, load_spec(path))


def reach_of(name: str, spec: Any) -> ReachSet:
    """The reach boxes of the model `spec` of the robot `name`."""
    model = spec.compile()
    feet = foot_names(model)
    index = indices(model, feet)
    return reach_set(name, legs(model, feet), index.radius, trunk_box(model), index.size)


def size_in(spec: Any) -> float:
    """Size of the robot of a model in its nominal stance, in ANYmals."""
    model = spec.compile()
    return indices(model, foot_names(model)).size


def derive_from(name: str, spec: Any, known: ReachSet | None = None) -> CentroidalRobot:
    """Everything the planner needs, from the model `spec` of the robot `name`. `known`: of the same robot in another stance."""
    model = spec.compile()
    data = mujoco.MjData(model)
    stand(model, data)
    feet = foot_names(model)
    index = indices(model, feet)
    body = composite(model, data)
    trunk = trunk_box(model)
    base = data.xpos[index.base] + body.center_of_mass
    nominal = data.site_xpos[index.site] - np.array([0, 0, index.radius]) - base
    reach = known or reach_of(name, spec)
    boxes = [Box(b.center - body.center_of_mass, b.half_size) for b in reach.boxes]
    for e, (foot, place, box) in enumerate(zip(feet, nominal, boxes, strict=True)):
        room = np.minimum(LEAST_ROOM * reach.size, box.half_size / 2)
        if (np.abs(place - box.center) > box.half_size - room).any():
            around = Box(place + body.center_of_mass, room)
            found = _largest_box(legs(model, feet)[e], index.radius, trunk, reach.rules, reach.size, around)
            if found is not None:
                boxes[e] = Box(found.center - body.center_of_mass, found.half_size)
                continue
            raise InputError(
                f"{name}: foot {foot}: in the stance it is at {np.round(place, 3).tolist()} m, at the edge of its reach box or outside it, "
                f"{np.round(box.center, 3).tolist()} ± {np.round(box.half_size, 3).tolist()} m; give another stance"
            )
    cycle, texts = numeric(model, "gait_cycle"), {t.name: t.data for t in spec.texts}
    return CentroidalRobot(
        name=name,
        source=texts.get("source", "the MJCF model of the same name"),
        body=body,
        torso=Box(trunk.center - body.center_of_mass, trunk.half_size),
        feet=feet,
        nominal=nominal,
        reach=tuple(boxes),
        shanks=tuple(shank_shape(model, leg) for leg in legs(model, feet)),
        legs=tuple(chains(model, index, data.qpos[index.qpos])),
        radius=index.radius,
        gait_cycle=None if cycle is None else float(cycle[0]),
        rules=reach.rules,
        size=reach.size,
    )


@dataclass(frozen=True)
class ReachSet:
    """The reach boxes of a robot."""

    boxes: tuple[Box, ...]  # by foot, from the base's origin
    rules: ReachRules
    size: float  # of the robot, in ANYmals


def reach_set(name: str, all_legs: list[Leg], radius: float, trunk: Box, size: float) -> ReachSet:
    """A box for each leg. A box is mirrored to the legs that reach all of its mirror image, and else computed."""
    boxes: list[Box] = []
    rules = ReachRules(side=SIDE * size, play=PLAY * size)
    for leg in all_legs:
        for other, box in zip(all_legs, list(boxes), strict=False):
            mirror = np.append(np.sign(leg.hip[:2] * other.hip[:2]), 1.0)
            mirrored = Box(box.center * mirror, box.half_size)
            if _reaches(leg, mirrored, radius, trunk, rules):
                boxes.append(mirrored)
                break
        else:
            largest = _largest_box(leg, radius, trunk, rules, size)
            if largest is None:
                least = np.round(LEAST_FRACTIONS[-1] * size * LEAST_BOX, 3).tolist()
                raise InputError(f"{name}: leg {leg.name} reaches no box of {least} m within its joint limits")
            boxes.append(largest)
    return ReachSet(tuple(boxes), rules, size)


def _reaches(leg: Leg, box: Box, radius: float, trunk: Box, rules: ReachRules) -> bool:
    """Whether a leg reaches a box; it stops at the samples that say no."""
    samples = MIRROR_SAMPLES // 4 if is_redundant(leg) else MIRROR_SAMPLES
    points = box.center + np.random.default_rng(0).uniform(-1, 1, (samples, 3)) * box.half_size
    missed = 0
    for some in np.split(points, [samples // 20, samples // 4]):
        missed += int(np.count_nonzero(~reached(leg, some, radius, trunk, rules)))
        if (samples - missed) / samples < MIRROR_FRACTION:
            return False
    return True


def _largest_box(leg: Leg, radius: float, trunk: Box, rules: ReachRules, size: float, hold: Box | None = None) -> Box | None:
    """The largest box, with `hold` in it, with edges of at least `LEAST_BOX`, or, where the leg reaches none, of as much of it as it does."""
    resolution = RESOLUTION * size
    if isinstance(leg, SerialLeg):
        resolution = max(resolution, leg.span / (REDUNDANT_CELLS if is_redundant(leg) else SERIAL_CELLS))
    least = np.array([fraction * size * LEAST_BOX for fraction in LEAST_FRACTIONS])
    return reach_box(leg, radius, trunk, rules, least, resolution, hold)


def _row(values: Array, digits: int = 3) -> str:
    return "[" + ", ".join(f"{v + 0.0:.{digits}f}" for v in np.round(values, digits)) + "]"


def _digits(robot: CentroidalRobot) -> int:
    """Of lengths: tenths of a millimeter for small robots."""
    return 3 if robot.size > 0.9 else 4


def _foot_lines(robot: CentroidalRobot, e: int) -> list[str]:
    """The table of foot number `e`."""
    box, leg, center, shank = robot.reach[e], robot.legs[e], robot.body.center_of_mass, robot.shanks[e]
    digits = _digits(robot)
    return [
        "",
        "[[feet]]",
        f'name = "{robot.feet[e]}"',
        f"nominal = {_row(robot.nominal[e], digits)}              # m",
        f"reach = {{ center = {_row(box.center, digits)}, half_size = {_row(box.half_size, digits)} }}   # m",
        "[feet.leg]",
        f"knee_radius = {shank.knee_radius:.4f}                        # m",
        f"corner = {_row(np.array(shank.corner), 4)}                  # m, of the shank, from the knee",
        f"tube = {_row(np.array(shank.tube), 4)}                    # m, upper end of the axis of the shank's tube, which leads to the foot",
        f"tube_radius = {shank.tube_radius:.4f}                        # m",
        f"foot_radius = {robot.radius:g}                         # m",
        f"foot = {_row(leg.foot, 6)}        # m, its center from the last joint",
        f"stance = {_row(leg.stance, 4)}             # rad",
        *(line for j, joint in enumerate(leg.joints) for line in _joint_lines(joint, center if j == 0 else np.zeros(3))),
    ]


def _joint_lines(joint: Joint, origin: Array) -> list[str]:
    """The table of a joint, whose position is given from `origin`."""
    tensor = [joint.inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return [
        "[[feet.leg.joints]]",
        f'name = "{joint.name}"',
        f"position = {_row(joint.position - origin, 6)}",
        f"axis = {_row(joint.axis, 6)}",
        f"range = {_row(joint.range, 4)}",
        f"speed_limit = {joint.speed_limit:g}",
        f"torque_limit = {joint.torque_limit:g}",
        f"mass = {joint.mass:.6g}",
        f"center = {_row(joint.center, 6)}",
        f"inertia = [{', '.join(f'{v + 0.0:.6g}' for v in tensor)}]",
        *([] if joint.radius is None else [f"radius = {joint.radius:.4f}"]),
    ]


def to_toml(robot: CentroidalRobot) -> str:
    """The robot file's text."""
    rules, (knee_least, knee_most) = robot.rules, robot.rules.knee
    digits = _digits(robot)
    lines = [
        f"# Derived from robots/{robot.name}.xml by `python -m warpgait.robots {robot.name}`. To change it, edit the model and run that again.",
        "# Base frame: x forward, y left, z up; everything is relative to the center of mass, which is in the model's base frame at",
        f"# {_row(robot.body.center_of_mass, 4)} m in the nominal stance. Feet are contact points, one foot radius ({robot.radius:g} m) below the foot's center.",
        f'name = "{robot.name}"',
        f"source = {json.dumps(robot.source, ensure_ascii=False)}",
        f"mass = {robot.body.mass:.6g}                                # kg",
        "inertia = [                                    # kg m², about the center of mass, nominal stance",
        *(f"  {_row(row, 6)}," for row in robot.body.inertia),
        "]",
        *([] if robot.gait_cycle is None else [f"gait_cycle = {robot.gait_cycle:.2f}                              # s, default"]),
        "# The box around the trunk's collision shapes, m.",
        f"torso = {{ center = {_row(robot.torso.center, digits)}, half_size = {_row(robot.torso.half_size, digits)} }}",
        "",
        "# Reach: the largest box of contact points within the joint limits, with the knee bent by "
        f"{knee_least:g}–{knee_most:g} rad, the thigh within {np.degrees(rules.flexion):.0f}° of straight down, and the",
        f"# foot clear of the trunk, on ground tilted by up to {np.degrees(rules.tilt):.0f}°. Its edges are at least {_row(robot.size * LEAST_BOX, 2)} m where possible.",
        "# Joints: position from the one before (the first: from the center of mass), m; axis; range, rad; speed_limit, rad/s; torque_limit, N m;",
        "# and of the link that the joint moves: mass, kg; center of mass from the joint, m; inertia about it, xx yy zz xy xz yz, kg m².",
    ]
    for e in range(len(robot.feet)):
        lines += _foot_lines(robot, e)
    return "\n".join(lines) + "\n"


def main(words: list[str] | None = None) -> int:
    """Write the robot files; returns 0, or 2 on bad input."""
    parser = argparse.ArgumentParser(prog="python -m warpgait.robots", description=__doc__)
    parser.add_argument("names", nargs="*", help="models (default: all that can be found)")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a robot file does not match its model")
    options = parser.parse_args(words)
    try:
        check_mujoco()
        stale = []
        for name in options.names or available_models():
            path = find_model(name)
            target = path.with_suffix(".toml")
            text = to_toml(derive(path))
            if not options.check:
                write_text(target, text)
                emit(f"wrote {target}")
            elif not target.is_file() or target.read_text(encoding="utf-8") != text:
                stale.append(name)
        if stale:
            raise InputError(f"robot files that do not match their models: {', '.join(stale)}; run python -m warpgait.robots")
    except (InputError, OSError) as error:
        complain(error)
        return ERROR
    return 0


if __name__ == "__main__":
    raise SystemExit(run(main))
