"""What a robot's description says, in the terms of the planner: a base, and legs of two to seven hinges that end in feet.

Joints that belong to no leg (arms, heads, grippers, mimicking joints) are frozen, and their links are part of the link that carries them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from .arrays import Array
from .errors import InputError
from .inertia import nearest_inertia
from .model import JOINT_COUNTS, PITCH_ONLY, SAGITTAL, merged
from .shapes import boxes_around
from .urdf import Limits

FOOT_NAME = re.compile(r"foot|feet|toe|sole|contact|ankle|tip", re.IGNORECASE)
GROUND_BAND = (
    0.35  # a leaf link whose lowest point is within this fraction of the robot's height above the lowest one may reach the ground
)
SOLE = 3  # so many equal spheres on the last link, or more, are a sole: the foot is at their middle
MOST_FEET = 8
_ALIGNED = 1e-6  # of the direction of a joint axis
ON_THE_SPOT = 0.02  # of the leg: a foot whose center is nearer to the last axis is only turned by it
_INERTIA_ROUNDING = 0.01  # by how much a principal moment may exceed the sum of the other two, as a fraction


@dataclass(frozen=True)
class Shape:
    """A convex primitive in axes parallel to the base's, from the origin of its link."""

    kind: str  # sphere, capsule, cylinder or box
    center: Array  # (3,) m
    rotation: Array  # (3, 3)
    size: Array  # as MuJoCo has it: radius; radius and half length; half edges

    def corners(self) -> Array:
        """Corners (8, 3) of its oriented box, m."""
        half = {"sphere": self.size[[0, 0, 0]], "box": self.size}.get(self.kind)
        if half is None:
            half = np.array([self.size[0], self.size[0], self.size[1] + (self.size[0] if self.kind == "capsule" else 0)])
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        corners: Array = self.center + (signs * half) @ self.rotation.T
        return corners

    def lowest(self) -> float:
        """z of its lowest point, m."""
        if self.kind in ("sphere", "capsule"):
            along = abs(self.rotation[2, 2]) * (self.size[1] if self.kind == "capsule" else 0.0)
            return float(self.center[2] - along - self.size[0])
        return float(self.corners()[:, 2].min())


@dataclass(frozen=True)
class Link:
    """A link with all that is fixed to it; the joint that moves it, if it is not the base. Base axes at zero joint angles."""

    body: str
    joint: str
    anchor: Array  # (3,) m, from the base's origin
    axis: Array  # (3,)
    mass: float
    center: Array  # (3,) m, from the base's origin
    inertia: Array  # (3, 3) kg m²
    shapes: list[Shape]  # centers from the base's origin
    limits: Limits


@dataclass
class Leg:
    """Two to seven links from the base down, and the foot."""

    links: list[Link]
    foot: Array  # (3,) its center, from the base's origin at zero joint angles
    radius: float
    foot_body: str
    foot_shapes: list[Shape] = field(default_factory=list)  # replaced by the foot's sphere


@dataclass
class Skeleton:
    """A robot as the planner knows it."""

    path: Path
    base: Link
    legs: list[Leg]
    notes: list[str]
    key: dict[str, float]  # joint angles of a keyframe, by joint


class Reader:
    """Takes a compiled model apart."""

    def __init__(self, path: Path, model: Any, limits: dict[str, Limits], mimics: dict[str, str], notes: list[str]) -> None:
        """`limits` and `mimics` by joint; `notes` is added to."""
        self.path, self.model, self.limits, self.mimics, self.notes = path, model, limits, mimics, notes
        self.free = self._free_joint()
        self.base = int(model.jnt_bodyid[self.free])
        self.frozen: dict[int, float] = {}
        self.forward = 0.0  # rad, of the file's direction ahead from its x axis, about z
        self.data = mujoco.MjData(model)

    def _free_joint(self) -> int:
        free = np.flatnonzero(self.model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
        if len(free) != 1:
            raise InputError(
                f"{self.path}: {len(free)} bodies float freely; a robot has one, its base (MJCF: <freejoint/> in its body)"
            )
        return int(free[0])

    def name(self, body: int) -> str:
        """Of a body."""
        return str(self.model.body(body).name) or f"number {body}"

    def joint_name(self, joint: int) -> str:
        """Of a joint."""
        return str(self.model.joint(joint).name) or f"number {joint}"

    def joints_above(self, body: int) -> list[int]:
        """Joints that are not frozen between the base and a body, from the base down."""
        found: list[int] = []
        while body not in (self.base, 0):
            first = int(self.model.body_jntadr[body])
            found[:0] = [j for j in range(first, first + int(self.model.body_jntnum[body])) if j not in self.frozen]
            body = int(self.model.body_parentid[body])
        return found

    def carrier(self, body: int) -> int:
        """The body of the last joint above, or the base."""
        joints = self.joints_above(body)
        return int(self.model.jnt_bodyid[joints[-1]]) if joints else self.base

    def link_bodies(self, body: int) -> list[int]:
        """All bodies that move with the link of `body`."""
        of_robot = [b for b in range(1, self.model.nbody) if self._below(b, self.base)]
        return [b for b in of_robot if self.carrier(b) == body]

    def _below(self, body: int, above: int) -> bool:
        while body not in (above, 0):
            body = int(self.model.body_parentid[body])
        return body == above

    def collision_geoms(self, bodies: list[int]) -> list[int]:
        """Shapes that can touch anything."""
        m = self.model
        return [g for g in range(m.ngeom) if m.geom_bodyid[g] in bodies and (m.geom_contype[g] or m.geom_conaffinity[g])]

    def shape(self, g: int) -> Shape:
        """A geom as a primitive, in the world frame of the posture in `data`; what is no sphere, capsule or cylinder becomes a box."""
        m, kinds = self.model, mujoco.mjtGeom
        kind = int(m.geom_type[g])
        place, rotation = self.data.geom_xpos[g].copy(), self.data.geom_xmat[g].reshape(3, 3).copy()
        place = place - self.data.xpos[self.base]
        names = {int(kinds.mjGEOM_SPHERE): "sphere", int(kinds.mjGEOM_CAPSULE): "capsule", int(kinds.mjGEOM_CYLINDER): "cylinder"}
        if kind in names:
            size = m.geom_size[g][: 1 if names[kind] == "sphere" else 2].copy()
            return Shape(names[kind], place, rotation, size)
        if kind == int(kinds.mjGEOM_MESH):
            points, rotation = self._vertices(g)
            low, high = points.min(0), points.max(0)
            return Shape("box", place + rotation @ ((low + high) / 2), rotation, np.maximum((high - low) / 2, 1e-4))
        box = m.geom_aabb[g]
        return Shape("box", place + rotation @ box[:3], rotation, np.maximum(box[3:], 1e-4))

    def _vertices(self, g: int) -> tuple[Array, Array]:
        """Vertices of a mesh in its file's axes, from the geom's place, and those axes in the world. (MuJoCo turns a mesh into its principal axes,
        which are arbitrary for one that is nearly round.)"""
        m, mesh = self.model, int(self.model.geom_dataid[g])
        turned = np.zeros(9)
        mujoco.mju_quat2Mat(turned, m.mesh_quat[mesh])
        first, count = int(m.mesh_vertadr[mesh]), int(m.mesh_vertnum[mesh])
        turn = turned.reshape(3, 3)
        points: Array = m.mesh_vert[first : first + count].astype(float) @ turn.T
        return points, self.data.geom_xmat[g].reshape(3, 3) @ turn.T

    def shapes(self, g: int) -> list[Shape]:
        """A geom as one or more primitives: a mesh as boxes around parts of its convex hull."""
        m, whole = self.model, self.shape(g)
        if int(m.geom_type[g]) != int(mujoco.mjtGeom.mjGEOM_MESH):
            return [whole]
        place = self.data.geom_xpos[g] - self.data.xpos[self.base]
        points, rotation = self._vertices(g)
        return [
            Shape("box", place + rotation @ ((low + high) / 2), rotation, np.maximum((high - low) / 2, 1e-4))
            for low, high in boxes_around(points)
        ]

    def freeze(self, joint: int, angle: float) -> None:
        """Hold a joint at an angle."""
        self.frozen[joint] = angle

    def pose(self) -> None:
        """Put `data` into zero joint angles, the frozen joints at theirs, with the direction ahead along x."""
        self.data.qpos[:] = 0
        address = int(self.model.jnt_qposadr[self.free])
        self.data.qpos[address + 3 : address + 7] = [np.cos(self.forward / 2), 0, 0, -np.sin(self.forward / 2)]
        for joint in range(self.model.njnt):
            if self.model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_BALL):
                self.data.qpos[int(self.model.jnt_qposadr[joint])] = 1
        for joint, angle in self.frozen.items():
            self.data.qpos[int(self.model.jnt_qposadr[joint])] = angle
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def link(self, body: int, joint: int | None) -> Link:
        """The link of a body, in zero posture."""
        bodies = self.link_bodies(body)
        mass, center, inertia = merged(self.model, self.data, bodies)
        name, origin = self.name(body), self.data.xpos[self.base]
        moments = np.linalg.eigvalsh(inertia)
        if mass < 1e-4 or moments[0] <= 0:
            raise InputError(
                f'{self.path}: link "{name}": it has a mass of {mass:.3g} kg with all that is fixed to it; a link that moves has mass and inertia'
            )
        if moments[2] > (moments[0] + moments[1]) * (1 + _INERTIA_ROUNDING):
            raise InputError(f'{self.path}: link "{name}": no body has the principal moments of inertia {moments} kg m²')
        if moments[2] > moments[0] + moments[1]:
            inertia = nearest_inertia(inertia)
        return Link(
            body=name,
            joint="" if joint is None else self.joint_name(joint),
            anchor=np.zeros(3) if joint is None else self.data.xanchor[joint] - origin,
            axis=np.zeros(3) if joint is None else self.data.xaxis[joint].copy(),
            mass=mass,
            center=center - origin,
            inertia=inertia,
            shapes=[shape for g in self.collision_geoms(bodies) for shape in self.shapes(g)],
            limits=Limits() if joint is None else self.limits.get(self.joint_name(joint), Limits()),
        )


def moving_leaves(reader: Reader) -> list[int]:
    """Bodies with a joint below which nothing moves."""
    m = reader.model
    moving = [b for b in range(1, m.nbody) if reader.joints_above(b) and reader.carrier(b) == b]
    above = {int(m.jnt_bodyid[j]) for b in moving for j in reader.joints_above(b)[:-1]}
    return [b for b in moving if b not in above]


def _foot_bodies(reader: Reader, leaf: int, named: set[str]) -> list[int]:
    """The bodies of a leaf link that are its foot: those named by the user, or with a name like one."""
    bodies = reader.link_bodies(leaf)
    if named:
        return [b for b in bodies if reader.name(b) in named]
    return [b for b in bodies if FOOT_NAME.search(reader.name(b))]


def _lowest(reader: Reader, leaf: int, q: Array) -> float:
    """z of the lowest point of a leaf link, for angles q of all joints, m from the base's origin."""
    reader.data.qpos[:] = q
    mujoco.mj_kinematics(reader.model, reader.data)
    bodies = reader.link_bodies(leaf)
    points = [reader.shape(g).lowest() for g in reader.collision_geoms(bodies)]
    points += [float(reader.data.xpos[b][2] - reader.data.xpos[reader.base][2]) for b in bodies]
    return min(points)


def find_feet(reader: Reader, names: list[str], postures: list[Array]) -> list[int]:
    """The leaf links that are legs: those that the user's `names` name, or that reach the ground in one of `postures` (nq,)."""
    m = reader.model
    if names:
        known = {reader.name(b): b for b in range(1, m.nbody)}
        for name in names:
            if name not in known:
                raise InputError(f'--feet: {reader.path} has no link "{name}"; its links are {", ".join(known)}')
        return [reader.carrier(known[name]) for name in names]
    leaves = moving_leaves(reader)
    if not leaves:
        raise InputError(f"{reader.path}: no link moves: there are no legs")
    heights = [min(_lowest(reader, leaf, q) for q in postures) for leaf in leaves]
    floor = min(heights)
    feet = [leaf for leaf, height in zip(leaves, heights, strict=True) if height < floor * (1 - GROUND_BAND) and height < 0]
    like_feet = [leaf for leaf in feet if _foot_bodies(reader, leaf, set())]
    feet = like_feet if len(like_feet) >= 2 else feet
    if not 1 <= len(feet) <= MOST_FEET:
        raise InputError(
            f"{reader.path}: {len(feet)} links reach the ground ({', '.join(map(reader.name, feet)) or 'none'}); allowed: 1 to {MOST_FEET}. "
            "Name the feet: --feet LINK,LINK,…"
        )
    return feet


def foot_of(reader: Reader, leaf: int, named: set[str], radius: float | None) -> tuple[Array, float, int, list[int]]:
    """Center (from the base's origin, zero posture), radius, body, and the geoms that the foot replaces, of a leaf link's foot."""
    bodies = _foot_bodies(reader, leaf, named) or [leaf]
    body = bodies[-1]
    geoms = reader.collision_geoms(bodies)
    if not geoms:  # the foot is a mere frame: a sphere of its link may be what touches the ground
        sphere = int(mujoco.mjtGeom.mjGEOM_SPHERE)
        geoms = [g for g in reader.collision_geoms(reader.link_bodies(leaf)) if int(reader.model.geom_type[g]) == sphere]
    shapes = {g: reader.shape(g) for g in geoms}
    origin = reader.data.xpos[reader.base]
    anchor = reader.data.xanchor[reader.joints_above(leaf)[-1]] - origin
    spheres = [g for g in geoms if shapes[g].kind == "sphere"]
    if spheres:
        g = max(spheres, key=lambda g: float(np.linalg.norm(shapes[g].center - anchor)))
        alike = [
            s
            for s in spheres
            if reader.model.geom_bodyid[s] == reader.model.geom_bodyid[g] and shapes[s].size[0] == shapes[g].size[0]
        ]
        ends = alike if len(alike) >= SOLE else [g]
        return np.mean([shapes[s].center for s in ends], axis=0), float(radius or shapes[g].size[0]), body, ends
    if geoms and (body != leaf or reader.name(leaf) in named):
        # A sphere of the size of the lowest shape, at its lower end.
        g = min(geoms, key=lambda g: shapes[g].lowest())
        shape = shapes[g]
        size = float(radius or _thickness(shape))
        center = shape.center.copy()
        if shape.kind == "capsule" and abs(shape.rotation[2, 2]) > 0.5:
            center = shape.center - np.sign(shape.rotation[2, 2]) * shape.size[1] * shape.rotation[:, 2]
        else:
            center[2] = shape.lowest() + size
        return center, size, body, geoms
    if body != leaf and radius is not None:
        return reader.data.xpos[body] - origin, radius, body, geoms
    if body != leaf:
        raise InputError(
            f'{reader.path}: link "{reader.name(body)}": a foot without a collision shape; give the radius of its sphere: --foot-radius M'
        )
    if not geoms:
        raise InputError(
            f'{reader.path}: link "{reader.name(leaf)}": a leg that ends without a collision shape; name the link of the foot: --feet LINK,…'
        )
    g = max(geoms, key=lambda g: float(np.linalg.norm(shapes[g].corners() - anchor, axis=1).max()))
    shape = shapes[g]
    far = shape.corners()
    far = far[np.argsort(-np.linalg.norm(far - anchor, axis=1))[:4]].mean(0)
    size = float(radius or _thickness(shape))
    return far + (anchor - far) / np.linalg.norm(anchor - far) * size, size, body, []


def _thickness(shape: Shape) -> float:
    """Radius of a ball as thick as a shape."""
    if shape.kind == "box":
        return float(np.sort(shape.size)[1])
    return float(shape.size[0])


def leg_of(reader: Reader, leaf: int, named: set[str], radius: float | None) -> Leg:
    """The leg that ends in a leaf link; refuses one that has not two to seven hinges."""
    m = reader.model
    joints = reader.joints_above(leaf)
    names = ", ".join(reader.joint_name(j) for j in joints)
    for j in joints:
        if m.jnt_type[j] != int(mujoco.mjtJoint.mjJNT_HINGE):
            raise InputError(
                f'{reader.path}: joint "{reader.joint_name(j)}" of the leg to "{reader.name(leaf)}" is no hinge; legs have hinges only'
            )
        if reader.joint_name(j) in reader.mimics:
            raise InputError(
                f'{reader.path}: joint "{reader.joint_name(j)}" of the leg to "{reader.name(leaf)}" follows "{reader.mimics[reader.joint_name(j)]}" (mimic); '
                "legs have independent joints only"
            )
    if len(joints) not in JOINT_COUNTS:
        extra = len(joints) - max(JOINT_COUNTS)
        hint = f"; hold {extra} of them still: --freeze JOINT=ANGLE, once for each" if extra > 0 else ""
        raise InputError(
            f'{reader.path}: the leg to "{reader.name(leaf)}" has {len(joints)} joints ({names}); allowed: two to seven{hint}'
        )
    center, size, body, replaced = foot_of(reader, leaf, named, radius)
    links = [reader.link(int(m.jnt_bodyid[j]), j) for j in joints]
    end = links[-1]
    if np.linalg.norm(np.cross(center - end.anchor, end.axis)) < ON_THE_SPOT * np.linalg.norm(center - links[0].anchor):
        raise InputError(
            f'{reader.path}: joint "{end.joint}" turns the foot of the leg to "{reader.name(leaf)}" on the spot, as that of a wheel does; '
            f"hold it still: --freeze {end.joint}"
        )
    if len(links) == SAGITTAL and any(abs(link.axis[1]) < 1 - _ALIGNED for link in links):
        axes = " and ".join(str(np.round(link.axis, 3).tolist()) for link in links)
        raise InputError(
            f'{reader.path}: the leg to "{reader.name(leaf)}": {PITCH_ONLY}; the axes of {names} are {axes}; if the robot does not face along x, say where: --forward'
        )
    gone = [shape for g in replaced for shape in reader.shapes(g)]
    last = links[-1]
    kept = [s for s in last.shapes if not any(np.array_equal(s.center, f.center) and s.kind == f.kind for f in gone)]
    last.shapes[:] = kept
    return Leg(links, center, size, reader.name(body), gone)
