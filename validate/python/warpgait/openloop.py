"""Open loop: can the full robot take the plan's postures, and do the planned forces move it as planned? No simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from .kinematics import legs
from .model import Indices
from .plan import Array, Bools, Plan
from .rolling import Rolling, none, roll


@dataclass(frozen=True)
class OpenLoop:
    """Joint trajectory and wrenches at the plan's samples. World frame."""

    qpos: Array  # (N, nq) MuJoCo's positions
    qvel: Array  # (N, nv)
    rolling: Rolling  # of the feet in these postures
    unreachable: Bools  # (N, E) no joint angles put the foot there
    beyond_limits: Bools  # (N, E) only with a joint past its limit
    in_ground: list[tuple[int, str]]  # sample and body of every posture with a part other than a foot in the ground
    plan_residual: Array  # (N, 6) force N and torque about the centre of mass N m that the centroidal plan leaves unexplained
    body_residual: Array  # (N, 6) the same for the full body
    torque: Array  # (N, E, 3) N m


@dataclass(frozen=True)
class Postures:
    """Inverse kinematics along the plan."""

    qpos: Array  # (N, nq)
    unreachable: Bools  # (N, E)
    beyond_limits: Bools  # (N, E)
    shank: Array  # (N, E, 3, 3) orientations of the bodies that carry the feet, body to world


def postures(plan: Plan, model: Any, index: Indices, rolling: Rolling) -> Postures:
    """Joint positions that put centre of mass, trunk orientation and feet where the plan has them; what cannot be reached.

    The base's origin lies off the centre of mass by an amount that depends on the legs: three fixed-point steps find it.
    """
    data = mujoco.MjData(model)
    N, E = plan.foot_contact.shape
    R = Rotation.from_quat(plan.base_quaternion_wxyz[:, [1, 2, 3, 0]]).as_matrix()
    centers = plan.foot_position + index.radius * plan.center_direction + rolling.offset
    qpos = np.zeros((N, model.nq))
    qpos[:, 3:7] = plan.base_quaternion_wxyz
    unreachable, beyond = np.zeros((N, E), bool), np.zeros((N, E), bool)
    shank = np.zeros((N, E, 3, 3))
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    mujoco.mj_forward(model, data)
    offset = np.tile(data.subtree_com[index.base] - data.xpos[index.base], (N, 1))
    chain = legs(model, index.feet)
    for _ in range(3):
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
            offset[k] = R[k].T @ (data.subtree_com[index.base] - data.xpos[index.base])
            shank[k] = data.xmat[index.body].reshape(E, 3, 3)
    return Postures(qpos, unreachable, beyond, shank)


def centroidal_residual(plan: Plan) -> Array:
    """What the plan's own motion and forces leave of Newton's and Euler's laws, (N, 6); ends left at zero.

    Σf + m g = m p̈ and Σ(pᵢ − p) × fᵢ = d/dt (R I Rᵀ ω), with p̈ and ω from differences of the sampled *poses*, so that neither
    stored derivatives nor forces on feet in the air can flatter the plan.
    """
    step = plan.t[1]
    force = plan.foot_force * plan.foot_contact[..., None]
    residual = np.zeros((len(plan.t), 6))
    p = plan.base_position
    acceleration = (p[2:] - 2 * p[1:-1] + p[:-2]) / step**2
    residual[1:-1, :3] = force.sum(1)[1:-1] + plan.robot.mass * (plan.robot.gravity - acceleration)
    rotation = Rotation.from_quat(plan.base_quaternion_wxyz[:, [1, 2, 3, 0]])
    turn = (rotation[1:] * rotation[:-1].inv()).as_rotvec()
    middle = (Rotation.from_rotvec(turn / 2) * rotation[:-1]).as_matrix()
    momentum = np.einsum("nij,jk,nlk,nl->ni", middle, plan.robot.inertia, middle, turn / step)
    torque = np.cross(plan.foot_position - p[:, None], force).sum(1)
    residual[1:-1, 3:] = torque[1:-1] - np.diff(momentum, axis=0) / step
    return residual


def parts_in_ground(world: Any, index: Indices, qpos: Array) -> list[tuple[int, str]]:
    """Which postures (N, nq) put a part other than a foot into the ground of `world` by more than a millimetre: (sample, body)."""
    data = mujoco.MjData(world)
    ground, feet = world.geom("ground").id, set(index.geom)
    found = []
    for k in range(len(qpos)):
        data.qpos[:] = qpos[k]
        mujoco.mj_kinematics(world, data)
        mujoco.mj_collision(world, data)
        for contact in range(data.ncon):
            pair = data.contact.geom[contact]
            other = int(pair[1] if pair[0] == ground else pair[0])
            if other not in feet and data.contact.dist[contact] < -1e-3:
                found.append((k, world.body(world.geom_bodyid[other]).name))
                break
    return found


def analyse(plan: Plan, model: Any, world: Any, index: Indices) -> OpenLoop:
    """Inverse kinematics and inverse dynamics along the plan, of `model` (contacts are switched off), and its way over the ground of `world`."""
    found = postures(plan, model, index, none(plan))
    rolling = roll(plan, found.shank, index.radius)
    found = postures(plan, model, index, rolling)
    qpos = found.qpos
    data = mujoco.MjData(model)
    N, step = len(plan.t), plan.t[1]
    qvel, qacc = np.zeros((N, model.nv)), np.zeros((N, model.nv))
    for k in range(1, N - 1):
        mujoco.mj_differentiatePos(model, qvel[k], 2 * step, qpos[k - 1], qpos[k + 1])
    qacc[2:-2] = (qvel[3:-1] - qvel[1:-3]) / (2 * step)

    flags = model.opt.disableflags
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    residual, torque = np.zeros((N, 6)), np.zeros((N, len(index.feet), 3))
    J = np.zeros((3, model.nv))
    for k in range(2, N - 2):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[k], qvel[k], qacc[k]
        mujoco.mj_inverse(model, data)
        generalized = data.qfrc_inverse.copy()
        for e in np.flatnonzero(plan.foot_contact[k]):
            mujoco.mj_jac(model, data, J, None, plan.foot_position[k, e], index.body[e])
            generalized -= J.T @ plan.foot_force[k, e]
        # The free joint's rows are a world force and a body-frame torque about the base's origin; moved to the centre of mass.
        force = generalized[:3]
        arm = data.subtree_com[index.base] - data.xpos[index.base]
        moment = data.xmat[index.base].reshape(3, 3) @ generalized[3:6] - np.cross(arm, force)
        residual[k] = np.r_[force, moment]
        torque[k] = generalized[index.qvel]
    model.opt.disableflags = flags
    return OpenLoop(
        qpos=qpos,
        qvel=qvel,
        rolling=rolling,
        unreachable=found.unreachable,
        beyond_limits=found.beyond_limits,
        in_ground=parts_in_ground(world, index, qpos),
        plan_residual=centroidal_residual(plan),
        body_residual=residual,
        torque=torque,
    )
