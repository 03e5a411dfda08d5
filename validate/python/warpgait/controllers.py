"""The controller of the replay: a whole-body quadratic program.

It uses a robot model of its own, the planned one, with measured positions and velocities. The simulated robot may differ from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import daqp
import mujoco
import numpy as np

from .arrays import Array, Bools, Integers, runs
from .geometry import rotation_vector, smootherstep
from .model import Indices
from .reference import Reference

FRICTION_IN_THE_AIR = 0.05  # friction coefficient that the controller relies on while a stance foot does not touch the ground yet
FRICTION_USED = 0.95  # fraction of the friction that the controller uses; at the edge of the cone a foot slides
EDGES = 8  # of the pyramid inside the friction cone, which has 92 % of the cone's width
EDGE_WINDOW = (0.05, 0.5)  # fractions of a swing between which a contact is an edge, not lift-off or touch-down
EARLY = 0.6  # fraction of a swing after which a contact is the touch-down: the foot stands

_UNBOUNDED = 1e30  # DAQP's infinity
_EQUALITY = 5  # DAQP's flags: active and immutable


def friction_cones(normal: Array, friction: float) -> Array:
    """Rows (..., EDGES + 1, 3) for normals (..., 3): ν cos(π/EDGES) n − s for directions s around n, then n itself.

    Row · force is zero or more for every row if the force is inside the pyramid.
    """
    tx = np.cross([0.0, 1.0, 0.0], normal)
    tx /= np.linalg.norm(tx, axis=-1, keepdims=True)
    ty = np.cross(normal, tx)
    angles = 2 * np.pi * np.arange(EDGES)[:, None] / EDGES
    around = np.cos(angles) * tx[..., None, :] + np.sin(angles) * ty[..., None, :]
    inner = friction * np.cos(np.pi / EDGES) * normal[..., None, :]
    return np.concatenate([inner - around, normal[..., None, :]], axis=-2)


@dataclass(frozen=True)
class Gains:
    """Feedback gains (stiffness 1/s², damping 1/s) and task weights.

    The center of mass has priority over the trunk's orientation, whose gains are low. On two feet, only a rotation of the trunk can balance
    the angular momentum of the swinging legs, which the plan does not model. With a stiff trunk, the center of mass would fall over the line
    of support.
    """

    com: tuple[float, float] = (100.0, 20.0)
    rotation: tuple[float, float] = (20.0, 9.0)
    swing: tuple[float, float] = (350.0, 32.0)
    stance_damping: float = 20.0
    reach_down: float = 0.01  # m below the plan, the target of a stance foot that does not touch the ground yet …
    seek: tuple[float, float] = (0.25, 0.05)  # m/s, m: … and how fast and how far it goes on down until it touches
    touch_force: float = 20.0  # N, the largest normal force that is asked of such a foot
    step_over: tuple[float, float] = (2.0, 0.05)  # m/s, m: how fast and how far a foot rises that meets an edge
    weight_com: float = 100.0
    weight_rotation: float = 7.0
    weight_swing: float = 5.0
    weight_stance: float = 50.0
    weight_force: float = 3e-3
    weight_acceleration: float = 1e-3
    least_normal_force: float = 5.0  # N, on feet that are not adhesive or do not touch the ground yet


def swing_progress(reference: Reference) -> Array:
    """Fraction (K, E) of the current swing that is over; zero in stance."""
    progress: Array = np.zeros(reference.contact.shape)
    for e in range(progress.shape[1]):
        for first, end in runs(~reference.contact[:, e]):
            progress[first:end, e] = np.arange(end - first) / (end - first)
    return progress


class StepOver:
    """Lifts a foot that touches something in the first half of its swing: an edge that the plan does not know, which would hold it back.

    Where the ground is as planned, no foot touches it then, and nothing changes.
    """

    def __init__(self, reference: Reference, speed: float, limit: float) -> None:
        """`speed` m/s and `limit` m of the rise."""
        self._contact, self._progress = reference.contact, swing_progress(reference)
        self._step, self._speed, self._limit = speed * float(reference.t[1]), speed, limit
        self._met = np.zeros(reference.contact.shape[1], bool)
        self._risen = np.zeros(reference.contact.shape[1])

    def update(self, k: int, touching: Bools) -> tuple[Array, Array]:
        """Rise (E,) m of the feet's targets along the normal, and its speed (E,) m/s. It is zero again at touch-down. Call once a step."""
        s, stance = self._progress[k], self._contact[k]
        self._met = ~stance & (self._met | (touching & (s > EDGE_WINDOW[0]) & (s < EDGE_WINDOW[1])))
        rising = self._met & (self._risen < self._limit)
        self._risen = np.where(stance, 0.0, self._risen + rising * self._step)
        return (1 - smootherstep(s)) * self._risen, np.where(rising, self._speed, 0.0)


class TouchDown:
    """Feet that meet the ground earlier or later than planned, because it is higher or lower than in the plan."""

    def __init__(self, progress: Array, step: float, speed: float, limit: float) -> None:
        """`progress` (K, E): fraction of the current swing that is over; `speed` m/s and `limit` m of the search downward."""
        self._progress, self._step, self._speed, self._limit = progress, step, speed, limit
        self.early = np.zeros(progress.shape[1], bool)  # stands before the plan has it stand
        self.sought = np.zeros(progress.shape[1])  # m below the plan's foothold

    def update(self, k: int, contact: Bools, touching: Bools) -> None:
        """`contact` (E,): which feet the plan has standing at control step k. Call once a step."""
        self.early = ~contact & (self.early | (touching & (self._progress[k] > EARLY)))
        seeking = contact & ~touching
        further = np.minimum(self.sought + self._speed * self._step, self._limit)
        self.sought = np.where(seeking, further, np.where(contact, self.sought, 0.0))


class WholeBody:
    """Joint accelerations and stance forces from one quadratic program a control step.

    It minimizes the weighted errors of the tasks (center of mass, trunk orientation, feet) and of the planned forces, subject to the
    trunk's dynamics, torque limits, friction pyramids and a least normal force.
    """

    def __init__(
        self,
        model: Any,
        index: Indices,
        reference: Reference,
        friction: float,
        pull: Array,
        preload: Array,
        gains: Gains | None = None,
    ) -> None:
        """`pull` (E,): how hard a foot may pull, N; `preload` (E,): adhesion that adds to the normal force in the friction law, N."""
        self.model, self.index, self.reference, self.gains = model, index, reference, gains or Gains()
        self.friction, self.pull, self.preload = FRICTION_USED * friction, pull, preload
        self.mass = float(model.body_mass.sum())
        self.failures = 0
        nv, E = model.nv, len(index.feet)
        self._M = np.zeros((nv, nv))
        self._A = np.zeros((6 + 3 * E, nv))  # tasks A q̈ = b: center of mass, trunk, then the feet
        self._b = np.zeros(6 + 3 * E)
        self._A[3:6, 3:6] = np.eye(3)
        self._contact_jacobian = np.zeros((E, 3, nv))
        self._jacobian_rate = np.zeros((3, nv))
        self._cones = friction_cones(reference.normal, self.friction)
        self._cones_in_the_air = friction_cones(reference.normal, FRICTION_IN_THE_AIR)
        self._last = np.zeros((E, 3))
        self._step_over = StepOver(reference, *self.gains.step_over)
        self._touch_down = TouchDown(swing_progress(reference), float(reference.t[1]), *self.gains.seek)

    def torque(self, k: int, data: Any, touching: Bools) -> Array:
        """Motor torques (E, 3) N m at control step k for the measured state in `data` (kinematics and bias up to date).

        Without a solution, the torques of the step before are kept.
        Unknowns: accelerations q̈ (nv,), then the forces (3,) of each foot in stance.
        """
        mujoco.mj_fullM(self.model, data, self._M)
        bias = data.qfrc_bias - data.qfrc_passive
        self._touch_down.update(k, self.reference.contact[k], touching)
        stance = np.flatnonzero(self.reference.contact[k] | self._touch_down.early)
        weights = np.array(self._base_tasks(k, data, bias) + self._foot_tasks(k, data, touching))
        H, gradient = self._objective(k, stance, weights)
        C, lower, upper = self._constraints(k, stance, touching, bias)
        sense = np.zeros(len(C), np.int32)
        sense[:6] = _EQUALITY
        x, _, flag, _ = daqp.solve(H, gradient, C, upper, lower, sense)
        if flag < 1 or not np.isfinite(x).all():
            self.failures += 1
            return self._last
        motors = self.index.qvel.ravel()
        self._last = (C[6 : 6 + len(motors)] @ x + bias[motors]).reshape(-1, 3)
        return self._last

    def _base_tasks(self, k: int, data: Any, bias: Array) -> list[float]:
        """Fill the rows of A q̈ = b for the center of mass and the trunk's orientation; returns their weights."""
        ref, g, index, v = self.reference, self.gains, self.index, data.qvel
        # The first three rows of the equations of motion are the total force: m (c̈ − gravity) = M₀ q̈ + bias₀.
        jacobian = self._M[:3] / self.mass
        self._A[:3] = jacobian
        drift = bias[:3] / self.mass + self.model.opt.gravity
        error, rate = ref.com[k] - data.subtree_com[index.base], ref.com_velocity[k] - jacobian @ v
        self._b[:3] = ref.com_acceleration[k] + g.com[0] * error + g.com[1] * rate - drift
        R = data.xmat[index.base].reshape(3, 3)
        turn, spin = rotation_vector(R.T @ ref.rotation[k]), R.T @ ref.angular_velocity[k] - v[3:6]
        self._b[3:6] = R.T @ ref.angular_acceleration[k] + g.rotation[0] * turn + g.rotation[1] * spin
        return [g.weight_com] * 3 + [g.weight_rotation] * 3

    def _foot_tasks(self, k: int, data: Any, touching: Bools) -> list[float]:
        """Fill the rows of A q̈ = b for the feet, and the Jacobians of their contacts; returns the rows' weights."""
        ref, g, model, index, v = self.reference, self.gains, self.model, self.index, data.qvel
        weights = []
        rise, rise_speed = self._step_over.update(k, touching)
        for e in range(len(index.feet)):
            center, normal = data.site_xpos[index.site[e]], ref.normal[k, e]
            stance = ref.contact[k, e] or self._touch_down.early[e]
            point = center - index.radius * normal if stance else center
            J = self._contact_jacobian[e]
            mujoco.mj_jac(model, data, J, None, point, index.body[e])
            mujoco.mj_jacDot(model, data, self._jacobian_rate, None, point, index.body[e])
            velocity = J @ v
            if stance and touching[e]:
                wanted = -g.stance_damping * velocity
            else:
                # A foot that is to stand but does not touch the ground yet reaches for it, a little below the plan.
                down = stance * g.reach_down + self._touch_down.sought[e]
                target = ref.foot[k, e] + (rise[e] - down) * normal
                rate = ref.foot_velocity[k, e] + rise_speed[e] * normal
                wanted = ref.foot_acceleration[k, e] + g.swing[0] * (target - center) + g.swing[1] * (rate - velocity)
            rows = slice(6 + 3 * e, 9 + 3 * e)
            self._A[rows] = J
            self._b[rows] = wanted - self._jacobian_rate @ v
            weights += [g.weight_stance if stance else g.weight_swing] * 3
        return weights

    def _objective(self, k: int, stance: Integers, weights: Array) -> tuple[Array, Array]:
        """Hessian and gradient of the weighted squares, for the tasks' `weights` and the feet in `stance`."""
        ref, g, nv = self.reference, self.gains, self.model.nv
        n = nv + 3 * len(stance)
        weighted = self._A * weights[:, None]
        H, gradient = np.zeros((n, n)), np.zeros(n)
        H[:nv, :nv] = self._A.T @ weighted
        H.flat[: nv * (n + 1) : n + 1] += g.weight_acceleration
        H.flat[nv * (n + 1) :: n + 1] = g.weight_force
        gradient[:nv] = -(weighted.T @ self._b)
        gradient[nv:] = -g.weight_force * ref.force[k, stance].ravel()
        return H, gradient

    def _constraints(self, k: int, stance: Integers, touching: Bools, bias: Array) -> tuple[Array, Array, Array]:
        """Rows and their lower and upper bounds: the trunk's dynamics (6 equalities), motor torques, and each stance foot's forces."""
        g, index, nv = self.gains, self.index, self.model.nv
        motors = index.qvel.ravel()
        m, rows = len(motors), EDGES + 1
        J = self._contact_jacobian[stance].reshape(-1, nv)
        C = np.zeros((6 + m + rows * len(stance), nv + 3 * len(stance)))
        lower, upper = np.zeros(len(C)), np.full(len(C), _UNBOUNDED)
        C[:6, :nv], C[:6, nv:] = self._M[:6], -J[:, :6].T
        C[6 : 6 + m, :nv], C[6 : 6 + m, nv:] = self._M[motors], -J[:, motors].T
        lower[:6] = upper[:6] = -bias[:6]
        limit = index.torque_limit.ravel()
        lower[6 : 6 + m], upper[6 : 6 + m] = -limit - bias[motors], limit - bias[motors]
        for j, e in enumerate(stance):
            first = 6 + m + rows * j
            force = slice(nv + 3 * j, nv + 3 * j + 3)
            C[first : first + rows, force] = self._cones[k, e]
            lower[first + EDGES] = g.least_normal_force
            if not touching[e]:  # relying on a force that is not there (push, pull or friction) would throw the leg
                upper[first + EDGES] = g.touch_force
                C[first : first + EDGES, force] = self._cones_in_the_air[k, e, :EDGES]
            elif self.pull[e] > 0:
                lower[first : first + EDGES] = -self.friction * np.cos(np.pi / EDGES) * self.preload[e]
                lower[first + EDGES] = -self.pull[e]
        return C, lower, upper
