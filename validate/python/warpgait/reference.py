"""The plan at control rate: what the controllers follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, make_interp_spline
from scipy.spatial.transform import Rotation, Slerp

from .plan import Array, Bools, Plan
from .rolling import Rolling, none


@dataclass(frozen=True)
class Reference:
    """K samples at a fixed step; world frame, SI. Foot centres are one radius above the contact points, along the normal."""

    t: Array  # (K,)
    com: Array  # (K, 3)
    com_velocity: Array  # (K, 3)
    com_acceleration: Array  # (K, 3)
    rotation: Array  # (K, 3, 3) body to world
    angular_velocity: Array  # (K, 3)
    angular_acceleration: Array  # (K, 3)
    foot: Array  # (K, E, 3) centres
    foot_velocity: Array  # (K, E, 3)
    foot_acceleration: Array  # (K, E, 3)
    normal: Array  # (K, E, 3) of the terrain in stance; in the air, from contact point to centre
    force: Array  # (K, E, 3)
    contact: Bools  # (K, E)


def sample(plan: Plan, rate: float, foot_radius: float, rolling: Rolling | None = None) -> Reference:
    """Evaluate `plan` at `rate` Hz from 0 to its end; `rolling` moves the feet's centres.

    Positions by cubic Hermite interpolation of the plan's samples and velocities, orientation by spherical interpolation,
    all else linearly; contact is that of the sample before. A force counts only while its foot is in contact.
    """
    rolling = rolling or none(plan)
    t = np.arange(round(plan.duration * rate) + 1) / rate
    t = np.minimum(t, plan.duration)
    before = np.clip(np.floor(t / plan.t[1] + 1e-6).astype(int), 0, len(plan.t) - 1)
    contact = plan.foot_contact[before]

    def linear(values: Array) -> Array:
        result: Array = make_interp_spline(plan.t, values, k=1)(t)
        return result

    quaternion = plan.base_quaternion_wxyz[:, [1, 2, 3, 0]]
    rotation = Slerp(plan.t, Rotation.from_quat(quaternion))(t).as_matrix()
    # The centre is the contact point plus radius times a direction, which turns while the foot swings.
    normal = linear(plan.center_direction)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    turning = np.gradient(plan.center_direction, plan.t, axis=0) * ~plan.foot_contact[..., None]
    return Reference(
        t=t,
        com=CubicHermiteSpline(plan.t, plan.base_position, plan.base_linear_velocity)(t),
        com_velocity=linear(plan.base_linear_velocity),
        com_acceleration=linear(plan.base_linear_acceleration),
        rotation=rotation,
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
    )
