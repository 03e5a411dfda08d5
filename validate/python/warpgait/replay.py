"""Closed loop: the plan on the full robot in MuJoCo."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from .controllers import Controller, rotation_error
from .model import Indices
from .plan import Array, Bools
from .reference import Reference
from .scene import Disturbance

SETTLE = 0.3  # s of standing at the first sample before the plan's clock starts
PRESS = (
    5e-4  # m: the feet start this deep in the ground, about as deep as the weight presses them, so that none starts in the air
)
TILT_LIMIT = np.deg2rad(35.0)
STRAY_LIMIT = 0.5  # m: a centre of mass this far off is a fall, whatever the trunk's attitude


@dataclass(frozen=True)
class Incident:
    """Something that went wrong."""

    time: float  # s
    what: str
    foot: str | None = None


@dataclass(frozen=True)
class Replay:
    """What happened, at control rate; K samples, fewer than the reference's if the robot fell. World frame, SI."""

    t: Array  # (K,)
    qpos: Array  # (K, nq)
    qvel: Array  # (K, nv)
    torque: Array  # (K, E, 3) as applied
    com: Array  # (K, 3)
    rotation_error: Array  # (K, 3) rad, base frame
    foot: Array  # (K, E, 3) centres
    force: Array  # (K, E, 3) ground on robot, adhesion included
    slip: Array  # (K, E) m, gained in this control step by a foot in planned and actual contact
    stray_contacts: Array  # (K,) contacts of other parts with the ground
    controller_failures: int
    fall: Incident | None
    first_stray: Incident | None


class _Feet:
    """Forces of the ground on the feet, read from the solver's contact forces."""

    def __init__(self, model: Any, index: Indices) -> None:
        self.model, self.index = model, index
        self.ground = model.geom("ground").id
        self.foot_of_geom = np.full(model.ngeom, -1)
        self.foot_of_geom[index.geom] = np.arange(len(index.feet))
        self.adhesion = [
            (e, model.actuator(f"adhesion_{f}").id) for e, f in enumerate(index.feet) if _has_actuator(model, f"adhesion_{f}")
        ]

    def look(self, data: Any) -> Bools:
        """Which feet touch the ground (E,); remembers this step's contacts for `forces`."""
        geom = data.contact.geom.reshape(-1, 2)
        self.first = geom[:, 0] == self.ground
        self.other = np.where(self.first, geom[:, 1], geom[:, 0])
        self.foot = self.foot_of_geom[self.other]
        touching = np.zeros(len(self.index.feet) + 1, bool)
        touching[self.foot] = True  # -1, no foot, lands in the spare last place
        return touching[:-1]

    def forces(self, data: Any) -> tuple[Array, list[int]]:
        """Forces (E, 3) of the contacts seen by `look`, now that they are known, and the other geoms that touch the ground."""
        E, contact = len(self.index.feet), data.contact
        row = contact.efc_address
        if len(row) != len(self.foot):  # the simulation blew up, and MuJoCo began anew
            return np.zeros((E, 3)), []
        active = np.flatnonzero((self.foot >= 0) & (row >= 0))
        if not len(active):
            return np.zeros((E, 3)), [int(g) for g in self.other[self.foot < 0]]
        sign = np.where(self.first[active], 1.0, -1.0)[:, None]  # MuJoCo's force acts on the second geom
        frame = contact.frame[active].reshape(-1, 3, 3)
        local = data.efc_force[row[active, None] + np.arange(3)]  # normal, two tangents: elliptic cones
        on_foot = self.foot[active] == np.arange(E)[:, None]  # (E, contacts)
        force = np.asarray(on_foot @ (sign * (local[:, None] @ frame)[:, 0]), float)
        for e, actuator in self.adhesion:
            if on_foot[e].any():  # the actuator presses the foot on; the ground's net force is what remains
                normal = (sign * frame[:, 0])[on_foot[e]].sum(0)
                force[e] -= data.actuator_force[actuator] * normal / np.linalg.norm(normal)
        return force, [int(g) for g in self.other[self.foot < 0]]


def _has_actuator(model: Any, name: str) -> bool:
    return bool(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name) >= 0)


class _Measurement:
    """The state as the controller sees it: late and noisy if so wished, in a model of its own."""

    def __init__(self, model: Any, disturbance: Disturbance, period: float) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.noise, self.rng = disturbance.noise, np.random.default_rng(disturbance.seed)
        self.queue: deque[tuple[Array, Array, Bools]] = deque(maxlen=round(disturbance.delay / period) + 1)

    def take(self, qpos: Array, qvel: Array, touching: Bools) -> Bools:
        """Note the true state; `data` then holds the measured one, and the measured contacts are returned."""
        self.queue.append((qpos.copy(), qvel.copy(), touching.copy()))
        q, v, contact = self.queue[0]
        self.data.qpos[:], self.data.qvel[:] = q, v
        if self.noise > 0:
            s, random, degree = self.noise, self.rng.standard_normal, np.deg2rad(1.0)
            self.data.qpos[:3] += s * 1e-3 * random(3)
            mujoco.mju_quatIntegrate(self.data.qpos[3:7], s * 0.1 * degree * random(3), 1.0)
            self.data.qpos[7:] += s * 0.1 * degree * random(len(q) - 7)
            self.data.qvel[:3] += s * 0.02 * random(3)
            self.data.qvel[3:] += s * degree * random(len(v) - 3)
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        return contact


@contextmanager
def _quiet() -> Iterator[None]:
    """MuJoCo prints its warnings and writes them to a file in the working directory; the replay reports them itself."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@_quiet()
def run(
    world: Any,
    own_model: Any,
    index: Indices,
    reference: Reference,
    controller: Controller,
    qpos: Array,
    disturbance: Disturbance | None = None,
) -> Replay:
    """Simulate `world` from posture `qpos` (nq,) under `controller`, which looks at `own_model` (no contacts).

    The first sample of the reference is held for SETTLE seconds. Stops at a fall.
    """
    disturbance = disturbance or Disturbance()
    data = mujoco.MjData(world)
    data.qpos[:] = qpos
    data.qpos[2] -= PRESS
    period = reference.t[1]
    substeps = max(1, round(period / world.opt.timestep))
    ground, measured = _Feet(world, index), _Measurement(own_model, disturbance, period)
    motors, base = index.actuator.ravel(), index.base
    K, E = len(reference.t), len(index.feet)
    settle = round(SETTLE / period)
    log: dict[str, list[Any]] = {n: [] for n in ("qpos", "qvel", "torque", "com", "turn", "foot", "force", "slip", "stray")}
    fall, first_stray = None, None
    jacobian = np.zeros((3, world.nv))
    for step in range(-settle, K):
        k = max(step, 0)
        data.xfrc_applied[base, :3] = 0.0
        if disturbance.push and disturbance.push[0] <= step * period < disturbance.push[0] + disturbance.push[1]:
            data.xfrc_applied[base, :3] = disturbance.push[2:]
        slip = np.zeros(E)
        for sub in range(substeps):
            mujoco.mj_step1(world, data)
            if sub == 0:
                touching = ground.look(data)
                seen = measured.take(data.qpos, data.qvel, touching)
                torque = controller.torque(k, measured.data, seen)
                data.ctrl[motors] = torque.ravel()
                for e, actuator in ground.adhesion:
                    data.ctrl[actuator] = float(reference.contact[k, e])
                state = data.qpos.copy(), data.qvel.copy(), data.subtree_com[base].copy()
                turn = rotation_error(data.xmat[base].reshape(3, 3).T @ reference.rotation[k])
                centers = data.site_xpos[index.site].copy()
            mujoco.mj_step2(world, data)
            if sub == 0:
                force, stray = ground.forces(data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or not np.isfinite(data.qpos).all():
            fall = Incident(max(step * period, 0.0), "the simulation blew up")
            break
        for e in map(int, np.flatnonzero(touching & reference.contact[k])):
            mujoco.mj_jac(world, data, jacobian, None, centers[e] - index.radius * reference.normal[k, e], index.body[e])
            velocity = jacobian @ data.qvel
            n = reference.normal[k, e]
            slip[e] = math.hypot(*(velocity - n * (n @ velocity))) * period
        tilt = math.acos(min(1.0, max(-1.0, data.xmat[base].reshape(3, 3)[:, 2] @ reference.rotation[k][:, 2])))
        off = math.dist(reference.com[k], state[2])
        if stray and first_stray is None and step >= 0:
            body = world.body(world.geom_bodyid[stray[0]]).name
            first_stray = Incident(
                step * period, f"{body} touches the ground", next((f for f in index.feet if body.startswith(f)), None)
            )
        if step >= 0:
            for name, value in zip(
                log,
                (
                    *state[:2],
                    np.clip(torque, -index.torque_limit, index.torque_limit),
                    state[2],
                    turn,
                    centers,
                    force,
                    slip,
                    len(stray),
                ),
                strict=True,
            ):
                log[name].append(value)
        if tilt > TILT_LIMIT or off > STRAY_LIMIT:
            what = (
                f"the trunk tilts {np.degrees(tilt):.0f}° off the plan"
                if tilt > TILT_LIMIT
                else f"the centre of mass is {off:.2f} m off"
            )
            fall = Incident(max(step * period, 0.0), f"fall: {what}")
            break
    arrays = {name: np.array(values) for name, values in log.items()}
    return Replay(
        t=reference.t[: len(arrays["stray"])],
        qpos=arrays["qpos"],
        qvel=arrays["qvel"],
        torque=arrays["torque"],
        com=arrays["com"],
        rotation_error=arrays["turn"],
        foot=arrays["foot"],
        force=arrays["force"],
        slip=arrays["slip"],
        stray_contacts=arrays["stray"],
        controller_failures=controller.failures,
        fall=fall,
        first_stray=first_stray,
    )
