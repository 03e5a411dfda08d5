"""The plan at the control rate: what the controllers follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, make_interp_spline
from scipy.spatial.transform import Slerp

from .arrays import Array, Bools
from .geometry import rotation_from_wxyz
from .plan import Plan
from .rolling import Rolling, no_rolling

AT_REST = 1e-3  # m/s, rad/s: slower than this the trunk is at rest


@dataclass(frozen=True)
class Reference:
    """K samples at a fixed step; world frame, SI. In stance, a foot's center is one radius from the contact point, along the normal."""

    t: Array  # (K,)
    com: Array  # (K, 3)
    com_velocity: Array  # (K, 3)
    com_acceleration: Array  # (K, 3)
    rotation: Array  # (K, 3, 3) body to world
    angular_velocity: Array  # (K, 3)
    angular_acceleration: Array  # (K, 3)
    foot: Array  # (K, E, 3) centers
    foot_velocity: Array  # (K, E, 3)
    foot_acceleration: Array  # (K, E, 3)
    normal: Array  # (K, E, 3) of the terrain in stance; in the air, from contact point to center
    force: Array  # (K, E, 3)
    contact: Bools  # (K, E)
    # (K, E, J) joint angles, rad, of legs of more than three joints; the feet leave those of others no choice
    posture: Array | None = None

    @property
    def moves_at_start(self) -> bool:
        """Whether the trunk moves at the first sample: the plan goes on from a motion."""
        return bool(max(np.linalg.norm(self.com_velocity[0]), np.linalg.norm(self.angular_velocity[0])) > AT_REST)


def sample(
    plan: Plan, rate: float, foot_radius: float, rolling: Rolling | None = None, posture: Array | None = None
) -> Reference:
    """Evaluate `plan` at `rate` Hz from 0 to its end; `rolling` moves the feet's centers. `posture` (N, E, J)
    has the joint angles at the plan's samples, for legs of more than three joints.

    Positions are cubic Hermite interpolants of the plan's samples and velocities. Orientations are interpolated spherically, all else
    linearly. Contact is that of the sample before. Forces are zero where a foot is not in contact.
    """
    rolling = rolling or no_rolling(plan)
    t = np.arange(round(plan.duration * rate) + 1) / rate
    t = np.minimum(t, plan.duration)
    before = np.clip(np.floor(t / plan.t[1] + 1e-6).astype(int), 0, len(plan.t) - 1)  # rounding must not choose the sample before
    contact = plan.foot_contact[before]

    def linear(values: Array) -> Array:
        result: Array = make_interp_spline(plan.t, values, k=1)(t)
        return result

    # The center is the contact point plus the radius times a direction that turns during a swing.
    normal = linear(plan.center_direction)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    turning = np.gradient(plan.center_direction, plan.t, axis=0) * ~plan.foot_contact[..., None]
    return Reference(
        t=t,
        com=CubicHermiteSpline(plan.t, plan.base_position, plan.base_linear_velocity)(t),
        com_velocity=linear(plan.base_linear_velocity),
        com_acceleration=linear(plan.base_linear_acceleration),
        rotation=Slerp(plan.t, rotation_from_wxyz(plan.base_quaternion_wxyz))(t).as_matrix(),
        angular_velocity=linear(plan.base_angular_velocity),
        angular_acceleration=linear(plan.base_angular_acceleration),
        foot=CubicHermiteSpline(plan.t, plan.foot_position, plan.foot_velocity)(t)
        + foot_radius * normal
        + linear(rolling.offset),
        foot_velocity=linear(plan.foot_velocity + foot_radius * turning + rolling.velocity),
        foot_acceleration=linear(plan.foot_acceleration + rolling.acceleration),
        normal=normal,
        force=linear(plan.foot_force) * contact[..., None],
        contact=contact,
        posture=None if posture is None else linear(posture),
    )
