"""What happened in a simulated replay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools

CONTACT_FORCE = 3.0  # N, of a robot of ANYmal's size


@dataclass(frozen=True)
class Incident:
    """Something that went wrong."""

    time: float | None  # s; none if it has no place in time
    what: str
    foot: str | None = None

    def __str__(self) -> str:
        """Time and foot, if any, and what happened."""
        place = [f"{self.time:.2f} s"] if self.time is not None else []
        place += [self.foot] if self.foot else []
        return f"{', '.join(place)}: {self.what}" if place else self.what


@dataclass(frozen=True)
class Replay:
    """What happened, at the control rate. World frame, SI. If the robot fell, the K samples are fewer than the reference's."""

    t: Array  # (K,)
    qpos: Array  # (K, nq)
    qvel: Array  # (K, nv)
    torque: Array  # (K, E, J) as applied
    com: Array  # (K, 3)
    rotation_error: Array  # (K, 3) rad, base frame
    foot: Array  # (K, E, 3) centers
    force: Array  # (K, E, 3) ground on robot, adhesion included
    slip: Array  # (K, E) m, in this control step, of a foot in planned and actual contact
    stray_contacts: Array  # (K,) number of contacts of other parts with the ground
    controller_failures: int
    fall: Incident | None
    first_stray: Incident | None
    contact_force: float = CONTACT_FORCE  # N: a foot with less force on it does not count as in contact

    @property
    def contact(self) -> Bools:
        """(K, E) feet with a contact force."""
        touching: Bools = np.linalg.norm(self.force, axis=2) > self.contact_force
        return touching
