"""The ground's contacts with the robot, read from MuJoCo."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from .arrays import Array, Bools
from .model import Indices, adhesion_name


def _actuator_id(model: Any, name: str) -> int:
    """-1 if there is none."""
    return int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name))


class GroundContacts:
    """Contacts of the feet and of other parts with the ground, and the feet's forces. Call `detect`, then `forces`, once a control step."""

    def __init__(self, model: Any, index: Indices) -> None:
        """`model` is the world, with a geom `ground`."""
        self._feet = len(index.feet)
        self._ground = model.geom("ground").id
        self._foot_of_geom = np.full(model.ngeom, -1)
        self._foot_of_geom[index.geom] = np.arange(self._feet)
        actuators = [_actuator_id(model, adhesion_name(foot)) for foot in index.feet]
        self.adhesion = [(e, actuator) for e, actuator in enumerate(actuators) if actuator >= 0]  # foot, actuator

    def detect(self, data: Any) -> Bools:
        """Which feet touch the ground (E,); keeps this step's contacts for `forces`."""
        geom = data.contact.geom.reshape(-1, 2)
        self._ground_is_first = geom[:, 0] == self._ground
        self._other = np.where(self._ground_is_first, geom[:, 1], geom[:, 0])
        self._foot = self._foot_of_geom[self._other]
        touching = np.zeros(self._feet + 1, bool)
        touching[self._foot] = True  # -1, no foot, is the extra last element
        return touching[:-1]

    def forces(self, data: Any) -> tuple[Array, list[int]]:
        """Forces (E, 3) N of the ground on the feet at the contacts of `detect`, and the geoms other than feet that touch the ground.

        They are known after the second half of the time step.
        """
        contact = data.contact
        row = contact.efc_address
        if len(row) != len(self._foot):  # the simulation blew up, and MuJoCo has reset it
            return np.zeros((self._feet, 3)), []
        stray = [int(g) for g in self._other[self._foot < 0]]
        active = np.flatnonzero((self._foot >= 0) & (row >= 0))
        if not len(active):
            return np.zeros((self._feet, 3)), stray
        sign = np.where(self._ground_is_first[active], 1.0, -1.0)[:, None]  # MuJoCo's force acts on the second geom
        frame = contact.frame[active].reshape(-1, 3, 3)
        local = data.efc_force[row[active, None] + np.arange(3)]  # normal, two tangents: elliptic cones
        on_foot = self._foot[active] == np.arange(self._feet)[:, None]  # (E, contacts)
        force = np.asarray(on_foot @ (sign * (local[:, None] @ frame)[:, 0]), float)
        for e, actuator in self.adhesion:
            if on_foot[e].any():  # the actuator presses the foot onto the ground; without it, the ground's net force remains
                force[e] -= data.actuator_force[actuator] * (sign * frame[:, 0])[on_foot[e]].mean(0)
        return force, stray
