"""How the trunk returns to the plan: a linear quadratic regulator along the whole plan.

Two feet cannot turn the trunk about the line between them. Whether an error there can be corrected, and by what, depends on the steps that
follow, so the gains of every instant account for the errors, the contacts and the forces until the plan's end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Array, Integers
from .reference import Reference

PERIOD = 0.01  # s, between the instants at which gains are computed
TAIL = 1.0  # s, for which the robot stands on after the plan's end
FORCE_COST = (
    0.02  # of a change of a foot's force, as a fraction of what the foot bears, against the accelerations that forces cause
)
LEAST_LOAD = 0.02  # of the weight, that a foot bears at least in this comparison


@dataclass(frozen=True)
class Body:
    """The robot as one rigid body on feet."""

    mass: float  # kg
    inertia: Array  # (3, 3) kg m², body frame
    foot_radius: float  # m
    gravity: float  # m/s²
    lever: float  # m, by which rotations are compared with displacements
    sagittal: bool  # whether its legs move in planes of the base only


class Regulator:
    """Gains for the errors e = (c, θ, ċ, ω) of center of mass and orientation, world frame, actual minus planned.

    With changes u of the standing feet's forces at r from the center of mass, and the planned net force F, the errors obey

        m c̈ = Σ u,    I ω̇ = Σ r × u + F × c.

    The gains minimize

        ∫ s (c·c + ℓ² θ·θ) + d (ċ·ċ + ℓ² ω·ω) + a·a + ℓ² α·α + ε Σ (u·u / m²) / ρ² dt,

    where a and α are the accelerations that u causes, ℓ is the lever, and ρ the fraction of the weight that the foot bears in the plan: one that
    bears little can neither push nor pull. With s = k² and d = k_d² − 2 k, an error that the feet can correct at once has the stiffness k and
    the damping k_d. Where legs move in planes of the base, contacts hold what the motors do not move, and every acceleration counts as free.
    """

    def __init__(self, reference: Reference, body: Body, stiffness: float, damping: float) -> None:
        """`stiffness` k in 1/s² and `damping` k_d in 1/s."""
        step = float(reference.t[1])
        self._stride = max(1, round(PERIOD / step))
        at = np.arange(0, len(reference.t), self._stride)
        period = self._stride * step
        weights = np.r_[np.ones(3), np.full(3, body.lever**2)]
        Q = period * np.diag(np.r_[weights * stiffness**2, weights * (damping**2 - 2 * stiffness)])
        own, caused, costs = _linearized(reference, at, body)
        self._gains = np.zeros((len(at), 6, 12))
        P = Q / period
        for n in [len(at) - 1] * round(TAIL / period) + list(reversed(range(len(at)))):
            standing = np.repeat(reference.contact[at[n]], 3)
            forces = np.eye(6) if body.sagittal and standing.any() else caused[n][:, standing]
            cost = np.zeros(6) if body.sagittal else costs[n, standing]
            A, B = _over(period, own[n], forces)
            R = forces.T @ (weights[:, None] * forces)
            R[np.diag_indices(len(R))] += cost[: len(R)]
            K = np.linalg.solve(period * R + B.T @ P @ B, B.T @ P @ A)
            P = Q + A.T @ P @ (A - B @ K)
            P = (P + P.T) / 2
            self._gains[n] = own[n] - forces @ K

    def acceleration(self, k: int, errors: Array) -> Array:
        """Linear and angular acceleration (6,) beside the planned ones, world frame, at control step `k` for `errors` (12,)."""
        result: Array = self._gains[min(k // self._stride, len(self._gains) - 1)] @ errors
        return result


def _linearized(reference: Reference, at: Integers, body: Body) -> tuple[Array, Array, Array]:
    """Accelerations for the errors (n, 6, 12) and for the feet's forces (n, 6, 3E), and what these cost (n, 3E), at the samples `at`."""
    rotation, force, normal = reference.rotation[at], reference.force[at], reference.normal[at]
    inverse = np.linalg.inv(rotation @ body.inertia @ rotation.swapaxes(-1, -2))
    arms = reference.foot[at] - body.foot_radius * normal - reference.com[at, None]
    own = np.zeros((len(at), 6, 12))
    own[:, 3:, :3] = inverse @ _cross(force.sum(1))
    caused = np.zeros((len(at), 6, force.shape[1], 3))
    caused[:, :3] = np.eye(3)[None, :, None] / body.mass
    caused[:, 3:] = np.moveaxis(inverse[:, None] @ _cross(arms), 1, 2)
    load = np.maximum((force * normal).sum(-1) / (body.mass * body.gravity), LEAST_LOAD)
    costs = np.repeat(FORCE_COST / (load * body.mass) ** 2, 3, axis=-1)
    return own, caused.reshape(len(at), 6, -1), costs


def _cross(vectors: Array) -> Array:
    """Matrices (..., 3, 3) of the cross product of `vectors` (..., 3) with another."""
    result: Array = np.cross(vectors[..., None, :], np.eye(3)).swapaxes(-1, -2)
    return result


def _over(period: float, own: Array, forces: Array) -> tuple[Array, Array]:
    """Errors (12, 12) after a period for those at its start, and (12, n) for forces that are constant meanwhile."""
    A = np.eye(12)
    A[:6, 6:] += period * np.eye(6)
    A[:6] += period**2 / 2 * own
    A[6:] += period * own
    return A, np.concatenate([period**2 / 2 * forces, period * forces])
