"""Closed loop: the plan on the full robot in MuJoCo."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np

from .arrays import Array, Bools
from .contacts import GroundContacts
from .controllers import LATENCY, WholeBody
from .geometry import rotation_vector
from .model import Indices, foot_of
from .reference import Reference
from .replay import CONTACT_FORCE, Incident, Replay
from .settings import Disturbance
from .trunk import TrunkForces

SETTLING_TIME = 0.6  # s: the robot stands at the first sample before the plan's clock starts
INITIAL_DEPTH = 5e-4  # m: the feet start this deep in the ground, about as deep as the weight presses them, so that all touch
TILT_LIMIT = np.deg2rad(35.0)  # between the trunk's vertical axis and the planned one; more is a fall
OFFSET_LIMIT = 0.5  # m, for a robot of ANYmal's size, of the center of mass from the planned one; more is a fall, whatever the trunk's attitude

# Standard deviations of the sensor noise at `Disturbance.noise` = 1.
POSITION_NOISE = 1e-3  # m, base
ANGLE_NOISE = 0.1 * np.deg2rad(1.0)  # rad, base and joints
VELOCITY_NOISE = 0.02  # m/s, base
ANGULAR_VELOCITY_NOISE = np.deg2rad(1.0)  # rad/s, base and joints


class _Measurement:
    """The state that the controller sees, delayed and noisy if the disturbance says so."""

    def __init__(self, model: Any, disturbance: Disturbance, period: float) -> None:
        self.qpos, self.qvel, self.touching = np.zeros(model.nq), np.zeros(model.nv), np.zeros(0, bool)
        self.noise, self.rng = disturbance.noise, np.random.default_rng(disturbance.seed)
        self.queue: deque[tuple[Array, Array, Bools]] = deque(maxlen=round(disturbance.delay / period) + 1)

    def take(self, qpos: Array, qvel: Array, touching: Bools) -> None:
        """Record the true state, and put the measured one into `qpos`, `qvel` and `touching`."""
        self.queue.append((qpos.copy(), qvel.copy(), touching.copy()))
        q, v, self.touching = self.queue[0]
        self.qpos, self.qvel = q.copy(), v.copy()
        if self.noise > 0:
            self._add_noise()

    def _add_noise(self) -> None:
        q, v, random = self.qpos, self.qvel, self.rng.standard_normal
        q[:3] += self.noise * POSITION_NOISE * random(3)
        mujoco.mju_quatIntegrate(q[3:7], self.noise * ANGLE_NOISE * random(3), 1.0)
        q[7:] += self.noise * ANGLE_NOISE * random(len(q) - 7)
        v[:3] += self.noise * VELOCITY_NOISE * random(3)
        v[3:] += self.noise * ANGULAR_VELOCITY_NOISE * random(len(v) - 3)


@contextmanager
def _muted() -> Iterator[None]:
    """MuJoCo prints its warnings and writes them to a file in the working directory. The replay reports them itself."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@dataclass
class _Sample:
    """One sample of a `Replay`, whose fields have the same names."""

    qpos: Array
    qvel: Array
    torque: Array
    com: Array
    rotation_error: Array
    foot: Array
    force: Array
    slip: Array
    stray_contacts: int


class Simulation:
    """The robot in its world, under a controller that follows a reference."""

    def __init__(
        self,
        world: Any,
        own_model: Any,
        index: Indices,
        reference: Reference,
        controller: WholeBody,
        adhesion: Array,
        qpos: Array,
        disturbance: Disturbance | None = None,
        applied: TrunkForces | None = None,
    ) -> None:
        """The robot starts in `world` in posture `qpos` (nq,). The controller sees `own_model`, which has no contacts.

        `adhesion` (K, E) N: how strongly the feet stick. `applied` acts on the trunk as planned.
        """
        self._disturbance = disturbance or Disturbance()
        self._world, self._index, self._reference, self._controller = world, index, reference, controller
        self._applied = applied
        self._adhesion, self._data = adhesion, mujoco.MjData(world)
        self._data.qpos[:] = qpos
        self._data.qpos[2] -= INITIAL_DEPTH
        self._period = float(reference.t[1])
        self._substeps = max(1, round(self._period / world.opt.timestep))
        self._contacts = GroundContacts(world, index)
        self._measurement = _Measurement(own_model, self._disturbance, self._period)
        self._torques: deque[Array] = deque(maxlen=LATENCY + 1)
        self._jacobian = np.zeros((3, world.nv))
        self._samples: list[_Sample] = []
        self._fall: Incident | None = None
        self._first_stray: Incident | None = None

    def run(self) -> Replay:
        """Let the robot settle on the first sample, or set it in motion as it is there, then follow the reference to its end or to a fall."""
        settling_steps = round(SETTLING_TIME / self._period)
        if self._reference.moves_at_start:
            self._set_in_motion()
            settling_steps = 0
        with _muted():
            for step in range(-settling_steps, len(self._reference.t)):
                self._control_period(step)
                if self._fall is not None:
                    break
        return self._replay()

    def _set_in_motion(self) -> None:
        """Give the trunk its velocities at the first sample, and the joints those at which the feet stay where they are."""
        data, world, index, reference = self._data, self._world, self._index, self._reference
        mujoco.mj_forward(world, data)
        omega = reference.angular_velocity[0]
        rotation = data.xmat[index.base].reshape(3, 3)
        arm = data.subtree_com[index.base] - data.xpos[index.base]
        data.qvel[:3] = reference.com_velocity[0] - np.cross(omega, arm)
        data.qvel[3:6] = rotation.T @ omega
        jacobian = np.zeros((len(index.feet), 3, world.nv))
        for rows, geom, body in zip(jacobian, index.geom, index.body, strict=True):
            mujoco.mj_jac(world, data, rows, None, data.geom_xpos[geom], body)
        feet = jacobian.reshape(-1, world.nv)
        data.qvel[6:] = np.linalg.lstsq(feet[:, 6:], -feet[:, :6] @ data.qvel[:6], rcond=None)[0]

    def _control_period(self, step: int) -> None:
        """One control step and its physics steps. Negative steps settle on the first sample of the reference; only one in which the robot
        falls is recorded, so that a replay has at least one sample.
        """
        k, time = max(step, 0), step * self._period
        self._push(time)
        touching = self._measure()
        torque = self._control(step)
        sample = self._observe(k, torque)
        stray = self._step(sample)
        if self._blew_up():
            self._fall = Incident(max(time, 0.0), "the simulation blew up")
            sample.force[:] = 0.0  # it may be infinite
        else:
            sample.slip = self._slip(k, sample.foot, touching)
            self._judge_fall(k, max(time, 0.0), sample.com)
        if step >= 0:
            self._note_stray(time, stray)
        if step >= 0 or self._fall is not None:
            self._samples.append(sample)

    def _push(self, time: float) -> None:
        """Apply the force of the disturbance, and those of the plan, to the base while they last."""
        wrench, push = self._data.xfrc_applied[self._index.base], self._disturbance.push
        wrench[:] = 0.0
        if push and push[0] <= time < push[0] + push[1]:
            wrench[:3] = push[2:]
        if self._applied is not None:
            k = max(round(time / self._period), 0)
            wrench += self._applied.about_center(k, self._data, self._index.base)

    def _measure(self) -> Bools:
        """Which feet touch the ground (E,). What the controller sees is in `_measurement`."""
        mujoco.mj_step1(self._world, self._data)
        touching = self._contacts.detect(self._data)
        self._measurement.take(self._data.qpos, self._data.qvel, touching)
        return touching

    def _control(self, step: int) -> Array:
        """Set the motors and the feet's adhesion; returns the torques (E, J) N m that act. The next ones are computed meanwhile."""
        seen = self._measurement
        k = min(max(step + LATENCY, 0), len(self._reference.t) - 1)
        self._torques.append(self._controller.torque(k, seen.qpos, seen.qvel, seen.touching))
        torque = self._torques[0]
        self._data.ctrl[self._index.actuator.ravel()] = torque.ravel()
        for e, actuator in self._contacts.adhesion:
            strength = float(self._world.actuator_gainprm[actuator, 0])
            self._data.ctrl[actuator] = self._adhesion[max(step, 0), e] / strength
        return torque

    def _observe(self, k: int, torque: Array) -> _Sample:
        """The state at the beginning of the control step; `force`, `slip` and `stray_contacts` are not known yet."""
        data, index = self._data, self._index
        rotation = data.xmat[index.base].reshape(3, 3)
        return _Sample(
            qpos=data.qpos.copy(),
            qvel=data.qvel.copy(),
            torque=np.clip(torque, -index.torque_limit, index.torque_limit),
            com=data.subtree_com[index.base].copy(),
            rotation_error=rotation_vector(rotation.T @ self._reference.rotation[k]),
            foot=data.site_xpos[index.site].copy(),
            force=np.zeros((len(index.feet), 3)),
            slip=np.zeros(len(index.feet)),
            stray_contacts=0,
        )

    def _step(self, sample: _Sample) -> list[int]:
        """Physics to the end of the control step. Adds the contact forces to `sample`; returns other geoms that touch the ground."""
        mujoco.mj_step2(self._world, self._data)
        sample.force, stray = self._contacts.forces(self._data)
        sample.stray_contacts = len(stray)
        for _ in range(self._substeps - 1):
            mujoco.mj_step1(self._world, self._data)
            mujoco.mj_step2(self._world, self._data)
        return stray

    def _blew_up(self) -> bool:
        bad_acceleration = self._data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number
        return bool(bad_acceleration or not np.isfinite(self._data.qpos).all())

    def _slip(self, k: int, centers: Array, touching: Bools) -> Array:
        """How far (E,) m the contact points slide along the ground in this control step, where contact is planned and actual."""
        slip = np.zeros(len(self._index.feet))
        for e in map(int, np.flatnonzero(touching & self._reference.contact[k])):
            normal = self._reference.normal[k, e]
            point = centers[e] - self._index.radius * normal
            mujoco.mj_jac(self._world, self._data, self._jacobian, None, point, self._index.body[e])
            velocity = self._jacobian @ self._data.qvel
            slip[e] = math.hypot(*(velocity - normal * (normal @ velocity))) * self._period
        return slip

    def _note_stray(self, time: float, stray: list[int]) -> None:
        """Keep the first contact of a part other than a foot."""
        if stray and self._first_stray is None:
            body = self._world.body(self._world.geom_bodyid[stray[0]]).name
            self._first_stray = Incident(time, f"{body} touches the ground", foot_of(body, self._index.feet))

    def _judge_fall(self, k: int, time: float, com: Array) -> None:
        """A trunk that tilts too far from the plan, or a center of mass (3,) too far off, is a fall."""
        up = self._data.xmat[self._index.base].reshape(3, 3)[:, 2]
        tilt = math.acos(min(1.0, max(-1.0, up @ self._reference.rotation[k][:, 2])))
        offset = math.dist(self._reference.com[k], com)
        if tilt > TILT_LIMIT:
            self._fall = Incident(time, f"fall: the trunk tilts {np.degrees(tilt):.0f}° from the plan")
        elif offset > OFFSET_LIMIT * self._index.size:
            self._fall = Incident(time, f"fall: the center of mass is {offset:.2f} m from the plan")

    def _replay(self) -> Replay:
        return Replay(
            t=self._reference.t[: len(self._samples)],
            **{field.name: np.array([getattr(s, field.name) for s in self._samples]) for field in fields(_Sample)},
            controller_failures=self._controller.failures,
            fall=self._fall,
            first_stray=self._first_stray,
            contact_force=CONTACT_FORCE * self._index.size**3,
        )
