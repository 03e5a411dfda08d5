"""What the robot's model does not explain: a wrench on the trunk, and torques in the joints of swinging legs.

A payload, a center of mass that is elsewhere, drives with inertia and friction, and pushes all show there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Array, Bools
from .model import SAGITTAL, Indices

WRENCH_TIME = 0.15  # s, time constant of the wrench on the trunk
JOINT_TIME = 0.04  # s, time constant of the joint torques
LEAST_WEIGHT = 0.5  # of the model's weight, that the estimated one has at least
CENTER_TIME = 0.3  # s, time constant of the center of mass


@dataclass(frozen=True)
class Moment:
    """One control step as the controller saw it."""

    mass_matrix: Array  # (nv, nv)
    bias: Array  # (nv,) gravity, Coriolis and passive forces
    jacobians: Array  # (E, 3, nv) of the feet's contact points
    torque: Array  # (E, J) N m, of the motors
    standing: Bools  # (E,) feet that touch the ground


class Observer:
    """Compares the measured accelerations with those that the model has for the applied torques.

    The equations of motion are M v̇ + h = Sᵀ τ + Σ Jᵢᵀ fᵢ + d. The rows of a standing leg give the force of its foot, without a force sensor;
    the rows of the trunk then give the wrench d on it. The rows of a swinging leg, which has no force, give the torques d in its joints.
    """

    def __init__(self, model: Any, index: Indices, period: float) -> None:
        """`period` s between updates."""
        self._index, self._period, self._gravity = index, period, np.asarray(model.opt.gravity, float).copy()
        self._mass = float(model.body_mass.sum())
        self.generalized = np.zeros(model.nv)  # d, in the coordinates of MuJoCo's velocities
        self.center = np.zeros(3)  # m, from the model's center of mass to the estimated one, horizontal

    def update(self, change: Array, moment: Moment, standing: Bools) -> None:
        """`change` (nv,) of the velocity over the control step that `moment` describes, and which feet (E,) touch at its end."""
        unexplained = moment.mass_matrix @ (change / self._period) + moment.bias
        unexplained[self._index.qvel] -= moment.torque
        wrench, joints = self._period / WRENCH_TIME, self._period / JOINT_TIME
        base = unexplained[:6].copy()
        across = []
        for e, rows in enumerate(self._index.qvel):
            if moment.standing[e] or standing[e]:
                jacobian = moment.jacobians[e]
                force = np.linalg.lstsq(jacobian[:, rows].T, unexplained[rows], rcond=1e-3)[0]
                base -= jacobian[:, :6].T @ force
                if len(rows) == SAGITTAL:
                    across.append(jacobian[:, :6].T @ np.cross(*jacobian[:, rows].T))
                self.generalized[rows] *= 1 - joints
            else:
                self.generalized[rows] += joints * (unexplained[rows] - self.generalized[rows])
        if across:
            base -= _borne(np.transpose(across), base)
        self.generalized[:6] += wrench * (base - self.generalized[:6])

    def locate(self, rotation: Array, arm: Array) -> Array:
        """Update and return `center` for the trunk's `rotation` (3, 3) and the `arm` (3,) from its origin to the model's center of mass."""
        force, about_origin = self.generalized[:3], rotation @ self.generalized[3:6]
        torque = about_origin - np.cross(arm, force)
        g = self._gravity
        weight = max(self._mass * (g @ g) + force @ g, LEAST_WEIGHT * self._mass * (g @ g))  # times gravity, the load included
        target = np.cross(g, torque) / weight
        self.center += self._period / CENTER_TIME * (target - self.center)
        return self.center


def _borne(across: Array, base: Array) -> Array:
    """The part of the wrench `base` (6,) on the trunk that standing feet exert by forces across the planes of their legs, in which no joint has
    a part. `across` (6, n) has the wrench of each such force.

    They are the least that bear the sideways force and the torque about the vertical axis. What is left of the torque about the axis ahead is
    then that of a center of mass that is elsewhere.
    """
    held = [0, 1, 2, 5]
    result: Array = across @ np.linalg.lstsq(across[held], base[held], rcond=1e-3)[0]
    return result
