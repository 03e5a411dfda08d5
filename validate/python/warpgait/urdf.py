"""URDF made readable for MuJoCo's compiler: what it would misread is refused or put right here, by the name of the link.

MuJoCo takes the root link for a part of the world, ignores speed limits, and stops at meshes that are not there, at COLLADA, and at links without
mass. Here visual shapes are left out, and boxes take the place of each mesh of a collision shape.
"""

from __future__ import annotations

import copy
import os
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import Array
from .errors import InputError
from .inertia import MENDED, nearest_inertia
from .shapes import boxes_around, mesh_points

LEAST_MASS = (
    1e-6  # kg: MuJoCo refuses a moving link with less; whether a link with all that is fixed to it has mass is judged later
)
NO_MASS = 1e-9  # kg: frames that were exported with a mass of rounding errors have none
LIGHT = 0.02  # of the robot's mass: a link that is fixed to another and lighter may be a point mass
MOMENT_ROUNDING = (
    0.01  # by how much a principal moment may exceed the sum of the other two, as a fraction: files have rounded numbers
)
_SINGLE = (
    "origin",
    "axis",
    "parent",
    "child",
    "limit",
    "mimic",
    "inertial",
    "mass",
    "inertia",
    "geometry",
)  # at most one in an element
_VECTORS = {
    "origin": {"xyz": 3, "rpy": 3},
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}  # how many numbers the attributes of an element have
_SIZED = ("box", "sphere", "cylinder", "capsule")


@dataclass
class Limits:
    """Of a joint, as far as the file has them."""

    range: tuple[float, float] | None = None  # rad
    speed: float | None = None  # rad/s
    torque: float | None = None  # N m


@dataclass
class Urdf:
    """A URDF for MuJoCo."""

    text: str
    limits: dict[str, Limits] = field(default_factory=dict)  # by joint
    mimics: dict[str, str] = field(default_factory=dict)  # joint → the joint that it follows
    notes: list[str] = field(default_factory=list)


def read_urdf(path: Path, content: bytes, without_meshes: bool, mend_inertias: bool = False) -> Urdf:
    """Read a URDF. `without_meshes`: collision shapes whose meshes are not there are left out instead of refused; `mend_inertias`: impossible
    inertias are replaced."""
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        raise InputError(f"{path}:{error.position[0]}: not XML: {error}") from error
    if root.tag != "robot":
        raise InputError(f"{path}: the root element is <{root.tag}>; that of a URDF is <robot>, that of MJCF <mujoco>")
    if any("xacro" in element.tag or any("${" in value for value in element.attrib.values()) for element in root.iter()):
        raise InputError(f"{path}: this is xacro, not URDF; expand it first: xacro {path.name} > robot.urdf")
    links = _links(path, root)
    _judge_elements(path, root)
    _unfasten(path, root, links, _tree(path, root, links))
    found = Urdf("")
    rigid = _rigid(root)
    total = sum(_mass(path, link) for link in links.values())
    mended = []
    for link in links.values():
        if _inertial(path, link, rigid, total, mend_inertias, found.notes):
            mended.append(f'"{link.attrib["name"]}"')
        for visual in link.findall("visual"):
            link.remove(visual)
        _collisions(path, link, without_meshes, found.notes)
    if mended:
        found.notes.append(f"link {', '.join(mended)}: {MENDED}")
    for joint in root.findall("joint"):
        _joint(path, joint, found)
    for extra in ("transmission", "gazebo", "mujoco", "sensor"):
        for element in root.findall(extra):
            root.remove(element)
    compiler = ET.SubElement(ET.SubElement(root, "mujoco"), "compiler")
    compiler.attrib.update(fusestatic="false", discardvisual="false", inertiafromgeom="false", balanceinertia="true")
    compiler.attrib.update(boundmass=f"{LEAST_MASS:g}", boundinertia="1e-12", strippath="false", angle="radian")
    found.text = ET.tostring(root, encoding="unicode")
    return found


def _links(path: Path, root: ET.Element) -> dict[str, ET.Element]:
    links: dict[str, ET.Element] = {}
    for link in root.findall("link"):
        name = link.attrib.get("name", "")
        if not name or name in links:
            raise InputError(f'{path}: link "{name}": every link needs a name that no other link has')
        links[name] = link
    if not links:
        raise InputError(f"{path}: there are no links")
    return links


def _judge_elements(path: Path, root: ET.Element) -> None:
    """Refuse what a link or joint has twice, and places, axes and sizes that are none. MuJoCo's messages have no names and lines of another text."""
    for owner in [*root.findall("link"), *root.findall("joint")]:
        where = f'{owner.tag} "{owner.attrib.get("name", "")}"'
        seen = [part for part in owner if part.tag in ("inertial", "collision", "origin")]  # others are left out, or judged later
        for element in [owner, *(e for part in seen for e in part.iter())]:
            _judge_element(path, where, element)
        axis = owner.find("axis")
        moves = owner.attrib.get("type") in ("revolute", "continuous", "prismatic")
        if moves and axis is not None and not np.any(_vector(path, where, axis, "xyz", 3)):
            raise InputError(f"{path}: {where}: its axis has no direction: {axis.attrib['xyz']}")


def _judge_element(path: Path, where: str, element: ET.Element) -> None:
    for tag in _SINGLE:
        found = element.findall(tag)
        if any(ET.tostring(other).split() != ET.tostring(found[0]).split() for other in found[1:]):
            raise InputError(f"{path}: {where}: there are {len(found)} different <{tag}> in one <{element.tag}>; allowed: 1")
        for other in found[1:]:
            element.remove(other)
    if element.tag == "geometry" and not (len(element) == 1 and element[0].tag in (*_SIZED, "mesh")):
        given = ", ".join(f"<{shape.tag}>" for shape in element) or "nothing"
        raise InputError(f"{path}: {where}: a collision shape is {given}; allowed: one of {', '.join((*_SIZED, 'mesh'))}")
    for key, count in _VECTORS.get(element.tag, {}).items():
        if element.tag in _SIZED and key not in element.attrib:
            raise InputError(f"{path}: {where}: <{element.tag}> has no {key}")
        if element.attrib.get(key):
            _vector(path, where, element, key, count)


def _vector(path: Path, where: str, element: ET.Element, key: str, count: int) -> Array:
    text = element.attrib.get(key) or "1 0 0"
    try:
        values = np.array(text.split(), float)
    except ValueError:
        values = np.array([])
    if values.shape != (count,) or not np.isfinite(values).all():
        numbers = "1 number" if count == 1 else f"{count} numbers"
        raise InputError(f'{path}: {where}: <{element.tag}> has {key} = "{text}"; allowed: {numbers}')
    if element.tag in _SIZED and (values <= 0).any():
        raise InputError(f'{path}: {where}: <{element.tag}> has {key} = "{text}"; allowed: above 0')
    return values


def _tree(path: Path, root: ET.Element, links: dict[str, ET.Element]) -> str:
    """Refuse links that do not form a tree; returns the root link."""
    parent_of: dict[str, str] = {}
    joints: set[str] = set()
    for joint in root.findall("joint"):
        name = joint.attrib.get("name", "")
        if not name or name in joints:
            raise InputError(f'{path}: joint "{name}": every joint needs a name that no other joint has')
        joints.add(name)
        ends = [joint.find(end) for end in ("parent", "child")]
        names = ["" if end is None else end.attrib.get("link", "") for end in ends]
        for end, link in zip(("parent", "child"), names, strict=True):
            if link not in links:
                raise InputError(f'{path}: joint "{name}": its {end} link "{link}" is not in the file')
        parent, child = names
        if child in parent_of:
            raise InputError(
                f'{path}: link "{child}" has two parents, "{parent_of[child]}" and "{parent}": closed loops are not supported'
            )
        parent_of[child] = parent
    for link in links:
        seen, at = {link}, link
        while at in parent_of:
            at = parent_of[at]
            if at in seen:
                raise InputError(f'{path}: link "{at}" is its own ancestor: the joints form a cycle')
            seen.add(at)
    roots = [link for link in links if link not in parent_of]
    if len(roots) > 1:
        raise InputError(
            f"{path}: no joint leads to the links {', '.join(roots[1:])}; one link is the root, here {roots[0]}, and has no parent"
        )
    return roots[0]


def _unfasten(path: Path, root: ET.Element, links: dict[str, ET.Element], top: str) -> None:
    """Take away a world that the robot floats in: MuJoCo's root link is made to float anyway."""
    for joint in [j for j in root.findall("joint") if j.attrib.get("type") == "floating"]:
        ends = [joint.find(end) for end in ("parent", "child")]
        parent, child = ("" if end is None else end.attrib["link"] for end in ends)
        name = joint.attrib.get("name", "")
        if parent != top or len(links[top]):
            raise InputError(
                f'{path}: joint "{name}": only the whole robot floats, in an empty root link; "{child}" cannot float off "{parent}"'
            )
        root.remove(joint)
        root.remove(links.pop(top))


def _number(path: Path, where: str, element: ET.Element, key: str, default: str = "0") -> float:
    text = element.attrib.get(key, default)
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f'{path}: {where}: {key} = "{text}"; allowed: a number')
    return value


def _rigid(root: ET.Element) -> set[str]:
    """Links that are fixed to another."""
    fixed = [joint for joint in root.findall("joint") if joint.attrib.get("type") == "fixed"]
    return {joint.find(end).attrib["link"] for joint in fixed for end in ("parent", "child")}  # type: ignore[union-attr]


def _mass(path: Path, link: ET.Element) -> float:
    mass = link.find("inertial/mass")
    value = 0.0 if mass is None else _number(path, f'link "{link.attrib["name"]}"', mass, "value")
    if value < 0:
        raise InputError(f'{path}: link "{link.attrib["name"]}": its mass is {value:g} kg; allowed: none below 0')
    return value


def _inertial(path: Path, link: ET.Element, rigid: set[str], total: float, mend: bool, notes: list[str]) -> bool:
    """Refuse inertias that no body has, or `mend` them; returns whether it did. A light link that is fixed to another is taken for a point mass then."""
    name = link.attrib["name"]
    where = f'link "{name}"'
    inertial, mass = link.find("inertial"), _mass(path, link)
    if inertial is None:
        return False
    tensor = inertial.find("inertia")
    if mass < NO_MASS:
        link.remove(inertial)
        return False
    light = name in rigid and mass <= LIGHT * total
    if tensor is None:
        raise InputError(f"{path}: {where}: it has a mass but no inertia")
    xx, yy, zz, xy, xz, yz = (_number(path, where, tensor, f"i{k}") for k in ("xx", "yy", "zz", "xy", "xz", "yz"))
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments = np.linalg.eigvalsh(inertia)
    rounding = MOMENT_ROUNDING * abs(moments).sum()
    if moments[0] < -rounding or moments[2] > moments[0] + moments[1] + rounding:
        what = f"no body has the principal moments of inertia {_words(moments)} kg m²"
        if mend:
            nearest = nearest_inertia(inertia)
            tensor.attrib.update({f"i{'xyz'[i]}{'xyz'[j]}": f"{nearest[i, j]:.9g}" for i in range(3) for j in range(i, 3)})
            return True
        if not light:
            raise InputError(
                f"{path}: {where}: {what}; none may be negative, nor larger than the sum of the other two. Put it right, or take the nearest that a body "
                "has: --mend-inertias"
            )
        notes.append(f"{where}: {what}; it is taken for a point mass")
        tensor.attrib.update(ixx="0", iyy="0", izz="0", ixy="0", ixz="0", iyz="0")
    return False


def _words(values: Any) -> str:
    return ", ".join(f"{v:.3g}" for v in values)


def resolve(name: str, folder: Path) -> Path | None:
    """The file of a mesh: relative to the URDF, or in a package whose folder is above the URDF or below one of $ROS_PACKAGE_PATH."""
    if name.startswith("file://"):
        name = name.removeprefix("file://")
    if not name.startswith(("package://", "model://")):
        found = (folder / name).resolve()
        return found if found.is_file() else None
    package, _, rest = name.split("://", 1)[1].partition("/")
    above = [folder.resolve(), *folder.resolve().parents]
    named = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    places = [p for p in above if p.name == package] + [p / package for p in (*above, *named)]
    return next((p / rest for p in places if (p / rest).is_file()), None)


def _collisions(path: Path, link: ET.Element, without_meshes: bool, notes: list[str]) -> None:
    """Put boxes in the place of each mesh."""
    name = link.attrib["name"]
    for collision in link.findall("collision"):
        geometry = collision.find("geometry")
        mesh = None if geometry is None else geometry.find("mesh")
        if geometry is None or mesh is None:
            continue
        file = mesh.attrib.get("filename", "")
        found = resolve(file, path.parent)
        if found is None:
            if not without_meshes:
                raise InputError(
                    f'{path}: link "{name}": its collision mesh {file} is not there; put it in its place (a package:// is looked for above the '
                    "URDF and in $ROS_PACKAGE_PATH), or leave out such shapes with --without-meshes"
                )
            link.remove(collision)
            notes.append(f'link "{name}": its collision mesh {file} is not there and is left out')
            continue
        scale = np.array((mesh.attrib.get("scale") or "1 1 1").split(), float)
        geometry.remove(mesh)
        link.remove(collision)
        for low, high in boxes_around(mesh_points(found) * scale):
            box = copy.deepcopy(collision)
            box.attrib.pop("name", None)
            shape = box.find("geometry")
            if shape is not None:
                ET.SubElement(shape, "box", size=" ".join(f"{v:.9g}" for v in np.maximum(high - low, 1e-4)))
            _move_origin(box, (low + high) / 2)
            link.append(box)


def _move_origin(collision: ET.Element, by: Array) -> None:
    """Move a shape by `by`, in its own axes."""
    origin = collision.find("origin")
    if origin is None:
        origin = ET.SubElement(collision, "origin")
    place = np.array((origin.attrib.get("xyz") or "0 0 0").split(), float)
    roll, pitch, yaw = np.array((origin.attrib.get("rpy") or "0 0 0").split(), float)
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    origin.attrib["xyz"] = " ".join(f"{v:.9g}" for v in place + Rz @ Ry @ Rx @ by)


def _joint(path: Path, joint: ET.Element, found: Urdf) -> None:
    """Note the limits of a joint."""
    name, kind = joint.attrib.get("name", ""), joint.attrib.get("type", "")
    known = ("revolute", "continuous", "prismatic", "fixed", "floating")
    if kind not in known:
        raise InputError(f'{path}: joint "{name}": its type is "{kind}"; allowed: {", ".join(known)}')
    mimic = joint.find("mimic")
    if mimic is not None:
        found.mimics[name] = mimic.attrib.get("joint", "")
        joint.remove(mimic)
    if kind not in ("revolute", "continuous", "prismatic"):
        return
    limits, limit = Limits(), joint.find("limit")
    where = f'joint "{name}"'
    if limit is not None:
        lower, upper = (_number(path, where, limit, key) for key in ("lower", "upper"))
        if kind != "continuous" and lower < upper:
            limits.range = (lower, upper)
        limits.speed = _number(path, where, limit, "velocity") or None
        limits.torque = _number(path, where, limit, "effort") or None
        joint.remove(limit)  # judged here; MuJoCo refuses some
    if kind == "revolute":
        joint.attrib["type"] = "continuous"
    found.limits[name] = limits
