"""From a plan, or from its replay, to a motion at a rate.

Joint angles of a plan are those that the replay's controller follows: closed-form inverse kinematics at the plan's samples, with feet that roll.
Between samples they are cubic splines, whose derivatives are the joint speeds, so that positions and speeds agree.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.spatial.transform import Slerp

from .._native import load
from ..archive import Archive
from ..arrays import Array, Bools
from ..conditions import payload_of
from ..cycles import Cycle, cycle_of
from ..errors import InputError
from ..files import stem_of
from ..geometry import rotation_from_wxyz
from ..laws import explained
from ..model import Indices, find_model, indices, load_robot
from ..openloop import inverse_dynamics, joint_motion, rolled_postures
from ..plan import Plan
from .certificate import Joints, Report, certify, report_of
from .motion import Motion, turned_back

LOWEST_RATE, HIGHEST_RATE = 1.0, 1000.0  # Hz
_ON_GRID = 1e-6  # of a sample, by which a time may miss it
_FOOT_TOLERANCE = 1e-3  # m, between a foot of a replay and where its joint angles put it


@dataclass(frozen=True)
class _Planned:
    """What a plan says at K times."""

    t: Array
    center_of_mass: Array
    com_velocity: Array
    quaternion_wxyz: Array
    angular_velocity: Array
    contact_position: Array
    contact_velocity: Array
    force: Array
    contact: Bools
    normal: Array
    direction: Array  # (K, E, 3) from contact points to centers


def _frames(duration: float, rate: float) -> Array:
    """Times from 0 to `duration` s at `rate` Hz."""
    count = int(np.floor(duration * rate * (1 + 1e-12) + 1e-9)) + 1
    return np.arange(count) / rate


def _ensure_rate(rate: float) -> float:
    if not LOWEST_RATE <= rate <= HIGHEST_RATE:
        raise InputError(f"--rate {rate:g}: must be from {LOWEST_RATE:g} to {HIGHEST_RATE:g} Hz")
    return rate


def _samples(t: Array, of: Array) -> Array | None:
    """Which of the uniform times `of` the times `t` are, or nothing if some lie between."""
    step = of[1] - of[0]
    places = (t - of[0]) / step
    nearest = np.rint(places)
    return nearest.astype(np.intp) if np.abs(places - nearest).max() < _ON_GRID else None


def _planned(plan: Plan, t: Array) -> _Planned:
    """The plan's samples where they are, and its splines between them."""
    at = _samples(t, plan.t)
    if at is not None:
        return _Planned(
            t=t,
            center_of_mass=plan.base_position[at],
            com_velocity=plan.base_linear_velocity[at],
            quaternion_wxyz=plan.base_quaternion_wxyz[at],
            angular_velocity=plan.base_angular_velocity[at],
            contact_position=plan.foot_position[at],
            contact_velocity=plan.foot_velocity[at],
            force=plan.foot_force[at] * plan.foot_contact[at][..., None],
            contact=plan.foot_contact[at],
            normal=plan.foot_normal[at],
            direction=plan.center_direction[at],
        )
    splines = load(plan.path)
    # The file has one cycle of a plan that is repeated.
    number = np.minimum((t / splines.duration).astype(np.intp), plan.cycles - 1)
    inside = np.clip(t - number * splines.duration, 0.0, splines.duration)
    base, feet = splines.base(inside), splines.feet(inside)
    direction = CubicSpline(plan.t, plan.center_direction)(t)
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    found = _Planned(
        t=t,
        center_of_mass=base.position,
        com_velocity=base.linear_velocity,
        quaternion_wxyz=base.quaternion_wxyz,
        angular_velocity=base.angular_velocity,
        contact_position=feet.position,
        contact_velocity=feet.velocity,
        force=feet.force * feet.contact[..., None],
        contact=feet.contact,
        normal=feet.normal,
        direction=direction,
    )
    return found if plan.cycles == 1 else _moved(found, cycle_of(plan), number)


def _moved(planned: _Planned, cycle: Cycle, number: Array) -> _Planned:
    """What one cycle says, after `number` (K,) others; directions, which are those of all cycles, as they are."""
    return replace(
        planned,
        center_of_mass=cycle.moved(planned.center_of_mass, number),
        com_velocity=cycle.turned(planned.com_velocity, number),
        quaternion_wxyz=cycle.turned_quaternions(planned.quaternion_wxyz, number),
        angular_velocity=cycle.turned(planned.angular_velocity, number),
        contact_position=cycle.moved(planned.contact_position, number),
        contact_velocity=cycle.turned(planned.contact_velocity, number),
        force=cycle.turned(planned.force, number),
        normal=cycle.turned(planned.normal, number),
    )


@dataclass(frozen=True)
class _Walk:
    """What a robot with joints does at K times."""

    qpos: Array  # (K, nq)
    qvel: Array  # (K, nv)
    torque: Array  # (K, J) N m
    contact_position: Array  # (K, E, 3)
    force: Array  # (K, E, 3)
    contact: Bools  # (K, E)
    center_of_mass: Array  # (K, 3)


@dataclass(frozen=True)
class _Bodies:
    """Where the bodies and feet of a model are, from forward kinematics."""

    position: Array  # (K, B, 3)
    quaternion_wxyz: Array  # (K, B, 4)
    linear_velocity: Array  # (K, B, 3)
    angular_velocity: Array  # (K, B, 3)
    foot_position: Array  # (K, E, 3)
    foot_velocity: Array  # (K, E, 3)
    center_of_mass: Array  # (K, 3)


def _bodies(model: Any, index: Indices, qpos: Array, qvel: Array) -> _Bodies:
    data = mujoco.MjData(model)
    K, B, E = len(qpos), model.nbody - 1, len(index.feet)
    position, quaternion, com = np.zeros((K, B, 3)), np.zeros((K, B, 4)), np.zeros((K, 3))
    twist, foot_twist, foot = np.zeros((K, B, 6)), np.zeros((K, E, 6)), np.zeros((K, E, 3))
    for k in range(K):
        data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        position[k], quaternion[k], com[k] = data.xpos[1:], data.xquat[1:], data.subtree_com[index.base]
        foot[k] = data.site_xpos[index.site]
        for b in range(B):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, b + 1, twist[k, b], 0)
        for e, site in enumerate(index.site):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, site, foot_twist[k, e], 0)
    return _Bodies(position, quaternion, twist[..., 3:], twist[..., :3], foot, foot_twist[..., 3:], com)


def motion_of_plan(plan: Plan, rate: float | None = None) -> Motion:
    """The planned motion at `rate` Hz, by default that of the plan's samples. The robot's joint angles are found if it has a full model."""
    with explained(plan.path):
        return _motion_of_plan(plan, rate)


def _motion_of_plan(plan: Plan, rate: float | None) -> Motion:
    rate = _ensure_rate(round(1 / float(plan.t[1]), 6) if rate is None else rate)
    planned = _planned(plan, _frames(plan.duration, rate))
    report = report_of(plan)
    try:
        path = find_model(plan.robot.name)
    except InputError:
        return _rigid(plan, rate, planned, report)
    model = load_robot(path, plan.robot.gravity, payload_of(plan))
    index = indices(model, plan.foot_names)
    found, _ = rolled_postures(plan, model, index)
    if found.unreachable.any():
        k, e = np.argwhere(found.unreachable)[0]
        raise InputError(
            f"{plan.path}: {plan.foot_names[e]} is out of reach of {path.stem} at {plan.t[k]:.2f} s; there are no joint angles for it"
        )
    torque = np.zeros((len(plan.t), model.nv))
    _, by_leg = inverse_dynamics(plan, model, index, found.qpos, *joint_motion(plan, model, found.qpos))
    torque[:, index.qvel.ravel()] = by_leg.reshape(len(plan.t), -1)
    t = planned.t
    trunk, joints = CubicSpline(plan.t, found.qpos[:, :3]), CubicSpline(plan.t, found.qpos[:, 7:])
    qpos = np.hstack([trunk(t), planned.quaternion_wxyz, joints(t)])
    spin = turned_back(planned.quaternion_wxyz, planned.angular_velocity)
    qvel = np.hstack([trunk(t, 1), spin, joints(t, 1)])
    tau = np.stack([np.interp(t, plan.t, column) for column in torque[:, 6:].T], axis=-1)
    walk = _Walk(qpos, qvel, tau, planned.contact_position, planned.force, planned.contact, planned.center_of_mass)
    return _jointed(plan, rate, "plan", planned, _Robot(path, model, index), walk, report)


def motion_of_replay(plan: Plan, rate: float | None = None) -> Motion:
    """The motion of the replay whose file lies beside the plan, at `rate` Hz, by default that of the replay's controller."""
    with explained(plan.path):
        return _motion_of_replay(plan, rate)


def _motion_of_replay(plan: Plan, rate: float | None) -> Motion:
    file = plan.path.with_name(f"{stem_of(plan.path)}.replay.npz")
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; replay the plan first: warpgait validate {plan.path.name}")
    replay = _Replay(file, plan)
    report = report_of(plan)
    path = find_model(report.robot if report.robot else plan.robot.name)
    model = load_robot(path, plan.robot.gravity, payload_of(plan))
    index = indices(model, plan.foot_names)
    rate = _ensure_rate(round(1 / float(replay.t[1] - replay.t[0]), 6) if rate is None else rate)
    t = _frames(float(replay.t[-1]), rate)
    planned = _planned(plan, t)
    feet = replay.feet(t)
    qpos, qvel, tau = replay.joints(t, model)
    touching = feet - index.radius * planned.direction
    walk = _Walk(qpos, qvel, tau, touching, replay.force(t), replay.contact(t), replay.center_of_mass(t))
    motion = _jointed(plan, rate, "replay", planned, _Robot(path, model, index), walk, report)
    if np.abs(motion.foot_position - feet).max() > _FOOT_TOLERANCE:
        raise InputError(f"{file}: its joint angles do not put the feet of {path.stem} where it has them; was it another model?")
    return motion


class _Replay:
    """A NAME.replay.npz, checked."""

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path, self.arrays = path, Archive(path)
        if str(self._take("plan_sha256", 0)) != plan.sha256:
            raise InputError(f"{path}: is the replay of another plan; replay this one: warpgait validate {plan.path.name}")
        self.t = self._take("t", 1)
        K = len(self.t)
        if K < 3 or not np.isfinite(self.t).all() or np.ptp(np.diff(self.t)) > 1e-6 or self.t[1] <= self.t[0]:
            raise InputError(f"{path}: member t: expected at least three uniform times")
        self.names = tuple(str(name) for name in self._take("joint_names", 1))
        E, J = len(plan.foot_names), len(self.names)
        self.values = {
            name: self._shaped(name, (K, *shape))
            for name, shape in {
                "base_position": (3,),
                "base_quaternion_wxyz": (4,),
                "base_linear_velocity": (3,),
                "base_angular_velocity": (3,),
                "center_of_mass": (3,),
                "q": (J,),
                "qd": (J,),
                "tau": (J,),
                "foot_position": (E, 3),
                "foot_force": (E, 3),
            }.items()
        }
        self.touching = self._take("foot_contact", 2)
        if self.touching.shape != (K, E) or self.touching.dtype != np.bool_:
            raise InputError(f"{path}: member foot_contact: expected {(K, E)} of true or false")

    def _take(self, name: str, axes: int) -> Any:
        if name not in self.arrays:
            raise InputError(f"{self.path}: member {name}: is missing; an older warpgait wrote it: replay the plan again")
        array = self.arrays[name]
        if array.ndim != axes:
            raise InputError(f"{self.path}: member {name}: has {array.ndim} axes, expected {axes}")
        return array

    def _shaped(self, name: str, shape: tuple[int, ...]) -> Array:
        array = self._take(name, len(shape))
        if array.shape != shape or array.dtype != np.float64 or not np.isfinite(array).all():
            raise InputError(f"{self.path}: member {name}: expected finite numbers of shape {shape}, found {array.shape}")
        return np.asarray(array, np.float64)

    def _linear(self, name: str, t: Array) -> Array:
        at = _samples(t, self.t)
        values = self.values[name]
        if at is not None:
            return np.asarray(values[at])
        flat = values.reshape(len(values), -1)
        return np.stack([np.interp(t, self.t, column) for column in flat.T], -1).reshape(len(t), *values.shape[1:])

    def _curve(self, position: str, velocity: str, t: Array) -> Array:
        at = _samples(t, self.t)
        if at is not None:
            return np.asarray(self.values[position][at])
        curve: Array = CubicHermiteSpline(self.t, self.values[position], self.values[velocity])(t)
        return curve

    def feet(self, t: Array) -> Array:
        """Centers of the feet (K, E, 3)."""
        return self._linear("foot_position", t)

    def center_of_mass(self, t: Array) -> Array:
        """(K, 3)."""
        return self._linear("center_of_mass", t)

    def force(self, t: Array) -> Array:
        """Of the ground on the feet (K, E, 3)."""
        return self._linear("foot_force", t)

    def contact(self, t: Array) -> Bools:
        """Feet that touch (K, E)."""
        before = np.clip(np.floor((t - self.t[0]) / (self.t[1] - self.t[0]) + _ON_GRID).astype(int), 0, len(self.t) - 1)
        touching: Bools = self.touching[before]
        return touching

    def joints(self, t: Array, model: Any) -> tuple[Array, Array, Array]:
        """MuJoCo's positions and velocities, and joint torques in the model's order."""
        own = _joint_names(model)
        if set(own) != set(self.names):
            raise InputError(f"{self.path}: its joints are not those of the model: {', '.join(self.names)}")
        order = [self.names.index(name) for name in own]
        at = _samples(t, self.t)
        quaternion = self.values["base_quaternion_wxyz"]
        if at is not None:
            turned = quaternion[at]
        else:
            turned = np.roll(Slerp(self.t, rotation_from_wxyz(quaternion))(t).as_quat(), 1, axis=-1)
            before = quaternion[np.clip(np.searchsorted(self.t, t, "right") - 1, 0, len(self.t) - 1)]
            turned *= np.where((turned * before).sum(-1, keepdims=True) < 0, -1.0, 1.0)
        trunk = self._curve("base_position", "base_linear_velocity", t)
        qpos = np.hstack([trunk, turned, self._curve("q", "qd", t)[:, order]])
        speeds = [self._linear(name, t) for name in ("base_linear_velocity", "base_angular_velocity")]
        return qpos, np.hstack([*speeds, self._linear("qd", t)[:, order]]), self._linear("tau", t)[:, order]


@dataclass(frozen=True)
class _Robot:
    """A full model, and where it is from."""

    path: Path
    model: Any
    index: Indices


def _joint_names(model: Any) -> tuple[str, ...]:
    """The joints of a model after its free joint, in its order."""
    names = tuple(model.joint(i).name for i in range(model.njnt))
    if model.jnt_type[0] != mujoco.mjtJoint.mjJNT_FREE or (model.jnt_type[1:] != mujoco.mjtJoint.mjJNT_HINGE).any():
        raise InputError("the robot model must have a free joint and then hinges only")
    return names[1:]


def _jointed(plan: Plan, rate: float, source: str, planned: _Planned, robot: _Robot, walk: _Walk, report: Report) -> Motion:
    """The motion of a robot with joints."""
    model, index = robot.model, robot.index
    bodies = _bodies(model, index, walk.qpos, walk.qvel)
    joints = Joints(model, index, walk.qpos, walk.qvel, walk.torque)
    return Motion(
        name=stem_of(plan.path),
        robot=robot.path.stem,
        source=source,
        rate=rate,
        t=planned.t,
        base_position=walk.qpos[:, :3],
        base_quaternion_wxyz=walk.qpos[:, 3:7],
        base_linear_velocity=walk.qvel[:, :3],
        base_angular_velocity=bodies.angular_velocity[:, index.base - 1],
        center_of_mass=walk.center_of_mass,
        joint_names=_joint_names(model),
        joint_position=walk.qpos[:, 7:],
        joint_velocity=walk.qvel[:, 6:],
        joint_torque=walk.torque,
        body_names=tuple(model.body(i).name for i in range(1, model.nbody)),
        body_position=bodies.position,
        body_quaternion_wxyz=bodies.quaternion_wxyz,
        body_linear_velocity=bodies.linear_velocity,
        body_angular_velocity=bodies.angular_velocity,
        foot_names=plan.foot_names,
        foot_radius=index.radius,
        foot_position=bodies.foot_position,
        foot_velocity=bodies.foot_velocity,
        contact_position=walk.contact_position,
        foot_force=walk.force,
        foot_contact=walk.contact,
        foot_normal=planned.normal,
        friction=plan.robot.friction,
        ground=plan.terrain,
        certificate=certify(plan, source, report, walk.force, walk.contact, planned.normal, joints),
        model_path=robot.path,
        model=model,
        qpos=walk.qpos,
        qvel=walk.qvel,
    )


def _rigid(plan: Plan, rate: float, planned: _Planned, report: Report) -> Motion:
    """The motion of a robot that is one rigid body."""
    K = len(planned.t)
    none = np.zeros((K, 0))
    return Motion(
        name=stem_of(plan.path),
        robot=plan.robot.name,
        source="plan",
        rate=rate,
        t=planned.t,
        base_position=planned.center_of_mass,
        base_quaternion_wxyz=planned.quaternion_wxyz,
        base_linear_velocity=planned.com_velocity,
        base_angular_velocity=planned.angular_velocity,
        center_of_mass=planned.center_of_mass,
        joint_names=(),
        joint_position=none,
        joint_velocity=none,
        joint_torque=none,
        body_names=(),
        body_position=np.zeros((K, 0, 3)),
        body_quaternion_wxyz=np.zeros((K, 0, 4)),
        body_linear_velocity=np.zeros((K, 0, 3)),
        body_angular_velocity=np.zeros((K, 0, 3)),
        foot_names=plan.foot_names,
        foot_radius=0.0,
        foot_position=planned.contact_position,
        foot_velocity=planned.contact_velocity,
        contact_position=planned.contact_position,
        foot_force=planned.force,
        foot_contact=planned.contact,
        foot_normal=planned.normal,
        friction=plan.robot.friction,
        ground=plan.terrain,
        certificate=certify(plan, "plan", report, planned.force, planned.contact, planned.normal),
    )
