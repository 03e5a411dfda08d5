"""From a skeleton and a stance to the two files of an imported robot."""

from __future__ import annotations

import re
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from . import stance as stances
from .arrays import Array
from .collision import PERIOD, SelfCollision
from .errors import InputError
from .kinematics import legs as legs_in
from .mjcf import foot_names, order, write_mjcf
from .model import indices
from .reach import Box
from .robots import CentroidalRobot, derive_from, reach_of, size_in
from .skeleton import Leg, Link, Shape, Skeleton

CYCLE, CYCLE_LENGTH = (
    1.2,
    0.6125,
)  # s, m: the cycle of ANYmal C and the length of its legs; cycles grow with the root of the length
SWING_TRAVEL = (
    6.0  # rad: a cycle is at least this over the speed limit of the slowest joint, which turns about 1.2 rad in a swing of a walk
)
STANCE_ROUNDS = 4  # of stance and reach boxes
TRIM = 0.25  # of the foot's radius: a shape of the shank that is not at least this much higher than the foot's lowest point is left out
SAME = 1e-2  # rad: stances that differ less are the same
SAMPLES = 300  # postures in which parts of the robot may hit each other
MIDDLE = 0.5  # of half a reach box: how far a foot is from its middle in them
_FRONT = re.compile("front|fore", re.IGNORECASE)
_REAR = re.compile("rear|hind|back", re.IGNORECASE)


@dataclass(frozen=True)
class Imported:
    """A robot, ready to be written."""

    model: str  # the text of NAME.xml
    robot: CentroidalRobot
    skeleton: Skeleton
    source: str  # of the stance


def is_backward(legs: list[Leg], feet: list[Array]) -> bool:
    """Whether the legs whose links are called front stand behind those that are called rear, hind or back."""
    ends: dict[bool, list[float]] = {True: [], False: []}
    for leg, foot in zip(legs, feet, strict=True):
        words = " ".join([leg.foot_body, *(name for link in leg.links for name in (link.body, link.joint))])
        if _FRONT.search(words) or _REAR.search(words):
            ends[bool(_FRONT.search(words))].append(float(foot[0]))
    return bool(ends[True] and ends[False]) and max(ends[True]) < min(ends[False])


def _shape_at(shape: Shape, link: Link, frame: tuple[Array, Array]) -> Shape:
    """A shape of a link in the posture in which the link's joint is at `frame`."""
    R, at = frame
    return replace(shape, center=at + R @ (shape.center - link.anchor), rotation=R @ shape.rotation)


def _cut(shape: Shape, leg: Leg) -> Shape | None:
    """A box that took the place of a mesh, without the part of it beside and below the foot, which the foot's sphere stands for."""
    upright = shape.kind == "box" and np.abs(shape.rotation - np.eye(3)).max() < 1e-6
    if not upright or leg.foot[2] >= leg.links[-1].anchor[2]:
        return shape
    low, high = shape.center[2] - shape.size[2], shape.center[2] + shape.size[2]
    end = leg.foot[2] + leg.radius
    if low >= end:
        return shape
    if high <= end:
        return None
    center, size = shape.center.copy(), shape.size.copy()
    center[2], size[2] = (high + end) / 2, (high - end) / 2
    return replace(shape, center=center, size=size)


def _trim(skeleton: Skeleton, leg: Leg, q: Array) -> Leg:
    """Leave out shapes of the shank that would touch the ground with the foot."""
    foot, frames = stances.place(leg, q)
    last, floor = leg.links[-1], foot[2] - leg.radius
    shapes = [_cut(s, leg) for s in last.shapes]
    kept = [s for s in shapes if s is not None and _shape_at(s, last, frames[-1]).lowest() > floor + TRIM * leg.radius]
    if len(kept) < len(last.shapes):
        skeleton.notes.append(
            f'link "{last.body}": {len(last.shapes) - len(kept)} of its shapes reach as low as the foot and are left out'
        )
    return replace(leg, links=[*leg.links[:-1], replace(last, shapes=kept)])


def _trunk(base: Link, legs: list[Leg], notes: list[str]) -> Link:
    """The base, with a box around the hips where the file has no collision shapes of it."""
    if base.shapes:
        return base
    hips = np.array([leg.links[0].anchor for leg in legs])
    low, high = hips.min(0), hips.max(0)
    half = np.maximum((high - low) / 2, 0.05 * np.ptp(hips[:, 0]) + 0.02)
    notes.append(f'link "{base.body}": it has no collision shapes; a box around the hips takes their place')
    return replace(base, shapes=[Shape("box", (low + high) / 2, np.eye(3), half)])


def assemble(skeleton: Skeleton, name: str, q: list[Array], source: str, words: str) -> Imported:
    """The robot that stands with the joint angles `q` (E, J); a computed stance is moved to the middle of the reach boxes.

    `words` say where the file is from.
    """
    stances.judge(skeleton, q, source)
    skeleton = replace(skeleton, notes=list(skeleton.notes))
    feet = [stances.place(leg, angles)[0] for leg, angles in zip(skeleton.legs, q, strict=True)]
    sequence = order(feet)
    skeleton.legs = [_trim(skeleton, skeleton.legs[e], q[e]) for e in sequence]
    skeleton.base = _trunk(skeleton.base, skeleton.legs, skeleton.notes)
    q, feet = [q[e] for e in sequence], [feet[e] for e in sequence]
    lengths = [stances.length(leg) for leg in skeleton.legs]
    slowest = min(link.limits.speed or np.inf for leg in skeleton.legs for link in leg.links)
    cycle = round(20 * max(CYCLE * float(np.sqrt(min(lengths) / CYCLE_LENGTH)), SWING_TRAVEL / slowest)) / 20
    names = foot_names(feet)
    if SWING_TRAVEL / slowest > CYCLE * float(np.sqrt(min(lengths) / CYCLE_LENGTH)):
        skeleton.notes.append(
            f"a cycle takes {cycle:g} s, because the slowest joint turns at {slowest:g} rad/s at most; --speed-limit gives other limits"
        )
    if is_backward(skeleton.legs, feet):
        skeleton.notes.append("by the names of its legs, the robot looks the other way; --forward says which way is ahead")

    def model_in(q: list[Array]) -> tuple[str, Any]:
        feet = [stances.place(leg, angles)[0] for leg, angles in zip(skeleton.legs, q, strict=True)]
        height = max(leg.radius - float(foot[2]) for leg, foot in zip(skeleton.legs, feet, strict=True))
        text = write_mjcf(skeleton, name, names, q, height, cycle, words)
        return text, mujoco.MjSpec.from_string(text)

    text, spec = model_in(q)
    reach = reach_of(name, spec)
    if source == "computed":
        for _ in range(STANCE_ROUNDS):  # the boxes depend on the robot's size, and that on the stance
            text, spec = model_in(stances.inside(skeleton.legs, q, reach.boxes))
            if reach.size == size_in(spec):
                break
            reach = reach_of(name, spec)
    # The robot file is derived from the very text of the model.
    return Imported(text, derive_from(name, spec, reach), skeleton, source)


def assemble_freest(skeleton: Skeleton, name: str, alternatives: list[list[Array]], words: str) -> Imported:
    """The robot in the first of several stances in which its parts do not hit each other, or else in that in which they do so least.

    Only the first must be possible.
    """
    first = assemble(skeleton, name, alternatives[0], "computed", words)
    found = [(self_collisions(first), first)]
    for q in alternatives[1:]:
        if not found[-1][0]:
            break
        if not np.allclose(q, alternatives[0], atol=SAME):
            with suppress(InputError):
                robot = assemble(skeleton, name, q, "computed", words)
                found.append((self_collisions(robot), robot))
    hits, best = min(found, key=lambda pair: len(pair[0]))
    if best is not found[0][1]:
        best.skeleton.notes.append(
            f"all knees bend the same way; with the joints nearer to the middle of their ranges, parts of the robot hit each other in {len(found[0][0])} "
            f"of {SAMPLES} postures"
        )
    if hits:
        best.skeleton.notes.append(
            f"in {len(hits)} of {SAMPLES} postures around the stance, parts of the robot hit each other, mostly {Counter(hits).most_common(1)[0][0]}; "
            "--stance gives another"
        )
    return best


def self_collisions(imported: Imported) -> list[str]:
    """Of random postures with each foot around the middle of its reach box: what hits what in those in which parts of the robot hit each other."""
    spec, robot = mujoco.MjSpec.from_string(imported.model), imported.robot
    model = spec.compile()
    index = indices(model, robot.feet)
    random = np.random.default_rng(0)
    qpos = np.tile(model.key("stand").qpos, (SAMPLES, 1))
    for leg, box, joints in zip(legs_in(model, robot.feet), robot.reach, index.qpos, strict=True):
        centers = _around(box, random) + robot.body.center_of_mass + [0, 0, robot.radius]
        qpos[:, joints] = leg.inverse(centers)[0]
    times = np.linspace(0, PERIOD * (SAMPLES - 1), SAMPLES)
    return [incident.what for incident in SelfCollision(spec, index).find(times, qpos)]


def note_hits(imported: Imported) -> Imported:
    """Note what hits what in a stance that was not computed."""
    spec = mujoco.MjSpec.from_string(imported.model)
    model = spec.compile()
    stance = np.tile(model.key("stand").qpos, (2, 1))
    for incident in SelfCollision(spec, indices(model, imported.robot.feet)).find(np.array([0, PERIOD]), stance)[:1]:
        imported.skeleton.notes.append(f"in the stance ({imported.source}), {incident.what}; --stance gives another")
    return imported


def _around(box: Box, random: np.random.Generator) -> Array:
    """Points (SAMPLES, 3) around the middle of a box."""
    points: Array = box.center + MIDDLE * box.half_size * random.uniform(-1, 1, (SAMPLES, 3))
    return points
