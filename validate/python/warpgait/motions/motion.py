"""A motion as every exporter reads it. World frame: x forward, y left, z up. SI units. Quaternions are scalar-first, body to world.

K frames, J joints, B bodies, E feet. A robot that is planned as one rigid body has no joints and no bodies; its base frame lies in its center
of mass, and its feet are points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array, Bools
from ..errors import InputError
from ..plan import Heightfield

FRAMES = {
    "world": "x forward, y left, z up; m, s, rad, N",
    "base": "origin of the trunk's frame, axes of the trunk (without joints: the center of mass)",
    "quaternion": "body to world",
    "velocity": "linear velocities in the world frame, of the origin of the frame they belong to",
    "force": "of the ground on the robot, world frame, N",
    "foot_position": "center of the foot's sphere; the ground is one foot_radius away",
    "contact_position": "the point of the foot that touches the ground; fixed during a stance of the plan",
    "ground": "heights in m, rows along y, columns along x; the first is at the least x and y, origin",
}
"""What the quantities of a motion mean, in the words that every output carries."""


@dataclass(frozen=True)
class Motion:
    """A motion at a fixed rate, with its ground and its certificate."""

    name: str  # of the plan
    robot: str
    source: str  # plan or replay
    rate: float  # Hz
    t: Array  # (K,) s
    base_position: Array  # (K, 3) m
    base_quaternion_wxyz: Array  # (K, 4)
    base_linear_velocity: Array  # (K, 3) m/s
    base_angular_velocity: Array  # (K, 3) rad/s, world
    center_of_mass: Array  # (K, 3) m
    joint_names: tuple[str, ...]  # as in the model
    joint_position: Array  # (K, J) rad
    joint_velocity: Array  # (K, J) rad/s
    joint_torque: Array  # (K, J) N m
    body_names: tuple[str, ...]  # as in the model, depth first
    body_position: Array  # (K, B, 3) m, origins of the bodies' frames
    body_quaternion_wxyz: Array  # (K, B, 4)
    body_linear_velocity: Array  # (K, B, 3) m/s
    body_angular_velocity: Array  # (K, B, 3) rad/s, world
    foot_names: tuple[str, ...]
    foot_radius: float  # m
    foot_position: Array  # (K, E, 3) m, centers
    foot_velocity: Array  # (K, E, 3) m/s, of the centers
    contact_position: Array  # (K, E, 3) m
    foot_force: Array  # (K, E, 3) N
    foot_contact: Bools  # (K, E)
    foot_normal: Array  # (K, E, 3) of the ground under the foot
    friction: float
    ground: Heightfield
    certificate: Mapping[str, Any]
    model_path: Path | None = None  # MJCF
    model: Any = field(default=None, repr=False)  # MuJoCo's
    qpos: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)  # (K, nq)
    qvel: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)  # (K, nv)

    @property
    def duration(self) -> float:
        """From the first to the last frame, s."""
        return float(self.t[-1])

    @property
    def facts(self) -> dict[str, Any]:
        """What a reader must know: frames, orders of names, and the certificate. Plain data."""
        return {
            "name": self.name,
            "robot": self.robot,
            "source": self.source,
            "rate_hz": self.rate,
            "frames": len(self.t),
            "joint_names": list(self.joint_names),
            "body_names": list(self.body_names),
            "foot_names": list(self.foot_names),
            "foot_radius": self.foot_radius,
            "friction": self.friction,
            "conventions": dict(FRAMES),
            "certificate": dict(self.certificate),
        }

    def in_base(self, points: Array) -> Array:
        """Points (K, …, 3) m of the world in the base frame."""
        extra = (1,) * (points.ndim - 2)
        offset = points - self.base_position.reshape(len(self.t), *extra, 3)
        return turned_back(self.base_quaternion_wxyz, offset)


def turned_back(quaternion_wxyz: Array, vectors: Array) -> Array:
    """Vectors (K, …, 3) of the world in frames with orientations (K, 4)."""
    w, xyz = quaternion_wxyz[:, :1], -quaternion_wxyz[:, 1:]
    extra = (1,) * (vectors.ndim - 2)
    w, xyz = w.reshape(-1, *extra, 1), xyz.reshape(-1, *extra, 3)
    twice = 2 * np.cross(np.broadcast_to(xyz, vectors.shape), vectors)
    result: Array = vectors + w * twice + np.cross(np.broadcast_to(xyz, vectors.shape), twice)
    return result


def xyzw(quaternion_wxyz: Array) -> Array:
    """Quaternions (…, 4) with the scalar last."""
    return np.roll(quaternion_wxyz, -1, axis=-1)


def whole_rate(motion: Motion, what: str) -> int:
    """The rate in Hz, for formats that have room for a whole number only."""
    if abs(motion.rate - round(motion.rate)) > 1e-9:
        raise InputError(f"--rate {motion.rate:g}: {what} needs a whole number of Hz")
    return round(motion.rate)
