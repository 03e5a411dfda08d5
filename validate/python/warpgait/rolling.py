"""How far the feet roll.

In the plan, a contact point does not move during stance. A real foot is a sphere of radius r on a shank that turns with angular velocity ω:
its center moves at ω × r n, and the contact point moves with it, by about a centimeter in a long stance. A foot whose center is held still
must slide. So the reference lets each foot roll around its planned contact point, which it passes in the middle of the stance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from .arrays import Array, runs
from .geometry import rotations_between, smootherstep, smootherstep_acceleration, smootherstep_rate
from .plan import Plan


@dataclass(frozen=True)
class Rolling:
    """What rolling adds to the feet's centers at the plan's samples. World frame."""

    offset: Array  # (N, E, 3) m
    velocity: Array  # (N, E, 3) m/s
    acceleration: Array  # (N, E, 3) m/s²


def no_rolling(plan: Plan) -> Rolling:
    """Feet that do not roll."""
    zero = np.zeros_like(plan.foot_position)
    return Rolling(zero, zero, zero)


def roll(plan: Plan, shank: Array, radius: float) -> Rolling:
    """Rolling of feet of `radius` m that are fixed to shanks with orientations `shank` (N, E, 3, 3), body to world.

    In a swing, the offset changes smoothly from the end of one stance to the beginning of the next.
    """
    step = float(plan.t[1])
    N, E = plan.foot_contact.shape
    offset, velocity, acceleration = (np.zeros_like(plan.foot_position) for _ in range(3))
    for e in range(E):
        turn = rotations_between(Rotation.from_matrix(shank[:, e]))
        moved = np.cross(turn, radius * plan.foot_normal[:-1, e])  # from sample to sample
        for first, end in runs(plan.foot_contact[:, e]):
            path = np.concatenate([np.zeros((1, 3)), np.cumsum(moved[first : end - 1], axis=0)])
            offset[first:end, e] = path - path[len(path) // 2]
            velocity[first : end - 1, e] = moved[first : end - 1] / step
        for first, end in runs(~plan.foot_contact[:, e]):
            before = offset[first - 1, e] if first > 0 else np.zeros(3)
            after = offset[end, e] if end < N else np.zeros(3)
            duration = (end - first + 1) * step
            s = ((np.arange(first, end) - first + 1) * step / duration)[:, None]
            offset[first:end, e] = before + smootherstep(s, after - before)
            velocity[first:end, e] = smootherstep_rate(s, after - before) / duration
            acceleration[first:end, e] = smootherstep_acceleration(s, after - before) / duration**2
    return Rolling(offset, velocity, acceleration)
