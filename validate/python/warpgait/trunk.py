"""The forces on the trunk that a plan's scenario has, as the replay applies them and the controller knows them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from .arrays import Array
from .conditions import forces_of
from .model import composite, stand
from .plan import Plan


@dataclass(frozen=True)
class TrunkForces:
    """F forces at the K samples of a reference, and where they act."""

    force: Array  # (K, F, 3) N, world
    point: Array  # (F, 3) m, from the base's origin, base frame

    def generalized(self, k: int, rotation: Array) -> Array:
        """Force in the world frame and torque about the base's origin in the base frame (6,), for the trunk's `rotation` (3, 3)."""
        force = self.force[k]
        wrench: Array = np.r_[force.sum(0), np.cross(self.point, force @ rotation).sum(0)]
        return wrench

    def about_center(self, k: int, data: Any, base: int) -> Array:
        """Force and torque about the center of mass of the base's body (6,), world frame."""
        force = self.force[min(k, len(self.force) - 1)]
        arm = self.point @ data.xmat[base].reshape(3, 3).T + data.xpos[base] - data.xipos[base]
        wrench: Array = np.r_[force.sum(0), np.cross(arm, force).sum(0)]
        return wrench


def trunk_forces(plan: Plan, model: Any, t: Array) -> TrunkForces | None:
    """The forces on the trunk at times `t` (K,), for the plan's robot; none if there are none."""
    forces = forces_of(plan)
    if not forces:
        return None
    data = mujoco.MjData(model)
    stand(model, data)
    center = composite(model, data).center_of_mass
    return TrunkForces(np.stack([force.at(t) for force in forces], axis=1), np.array([center + force.point for force in forces]))
