"""Full robot models: where they are found, and what the rest of the package reads from them.

A model is one MJCF file, `robots/NAME.xml`. It has a free joint `root`, a body `base`, and for each foot `F` a spherical geom `F`, a site `F` at
its center, three to seven hinges on the way from the base to it (or two in all legs; as many in each leg), and a motor for each hinge. Names of bodies of that leg begin with `F`. A keyframe
`stand` holds the nominal stance. The custom numeric `joint_speed_limit` is in rad/s and `joint_power_limit`, if it has one, in W: one number for
all joints, or one for each, leg by leg from the base down.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .arrays import Array, Integers
from .conditions import Payload
from .errors import InputError
from .settings import MUJOCO_VERSION
from .text import is_name

PITCH_ONLY = "a leg of two joints has both about the base's y axis (pitch and pitch)"
SAGITTAL = 2  # joints of a leg whose foot moves in a plane of the base
JOINT_COUNTS = (SAGITTAL, 3, 4, 5, 6, 7)  # of a leg; the same for all legs of a robot
CARRIED, CARRIED_RADIUS = "carried", 0.01  # the body of a payload, which plans take for a point, and its radius of gyration, m
ANYMAL_HEIGHT, SIZE_STEP = 0.43, 0.05  # m, of the ANYmals; sizes of robots are multiples of the step


def check_mujoco() -> None:
    """Refuse a version of MuJoCo other than the one that the criteria were calibrated with."""
    if mujoco.__version__ != MUJOCO_VERSION:
        raise InputError(
            f"MuJoCo {mujoco.__version__} is installed; the replay is calibrated with {MUJOCO_VERSION}. "
            f"Run: pip install mujoco=={MUJOCO_VERSION}"
        )


def robots_directories() -> list[Path]:
    """Where models are looked for: $WARPGAIT_ROBOTS, `models` in an installed package, `robots` above this file."""
    named = [Path(p) for p in os.environ.get("WARPGAIT_ROBOTS", "").split(os.pathsep) if p]
    here = Path(__file__).resolve()
    above = [p / "robots" for p in here.parents[:4]]
    return [*named, *(p for p in (here.parent / "models", *above) if p.is_dir())]


def available_models() -> list[str]:
    """Names of the full models that can be found."""
    return sorted({f.stem for d in robots_directories() for f in d.glob("*.xml")})


def model_file(model: str) -> Path:
    """The MJCF file that a user names: a file that ends in .xml, or that of a robot."""
    if not model.endswith(".xml"):
        return find_model(model)
    if not Path(model).is_file():
        raise InputError(f"{model}: there is no such model file")
    return Path(model)


def find_model(name: str) -> Path:
    """The MJCF file of robot `name`. A path is no name: a plan must not lead to a file."""
    if not is_name(name):
        raise InputError(f"{name!r} is not the name of a robot; only --model takes a file")
    for directory in robots_directories():
        path = directory / f"{name}.xml"
        if path.is_file():
            return path
    known = ", ".join(available_models()) or "none (set WARPGAIT_ROBOTS to the folder that holds them)"
    raise InputError(
        f'robot "{name}" has no full model (robots/{name}.xml). Available models: {known}. '
        f"Plan for one of these, or set WARPGAIT_ROBOTS to the folder of {name}.xml; `warpgait validate` also takes a model to replay on "
        "with --model (if it is of another robot, its mass and legs differ from the plan's)."
    )


@dataclass(frozen=True)
class Composite:
    """The robot frozen in one posture, as one rigid body."""

    mass: float  # kg
    center_of_mass: Array  # (3,) m, from the base origin, base frame
    inertia: Array  # (3, 3) kg m², about the center of mass, base frame


@dataclass(frozen=True)
class Indices:
    """Where things are in MuJoCo's arrays. E feet, in the order of `feet`, each with J joints."""

    feet: tuple[str, ...]
    joints_of: tuple[tuple[str, ...], ...]  # names of the joints of each leg, from the base to the foot
    qpos: Integers  # (E, J) joint positions
    qvel: Integers  # (E, J) joint velocities
    actuator: Integers  # (E, J) motors
    geom: list[int]  # (E,) foot spheres
    site: list[int]  # (E,) foot centers
    body: list[int]  # (E,) bodies that carry them
    base: int  # base body
    radius: float  # m, of the feet
    torque_limit: Array  # (E, J) N m
    speed_limit: Array  # (E, J) rad/s
    power_limit: Array  # (E, J) W; where the model does not say, torque times speed
    size: float  # of the robot, in ANYmals

    @property
    def is_redundant(self) -> bool:
        """Whether the legs have many postures for a foot."""
        return bool(self.qvel.shape[1] > 3)

    @property
    def joint_names(self) -> list[str]:
        """The E·J joints, leg by leg."""
        return [name for names in self.joints_of for name in names]


def foot_of(body: str, feet: Iterable[str]) -> str | None:
    """The foot whose leg `body` is part of, if any."""
    return next((foot for foot in feet if body.startswith(foot)), None)


def adhesion_name(foot: str) -> str:
    """The name of the actuator that makes a foot stick."""
    return f"adhesion_{foot}"


def load_spec(path: Path, payload: Payload | None = None) -> Any:
    """The model as an editable `MjSpec`, with a payload if the robot carries one."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise InputError(f"{path}: not a usable MJCF model: {error}") from error
    if payload is not None:
        model = mujoco.MjSpec.from_file(str(path)).compile()
        data = mujoco.MjData(model)
        stand(model, data)
        place = composite(model, data).center_of_mass + payload.position
        inertia = [payload.mass * CARRIED_RADIUS**2] * 3
        spec.body("base").add_body(
            name=CARRIED, pos=place, ipos=[0, 0, 0], mass=payload.mass, inertia=inertia, explicitinertial=True
        )
    return spec


def load_robot(path: Path, gravity: Array, payload: Payload | None = None) -> Any:
    """The robot alone, with a payload if it carries one, in this gravity (3,) m/s², without contacts."""
    spec = load_spec(path, payload)
    spec.option.gravity = gravity
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    return spec.compile()


def foot_names(model: Any) -> tuple[str, ...]:
    """The feet of a model: its sites, in the order of the file."""
    return tuple(model.site(i).name for i in range(model.nsite))


def size_of(height: float) -> float:
    """Size of a robot whose center of mass stands `height` m above its contact points, in ANYmals; the ANYmals have 1."""
    return max(round(height / ANYMAL_HEIGHT / SIZE_STEP), 1) * SIZE_STEP


def _standing_height(model: Any, sites: list[int]) -> float:
    """Center of mass above the feet's centers in the nominal stance, m."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return float(data.subtree_com[model.body("base").id, 2] - data.site_xpos[sites, 2].mean())


def leg_joints(model: Any, foot: str) -> list[int]:
    """The joints between the base and the body that carries the site `foot`, from the base down."""
    found: list[int] = []
    body, base = int(model.site_bodyid[model.site(foot).id]), model.body("base").id
    while body not in (base, 0):
        first = model.body_jntadr[body]
        found[:0] = range(first, first + model.body_jntnum[body])
        body = int(model.body_parentid[body])
    hinges = all(model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_HINGE) for j in found)
    if len(found) not in JOINT_COUNTS or not hinges:
        names = ", ".join(model.joint(j).name for j in found) or "none"
        raise InputError(f"leg {foot}: its joints are {names}; the replay needs two to seven hinges between base and foot")
    return found


def motor_of(model: Any, joint: int) -> int:
    """The actuator of a joint."""
    at_joint = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    found = np.flatnonzero(at_joint & (model.actuator_trnid[:, 0] == joint))
    if len(found) != 1:
        raise InputError(f"joint {model.joint(joint).name}: has {len(found)} motors; the replay needs one")
    return int(found[0])


def numeric(model: Any, name: str) -> Array | None:
    """The custom numbers `name` of a model, if it has them."""
    return next((model.numeric(i).data.copy() for i in range(model.nnumeric) if model.numeric(i).name == name), None)


def _by_joint(values: Array, shape: tuple[int, ...], name: str) -> Array:
    """One number for all joints, or one for each, as (E, J)."""
    if values.size not in (1, shape[0] * shape[1]):
        raise InputError(
            f"the robot model's {name} has {values.size} numbers; allowed: 1, or {shape[0] * shape[1]}, one for each joint"
        )
    return np.broadcast_to(values if values.size == 1 else values.reshape(shape), shape).copy()


def indices(model: Any, feet: tuple[str, ...]) -> Indices:
    """Look up the parts of `feet`, or name the missing one."""
    try:
        numbers = [leg_joints(model, foot) for foot in feet]
        if len({len(leg) for leg in numbers}) > 1:
            counts = ", ".join(f"{foot} {len(leg)}" for foot, leg in zip(feet, numbers, strict=True))
            raise InputError(f"the legs have different numbers of joints: {counts}; the replay needs as many in all of them")
        joints = [[model.joint(j) for j in leg] for leg in numbers]
        motors = [[model.actuator(motor_of(model, j)) for j in leg] for leg in numbers]
        geoms = [model.geom(foot).id for foot in feet]
        sites, radius = [model.site(foot).id for foot in feet], float(model.geom_size[geoms[0], 0])
        torque_limit = np.array([[m.ctrlrange[1] for m in leg] for leg in motors])
        shape = torque_limit.shape
        speeds, powers = numeric(model, "joint_speed_limit"), numeric(model, "joint_power_limit")
        if speeds is None:
            raise InputError("the robot model lacks the custom numeric joint_speed_limit, rad/s")
        speed_limit = _by_joint(speeds, shape, "joint_speed_limit")
        return Indices(
            feet=feet,
            joints_of=tuple(tuple(j.name for j in leg) for leg in joints),
            qpos=np.array([[j.qposadr[0] for j in leg] for leg in joints]),
            qvel=np.array([[j.dofadr[0] for j in leg] for leg in joints]),
            actuator=np.array([[m.id for m in leg] for leg in motors]),
            geom=geoms,
            site=sites,
            body=[int(model.geom_bodyid[g]) for g in geoms],
            base=model.body("base").id,
            radius=radius,
            torque_limit=torque_limit,
            speed_limit=speed_limit,
            size=size_of(_standing_height(model, sites) + radius),
            power_limit=torque_limit * speed_limit if powers is None else _by_joint(powers, shape, "joint_power_limit"),
        )
    except KeyError as error:
        raise InputError(f"the robot model lacks a part that the replay needs (feet {', '.join(feet)}): {error}") from error


def merged(model: Any, data: Any, bodies: list[int]) -> tuple[float, Array, Array]:
    """Mass, center of mass and inertia about it, world frame, of `bodies` as one rigid body in the posture in `data`."""
    mass = float(model.body_mass[bodies].sum())
    center = model.body_mass[bodies] @ data.xipos[bodies] / mass
    inertia = np.zeros((3, 3))
    for b in bodies:
        R = data.ximat[b].reshape(3, 3)
        r = data.xipos[b] - center
        inertia += R @ np.diag(model.body_inertia[b]) @ R.T + model.body_mass[b] * (r @ r * np.eye(3) - np.outer(r, r))
    return mass, center, inertia


def composite(model: Any, data: Any) -> Composite:
    """Mass, center of mass and inertia of the posture in `data`, whose positions must be up to date."""
    base = model.body("base").id
    rotation = data.xmat[base].reshape(3, 3)
    mass, center, inertia = merged(model, data, list(range(1, model.nbody)))
    return Composite(mass, rotation.T @ (center - data.xpos[base]), rotation.T @ inertia @ rotation)


def stand(model: Any, data: Any) -> None:
    """Put `data` into the model's nominal stance."""
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    mujoco.mj_forward(model, data)
