"""Cyclic plans (`gait.periodic`), one cycle after the other.

The end of such a plan is its start, turned about the vertical and shifted. What is turned and by how much is read from the plan's own ends, so that
no jump is between two cycles beside what `warpgait check` allows at the closure.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from .arrays import Array
from .errors import InputError
from .geometry import rotation_from_wxyz
from .plan import LONGEST, Plan

_DIRECTIONS = (
    "base_linear_velocity",
    "base_linear_acceleration",
    "base_angular_velocity",
    "base_angular_acceleration",
    "foot_velocity",
    "foot_acceleration",
    "foot_force",
    "foot_normal",
)


@dataclass(frozen=True)
class Cycle:
    """What one cycle turns and shifts, world frame."""

    turn: float  # rad, about the vertical
    origin: Array  # (3,) m, the base at the start
    shift: Array  # (3,) m, of the base

    def turned(self, vectors: Array, count: Array | int) -> Array:
        """Vectors (K, …, 3) after `count` (K,) cycles."""
        angle = np.broadcast_to(self.turn * np.asarray(count), len(vectors)).reshape(-1, *[1] * (vectors.ndim - 2))
        cos, sin = np.cos(angle), np.sin(angle)
        x, y, z = np.moveaxis(vectors, -1, 0)
        turned: Array = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1)
        return turned

    def moved(self, points: Array, count: Array | int) -> Array:
        """Points (K, …, 3) after `count` (K,) cycles."""
        n = np.broadcast_to(np.asarray(count), len(points))
        places = [self.origin]
        for _ in range(int(n.max(initial=0))):
            places.append(places[-1] + self.turned(self.shift[None], len(places) - 1)[0])
        at = np.array(places)[n].reshape(-1, *[1] * (points.ndim - 2), 3)
        moved: Array = self.turned(points - self.origin, n) + at
        return moved

    def turned_quaternions(self, quaternions: Array, count: Array | int) -> Array:
        """Scalar-first quaternions (K, 4) after `count` (K,) cycles."""
        half = 0.5 * np.broadcast_to(self.turn * np.asarray(count), len(quaternions))
        cos, sin = np.cos(half), np.sin(half)
        w, x, y, z = quaternions.T
        turned: Array = np.stack([cos * w - sin * z, cos * x - sin * y, cos * y + sin * x, cos * z + sin * w], axis=-1)
        return turned


def cycle_of(plan: Plan) -> Cycle:
    """The cycle of a cyclic plan; raises `InputError` for another plan."""
    try:
        scenario = tomllib.loads(str(plan.meta.get("scenario", "")))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{plan.path}: meta.scenario is not TOML: {error}") from error
    if scenario.get("gait", {}).get("periodic") is not True:
        raise InputError(f"{plan.path}: cannot be repeated, because it is not cyclic; set gait.periodic = true and solve again")
    end = (len(plan.t) - 1) // plan.cycles
    first, last = (rotation_from_wxyz(plan.base_quaternion_wxyz[[k]]) for k in (0, end))
    between: Rotation = last * first.inv()
    shift = plan.base_position[end] - plan.base_position[0]
    return Cycle(float(between.as_rotvec()[0, 2]), plan.base_position[0], shift)


def _ensure_ground(plan: Plan, cycle: Cycle, count: int) -> None:
    """Refuse more cycles than the plan's ground is long."""
    x_min, x_max, y_min, y_max = plan.terrain.extent
    for n in range(1, count):
        x, y, _ = np.moveaxis(cycle.moved(plan.foot_position, n), -1, 0)
        if x.min() < x_min or x.max() > x_max or y.min() < y_min or y.max() > y_max:
            raise InputError(
                f"--repeat {count}: the feet leave the plan's ground in cycle {n + 1}; at most {n}, or plan with a larger terrain.extent"
            )


def repeated(plan: Plan, count: int) -> Plan:
    """`count` cycles of a cyclic plan as one; raises `InputError` for a plan that is not cyclic, for counts below 1 or too large, and where
    the ground ends."""
    if count == 1:
        return plan
    if count < 1 or count * plan.duration > LONGEST:
        most = int(LONGEST / plan.duration)
        raise InputError(f"--repeat {count}: must be from 1 to {most}, with which the motion lasts {LONGEST:g} s at most")
    cycle = cycle_of(plan)
    _ensure_ground(plan, cycle, count)
    # The first sample of each cycle but the first is the last one of the cycle before.
    kept = [(n, slice(0 if n == 0 else 1, None)) for n in range(count)]
    joined: dict[str, Any] = {
        "t": np.concatenate([plan.t[k] + n * plan.duration for n, k in kept]),
        "base_quaternion_wxyz": np.concatenate([cycle.turned_quaternions(plan.base_quaternion_wxyz[k], n) for n, k in kept]),
        "foot_contact": np.concatenate([plan.foot_contact[k] for _, k in kept]),
    }
    for name in ("base_position", "foot_position"):
        joined[name] = np.concatenate([cycle.moved(getattr(plan, name)[k], n) for n, k in kept])
    for name in _DIRECTIONS:
        joined[name] = np.concatenate([cycle.turned(getattr(plan, name)[k], n) for n, k in kept])
    return replace(plan, cycles=count, **joined)
