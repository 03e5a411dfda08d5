"""The two controllers of the replay: a whole-body quadratic program, and joint PD with feed-forward as a pessimistic second opinion.

Both see a robot model of their own (the planned one) with measured positions and velocities; the simulated robot may differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import daqp
import mujoco
import numpy as np
from scipy.interpolate import make_interp_spline

from .model import Indices
from .plan import Array, Bools
from .reference import Reference

IN_THE_AIR = 0.05  # the friction that is counted on where a foot does not touch yet
EDGES = 8  # of the pyramid inside the friction cone: 92 % of its width


def rotation_error(R: Array) -> Array:
    """Rotation vector (3,) of a rotation matrix, rad; for angles well below π."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    angle = np.arccos(min(1.0, max(-1.0, (R[0, 0] + R[1, 1] + R[2, 2] - 1) / 2)))
    factor = 0.5 if angle < 1e-6 else angle / (2 * np.sin(angle))
    result: Array = factor * axis
    return result


def friction_cones(normal: Array, friction: float) -> Array:
    """Rows (..., EDGES + 1, 3) for normals (..., 3): ν cos(π/EDGES) n − s for directions s around n, then n itself; all ≥ 0 inside."""
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

    The centre of mass goes before the trunk's orientation, which is held softly. On two feet nothing but turning the trunk can balance the
    swinging legs' angular momentum, of which the plan knows nothing; a stiff trunk lets the centre of mass fall over the line of support.
    """

    com: tuple[float, float] = (100.0, 20.0)
    rotation: tuple[float, float] = (20.0, 9.0)
    swing: tuple[float, float] = (350.0, 32.0)
    stance_damping: float = 20.0
    reach_down: float = 0.01  # m
    touch_force: float = 20.0  # N, normal, the most that is asked of a foot in the air
    step_over: tuple[float, float] = (2.0, 0.05)  # m/s, m: how fast and how far a foot rises that meets something on its way
    weight_com: float = 100.0
    weight_rotation: float = 7.0
    weight_swing: float = 5.0
    weight_stance: float = 50.0
    weight_force: float = 3e-3
    weight_acceleration: float = 1e-3
    least_normal_force: float = 5.0  # N, on feet that do not stick or do not touch yet
    joint: tuple[float, float] = (11.5, 0.15)  # N m/rad and N m s/rad for every kg of the robot, of the joint PD


class StepOver:
    """A foot that touches in the first half of its swing has met an edge that the plan does not know, and would stay behind it: it rises.

    Where the ground is as planned, nothing is touched there and nothing changes.
    """

    def __init__(self, reference: Reference, speed: float, limit: float) -> None:
        """`speed` m/s and `limit` m of the rise."""
        self._contact = reference.contact
        self._progress = np.zeros(reference.contact.shape)  # share of the running swing that is over
        for e in range(reference.contact.shape[1]):
            edges = np.flatnonzero(np.diff(np.concatenate([[True], reference.contact[:, e], [True]])))
            for a, b in edges.reshape(-1, 2):
                self._progress[a:b, e] = np.arange(b - a) / (b - a)
        self._step, self._speed, self._limit = speed * float(reference.t[1]), speed, limit
        self._met = np.zeros(reference.contact.shape[1], bool)
        self._risen = np.zeros(reference.contact.shape[1])

    def update(self, k: int, touching: Bools) -> tuple[Array, Array]:
        """Rise (E,) m of the feet's targets along the normal, and its speed (E,) m/s. Gone by the touch-down; to be called once a step."""
        s, stance = self._progress[k], self._contact[k]
        self._met = ~stance & (self._met | (touching & (s > 0.05) & (s < 0.5)))
        rising = self._met & (self._risen < self._limit)
        self._risen = np.where(stance, 0.0, self._risen + rising * self._step)
        return (1 - s**3 * (10 - 15 * s + 6 * s * s)) * self._risen, np.where(rising, self._speed, 0.0)


class Controller(Protocol):
    """What the replay asks of a controller."""

    failures: int  # control steps without a solution

    def torque(self, k: int, data: Any, touching: Bools) -> Array:
        """Motor torques (E, 3) N m at control step k for the measured state in `data` (kinematics and bias up to date)."""
        ...


class WholeBody:
    """Joint accelerations and stance forces from one quadratic program a step.

    Minimise the weighted misfit of the tasks (centre of mass, trunk orientation, feet) and of the planned forces, subject to the
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
        """`pull` (E,): how hard a foot may pull, N; `preload` (E,): adhesion that friction adds to the normal force, N."""
        self.model, self.index, self.reference, self.gains = model, index, reference, gains or Gains()
        self.friction, self.pull, self.preload = friction, pull, preload
        self.mass = float(model.body_mass.sum())
        self.failures = 0
        nv, E = model.nv, len(index.feet)
        self._M = np.zeros((nv, nv))
        self._A = np.zeros((6 + 3 * E, nv))
        self._b = np.zeros(6 + 3 * E)
        self._A[3:6, 3:6] = np.eye(3)
        self._contact_jacobian = np.zeros((E, 3, nv))
        self._jacobian_rate = np.zeros((3, nv))
        self._cones = friction_cones(reference.normal, friction)
        self._narrow = friction_cones(reference.normal, IN_THE_AIR)
        self._last = np.zeros((E, 3))
        self._step_over = StepOver(reference, *self.gains.step_over)

    def _tasks(self, k: int, data: Any, touching: Bools, bias: Array) -> Array:
        """Fill A q̈ = b for all tasks and return the rows' weights."""
        ref, g, model, index = self.reference, self.gains, self.model, self.index
        v = data.qvel
        # The first three rows of the equations of motion are the total force: m (c̈ − gravity) = M₀ q̈ + bias₀.
        jacobian = self._M[:3] / self.mass
        self._A[:3] = jacobian
        drift = bias[:3] / self.mass + model.opt.gravity
        error, rate = ref.com[k] - data.subtree_com[index.base], ref.com_velocity[k] - jacobian @ v
        self._b[:3] = ref.com_acceleration[k] + g.com[0] * error + g.com[1] * rate - drift
        R = data.xmat[index.base].reshape(3, 3)
        turn, spin = rotation_error(R.T @ ref.rotation[k]), R.T @ ref.angular_velocity[k] - v[3:6]
        self._b[3:6] = R.T @ ref.angular_acceleration[k] + g.rotation[0] * turn + g.rotation[1] * spin
        weights = [g.weight_com] * 3 + [g.weight_rotation] * 3
        rise, rise_speed = self._step_over.update(k, touching)
        for e in range(len(index.feet)):
            center = data.site_xpos[index.site[e]]
            stance = ref.contact[k, e]
            point = center - index.radius * ref.normal[k, e] if stance else center
            J = self._contact_jacobian[e]
            mujoco.mj_jac(model, data, J, None, point, index.body[e])
            mujoco.mj_jacDot(model, data, self._jacobian_rate, None, point, index.body[e])
            velocity = J @ v
            if stance and touching[e]:
                wanted = -g.stance_damping * velocity
            else:
                # A foot that should stand but does not touch yet reaches for the ground, a little below the plan's.
                n = ref.normal[k, e]
                target = ref.foot[k, e] + (rise[e] - g.reach_down * ref.contact[k, e]) * n
                rate = ref.foot_velocity[k, e] + rise_speed[e] * n
                wanted = ref.foot_acceleration[k, e] + g.swing[0] * (target - center) + g.swing[1] * (rate - velocity)
            rows = slice(6 + 3 * e, 9 + 3 * e)
            self._A[rows] = J
            self._b[rows] = wanted - self._jacobian_rate @ v
            weights += [g.weight_stance if stance else g.weight_swing] * 3
        return np.array(weights)

    def torque(self, k: int, data: Any, touching: Bools) -> Array:
        """See `Controller.torque`."""
        ref, g, model, index = self.reference, self.gains, self.model, self.index
        nv = model.nv
        mujoco.mj_fullM(model, data, self._M)
        bias = data.qfrc_bias - data.qfrc_passive
        weights = self._tasks(k, data, touching, bias)
        stance = np.flatnonzero(ref.contact[k])
        n = nv + 3 * len(stance)
        weighted = self._A * weights[:, None]
        H, gradient = np.zeros((n, n)), np.zeros(n)
        H[:nv, :nv] = self._A.T @ weighted
        H.flat[: nv * (n + 1) : n + 1] += g.weight_acceleration
        H.flat[nv * (n + 1) :: n + 1] = g.weight_force
        gradient[:nv] = -(weighted.T @ self._b)
        gradient[nv:] = -g.weight_force * ref.force[k, stance].ravel()

        motors = index.qvel.ravel()
        m, rows = len(motors), EDGES + 1
        J = self._contact_jacobian[stance].reshape(-1, nv)
        C = np.zeros((6 + m + rows * len(stance), n))
        lower, upper = np.zeros(len(C)), np.full(len(C), 1e30)
        C[:6, :nv], C[:6, nv:] = self._M[:6], -J[:, :6].T
        C[6 : 6 + m, :nv], C[6 : 6 + m, nv:] = self._M[motors], -J[:, motors].T
        lower[:6] = upper[:6] = -bias[:6]
        limit = index.torque_limit.ravel()
        lower[6 : 6 + m], upper[6 : 6 + m] = -limit - bias[motors], limit - bias[motors]
        for j, e in enumerate(stance):
            first = 6 + m + rows * j
            C[first : first + rows, nv + 3 * j : nv + 3 * j + 3] = self._cones[k, e]
            lower[first + EDGES] = g.least_normal_force
            if not touching[e]:  # to count on a force that is not there, push, pull or friction, would throw the leg
                upper[first + EDGES] = g.touch_force
                C[first : first + EDGES, nv + 3 * j : nv + 3 * j + 3] = self._narrow[k, e, :EDGES]
            elif self.pull[e] > 0:
                lower[first : first + EDGES] = -self.friction * np.cos(np.pi / EDGES) * self.preload[e]
                lower[first + EDGES] = -self.pull[e]
        sense = np.zeros(len(C), np.int32)
        sense[:6] = 5  # equality
        x, _, flag, _ = daqp.solve(H, gradient, C, upper, lower, sense)
        if flag < 1 or not np.isfinite(x).all():
            self.failures += 1
            return self._last
        self._last = (C[6 : 6 + m] @ x + bias[motors]).reshape(-1, 3)
        return self._last


class JointPD:
    """Joint PD around the inverse kinematics of the plan, with the legs' gravity and the planned forces fed forward."""

    def __init__(
        self, model: Any, index: Indices, reference: Reference, t: Array, joints: Array, gains: Gains | None = None
    ) -> None:
        """`joints` (N, E, 3): joint angles at times `t` (N,)."""
        self.model, self.index, self.reference, self.gains = model, index, reference, gains or Gains()
        spline = make_interp_spline(t, np.unwrap(joints, axis=0), k=3)
        self._q, self._v = spline(reference.t), spline(reference.t, 1)
        self._stiffness, self._damping = np.array(self.gains.joint) * model.body_mass.sum()
        self._J = np.zeros((3, model.nv))
        self.failures = 0

    def torque(self, k: int, data: Any, touching: Bools) -> Array:
        """See `Controller.torque`."""
        index = self.index
        q, v = data.qpos[index.qpos], data.qvel[index.qvel]
        forward = (data.qfrc_bias - data.qfrc_passive)[index.qvel]
        for e in np.flatnonzero(self.reference.contact[k]):
            point = data.site_xpos[index.site[e]] - index.radius * self.reference.normal[k, e]
            mujoco.mj_jac(self.model, data, self._J, None, point, index.body[e])
            forward[e] -= self._J[:, index.qvel[e]].T @ self.reference.force[k, e]
        result: Array = np.clip(
            forward + self._stiffness * (self._q[k] - q) + self._damping * (self._v[k] - v),
            -index.torque_limit,
            index.torque_limit,
        )
        return result
