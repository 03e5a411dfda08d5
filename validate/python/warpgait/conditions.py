"""What acts on the robot besides the ground: the payload and the forces of a plan's scenario."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .arrays import Array
from .geometry import rotation_from_wxyz

if TYPE_CHECKING:
    from .plan import Plan

_TIME_STEP, _RAMP = 0.05, 0.2  # s, defaults of a scenario


@dataclass(frozen=True)
class Payload:
    """A point mass on the trunk."""

    mass: float  # kg
    position: Array  # (3,) m, base frame, from the center of mass of the robot without it in the nominal stance


@dataclass(frozen=True)
class Applied:
    """A force on the trunk for some time."""

    vector: Array  # (3,) N, world
    point: Array  # (3,) m, base frame, from the center of mass in the nominal stance
    begin: float  # s
    end: float  # s
    ramp: float  # s
    time_step: float  # s, between two of which it is linear

    def at(self, t: Array) -> Array:
        """The force (K, 3), N, at times `t` (K,), s."""
        ramp = max(self.ramp, self.time_step)
        nodes = np.arange(round(float(np.max(t, initial=0.0)) / self.time_step) + 2) * self.time_step
        fraction = np.clip(np.minimum(nodes - self.begin, self.end - nodes) / ramp, 0.0, 1.0)
        force: Array = np.interp(t, nodes, fraction)[:, None] * self.vector
        return force


def _scenario(plan: Plan) -> Mapping[str, Any]:
    text = plan.meta.get("scenario")
    try:
        return tomllib.loads(text) if isinstance(text, str) else {}
    except tomllib.TOMLDecodeError:
        return {}  # `check` refuses it, with what is wrong


def payload_of(plan: Plan) -> Payload | None:
    """The mass that the robot of a plan carries."""
    table = _scenario(plan).get("payload")
    if not isinstance(table, Mapping) or not float(table["mass"]) > 0:
        return None
    return Payload(float(table["mass"]), np.array(table.get("position", [0.0] * 3), float))


def forces_of(plan: Plan) -> list[Applied]:
    """The forces on the trunk of a plan."""
    scenario = _scenario(plan)
    step = float(scenario.get("time_step", _TIME_STEP))
    return [
        Applied(
            np.array(table["vector"], float),
            np.array(table.get("point", [0.0] * 3), float),
            float(table["from"]),
            float(table["until"]),
            float(table.get("ramp", _RAMP)),
            step,
        )
        for table in scenario.get("force", [])
    ]


def wrench_of(plan: Plan) -> Array:
    """Force, N, and torque about the center of mass, N m, of the forces on the trunk at the samples of a plan, (N, 6), world frame."""
    wrench = np.zeros((len(plan.t), 6))
    for applied in forces_of(plan):
        force, point = applied.at(plan.t), np.tile(applied.point, (len(plan.t), 1))
        if plan.center_of_mass_shift is not None:
            point = point - plan.center_of_mass_shift
        wrench[:, :3] += force
        wrench[:, 3:] += np.cross(rotation_from_wxyz(plan.base_quaternion_wxyz).apply(point), force)
    return wrench
