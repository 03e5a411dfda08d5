"""Boxes around meshes: STL, OBJ and COLLADA. Only places of vertices are read: what collides is their convex hull, as in MuJoCo."""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from .arrays import Array
from .errors import InputError

LARGEST_MESH = 256 << 20  # bytes
MOST_BOXES = 4  # around one mesh


def boxes_around(points: Array) -> list[tuple[Array, Array]]:
    """Boxes, each with its least and its greatest corner (3,), that cover the convex hull of points (M, 3).

    A long hull is cut across its longest edge; each piece gets a box of its own, so that a thin shank with a thick knee is not as thick all
    along.
    """
    low, high = points.min(0), points.max(0)
    edges = np.sort(high - low)
    count = int(np.clip(np.round(2 * edges[2] / max(edges[1], 1e-9)) - 1, 1, MOST_BOXES))
    axis = int(np.argmax(high - low))
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # flat, or too few points
        return [(low, high)]
    if count == 1:
        return [(low, high)]
    corners = points[hull.simplices]  # (F, 3, 3)
    starts, ends = corners.reshape(-1, 3), np.roll(corners, 1, axis=1).reshape(-1, 3)
    planes = np.linspace(low[axis], high[axis], count + 1)
    cuts = []
    for plane in planes[1:-1]:
        crossing = (starts[:, axis] - plane) * (ends[:, axis] - plane) < 0
        a, b = starts[crossing], ends[crossing]
        cuts.append(a + (b - a) * ((plane - a[:, axis]) / (b[:, axis] - a[:, axis]))[:, None])
    boxes = []
    for k in range(count):
        inside = starts[(starts[:, axis] >= planes[k]) & (starts[:, axis] <= planes[k + 1])]
        piece = np.concatenate([inside, *cuts[max(k - 1, 0) : k + 1]])
        least, greatest = piece.min(0), piece.max(0)
        least[axis], greatest[axis] = planes[k], planes[k + 1]
        boxes.append((least, greatest))
    return boxes


def mesh_points(path: Path) -> Array:
    """The vertices (M, 3) of a mesh, in its file's units; those of COLLADA in m, z up."""
    readers = {".stl": _stl, ".obj": _obj, ".dae": _collada}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: a mesh of this kind is not read; allowed: {', '.join(readers)}")
    if path.stat().st_size > LARGEST_MESH:
        raise InputError(f"{path}: the mesh is larger than {LARGEST_MESH >> 20} MiB")
    try:
        points = reader(path.read_bytes())
    except (ValueError, struct.error, ET.ParseError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: not a mesh that can be read: {error}") from error
    if not len(points) or not np.isfinite(points).all():
        raise InputError(f"{path}: the mesh has no vertices, or some that are not finite")
    return points


def _stl(content: bytes) -> Array:
    count = struct.unpack_from("<I", content, 80)[0] if len(content) >= 84 else -1
    if len(content) == 84 + 50 * count:
        triangles = np.frombuffer(
            content, np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("more", "<u2")]), count, 84
        )
        return triangles["corner"].reshape(-1, 3).astype(float)
    lines = (line.split() for line in content.decode("ascii", "replace").splitlines())
    return np.array([[float(x) for x in words[1:4]] for words in lines if words[:1] == ["vertex"]]).reshape(-1, 3)


def _obj(content: bytes) -> Array:
    lines = (line.split() for line in content.decode("utf-8", "replace").splitlines())
    return np.array([[float(x) for x in words[1:4]] for words in lines if words[:1] == ["v"]]).reshape(-1, 3)


def _collada(content: bytes) -> Array:
    root = ET.fromstring(content)
    for element in root.iter():  # without name spaces
        element.tag = element.tag.rsplit("}", 1)[-1]
    unit = root.find("asset/unit")
    scale = float(unit.attrib.get("meter", "1")) if unit is not None else 1.0
    axis = (root.findtext("asset/up_axis") or "Y_UP").strip()
    up = {
        "X_UP": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
        "Y_UP": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
        "Z_UP": np.eye(3),
    }[axis]
    meshes = {geometry.attrib["id"]: _positions(geometry) for geometry in root.iter("geometry")}
    points: list[Array] = []
    scenes = list(root.iter("visual_scene"))
    for node in (node for scene in scenes for node in scene.findall("node")):
        _collect(node, np.eye(4), meshes, points)
    if not scenes:
        points = list(meshes.values())
    found: Array = scale * np.concatenate([np.empty((0, 3)), *points]) @ up.T
    return found


def _positions(geometry: ET.Element) -> Array:
    """Vertices of a geometry: what its `vertices` name as positions."""
    named = {i.attrib["source"].lstrip("#") for i in geometry.iter("input") if i.attrib.get("semantic") == "POSITION"}
    found = [np.empty((0, 3))]
    for source in geometry.iter("source"):
        if source.attrib.get("id") in named:
            found.append(np.array((source.findtext("float_array") or "").split(), float).reshape(-1, 3))
    return np.concatenate(found)


def _collect(node: ET.Element, above: Array, meshes: dict[str, Array], points: list[Array]) -> None:
    """Add the vertices below a node of a scene, turned and moved as the scene has them."""
    place = above
    for element in node:
        numbers = (
            np.array((element.text or "").split(), float) if element.tag in ("matrix", "translate", "scale", "rotate") else None
        )
        own = np.eye(4)
        if element.tag == "matrix" and numbers is not None:
            own = numbers.reshape(4, 4)
        elif element.tag == "translate" and numbers is not None:
            own[:3, 3] = numbers
        elif element.tag == "scale" and numbers is not None:
            own[:3, :3] = np.diag(numbers)
        elif element.tag == "rotate" and numbers is not None:
            own[:3, :3] = _turn(numbers[:3], np.deg2rad(numbers[3]))
        place = place @ own
    for instance in node.findall("instance_geometry"):
        vertices = meshes.get(instance.attrib["url"].lstrip("#"), np.empty((0, 3)))
        points.append(vertices @ place[:3, :3].T + place[:3, 3])
    for child in node.findall("node"):
        _collect(child, place, meshes, points)


def _turn(axis: Array, angle: float) -> Array:
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: Array = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return turn
