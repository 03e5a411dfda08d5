"""Open loop, no simulation: can the full robot take the plan's postures, and do the planned forces produce the planned motion?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from .arrays import Array, Bools
from .conditions import wrench_of
from .geometry import rotation_from_wxyz, rotations_between
from .kinematics import legs
from .model import Indices, stand
from .plan import Plan
from .rolling import Rolling, no_rolling, roll

POSTURE_ITERATIONS = (
    3  # for the base's origin: each moves it an eighth as far as the one before; a fourth would move it by 0.2 mm
)
TOUCH_DEPTH = 1e-3  # m, for a robot of ANYmal's size: a part that is less deep in the ground only touches it


@dataclass(frozen=True)
class OpenLoop:
    """Joint trajectory and wrenches at the plan's samples. World frame."""

    qpos: Array  # (N, nq) MuJoCo's positions
    qvel: Array  # (N, nv)
    rolling: Rolling  # of the feet in these postures
    unreachable: Bools  # (N, E) no joint angles put the foot there
    beyond_limits: Bools  # (N, E) reached only with a joint past its limit
    in_ground: list[tuple[int, str]]  # sample and body of every posture that has a part other than a foot in the ground
    plan_residual: Array  # (N, 6) force N, and torque about the center of mass N m, that the plan's forces leave unexplained
    body_residual: Array  # (N, 6) the same for the full body
    torque: Array  # (N, E, J) N m


@dataclass(frozen=True)
class Postures:
    """Inverse kinematics along the plan."""

    qpos: Array  # (N, nq)
    unreachable: Bools  # (N, E)
    beyond_limits: Bools  # (N, E)
    shank: Array  # (N, E, 3, 3) orientations of the bodies that carry the feet, body to world


def com_from_base(data: Any, index: Indices) -> Array:
    """From the base's origin to the center of mass (3,), world frame."""
    offset: Array = data.subtree_com[index.base] - data.xpos[index.base]
    return offset


def postures(plan: Plan, model: Any, index: Indices, rolling: Rolling) -> Postures:
    """Joint positions that put the center of mass, the trunk's orientation and the feet where the plan has them.

    The offset of the center of mass from the base's origin depends on the legs. It is found by fixed-point iteration.
    """
    data = mujoco.MjData(model)
    N, E = plan.foot_contact.shape
    R = rotation_from_wxyz(plan.base_quaternion_wxyz).as_matrix()
    centers = plan.foot_position + index.radius * plan.center_direction + rolling.offset
    qpos = np.zeros((N, model.nq))
    qpos[:, 3:7] = plan.base_quaternion_wxyz
    unreachable, beyond = np.zeros((N, E), bool), np.zeros((N, E), bool)
    shank = np.zeros((N, E, 3, 3))
    stand(model, data)
    offset = np.tile(com_from_base(data, index), (N, 1))  # base frame
    chain = legs(model, index.feet)
    for _ in range(POSTURE_ITERATIONS):
        qpos[:, :3] = plan.base_position - np.einsum("nij,nj->ni", R, offset)
        local = np.einsum("nji,nej->nei", R, centers - qpos[:, None, :3])
        for e, leg in enumerate(chain):
            q, possible = leg.inverse(local[:, e])
            qpos[:, index.qpos[e]] = q
            unreachable[:, e], beyond[:, e] = ~possible, possible & ~leg.within_limits(q)
        for k in range(N):
            data.qpos[:] = qpos[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            offset[k] = R[k].T @ com_from_base(data, index)
            shank[k] = data.xmat[index.body].reshape(E, 3, 3)
    return Postures(qpos, unreachable, beyond, shank)


def centroidal_residual(plan: Plan) -> Array:
    """What the plan's own motion and forces leave of the laws of Newton and Euler, (N, 6); the first and last samples are zero.

    Σf + m g = m p̈ and Σ(pᵢ − p) × fᵢ = d/dt (R I Rᵀ ω). p̈ and ω are differences of the sampled *poses*, and forces on feet in the
    air are left out, so the stored derivatives cannot hide an error. In a plan whose legs have mass, the angular momentum is that which
    the plan states; `inverse_dynamics` computes it anew.
    """
    step = plan.t[1]
    force = plan.foot_force * plan.foot_contact[..., None]
    residual = np.zeros((len(plan.t), 6))
    p = plan.base_position
    acceleration = (p[2:] - 2 * p[1:-1] + p[:-2]) / step**2
    residual[1:-1, :3] = force.sum(1)[1:-1] + plan.robot.mass * (plan.robot.gravity - acceleration)
    applied = wrench_of(plan)
    residual[1:-1, :3] += applied[1:-1, :3]
    torque = np.cross(plan.foot_position - p[:, None], force).sum(1) + applied[:, 3:]
    if plan.angular_momentum is not None:
        change = (plan.angular_momentum[2:] - plan.angular_momentum[:-2]) / (2 * step)
        residual[1:-1, 3:] = (torque[:-2] + 2 * torque[1:-1] + torque[2:]) / 4 - change
        return residual
    rotation = rotation_from_wxyz(plan.base_quaternion_wxyz)
    turn = rotations_between(rotation)
    middle = (Rotation.from_rotvec(turn / 2) * rotation[:-1]).as_matrix()
    momentum = np.einsum("nij,jk,nlk,nl->ni", middle, plan.robot.inertia, middle, turn / step)
    residual[1:-1, 3:] = torque[1:-1] - np.diff(momentum, axis=0) / step
    return residual


def parts_in_ground(world: Any, index: Indices, qpos: Array) -> list[tuple[int, str]]:
    """Postures (N, nq) that put a part other than a foot deeper than `TOUCH_DEPTH` into the ground of `world`: (sample, body)."""
    data = mujoco.MjData(world)
    ground, feet = world.geom("ground").id, {world.geom(foot).id for foot in index.feet}
    found = []
    for k in range(len(qpos)):
        data.qpos[:] = qpos[k]
        mujoco.mj_kinematics(world, data)
        mujoco.mj_collision(world, data)
        for contact in range(data.ncon):
            pair = data.contact.geom[contact]
            other = int(pair[1] if pair[0] == ground else pair[0])
            if other not in feet and data.contact.dist[contact] < -TOUCH_DEPTH * index.size:
                found.append((k, world.body(world.geom_bodyid[other]).name))
                break
    return found


def joint_motion(plan: Plan, model: Any, qpos: Array) -> tuple[Array, Array]:
    """Velocities and accelerations (N, nv) by central differences of positions (N, nq); zero at the ends, where there are none.

    An acceleration is the mean over the two steps beside the sample, weighted with a hat: accelerations have kinks at the samples of the
    solver, and jump where legs are massless.
    """
    N, step = len(plan.t), plan.t[1]
    qvel, qacc, between = np.zeros((N, model.nv)), np.zeros((N, model.nv)), np.zeros((N - 1, model.nv))
    for k in range(N - 1):
        mujoco.mj_differentiatePos(model, between[k], step, qpos[k], qpos[k + 1])
    qvel[1:-1] = (between[1:] + between[:-1]) / 2
    qacc[1:-1] = np.diff(between, axis=0) / step
    return qvel, qacc


def inverse_dynamics(plan: Plan, model: Any, index: Indices, qpos: Array, qvel: Array, qacc: Array) -> tuple[Array, Array]:
    """Wrench (N, 6) about the center of mass that the planned forces leave unexplained, and joint torques (N, E, J).

    Forces are averaged with the same hat as the accelerations. Contacts and joint limits of `model` are switched off meanwhile. The
    samples at the ends, whose accelerations are unknown, are zero.
    """
    data = mujoco.MjData(model)
    N = len(plan.t)
    residual, torque = np.zeros((N, 6)), np.zeros((N, *index.qvel.shape))
    jacobian = np.zeros((3, model.nv))
    flags = model.opt.disableflags
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    forces = plan.foot_force * plan.foot_contact[..., None]
    forces[1:-1] = (forces[:-2] + 4 * forces[1:-1] + forces[2:]) / 6
    applied = wrench_of(plan)
    applied[1:-1] = (applied[:-2] + 4 * applied[1:-1] + applied[2:]) / 6
    for k in range(1, N - 1):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[k], qvel[k], qacc[k]
        mujoco.mj_inverse(model, data)
        generalized = data.qfrc_inverse.copy()
        for e in np.flatnonzero(forces[k].any(axis=-1)):
            mujoco.mj_jac(model, data, jacobian, None, plan.foot_position[k, e], index.body[e])
            generalized -= jacobian.T @ forces[k, e]
        # The free joint's rows are a force in the world frame and a torque about the base's origin in the base frame.
        force = generalized[:3]
        arm = com_from_base(data, index)
        moment = data.xmat[index.base].reshape(3, 3) @ generalized[3:6] - np.cross(arm, force)
        residual[k] = np.r_[force, moment] - applied[k]
        torque[k] = generalized[index.qvel]
    model.opt.disableflags = flags
    return residual, torque


def rolled_postures(plan: Plan, model: Any, index: Indices) -> tuple[Postures, Rolling]:
    """Postures along the plan whose feet roll while they stand, as those of a robot do."""
    rolling = roll(plan, postures(plan, model, index, no_rolling(plan)).shank, index.radius)
    return postures(plan, model, index, rolling), rolling


def analyze(plan: Plan, model: Any, world: Any, index: Indices) -> OpenLoop:
    """Inverse kinematics and inverse dynamics of `model` along the plan, and which parts would be in the ground of `world`."""
    found, rolling = rolled_postures(plan, model, index)
    qvel, qacc = joint_motion(plan, model, found.qpos)
    residual, torque = inverse_dynamics(plan, model, index, found.qpos, qvel, qacc)
    return OpenLoop(
        qpos=found.qpos,
        qvel=qvel,
        rolling=rolling,
        unreachable=found.unreachable,
        beyond_limits=found.beyond_limits,
        in_ground=parts_in_ground(world, index, found.qpos),
        plan_residual=centroidal_residual(plan),
        body_residual=residual,
        torque=torque,
    )
