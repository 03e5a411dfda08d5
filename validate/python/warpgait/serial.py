"""Numeric inverse kinematics of a leg of three joints with any axes, for many feet at once: the method of the planner (`src/leg/serial.rs`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools

ROUNDING = 4e-3  # weight of the distance from the stance, in lengths of the leg: see the planner
REACHED = 3e-3  # how far from its target a foot that is reached may be, in lengths of the leg
REGULAR = 0.15  # least singular value of ∂foot/∂q in a regular posture, in lengths of the leg
_STEPS, _LARGEST_TURN, _CONVERGED, _POLISHING = 60, 0.6, 1e-6, 4  # of the minimization; rad; rad; steps without the weight
_UPRIGHT = 0.8  # z of the first axis from which on a leg turns about the vertical, as an insect's does


def turns(axis: Array, angles: Array) -> Array:
    """The rotations (M, 3, 3) about a unit vector by angles (M,)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angles)[:, None, None], 1 - np.cos(angles)[:, None, None]
    R: Array = np.eye(3) + s * K + c * (K @ K)
    return R


@dataclass(frozen=True)
class SerialLeg:
    """One leg, read from the model at zero joint angles. Lengths in m, base frame."""

    name: str
    anchors: Array  # (3, 3) a point on each axis, from the base down
    axes: Array  # (3, 3) unit vectors
    foot: Array  # (3,) its center
    stance: Array  # (3,) rad: of all postures for a foot, the one that is reached from here is taken
    lower: Array  # (3,) rad
    upper: Array  # (3,) rad

    @property
    def hip(self) -> Array:
        """A point on the first axis (3,)."""
        first: Array = self.anchors[0]
        return first

    @property
    def length(self) -> float:
        """From the second joint over the third to the foot's center."""
        return float(np.linalg.norm(np.diff([*self.anchors[1:], self.foot], axis=0), axis=1).sum())

    @property
    def span(self) -> float:
        """No point that the foot's center reaches is further from `hip`."""
        return self.length + float(np.linalg.norm(self.anchors[1] - self.anchors[0]))

    @property
    def plane(self) -> Array:
        """Two unit vectors (2, 3) across the last joint's axis, the second one upward."""
        return plane_across(self.axes[2])

    @property
    def along(self) -> Array:
        """From the last axis to the foot, in `plane`, at zero joint angles: a unit vector (2,)."""
        line = self.plane @ (self.foot - self.anchors[2])
        unit: Array = line / np.linalg.norm(line)
        return unit

    @property
    def outward(self) -> Array:
        """Across that line, out of the bend (2,)."""
        across = np.array([-self.along[1], self.along[0]])
        # In the stance, the second joint is on the inner side of the shank.
        to_hip = self.plane @ turns(self.axes[2], -self.stance[2:])[0] @ (self.anchors[1] - self.anchors[2])
        return -across if across @ to_hip > 0 else across

    def place(self, q: Array) -> tuple[Array, Array, Array]:
        """Foot centers (M, 3), points on the axes (M, 3, 3) and the axes (M, 3, 3) for joint angles (M, 3)."""
        R, at, before = np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3)), np.zeros(3)
        points, axes = np.empty((len(q), 3, 3)), np.empty((len(q), 3, 3))
        for j in range(3):
            at = at + R @ (self.anchors[j] - before)
            points[:, j], axes[:, j] = at, R @ self.axes[j]
            R, before = R @ turns(self.axes[j], q[:, j]), self.anchors[j]
        return at + R @ (self.foot - before), points, axes

    def inverse(self, foot: Array) -> tuple[Array, Bools]:
        """Joint angles (..., 3) for foot centers (..., 3) in the base frame, and whether the leg reaches them.

        Joint limits are not applied.
        """
        foot = np.asarray(foot, float)
        targets = foot.reshape(-1, 3)
        q = np.tile(self.stance, (len(targets), 1))
        weight = (ROUNDING * self.length) ** 2
        active = np.flatnonzero(np.linalg.norm(targets - self.hip, axis=1) <= self.span)
        for _ in range(_STEPS):
            if not active.size:
                break
            step = self._step(q[active], targets[active], weight, self.stance)
            q[active] += step
            active = active[np.abs(step).max(1) > _CONVERGED]
        reached: Bools = np.linalg.norm(self.place(q)[0] - targets, axis=1) < REACHED * self.length
        for _ in range(_POLISHING):  # what the stance's weight has left
            within = np.flatnonzero(reached)
            q[within] += self._step(q[within], targets[within], 1e-6 * weight, q[within])
        return q.reshape(foot.shape), reached.reshape(foot.shape[:-1])

    def _step(self, q: Array, targets: Array, weight: float, stance: Array) -> Array:
        """A Gauss-Newton step (M, 3) toward the least distance from the targets (M, 3), and from `stance` times a weight."""
        at, points, axes = self.place(q)
        J = np.cross(axes, at[:, None] - points)  # (M, joint, 3)
        gradient = np.einsum("mji,mi->mj", J, targets - at) - weight * (q - stance)
        step = np.linalg.solve(J @ J.transpose(0, 2, 1) + weight * np.eye(3), gradient[..., None])[..., 0]
        most = np.abs(step).max(1)
        shortened: Array = step * np.minimum(1.0, _LARGEST_TURN / np.maximum(most, 1e-12))[:, None]
        return shortened

    def knee_angle(self, q: Array) -> Array:
        """Angle between thigh and shank across the last axis, rad: 0 stretched, π folded; for joint angles (..., 3)."""
        thigh = self.plane @ (self.anchors[2] - self.anchors[1])
        at_zero = np.arctan2(*(self.along[::-1])) - np.arctan2(*(thigh[::-1]))
        # The plane is seen from the tip of the last axis or from its other side.
        sense = np.sign(np.cross(self.plane[0], self.plane[1]) @ self.axes[2])
        angle: Array = np.abs((at_zero + sense * q[..., 2] + np.pi) % (2 * np.pi) - np.pi)
        return angle

    def thigh_angle(self, q: Array) -> Array:
        """Angle of the thigh from straight down, rad, for joint angles (..., 3); 0 for a leg that turns about the vertical."""
        if abs(self.axes[0, 2]) > _UPRIGHT:
            return np.zeros(q.shape[:-1])
        _, points, _ = self.place(q.reshape(-1, 3))
        thigh = points[:, 2] - points[:, 1]
        angle: Array = np.arccos(np.clip(-thigh[:, 2] / np.linalg.norm(thigh, axis=1), -1, 1))
        return angle.reshape(q.shape[:-1])

    def is_regular(self, q: Array) -> Bools:
        """Whether the leg can move its foot in all directions, for joint angles (M, 3): not near the first axis, not stretched."""
        at, points, axes = self.place(q)
        least = np.linalg.svd(np.cross(axes, at[:, None] - points), compute_uv=False)[:, -1]
        regular: Bools = least >= REGULAR * self.length
        return regular

    def within_limits(self, q: Array) -> Bools:
        """Whether joint angles (..., 3) are within the limits."""
        ok: Bools = np.all((q >= self.lower) & (q <= self.upper), axis=-1)
        return ok


def plane_across(axis: Array) -> Array:
    """Two unit vectors (2, 3) across an axis, the second one as upright as can be; x and z for an axis along y."""
    up = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < _UPRIGHT else np.array([1.0, 0.0, 0.0])
    second = up - axis * (axis @ up)
    second /= np.linalg.norm(second)
    first = np.cross(axis, second)
    return np.array([first, second])
