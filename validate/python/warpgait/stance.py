"""The nominal stance of an imported robot: given, of a keyframe, or computed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares, minimize

from .arrays import Array
from .errors import InputError
from .reach import Box
from .serial import thigh_of
from .skeleton import Leg, Skeleton

STRETCH = 0.72  # height of the hip above the foot in a computed stance, in lengths of the leg from there: about ANYmal's
LEAST_HEIGHT = 0.35  # of the hip above the foot in a keyframe that is taken for a stance, in the same lengths
AT_LIMIT = 0.02  # rad inside its range that a computed stance keeps each joint
BESIDE = 0.1  # of the length of a leg: hips nearer to the middle of the body are at its sides, not at an end
CENTRAL = 0.4  # of half a reach box: how far a foot stands from its middle, along x and y
REACHED = 1e-5  # m
_STARTS = 6  # of the search along each of two joints …
_REDUNDANT_STARTS = 3  # … and of a leg of more than three joints, whose others turn as well


def turned(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) about a unit vector."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    R: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return R


def place(leg: Leg, q: Array) -> tuple[Array, list[tuple[Array, Array]]]:
    """The center of the foot, and the rotation and place of each link's joint, for joint angles q (J,); from the base's origin."""
    R, at, before = np.eye(3), np.zeros(3), np.zeros(3)
    frames = []
    for link, angle in zip(leg.links, q, strict=True):
        at = at + R @ (link.anchor - before)
        R, before = R @ turned(link.axis, angle), link.anchor
        frames.append((R, at))
    return at + R @ (leg.foot - before), frames


def ranges(leg: Leg) -> Array:
    """Least and greatest angles (J, 2) rad."""
    rows = [link.limits.range for link in leg.links]
    return np.array([row if row is not None else (-np.pi, np.pi) for row in rows])


def thigh(leg: Leg) -> int:
    """The joint from which a leg goes down: its last but one, or of more than three the one that moves the first long link."""
    if len(leg.links) <= 3:
        return len(leg.links) - 2
    return thigh_of(np.array([link.anchor for link in leg.links]), leg.foot)


def length(leg: Leg) -> float:
    """Of a stretched leg, from the joint of its thigh to the center of its foot, m."""
    points = [link.anchor for link in leg.links[thigh(leg) :]] + [leg.foot]
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def stands(legs: list[Leg], stance: list[Array]) -> bool:
    """Whether all feet are well below the thighs' joints of their legs."""
    return all(
        frames[thigh(leg)][1][2] - foot[2] >= LEAST_HEIGHT * length(leg)
        for leg, q in zip(legs, stance, strict=True)
        for foot, frames in [place(leg, q)]
    )


def computed(legs: list[Leg]) -> list[list[Array]]:
    """Stances with each foot under its hip, all at one height, best first.

    The first has the joint angles nearest to the middle of their ranges; of equally near ones, those with the knees toward the middle of the
    body, or ahead where the hip is there. The others have all knees behind their feet, and all before them, where the ranges allow it.
    """
    hips = [leg.links[thigh(leg)].anchor for leg in legs]
    height = min(hip[2] - STRETCH * length(leg) - leg.radius for hip, leg in zip(hips, legs, strict=True))
    found = [_under_hip(leg, np.array([hip[0], leg.foot[1], height + leg.radius])) for hip, leg in zip(hips, legs, strict=True)]
    stances = [[min(postures, key=lambda p: p.rank).q for postures in found]]
    for side in (-1.0, 1.0):
        bent = [[p for p in postures if side * p.knee > 0] for postures in found]
        if all(bent):
            stances.append([min(postures, key=lambda p: p.rank).q for postures in bent])
    return stances


@dataclass(frozen=True)
class _Posture:
    """Of a leg whose foot is under its hip."""

    q: Array  # (J,) rad
    rank: float  # the distance of the angles from the middle of their ranges, and a little more where the knee is away from the body's middle
    knee: float  # m before the foot


def inside(legs: list[Leg], rough: list[Array], boxes: tuple[Box, ...]) -> list[Array]:
    """A computed stance `rough`, moved so that each foot is well inside its reach box (from the base's origin), all at one height."""
    height = float(np.mean([box.center[2] for box in boxes]))
    result = []
    for leg, q, box in zip(legs, rough, boxes, strict=True):
        foot, room = place(leg, q)[0], CENTRAL * box.half_size
        target = np.clip(foot, box.center - room, box.center + room)
        target[2] = height + leg.radius
        found = _solved(leg, q, target)
        if found is None:
            raise InputError(
                f'leg "{leg.foot_body}": it does not reach the middle of its reach box; give the joint angles of a stance: --stance'
            )
        result.append(found)
    return result


def _solved(leg: Leg, start: Array, target: Array, center: Array | None = None) -> Array | None:
    """Joint angles near `start` that put the center of the foot at `target`, if the leg reaches it.

    With more than three joints, they are the ones nearest to `center`, by default `start`, with each angle measured in its range.
    """
    low, high = _bounds(leg)
    start = np.clip(start, low, high)
    result = least_squares(lambda q: place(leg, q)[0] - target, start, bounds=(low, high), xtol=1e-12, ftol=1e-12)
    if np.linalg.norm(result.fun) >= REACHED:
        return None
    found: Array = result.x
    if len(leg.links) <= 3:
        return found
    near = start if center is None else center
    nearest = minimize(
        lambda q: float((((q - near) / (high - low)) ** 2).sum()),
        found,
        method="SLSQP",
        bounds=list(zip(low, high, strict=True)),
        constraints={"type": "eq", "fun": lambda q: (place(leg, q)[0] - target) / length(leg)},
        options={"ftol": 1e-10, "maxiter": 200},
    )
    reached = nearest.success and np.linalg.norm(place(leg, nearest.x)[0] - target) < REACHED
    if reached:
        found = nearest.x
    return found


def _bounds(leg: Leg) -> tuple[Array, Array]:
    """Least and greatest angles (J,) of a computed stance."""
    limits = ranges(leg)
    low, high = np.maximum(limits[:, 0] + AT_LIMIT, -np.pi), np.minimum(limits[:, 1] - AT_LIMIT, np.pi)
    return low, high


def _under_hip(leg: Leg, target: Array) -> list[_Posture]:
    """All postures that are found."""
    low, high = _bounds(leg)
    middle, half = (low + high) / 2, (high - low) / 2
    found = []
    bending = slice(thigh(leg), thigh(leg) + 2)
    end = float(np.sign(target[0])) if abs(target[0]) > BESIDE * length(leg) else -1.0
    count = _STARTS if len(leg.links) <= 3 else _REDUNDANT_STARTS
    starts = [np.linspace(lo, hi, count + 2)[1:-1] for lo, hi in zip(low[bending], high[bending], strict=True)]
    for angles in product(*starts):
        start = np.clip(0.0, low, high)
        start[bending] = angles
        q = _solved(leg, start, target, middle)
        if q is not None:
            _, frames = place(leg, q)
            knee = float(frames[thigh(leg) + 1][1][0] - target[0])
            rank = float((((q - middle) / half) ** 2).sum()) + 1e-3 * end * knee
            found.append(_Posture(q, rank, knee))
    if not found:
        raise InputError(
            f'leg "{leg.foot_body}": no joint angles within the limits put the foot under its hip, at {np.round(target, 3).tolist()} m from the base\'s '
            "origin; give the joint angles of a stance: --stance"
        )
    return found


def given(skeleton: Skeleton, values: list[float]) -> list[Array]:
    """Stances from the user's numbers: those of one leg for all of them, or those of each."""
    each = len(skeleton.legs[0].links)
    count = each * len(skeleton.legs)
    if len(values) not in (each, count):
        raise InputError(
            f"--stance: {len(values)} angles; allowed: {each}, for every leg, or {count}, leg by leg ({_order(skeleton.legs)}), rad"
        )
    rows = np.resize(np.array(values, float), (len(skeleton.legs), each))
    return list(rows)


def of_key(skeleton: Skeleton) -> list[Array] | None:
    """The stance of the file's keyframe, if it has one."""
    if not skeleton.key:
        return None
    return [np.array([skeleton.key.get(link.joint, 0.0) for link in leg.links]) for leg in skeleton.legs]


def _order(legs: list[Leg]) -> str:
    return ", ".join(link.joint for leg in legs for link in leg.links)


def judge(skeleton: Skeleton, stance: list[Array], source: str) -> None:
    """Refuse a stance that is out of its limits, or whose feet are above the base."""
    for leg, q in zip(skeleton.legs, stance, strict=True):
        for link, angle, (low, high) in zip(leg.links, q, ranges(leg), strict=True):
            if not low - 1e-6 <= angle <= high + 1e-6:
                raise InputError(
                    f'{skeleton.path}: joint "{link.joint}": the stance ({source}) has it at {angle:.3g} rad; allowed: its range, {low:.4g} to {high:.4g}'
                )
        foot, _ = place(leg, q)
        if foot[2] - leg.radius >= -leg.radius:
            raise InputError(
                f'{skeleton.path}: foot "{leg.foot_body}": in the stance ({source}) it is not below the base; give another with --stance'
            )
