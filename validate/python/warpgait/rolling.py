"""How far the feet roll.

The plan knows contact points that stay put in stance. A spherical foot of radius r does not: while the shank turns with ω, the foot's centre
moves with ω × r n, and so does the contact point, by a centimetre or so in a long stance. A robot that is asked to hold the centre still
would have to slide. So the reference rolls: around the planned contact point, which it passes in the middle of each stance.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from .plan import Array, Plan


@dataclass(frozen=True)
class Rolling:
    """What rolling adds to the feet's centres at the plan's samples. World frame."""

    offset: Array  # (N, E, 3) m
    velocity: Array  # (N, E, 3) m/s
    acceleration: Array  # (N, E, 3) m/s²


def none(plan: Plan) -> Rolling:
    """Feet that do not roll."""
    zero = np.zeros_like(plan.foot_position)
    return Rolling(zero, zero, zero)


def runs(plan: Plan, foot: int) -> list[tuple[bool, int, int]]:
    """Alternating stances and swings of a foot: (stance, first sample, one past the last)."""
    contact = plan.foot_contact[:, foot]
    edges = [0, *(np.flatnonzero(np.diff(contact)) + 1).tolist(), len(contact)]
    return [(bool(contact[a]), a, b) for a, b in pairwise(edges)]


def roll(plan: Plan, shank: Array, radius: float) -> Rolling:
    """Rolling of feet that are rigidly part of shanks with orientations `shank` (N, E, 3, 3).

    In a swing the offset goes over smoothly from the last of one stance to the first of the next.
    """
    step = float(plan.t[1])
    N, E = plan.foot_contact.shape
    result = none(plan)
    offset, velocity, acceleration = result.offset.copy(), result.velocity.copy(), result.acceleration.copy()
    for e in range(E):
        rotation = Rotation.from_matrix(shank[:, e])
        turn = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
        moved = np.cross(turn, radius * plan.foot_normal[:-1, e])  # from sample to sample
        phases = runs(plan, e)
        for stance, a, b in phases:
            if stance:
                path = np.concatenate([np.zeros((1, 3)), np.cumsum(moved[a : b - 1], axis=0)])
                offset[a:b, e] = path - path[len(path) // 2]
                velocity[a : b - 1, e] = moved[a : b - 1] / step
        for stance, a, b in phases:
            if not stance:
                before = offset[a - 1, e] if a > 0 else np.zeros(3)
                after = offset[b, e] if b < N else np.zeros(3)
                duration = (b - a + 1) * step
                s = ((np.arange(a, b) - a + 1) * step / duration)[:, None]
                offset[a:b, e] = before + (after - before) * s**3 * (10 - 15 * s + 6 * s * s)
                velocity[a:b, e] = (after - before) * 30 * s**2 * (1 - s) ** 2 / duration
                acceleration[a:b, e] = (after - before) * 60 * s * (1 - s) * (1 - 2 * s) / duration**2
    return Rolling(offset, velocity, acceleration)
