"""Numeric inverse kinematics of a leg of three to seven joints with any axes, for many feet at once: the method of the planner
(`src/leg/serial.rs`). Of all postures of a leg of more than three joints for a foot, it is the one nearest to the stance, with each angle measured
in halves of its joint's range.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Bools, Integers

ROUNDING = 4e-3  # weight of the distance from the stance, in lengths of the leg: see the planner
HALF_RANGE = (0.3, np.pi)  # rad, least and greatest half of a range in that
# Factors of the squared weight in the minimizations that lead a leg of more than three joints to its posture.
LARGER = (2000.0, 200.0, 25.0, 3.0)
REACHED = 3e-3  # how far from its target a foot that is reached may be, in lengths of the leg
REGULAR = 0.15  # least singular value of ∂foot/∂q in a regular posture, in lengths of the leg
_STEPS, _LARGEST_TURN, _CONVERGED, _POLISHING = 60, 0.6, 1e-6, 4  # of the minimization; rad; rad; steps without the weight
_NEAR, _HALVINGS = 0.03, 8  # rad, of the last step with a larger weight; of a step that does not lead downhill
_UPRIGHT = 0.8  # z of the first axis from which on a leg turns about the vertical, as an insect's does
_PARALLEL, _ACROSS, _HARDLY = 1e-4, 0.1, 1e-2  # sines of the angle between two axes; rad outside the limits
_THIGH = 0.2  # in lengths of the leg: the thigh is the first link below the first joint that is longer


def _crossing(axis: Array) -> Array:
    """The matrix (3, 3) of the product axis × ·."""
    x, y, z = axis
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def turns(axis: Array, angles: Array) -> Array:
    """The rotations (M, 3, 3) about a unit vector by angles (M,)."""
    K = _crossing(axis)
    s, c = np.sin(angles)[:, None, None], 1 - np.cos(angles)[:, None, None]
    R: Array = np.eye(3) + s * K + c * (K @ K)
    return R


def _turn(vectors: Array, axis: Array, angles: Array) -> None:
    """Turns vectors (..., 3, M) about a unit vector by angles (M,)."""
    K = _crossing(axis)
    once = K @ vectors
    vectors += np.sin(angles) * once + (1 - np.cos(angles)) * (K @ once)


def thigh_of(anchors: Array, foot: Array) -> int:
    """The joint that moves the thigh of a leg with its joints at `anchors` (J, 3) and its foot at `foot` (3,)."""
    links = np.linalg.norm(np.diff(anchors[1:], axis=0), axis=1)
    least = _THIGH * (links.sum() + np.linalg.norm(foot - anchors[-1]))
    return 1 + next((j for j, length in enumerate(links) if length > least), len(links) - 1)


@dataclass(frozen=True)
class SerialLeg:
    """One leg, read from the model at zero joint angles. Lengths in m, base frame."""

    name: str
    anchors: Array  # (J, 3) a point on each axis, from the base down
    axes: Array  # (J, 3) unit vectors
    foot: Array  # (3,) its center
    stance: Array  # (J,) rad: of all postures for a foot, the one that is reached from here is taken
    lower: Array  # (J,) rad
    upper: Array  # (J,) rad

    @property
    def hip(self) -> Array:
        """A point on the first axis (3,)."""
        first: Array = self.anchors[0]
        return first

    @property
    def is_redundant(self) -> bool:
        """Whether it has many postures for a foot."""
        return len(self.axes) > 3

    @property
    def length(self) -> float:
        """From the second joint over all others to the foot's center."""
        return float(np.linalg.norm(np.diff([*self.anchors[1:], self.foot], axis=0), axis=1).sum())

    @property
    def span(self) -> float:
        """No point that the foot's center reaches is further from `hip`."""
        return self.length + float(np.linalg.norm(self.anchors[1] - self.anchors[0]))

    @property
    def weights(self) -> Array:
        """Of the squared distance of each joint from the stance (J,), m²."""
        half = np.clip((self.upper - self.lower) / 2, *HALF_RANGE)
        weights: Array = (ROUNDING * self.length / half) ** 2
        return weights

    @property
    def plane(self) -> Array:
        """Two unit vectors (2, 3) across the last joint's axis, the second one upward."""
        return plane_across(self.axes[-1])

    @property
    def along(self) -> Array:
        """From the last axis to the foot, in `plane`, at zero joint angles: a unit vector (2,)."""
        line = self.plane @ (self.foot - self.anchors[-1])
        unit: Array = line / np.linalg.norm(line)
        return unit

    @property
    def outward(self) -> Array:
        """Across that line, out of the bend (2,)."""
        across = np.array([-self.along[1], self.along[0]])
        # In the stance, the joint before is on the inner side of the shank.
        to_hip = self.plane @ turns(self.axes[-1], -self.stance[-1:])[0] @ (self.anchors[-2] - self.anchors[-1])
        return -across if across @ to_hip > 0 else across

    def place(self, q: Array) -> tuple[Array, Array, Array]:
        """Foot centers (M, 3), points on the axes (M, J, 3) and the axes (M, J, 3) for joint angles (M, J)."""
        joints = q.shape[1]
        vectors = np.zeros((2 * joints + 1, 3, len(q)))  # the foot, then points and axes by turns, from the last joint on
        vectors[0] = (self.foot - self.anchors[-1])[:, None]
        for j in reversed(range(joints)):
            last = 2 * (joints - j) - 1
            _turn(vectors[:last], self.axes[j], q[:, j])
            vectors[last + 1] = self.axes[j][:, None]
            shift = self._link(j)[:, None]
            vectors[0] += shift
            vectors[1 : last + 1 : 2] += shift
        return vectors[0].T, vectors[-2::-2].transpose(2, 0, 1), vectors[:0:-2].transpose(2, 0, 1)

    def _link(self, j: int) -> Array:
        """To joint `j` from the one before, or from the base's origin (3,)."""
        line: Array = self.anchors[j] - (self.anchors[j - 1] if j else 0.0)
        return line

    def _foot(self, q: Array) -> Array:
        """Foot centers (M, 3) for joint angles (M, J)."""
        at = np.tile((self.foot - self.anchors[-1])[:, None], len(q))
        for j in reversed(range(q.shape[1])):
            _turn(at, self.axes[j], q[:, j])
            at += self._link(j)[:, None]
        return at.T

    def _moves(self, q: Array) -> tuple[Array, Array]:
        """Foot centers (3, M), and their derivatives (J, 3, M) with respect to the joint angles, for joint angles (J, M)."""
        vectors = np.empty(
            (len(q) + 1, 3, q.shape[1])
        )  # from the joint at hand to the foot, then the derivatives, from the last on
        vectors[0] = (self.foot - self.anchors[-1])[:, None]
        for j in reversed(range(len(q))):
            last = len(q) - j
            _turn(vectors[:last], self.axes[j], q[j])
            vectors[last] = _crossing(self.axes[j]) @ vectors[0]
            vectors[0] += self._link(j)[:, None]
        return vectors[0], vectors[:0:-1]

    def inverse(self, foot: Array) -> tuple[Array, Bools]:
        """Joint angles (..., J) for foot centers (..., 3) in the base frame, and whether the leg reaches them.

        Joint limits are not applied.
        """
        foot = np.asarray(foot, float)
        targets = foot.reshape(-1, 3)
        q = np.tile(self.stance, (len(targets), 1))
        within = np.flatnonzero(np.linalg.norm(targets - self.hip, axis=1) <= self.span)
        if self.is_redundant:
            for more in LARGER:
                self._descend(q, targets, within, more, _NEAR)
        self._descend(q, targets, within, 1.0, _CONVERGED)
        reached: Bools = np.linalg.norm(self._foot(q) - targets, axis=1) < REACHED * self.length
        within = np.flatnonzero(reached)
        for _ in range(_POLISHING):  # what the stance's weight has left
            step = self._gauss_newton(q[within], targets[within], 1e-6 * self.weights, q[within])
            q[within] += step
            within = within[np.abs(step).max(1) > _CONVERGED]
        return q.reshape(*foot.shape[:-1], len(self.stance)), reached.reshape(foot.shape[:-1])

    def may_reach(self, foot: Array) -> Bools:
        """Whether a regular posture within the limits can have the foot's center at a point, for points (M, 3): false if none has.

        There is a closed form for three joints of which the last two are parallel; for other legs, only the distance counts.
        """
        v = foot - self.hip
        near: Bools = np.linalg.norm(v, axis=1) <= self.span
        first, second, last = self.axes[0], self.axes[1], self.axes[-1]
        parallel = np.linalg.norm(np.cross(second, last)) < _PARALLEL and np.linalg.norm(np.cross(first, second)) > _ACROSS
        if self.is_redundant or not parallel:
            return near
        # The first joint brings the foot into the plane across the other two, on one side or the other of its axis.
        along, turned = v @ first, np.cross(first, v)
        a, b = (v - along[:, None] * first) @ second, turned @ second
        cosine = ((self.foot - self.hip) @ second - along * (first @ second)) / np.maximum(np.hypot(a, b), 1e-12)
        near &= np.abs(cosine) <= 1
        plane = plane_across(second)[::-1]
        thigh, shank = (complex(*(plane @ line)) for line in (self.anchors[2] - self.anchors[1], self.foot - self.anchors[2]))
        possible: Bools = np.zeros(len(foot), bool)
        for side in (-1.0, 1.0):
            hip = side * np.arccos(np.clip(cosine, -1, 1)) - np.arctan2(b, a)
            c, s = np.cos(hip)[:, None], np.sin(hip)[:, None]
            at = v * c - turned * s + along[:, None] * first * (1 - c) - (self.anchors[1] - self.hip)
            x, y = plane @ at.T
            bend = (x * x + y * y - abs(thigh) ** 2 - abs(shank) ** 2) / (2 * abs(thigh) * abs(shank))
            for sense in (-1.0, 1.0):
                knee = sense * np.arccos(np.clip(bend, -1, 1))
                lift = np.angle((x + 1j * y) / (thigh + shank * np.exp(1j * (knee + np.angle(thigh / shank)))))
                angles = np.stack([hip, lift, np.sign(second @ last) * (knee - np.angle(shank / thigh))], -1)
                possible |= (np.abs(bend) <= 1) & self._near_limits(angles)
        possible &= near
        return possible

    def _near_limits(self, q: Array) -> Bools:
        """Whether joint angles (M, J), or these and whole turns, are hardly outside the limits."""
        middle = (self.lower + self.upper) / 2
        off = np.abs((q - middle + np.pi) % (2 * np.pi) - np.pi)
        ok: Bools = np.all(off <= (self.upper - self.lower) / 2 + _HARDLY, axis=1)
        return ok

    def _descend(self, q: Array, targets: Array, active: Integers, more: float, last: float) -> None:
        """Moves the postures `active` among q (M, J) downhill, with the weights times `more`, each until a step is smaller than `last`, rad."""
        weights = more * self.weights
        for _ in range(_STEPS):
            if not active.size:
                return
            if self.is_redundant:
                step = self._newton(q[active], targets[active], weights)
            else:
                step = self._gauss_newton(q[active], targets[active], weights, self.stance)
            q[active] += step
            active = active[np.abs(step).max(1) > last]

    def _gauss_newton(self, q: Array, targets: Array, weights: Array, stance: Array) -> Array:
        """A step (M, J) toward the least distance from the targets (M, 3), and from `stance` by `weights` (J,)."""
        at, J = self._moves(q.T)
        off = targets.T - at
        gradient = [(column * off).sum(0) for column in J] - weights[:, None] * (q - stance).T
        normal = [[(J[j] * J[k]).sum(0) + (weights[j] if j == k else 0.0) for k in range(j + 1)] for j in range(len(J))]
        return _shortened(_solved(normal, gradient).T)

    def _newton(self, q: Array, targets: Array, weights: Array) -> Array:
        """The same with the curvature of the foot's place, which the choice among postures depends on; shortened until it leads downhill."""
        at, points, axes = self.place(q)
        J, off = np.cross(axes, at[:, None] - points), at - targets
        gradient = np.einsum("mji,mi->mj", J, off) + weights * (q - self.stance)
        normal = J @ J.transpose(0, 2, 1) + np.diag(weights)
        # ∂²F/∂qᵢ∂qⱼ = aᵢ × ∂F/∂qⱼ for i ≤ j.
        upper = np.triu(np.einsum("mic,mjc->mij", axes, np.cross(J, off[:, None])))
        curved = upper + np.triu(upper, 1).transpose(0, 2, 1)
        step = -np.linalg.solve(normal + curved, gradient[..., None])[..., 0]
        uphill = np.einsum("mj,mj->m", step, gradient) >= 0
        step[uphill] = -np.linalg.solve(normal[uphill], gradient[uphill, :, None])[..., 0]
        step = _shortened(step)
        value = self._value(at, targets, q, weights)
        left = np.arange(len(q))
        for _ in range(_HALVINGS):
            moved = q[left] + step[left]
            higher = self._value(self._foot(moved), targets[left], moved, weights) > value[left] * (1 + 1e-12)
            left = left[higher & (np.abs(step[left]).max(1) > _CONVERGED)]
            if not left.size:
                break
            step[left] /= 2
        return step

    def _value(self, at: Array, targets: Array, q: Array, weights: Array) -> Array:
        """What is minimized (M,), with the feet's centers at `at` (M, 3)."""
        value: Array = ((at - targets) ** 2).sum(1) + (weights * (q - self.stance) ** 2).sum(1)
        return value

    def knee_angle(self, q: Array) -> Array:
        """Angle between thigh and shank across the last axis of a leg of three joints, rad: 0 stretched, π folded; for joint angles (..., 3)."""
        thigh = self.plane @ (self.anchors[-1] - self.anchors[-2])
        at_zero = np.arctan2(*(self.along[::-1])) - np.arctan2(*(thigh[::-1]))
        # The plane is seen from the tip of the last axis or from its other side.
        sense = np.sign(np.cross(self.plane[0], self.plane[1]) @ self.axes[-1])
        angle: Array = np.abs((at_zero + sense * q[..., -1] + np.pi) % (2 * np.pi) - np.pi)
        return angle

    def thigh_angle(self, q: Array) -> Array:
        """Angle of the thigh from straight down, rad, for joint angles (..., J); 0 for a leg of three joints that turns about the vertical."""
        if abs(self.axes[0, 2]) > _UPRIGHT and not self.is_redundant:
            return np.zeros(q.shape[:-1])
        _, points, _ = self.place(q.reshape(-1, q.shape[-1]))
        joint = thigh_of(self.anchors, self.foot)
        thigh = points[:, joint + 1] - points[:, joint]
        angle: Array = np.arccos(np.clip(-thigh[:, 2] / np.linalg.norm(thigh, axis=1), -1, 1))
        return angle.reshape(q.shape[:-1])

    def is_regular(self, q: Array) -> Bools:
        """Whether the leg can move its foot in all directions, for joint angles (M, J): not near the first axis, not stretched."""
        _, J = self._moves(q.T)
        # The least singular value is larger than t if all leading minors of J Jᵀ − t² are positive.
        square = [[(J[:, i] * J[:, k]).sum(0) for k in range(3)] for i in range(3)]
        (a, d, e), (_, b, f), (_, _, c) = square
        a, b, c = (value - (REGULAR * self.length) ** 2 for value in (a, b, c))
        minor = a * b - d * d
        regular: Bools = (a > 0) & (minor > 0) & (c * minor > a * f * f - 2 * d * e * f + b * e * e)
        return regular

    def within_limits(self, q: Array) -> Bools:
        """Whether joint angles (..., J) are within the limits."""
        ok: Bools = np.all((q >= self.lower) & (q <= self.upper), axis=-1)
        return ok


def _solved(A: list[list[Array]], b: list[Array]) -> Array:
    """The solutions (J, M) of M systems of linear equations with right sides (J, M), whose symmetric, positive definite matrices are given by the
    rows of their lower triangles, of numbers (M,). By Cholesky's method, A = L D Lᵀ."""
    L: list[list[Array]] = []
    D: list[Array] = []
    x: list[Array] = []
    for row, right in zip(A, b, strict=True):
        scaled: list[Array] = []  # L[j, k] D[k]
        for k in range(len(L)):
            scaled.append(row[k] - sum(scaled[i] * L[k][i] for i in range(k)))
        L.append([value / pivot for value, pivot in zip(scaled, D, strict=True)])
        D.append(row[-1] - sum(value * factor for value, factor in zip(scaled, L[-1], strict=True)))
        x.append(right - sum(factor * value for factor, value in zip(L[-1], x, strict=True)))
    for j in reversed(range(len(x))):
        x[j] = x[j] / D[j] - sum(L[k][j] * x[k] for k in range(j + 1, len(x)))
    return np.array(x)


def _shortened(step: Array) -> Array:
    """Steps (M, J) that turn no joint by more than `_LARGEST_TURN`."""
    most = np.abs(step).max(1)
    shortened: Array = step * np.minimum(1.0, _LARGEST_TURN / np.maximum(most, 1e-12))[:, None]
    return shortened


def plane_across(axis: Array) -> Array:
    """Two unit vectors (2, 3) across an axis, the second one as upright as can be; x and z for an axis along y."""
    up = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < _UPRIGHT else np.array([1.0, 0.0, 0.0])
    second = up - axis * (axis @ up)
    second /= np.linalg.norm(second)
    first = np.cross(axis, second)
    return np.array([first, second])
