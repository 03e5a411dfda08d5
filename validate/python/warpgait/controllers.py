"""The controller of the replay: a whole-body quadratic program.

It uses a robot model of its own, the planned one, with measured positions and velocities. The simulated robot may differ from it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import daqp
import mujoco
import numpy as np

from .arrays import Array, Bools, Integers
from .footing import StepOver, TouchDown, swing_progress
from .geometry import rotation_vector
from .model import SAGITTAL, Indices, composite, stand
from .observer import Moment, Observer
from .reference import Reference
from .regulator import Body, Regulator
from .trunk import TrunkForces

FRICTION_IN_THE_AIR = 0.05  # friction coefficient that the controller relies on while a stance foot does not touch the ground yet
FRICTION_USED = 0.95  # fraction of the friction that the controller uses; at the edge of the cone a foot slides
LATENCY = 1  # control steps from a measurement until the torques that it leads to act
EDGES = 8  # of the pyramid inside the friction cone, which has 92 % of the cone's width

HELD = 10.0  # weight of such a foot's rest across its plane, before squaring

_UNBOUNDED = 1e30  # DAQP's infinity
_EQUALITY = 5  # DAQP's flags: active and immutable


def usable(friction: float) -> float:
    """The slope of the controller's friction pyramid, which is inside the cone of `friction`."""
    return FRICTION_USED * float(np.cos(np.pi / EDGES)) * friction


def friction_cones(normal: Array, friction: float) -> Array:
    """Rows (..., EDGES + 1, 3) for normals (..., 3): ν n − s for directions s around n, then n itself.

    Row · force is zero or more for every row if the force is inside the pyramid of slope ν = `friction`.
    """
    tx = np.cross([0.0, 1.0, 0.0], normal)
    tx /= np.linalg.norm(tx, axis=-1, keepdims=True)
    ty = np.cross(normal, tx)
    angles = 2 * np.pi * np.arange(EDGES)[:, None] / EDGES
    around = np.cos(angles) * tx[..., None, :] + np.sin(angles) * ty[..., None, :]
    inner = friction * normal[..., None, :]
    return np.concatenate([inner - around, normal[..., None, :]], axis=-2)


@dataclass(frozen=True)
class Gains:
    """Feedback gains (stiffness 1/s², damping 1/s) and task weights, for a robot of ANYmal's size.

    The gains are those of accelerations, so that forces and torques follow the robot's inertia.
    """

    trunk: tuple[float, float] = (100.0, 20.0)  # of center of mass and orientation, where the feet can correct an error at once
    lever: float = 0.4  # m, by which rotations of the trunk are compared with displacements
    swing: tuple[float, float] = (1000.0, 52.0)
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
    posture: tuple[float, float] = (400.0, 40.0)  # of the joints of legs of more than three …
    weight_posture: float = 0.05  # … which decide what the feet leave open
    least_normal_force: float = 5.0  # N, on feet that are not adhesive or do not touch the ground yet


def gains_for(size: float) -> Gains:
    """Gains for a robot of a size in ANYmals: lengths are proportional to it, forces to its cube, as weights are.

    It falls in a time proportional to the root of the size, which is what the gains must keep up with. The weight of forces compares them with accelerations, so it is that of forces by the robot's mass.
    """
    g = Gains()
    slower = size**0.5

    def pair(stiffness_damping: tuple[float, float]) -> tuple[float, float]:
        return stiffness_damping[0] / size, stiffness_damping[1] / slower

    return replace(
        g,
        trunk=pair(g.trunk),
        lever=size * g.lever,
        swing=pair(g.swing),
        posture=pair(g.posture),
        stance_damping=g.stance_damping / slower,
        reach_down=size * g.reach_down,
        seek=(size * g.seek[0], size * g.seek[1]),
        touch_force=size**3 * g.touch_force,
        step_over=(size * g.step_over[0], size * g.step_over[1]),
        weight_force=g.weight_force / size**6,
        least_normal_force=size**3 * g.least_normal_force,
    )


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
        adhesion: Array,
        gains: Gains | None = None,
        applied: TrunkForces | None = None,
    ) -> None:
        """`adhesion` (K, E) N: how strongly each foot sticks, which adds to the normal force in the friction law.

        `applied` acts on the trunk as planned.
        """
        self.model, self.index, self.reference, self.gains = model, index, reference, gains or gains_for(index.size)
        self.friction, self.adhesion = usable(friction), adhesion
        self.mass = float(model.body_mass.sum())
        self._applied = applied
        self.failures = 0
        nv, E = model.nv, len(index.feet)
        self._M = np.zeros((nv, nv))
        joints = index.qvel.ravel() if reference.posture is not None else np.zeros(0, int)
        self._A = np.zeros((6 + 3 * E + len(joints), nv))  # tasks A q̈ = b: center of mass, trunk, the feet, then the posture
        self._b = np.zeros(len(self._A))
        self._A[3:6, 3:6] = np.eye(3)
        self._A[6 + 3 * E + np.arange(len(joints)), joints] = 1
        self._contact_jacobian = np.zeros((E, 3, nv))
        self._jacobian_rate = np.zeros((3, nv))
        self._cones = friction_cones(reference.normal, self.friction)
        self._cones_in_the_air = friction_cones(reference.normal, FRICTION_IN_THE_AIR)
        self._last = np.zeros_like(index.torque_limit)
        self._acceleration = np.zeros(nv)
        self._velocity: Array | None = None
        self._data, self._period = mujoco.MjData(model), float(reference.t[1])
        self._moments: deque[Moment] = deque(maxlen=LATENCY + 1)
        self.observer = Observer(model, index, self._period)
        self._step_over = StepOver(reference, *self.gains.step_over)
        stand(model, self._data)
        stance = composite(model, self._data)
        gravity, sagittal = float(np.linalg.norm(model.opt.gravity)), index.qvel.shape[1] == SAGITTAL
        body = Body(stance.mass, stance.inertia, index.radius, gravity, self.gains.lever, sagittal)
        self._regulator = Regulator(reference, body, *self.gains.trunk)
        self._touch_down = TouchDown(swing_progress(reference), float(reference.t[1]), *self.gains.seek)

    def torque(self, k: int, qpos: Array, qvel: Array, touching: Bools) -> Array:
        """Motor torques (E, J) N m at control step k for the measured positions (nq,) and velocities (nv,), and the feet (E,) that touch.

        They act a control step later, so they are computed for the state that the robot will have then. Without a solution, the torques of
        the step before are kept. Unknowns: accelerations q̈ (nv,), then the forces (3,) of each foot in stance.
        """
        if self._velocity is not None and len(self._moments) == self._moments.maxlen:
            self.observer.update(qvel - self._velocity, self._moments[0], touching)
        self._velocity = qvel.copy()
        data = self._predict(qpos, qvel)
        mujoco.mj_fullM(self.model, data, self._M)
        bias = data.qfrc_bias - data.qfrc_passive
        self._touch_down.update(k, self.reference.contact[k], touching)
        stance = np.flatnonzero(self.reference.contact[k] | self._touch_down.early)
        weights = np.array(self._base_tasks(k, data, bias) + self._foot_tasks(k, data, touching) + self._posture_tasks(k, data))
        if self._applied is not None:
            bias[:6] -= self._applied.generalized(k, data.xmat[self.index.base].reshape(3, 3))
        H, gradient = self._objective(k, stance, weights)
        C, lower, upper = self._constraints(k, stance, touching, bias - self.observer.generalized)
        sense = np.zeros(len(C), np.int32)
        sense[:6] = _EQUALITY
        x, _, flag, _ = daqp.solve(H, gradient, C, upper, lower, sense)
        if flag >= 1 and np.isfinite(x).all():
            motors = self.index.qvel.ravel()
            self._last = (C[6 : 6 + len(motors)] @ x + (bias - self.observer.generalized)[motors]).reshape(self._last.shape)
            self._acceleration = x[: self.model.nv]
        else:
            self.failures += 1
        self._moments.append(Moment(self._M.copy(), bias, self._contact_jacobian.copy(), self._last, touching.copy()))
        return self._last

    def _predict(self, qpos: Array, qvel: Array) -> Any:
        """Kinematics and bias a control step after the measurement, with the accelerations that the last torques should cause."""
        data = self._data
        data.qpos[:], data.qvel[:] = qpos, qvel
        data.qvel[:] += self._period * self._acceleration
        mujoco.mj_integratePos(self.model, data.qpos, (qvel + data.qvel) / 2, self._period)
        mujoco.mj_fwdPosition(self.model, data)
        mujoco.mj_fwdVelocity(self.model, data)
        return data

    def _base_tasks(self, k: int, data: Any, bias: Array) -> list[float]:
        """Fill the rows of A q̈ = b for the center of mass and the trunk's orientation; returns their weights."""
        ref, g, index, v = self.reference, self.gains, self.index, data.qvel
        # The first three rows of the equations of motion are the total force: m (c̈ − gravity) = M₀ q̈ + bias₀.
        jacobian = self._M[:3] / self.mass
        self._A[:3] = jacobian
        drift = bias[:3] / self.mass + self.model.opt.gravity
        R = data.xmat[index.base].reshape(3, 3)
        com = data.subtree_com[index.base]
        center = self.observer.locate(R, com - data.xpos[index.base])
        error, rate = ref.com[k] - com - center, ref.com_velocity[k] - jacobian @ v
        turn, spin = R @ rotation_vector(R.T @ ref.rotation[k]), ref.angular_velocity[k] - R @ v[3:6]
        back = self._regulator.acceleration(k, -np.r_[error, turn, rate, spin])
        self._b[:3] = ref.com_acceleration[k] + back[:3] - drift
        self._b[3:6] = R.T @ (ref.angular_acceleration[k] + back[3:])
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
            aside = self._aside(bool(stance), data)
            self._A[rows] = aside @ J
            self._b[rows] = aside @ (wanted - self._jacobian_rate @ v)
            weights += [g.weight_stance if stance else g.weight_swing] * 3
        return weights

    def _posture_tasks(self, k: int, data: Any) -> list[float]:
        """Fill the right sides of A q̈ = b for the joints of legs of more than three; returns the rows' weights."""
        posture, g, index = self.reference.posture, self.gains, self.index
        if posture is None:
            return []
        step = posture[min(k + 1, len(posture) - 1)] - posture[k]
        error, rate = posture[k] - data.qpos[index.qpos], step / self._period - data.qvel[index.qvel]
        self._b[6 + 3 * len(index.feet) :] = (g.posture[0] * error + g.posture[1] * rate).ravel()
        return [g.weight_posture] * error.size

    def _aside(self, stance: bool, data: Any) -> Array:
        """What a foot's task is multiplied with (3, 3): for legs of two joints, whose feet move in planes of the base.

        In the air, nothing moves such a foot across its plane but the base, so that part of the task is left out. On the ground, the foot keeps
        the base from moving across that plane, which no task may deny.
        """
        if self.index.qvel.shape[1] != SAGITTAL:
            return np.eye(3)
        across = data.xmat[self.index.base].reshape(3, 3)[:, 1]
        scaled: Array = np.eye(3) + ((HELD if stance else 0.0) - 1) * np.outer(across, across)
        return scaled

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
            else:
                lower[first : first + EDGES] = -self.friction * self.adhesion[k, e]
                lower[first + EDGES] -= self.adhesion[k, e]
        return C, lower, upper
