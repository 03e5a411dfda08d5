"""Rotations, and the smooth step between two values."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from .arrays import Array

Floats = npt.NDArray[np.floating[Any]]

_SMALL_ANGLE = 1e-6  # rad: below it, 1/2 stands for angle / (2 sin angle), with a relative error below 2e-13


def rotation_from_wxyz(quaternion: Array) -> Rotation:
    """The rotations of scalar-first quaternions (N, 4)."""
    return Rotation.from_quat(quaternion[..., [1, 2, 3, 0]])


def rotations_between(rotation: Rotation) -> Array:
    """Rotation vectors (N - 1, 3) rad, world frame, from each of N rotations to the next."""
    vectors: Array = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    return vectors


def rotation_vector(R: Array) -> Array:
    """Rotation vector (3,) rad of a rotation matrix (3, 3), for angles well below π."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    angle = np.arccos(min(1.0, max(-1.0, (R[0, 0] + R[1, 1] + R[2, 2] - 1) / 2)))
    factor = 0.5 if angle < _SMALL_ANGLE else angle / (2 * np.sin(angle))
    vector: Array = factor * axis
    return vector


def smootherstep(s: Floats, height: float | Floats = 1.0) -> Floats:
    """From 0 at s = 0 to `height` at s = 1, with zero first and second derivatives at both ends: height (10 s³ - 15 s⁴ + 6 s⁵)."""
    return height * s**3 * (10 - 15 * s + 6 * s * s)


def smootherstep_rate(s: Floats, height: float | Floats = 1.0) -> Floats:
    """First derivative of `smootherstep` with respect to s."""
    return height * 30 * s**2 * (1 - s) ** 2


def smootherstep_acceleration(s: Floats, height: float | Floats = 1.0) -> Floats:
    """Second derivative of `smootherstep` with respect to s."""
    return height * 60 * s * (1 - s) * (1 - 2 * s)
