"""A leg as a chain of joints, read from a model: the facts of `[feet.leg]` and `[[feet.leg.joints]]` in a robot file.

All vectors are in axes parallel to the base's at zero joint angles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from .arrays import Array
from .model import Indices, merged


@dataclass(frozen=True)
class Joint:
    """A joint, and the link that it moves with all that is fixed to it."""

    name: str
    position: Array  # (3,) m, from the joint before; of the first, from the base's origin
    axis: Array  # (3,)
    range: Array  # (2,) rad
    speed_limit: float  # rad/s
    torque_limit: float  # N m
    mass: float  # kg
    center: Array  # (3,) m, from the joint
    inertia: Array  # (3, 3) kg m², about that center
    radius: float | None = None  # m, of the link's parts around the line to the next joint, where they could hit the ground


@dataclass(frozen=True)
class Chain:
    """A leg from the base to the foot."""

    joints: tuple[Joint, ...]
    foot: Array  # (3,) m, the foot's center from the last joint
    stance: Array  # (J,) rad, the joint angles of the nominal stance


def at_zero(model: Any) -> Any:
    """MuJoCo's data with the base at the origin, unturned, and all joint angles zero."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    data.qpos[3] = 1
    mujoco.mj_forward(model, data)
    return data


def rigid_bodies(model: Any, body: int) -> list[int]:
    """`body` and the bodies that are fixed to it."""
    found = [body]
    for b in range(body + 1, model.nbody):
        if model.body_parentid[b] in found and model.body_jntnum[b] == 0:
            found.append(b)
    return found


def link_radius(model: Any, data: Any, joint: Joint, end: Array) -> float | None:
    """Of a link's shapes around the line from the point of its joint's axis next to `end` (3,) to that, its next joint, m; none without shapes."""
    number = model.joint(joint.name).id
    bodies = rigid_bodies(model, int(model.jnt_bodyid[number]))
    start = joint.axis * (joint.axis @ end)
    line = end - start
    radii = []
    for g in np.flatnonzero(np.isin(model.geom_bodyid, bodies)):
        center = data.geom_xpos[g] - data.xanchor[number] - start
        along = np.clip(center @ line / max(line @ line, 1e-12), 0.0, 1.0)
        # Across its longest extent.
        thickness = float(np.sort(model.geom_aabb[g, 3:])[1])
        radii.append(thickness + float(np.linalg.norm(center - along * line)))
    return max(radii, default=None)


def chains(model: Any, index: Indices, stance: Array) -> list[Chain]:
    """The legs of `model`, whose joint angles in the nominal stance are `stance` (E, J)."""
    data = at_zero(model)
    result = []
    for e, names in enumerate(index.joints_of):
        joints, before = [], data.xpos[index.base].copy()
        for j, name in enumerate(names):
            joint = model.joint(name).id
            anchor = data.xanchor[joint].copy()
            mass, center, inertia = merged(model, data, rigid_bodies(model, int(model.jnt_bodyid[joint])))
            joints.append(
                Joint(
                    name=name,
                    position=anchor - before,
                    axis=data.xaxis[joint].copy(),
                    range=model.jnt_range[joint].copy(),
                    speed_limit=float(index.speed_limit[e, j]),
                    torque_limit=float(index.torque_limit[e, j]),
                    mass=mass,
                    center=center - anchor,
                    inertia=inertia,
                )
            )
            before = anchor
        for j in range(2, len(joints) - 1):
            joints[j] = replace(joints[j], radius=link_radius(model, data, joints[j], joints[j + 1].position))
        foot = data.site_xpos[index.site[e]] - before
        result.append(Chain(tuple(joints), foot, stance[e].copy()))
    return result
