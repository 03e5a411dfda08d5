"""Inverse kinematics of the legs of a model.

There is a closed form for legs with hip abduction (about x), hip flexion and knee flexion (both about y), in either sense, and for those without
the abduction; `serial.py` has the others, of three to seven joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from .arrays import Array, Bools
from .errors import InputError
from .model import PITCH_ONLY, SAGITTAL, leg_joints
from .serial import SerialLeg, plane_across

_LEAST_DROP = 1e-8  # m², the least squared distance of a reached foot from the HAA axis, in the leg's plane
_TOLERANCE = 1e-6  # of the direction of a joint axis
_BESIDE = (
    0.05  # in lengths of the leg: how far beside its plane a leg of two joints still reaches; the ball of its foot rolls as far
)


def _wrap(angle: Array) -> Array:
    """An angle wrapped to [-π, π)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


@dataclass(frozen=True)
class PlanarLeg:
    """One leg with a closed form, read from the model at zero joint angles. Lengths in m, base frame."""

    name: str
    hip: Array  # (3,) a point on the HAA axis; without one, on the HFE axis
    flexion_offset: float  # HFE forward (+x) of the HAA point
    rise: float  # HFE above the HAA axis, at zero joint angles
    lateral: float  # foot to the left (+y) of the HAA axis
    thigh: float  # HFE to KFE, in the leg's plane
    shank: float  # KFE to the foot's center, in the leg's plane
    thigh_zero: float  # rad, from -z toward +x, at zero joint angles
    shank_zero: float
    bend: float  # +1: the shank points further forward than the thigh (front legs), -1: further back
    signs: Array  # (J,) +1 for joints about +x and +y, -1 for those about -x and -y
    lower: Array  # (J,) rad
    upper: Array  # (J,) rad

    @property
    def abducts(self) -> bool:
        """Whether it has three joints. The foot of a leg of two moves in the plane y = lateral."""
        return len(self.signs) != SAGITTAL

    def inverse(self, foot: Array) -> tuple[Array, Bools]:
        """Joint angles (..., J) for foot centers (..., 3) in the base frame, and whether the leg reaches them.

        Joint limits are not applied. Out of reach, the angles are those of the stretched or folded leg.
        """
        v = np.asarray(foot, float) - self.hip
        if self.abducts:
            # Abduction brings the foot into the plane y = lateral; below the hip, hence the minus sign.
            drop2 = v[..., 1] ** 2 + v[..., 2] ** 2 - self.lateral**2
            reachable = drop2 > _LEAST_DROP
            drop = -np.sqrt(np.maximum(drop2, _LEAST_DROP))
            haa = [np.arctan2(v[..., 2], v[..., 1]) - np.arctan2(drop, self.lateral)]
        else:
            reachable, drop, haa = np.abs(v[..., 1] - self.lateral) <= _BESIDE * self.length, v[..., 2], []
        # Two links in the plane.
        x, z = v[..., 0] - self.flexion_offset, drop - self.rise
        cosine = (x * x + z * z - self.thigh**2 - self.shank**2) / (2 * self.thigh * self.shank)
        reachable &= np.abs(cosine) <= 1.0
        knee = self.bend * np.arccos(np.clip(cosine, -1.0, 1.0))
        thigh = np.arctan2(x, -z) - np.arctan2(self.shank * np.sin(knee), self.thigh + self.shank * np.cos(knee))
        # A positive rotation about +y turns -z toward -x, hence the signs.
        q = self.signs * np.stack([*haa, self.thigh_zero - thigh, self.shank_zero - self.thigh_zero - knee], -1)
        middle = (self.lower + self.upper) / 2
        return middle + _wrap(q - middle), reachable

    def knee_angle(self, q: Array) -> Array:
        """Angle between thigh and shank, rad: 0 stretched, π folded; for joint angles (..., J)."""
        return np.abs(_wrap(self.signs[-1] * q[..., -1] - (self.shank_zero - self.thigh_zero)))

    def thigh_angle(self, q: Array) -> Array:
        """Angle of the thigh from straight down in the leg's plane, rad, for joint angles (..., J)."""
        return np.abs(_wrap(self.thigh_zero - self.signs[-2] * q[..., -2]))

    def is_regular(self, q: Array) -> Bools:
        """Whether the leg can move its foot in all directions, for joint angles (M, J); here the limits of the knee see to that."""
        return np.ones(q.shape[:-1], bool)

    @property
    def length(self) -> float:
        """Of thigh and shank, m."""
        return self.thigh + self.shank

    @property
    def span(self) -> float:
        """No point that the foot's center reaches is further from `hip`."""
        return self.length + abs(self.lateral) + abs(self.flexion_offset) + abs(self.rise)

    @property
    def plane(self) -> Array:
        """Two unit vectors (2, 3) across the KFE axis: x and z."""
        return plane_across(np.array([0.0, 1.0, 0.0]))

    @property
    def along(self) -> Array:
        """From the KFE axis to the foot, in `plane`, at zero joint angles: a unit vector (2,)."""
        return np.array([np.sin(self.shank_zero), -np.cos(self.shank_zero)])

    @property
    def outward(self) -> Array:
        """Across that line, out of the bend (2,)."""
        return self.bend * np.array([-self.along[1], self.along[0]])

    def within_limits(self, q: Array) -> Bools:
        """Whether joint angles (..., J) are within the limits."""
        ok: Bools = np.all((q >= self.lower) & (q <= self.upper), axis=-1)
        return ok


Leg = PlanarLeg | SerialLeg


def is_redundant(leg: Leg) -> bool:
    """Whether a leg has many postures for a foot."""
    return isinstance(leg, SerialLeg) and leg.is_redundant


def legs(model: Any, feet: tuple[str, ...]) -> list[Leg]:
    """The legs that end in `feet`. Knees bend as in the keyframe `stand`."""
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    mujoco.mj_forward(model, data)
    return [_leg(model, data, name) for name in feet]


def _leg(model: Any, data: Any, name: str) -> Leg:
    ids = leg_joints(model, name)
    anchors, axes = data.xanchor[ids].copy(), data.xaxis[ids].copy()
    haa, hfe, kfe = anchors[0], anchors[-2], anchors[-1]  # of two joints, the hip is the HFE
    expected = np.array([[1, 0, 0], [0, 1, 0], [0, 1, 0]], float)[-len(ids) :]
    signs = np.sign((axes[-3:] * expected).sum(1))
    foot = data.site(name).xpos.copy()
    if len(ids) > 3 or not np.allclose(axes[-3:], signs[:, None] * expected, atol=_TOLERANCE):
        if len(ids) == SAGITTAL:
            raise InputError(f"leg {name}: {PITCH_ONLY}")
        stance = model.key("stand").qpos[model.jnt_qposadr[ids]].copy()
        limits = model.jnt_range[ids]
        return SerialLeg(name, anchors, axes, foot, stance, limits[:, 0].copy(), limits[:, 1].copy())
    upper, lower = kfe - hfe, foot - kfe
    thigh_zero, shank_zero = (float(np.arctan2(v[0], -v[2])) for v in (upper, lower))
    stance = model.key("stand").qpos[model.jnt_qposadr[ids[-1]]]
    return PlanarLeg(
        name=name,
        hip=haa,
        flexion_offset=float(hfe[0] - haa[0]),
        rise=float(hfe[2] - haa[2]),
        lateral=float(foot[1] - haa[1]),
        thigh=float(np.hypot(upper[0], upper[2])),
        shank=float(np.hypot(lower[0], lower[2])),
        thigh_zero=thigh_zero,
        shank_zero=shank_zero,
        bend=1.0 if _wrap(shank_zero - thigh_zero - signs[-1] * stance) >= 0 else -1.0,
        signs=signs,
        lower=model.jnt_range[ids, 0].copy(),
        upper=model.jnt_range[ids, 1].copy(),
    )
