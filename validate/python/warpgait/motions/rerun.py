"""Recordings of Rerun (`.rrd`): the robot's shapes moving, forces, joints over time, and the ground."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..arrays import Array
from ..files import replacing
from .format import Format
from .motion import Motion, xyzw

_FORCE_SCALE = 0.5  # m of an arrow for a force of m g
_FORCE_COLOR = (26, 115, 217)
_GROUND_COLOR = (190, 175, 150)


def _triangles(rows: int, columns: int) -> Array:
    """Two for each cell of a grid whose points are numbered by rows, seen from above counter-clockwise."""
    first = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).ravel()
    corners = [[0, 1, columns + 1], [0, columns + 1, columns]]
    found: Array = np.concatenate([first[:, None] + corner for corner in corners])
    return found


def _shapes(rerun: Any, stream: Any, motion: Motion) -> None:
    """The robot's shapes in the frames of their bodies."""
    model = motion.model
    for g in range(model.ngeom):
        body, kind, size = int(model.geom_bodyid[g]), int(model.geom_type[g]), model.geom_size[g]
        place = {"quaternions": [rerun.Quaternion(xyzw=xyzw(model.geom_quat[g]))], "colors": [model.geom_rgba[g]]}
        at = [model.geom_pos[g]]
        if body == 0:
            continue
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            shape = rerun.Boxes3D(half_sizes=[size], centers=at, fill_mode="solid", **place)
        elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            shape = rerun.Ellipsoids3D(half_sizes=[np.full(3, size[0])], centers=at, fill_mode="solid", **place)
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            shape = rerun.Cylinders3D(lengths=[2 * size[1]], radii=[size[0]], centers=at, fill_mode="solid", **place)
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            # It begins at its origin and goes along z.
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[g])
            shape = rerun.Capsules3D(lengths=[2 * size[1]], radii=[size[0]], translations=[at[0] - size[1] * turn[2::3]], **place)
        else:
            continue
        stream.log(f"world/robot/{model.body(body).name}/shape_{g}", shape, static=True)


def _write(motion: Motion, target: Path) -> None:
    rerun = FORMAT.require("rerun", "rerun-sdk")
    with replacing(target) as temporary:
        stream = rerun.RecordingStream(f"warpgait {motion.name}")
        stream.save(temporary)
        times = rerun.TimeColumn("time", duration=motion.t)

        def over_time(path: str, columns: Any) -> None:
            stream.send_columns(path, [times], columns)

        stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log("facts", rerun.TextDocument(FORMAT.facts_json(motion), media_type="application/json"), static=True)
        ground = motion.ground
        rows, columns = ground.heights.shape
        x, y = (ground.origin[axis] + ground.spacing[axis] * np.arange(count) for axis, count in ((0, columns), (1, rows)))
        points = np.stack([*np.meshgrid(x, y), ground.heights], -1).reshape(-1, 3)
        mesh = rerun.Mesh3D(vertex_positions=points, triangle_indices=_triangles(rows, columns), albedo_factor=_GROUND_COLOR)
        stream.log("world/ground", mesh, static=True)
        if motion.joint_names:
            _shapes(rerun, stream, motion)
        bodies = motion.body_names or ("base",)
        places = motion.body_position if motion.body_names else motion.base_position[:, None]
        turns = motion.body_quaternion_wxyz if motion.body_names else motion.base_quaternion_wxyz[:, None]
        for b, body in enumerate(bodies):
            pose = rerun.Transform3D.columns(translation=places[:, b], quaternion=xyzw(turns[:, b]))
            over_time(f"world/robot/{body}", pose)
        weight = max(float(np.linalg.norm(motion.foot_force.sum(1), axis=-1).mean()), 1e-9)
        for e, foot in enumerate(motion.foot_names):
            path, force = f"world/feet/{foot}", motion.foot_force[:, e]
            stream.log(path, rerun.Arrows3D.from_fields(colors=[_FORCE_COLOR], radii=[0.008]), static=True)
            arrows = rerun.Arrows3D.columns(origins=motion.contact_position[:, e], vectors=_FORCE_SCALE / weight * force)
            over_time(path, arrows)
            for axis, values in zip("xyz", force.T, strict=True):
                over_time(f"force/{foot}/{axis}", rerun.Scalars.columns(scalars=values))
        for j, joint in enumerate(motion.joint_names):
            quantities = {"position": motion.joint_position, "velocity": motion.joint_velocity, "torque": motion.joint_torque}
            for name, values in quantities.items():
                over_time(f"joint_{name}/{joint}", rerun.Scalars.columns(scalars=values[:, j]))
        stream.flush()
        stream.disconnect()


FORMAT = Format(
    name="rerun",
    purpose="the Rerun viewer",
    ending=".rrd",
    write=_write,
    conventions={
        "quaternions": "xyzw, as in Rerun",
        "transforms": "every body is a child of world; arrows of forces begin in the contact points",
        "numbers": "places in single precision, joints and forces in double",
    },
    joints=False,
    ground=True,
    extra="rerun",
)
