"""Messages of ROS for recordings: tf, joint states, odometry, wrenches, forces, and the ground.

Every frame of tf is a child of `world`: the bodies by their names, and `FOOT_contact`, which lies in the contact point of a foot with the axes
of the world; wrenches are in it. The robot's shapes are markers that move with the frames. The ground comes once, as a grid map and as points.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from ..arrays import Array
from .motion import Motion, turned_back, xyzw

_GRID_MAP = "grid_map_msgs/msg/GridMap"
_GRID_MAP_DEFINITIONS = {
    2: """
std_msgs/Header header
grid_map_msgs/GridMapInfo info
string[] layers
string[] basic_layers
std_msgs/Float32MultiArray[] data
uint16 outer_start_index
uint16 inner_start_index
================================================================================
MSG: grid_map_msgs/GridMapInfo
float64 resolution
float64 length_x
float64 length_y
geometry_msgs/Pose pose
""",
    1: """
grid_map_msgs/GridMapInfo info
string[] layers
string[] basic_layers
std_msgs/Float32MultiArray[] data
uint16 outer_start_index
uint16 inner_start_index
================================================================================
MSG: grid_map_msgs/GridMapInfo
std_msgs/Header header
float64 resolution
float64 length_x
float64 length_y
geometry_msgs/Pose pose
""",
}
"""As each version of ROS has it."""
_TF = "geometry_msgs/TransformStamped[] transforms"
_FORCE_SCALE = 0.5  # m of an arrow for a force of m g
WORLD = "world"
_FORCE_COLOR = (0.1, 0.45, 0.85, 1.0)
_SAME_SPACING = 1e-9  # m, by which the cells of a grid map may differ from squares


class Store:
    """Makes messages of one version of ROS."""

    def __init__(self, typesys: Any, version: int) -> None:
        """`typesys` is the module `rosbags.typesys`; `version` is 1 or 2."""
        stores = typesys.Stores
        self.version = version
        self.types = typesys.get_typestore(stores.ROS1_NOETIC if version == 1 else stores.ROS2_HUMBLE)
        self.types.register(typesys.get_types_from_msg(_GRID_MAP_DEFINITIONS[version], _GRID_MAP))
        if version == 1:
            self.types.register(typesys.get_types_from_msg(_TF, "tf2_msgs/msg/TFMessage"))

    def make(self, kind: str, /, **fields: Any) -> Any:
        """A message; `package/Name`."""
        package, name = kind.split("/")
        return self.types.types[f"{package}/msg/{name}"](**fields)

    def header(self, t: float, frame: str = WORLD) -> Any:
        """The header of a message at t s."""
        sequence = {"seq": 0} if self.version == 1 else {}
        return self.make("std_msgs/Header", **sequence, stamp=self.stamp(t), frame_id=frame)

    def stamp(self, t: float) -> Any:
        """t s as ROS has it."""
        nanoseconds = round(t * 1e9)
        return self.make("builtin_interfaces/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)

    def content(self, message: Any) -> bytes:
        """A message as it is stored."""
        store = self.types.serialize_ros1 if self.version == 1 else self.types.serialize_cdr
        return bytes(store(message, message.__msgtype__))


class _Messages:
    """Makes messages from arrays."""

    def __init__(self, store: Store, motion: Motion) -> None:
        self.store, self.motion = store, motion
        self.make: Callable[..., Any] = store.make

    def vector(self, xyz: Array) -> Any:
        return self.make("geometry_msgs/Vector3", x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))

    def point(self, xyz: Array) -> Any:
        return self.make("geometry_msgs/Point", x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))

    def quaternion(self, wxyz: Array) -> Any:
        x, y, z, w = (float(part) for part in xyzw(wxyz))
        return self.make("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, position: Array, wxyz: Array) -> Any:
        return self.make("geometry_msgs/Pose", position=self.point(position), orientation=self.quaternion(wxyz))

    def transforms(self, k: int) -> Any:
        """All frames of frame k."""
        motion, unturned = self.motion, np.array([1.0, 0.0, 0.0, 0.0])
        frames = list(zip(motion.body_names, motion.body_position[k], motion.body_quaternion_wxyz[k], strict=True))
        if not frames:
            frames = [("base", motion.base_position[k], motion.base_quaternion_wxyz[k])]
        frames += [
            (f"{foot}_contact", p, unturned) for foot, p in zip(motion.foot_names, motion.contact_position[k], strict=True)
        ]
        header = self.store.header(motion.t[k])
        listed = [
            self.make(
                "geometry_msgs/TransformStamped",
                header=header,
                child_frame_id=name,
                transform=self.make("geometry_msgs/Transform", translation=self.vector(p), rotation=self.quaternion(q)),
            )
            for name, p, q in frames
        ]
        return self.make("tf2_msgs/TFMessage", transforms=listed)

    def joints(self, k: int) -> Any:
        motion = self.motion
        return self.make(
            "sensor_msgs/JointState",
            header=self.store.header(motion.t[k], ""),
            name=list(motion.joint_names),
            position=motion.joint_position[k],
            velocity=motion.joint_velocity[k],
            effort=motion.joint_torque[k],
        )

    def odometry(self, k: int) -> Any:
        """The pose of the base; its twist is in its own frame, as ROS has it."""
        motion, unknown = self.motion, np.zeros(36)
        q = motion.base_quaternion_wxyz[k : k + 1]
        twist = self.make(
            "geometry_msgs/Twist",
            linear=self.vector(turned_back(q, motion.base_linear_velocity[k : k + 1])[0]),
            angular=self.vector(turned_back(q, motion.base_angular_velocity[k : k + 1])[0]),
        )
        return self.make(
            "nav_msgs/Odometry",
            header=self.store.header(motion.t[k]),
            child_frame_id=motion.body_names[0] if motion.body_names else "base",
            pose=self.make("geometry_msgs/PoseWithCovariance", pose=self.pose(motion.base_position[k], q[0]), covariance=unknown),
            twist=self.make("geometry_msgs/TwistWithCovariance", twist=twist, covariance=unknown),
        )

    def wrench(self, k: int, e: int) -> Any:
        motion = self.motion
        wrench = self.make("geometry_msgs/Wrench", force=self.vector(motion.foot_force[k, e]), torque=self.vector(np.zeros(3)))
        header = self.store.header(motion.t[k], f"{motion.foot_names[e]}_contact")
        return self.make("geometry_msgs/WrenchStamped", header=header, wrench=wrench)

    def marker(self, header: Any, number: int, kind: int, scale: Array, color: tuple[float, ...], **fields: Any) -> Any:
        nothing = SimpleNamespace(**fields)
        empty = np.zeros(0, np.uint8)
        only = {}
        if self.store.version == 2:
            only["texture"] = self.make("sensor_msgs/CompressedImage", header=header, format="", data=empty)
            only["mesh_file"] = self.make("visualization_msgs/MeshFile", filename="", data=empty)
            only |= {"texture_resource": "", "uv_coordinates": []}
        rest = np.array([1.0, 0.0, 0.0, 0.0])
        return self.make(
            "visualization_msgs/Marker",
            header=header,
            ns="warpgait",
            id=number,
            type=kind,
            action=0,
            pose=getattr(nothing, "pose", self.pose(np.zeros(3), rest)),
            scale=self.vector(scale),
            color=self.color(color),
            lifetime=self.make("builtin_interfaces/Duration", sec=0, nanosec=0),
            frame_locked=True,
            points=getattr(nothing, "points", []),
            colors=[],
            text="",
            mesh_resource="",
            mesh_use_embedded_materials=False,
            **only,
        )

    def color(self, rgba: tuple[float, ...]) -> Any:
        r, g, b, a = (float(part) for part in rgba)
        return self.make("std_msgs/ColorRGBA", r=r, g=g, b=b, a=a)

    def forces(self, k: int) -> Any:
        """An arrow from each contact point; without a force, one of no length."""
        motion = self.motion
        weight = max(float(np.linalg.norm(motion.foot_force.sum(1), axis=-1).mean()), 1e-9)
        markers = []
        for e, foot in enumerate(motion.foot_names):
            tip = _FORCE_SCALE * motion.foot_force[k, e] / weight
            header = self.store.header(motion.t[k], f"{foot}_contact")
            points = [self.point(np.zeros(3)), self.point(tip)]
            markers.append(self.marker(header, e, 0, np.array([0.015, 0.03, 0.04]), _FORCE_COLOR, points=points))
        return self.make("visualization_msgs/MarkerArray", markers=markers)

    def shapes(self) -> Any:
        """The robot's shapes, each in the frame of its body."""
        model, markers = self.motion.model, []
        kinds = {
            mujoco.mjtGeom.mjGEOM_BOX: 1,
            mujoco.mjtGeom.mjGEOM_SPHERE: 2,
            mujoco.mjtGeom.mjGEOM_CYLINDER: 3,
            mujoco.mjtGeom.mjGEOM_CAPSULE: 3,
        }
        for g in range(model.ngeom):
            kind = kinds.get(int(model.geom_type[g]))
            if kind is None or model.geom_bodyid[g] == 0:
                continue
            size = model.geom_size[g]
            scale = {1: 2 * size, 2: np.full(3, 2 * size[0]), 3: np.array([2 * size[0], 2 * size[0], 2 * size[1]])}[kind]
            header = self.store.header(0.0, model.body(model.geom_bodyid[g]).name)
            pose = self.pose(model.geom_pos[g], model.geom_quat[g])
            markers.append(self.marker(header, g, kind, scale, tuple(model.geom_rgba[g]), pose=pose))
        return self.make("visualization_msgs/MarkerArray", markers=markers)

    def grid_map(self) -> Any:
        """The ground as grid_map stores it: the first element has the largest x and y, columns come first."""
        ground = self.motion.ground
        cells = ground.heights.T[::-1, ::-1]
        rows, columns = cells.shape
        dimension = "std_msgs/MultiArrayDimension"
        layout = self.make(
            "std_msgs/MultiArrayLayout",
            dim=[
                self.make(dimension, label="column_index", size=columns, stride=rows * columns),
                self.make(dimension, label="row_index", size=rows, stride=rows),
            ],
            data_offset=0,
        )
        data = self.make("std_msgs/Float32MultiArray", layout=layout, data=np.ascontiguousarray(cells.T, np.float32).ravel())
        length = ground.spacing * [rows, columns]
        center = np.append(ground.origin + ground.spacing * (np.array([rows, columns]) - 1) / 2, 0.0)
        header = self.store.header(0.0)
        info = self.make(
            "grid_map_msgs/GridMapInfo",
            **({"header": header} if self.store.version == 1 else {}),
            resolution=float(ground.spacing[0]),
            length_x=float(length[0]),
            length_y=float(length[1]),
            pose=self.pose(center, np.array([1.0, 0.0, 0.0, 0.0])),
        )
        layers = ["elevation"]
        fields = {"layers": layers, "basic_layers": layers, "outer_start_index": 0, "inner_start_index": 0}
        own = {"header": header} if self.store.version == 2 else {}
        return self.make("grid_map_msgs/GridMap", **own, info=info, data=[data], **fields)

    def points(self) -> Any:
        """The ground as a cloud of points."""
        ground = self.motion.ground
        rows, columns = ground.heights.shape
        x = ground.origin[0] + ground.spacing[0] * np.arange(columns)
        y = ground.origin[1] + ground.spacing[1] * np.arange(rows)
        cloud = np.stack([*np.meshgrid(x, y), ground.heights], -1).astype(np.float32)
        real = 7  # FLOAT32
        fields = [self.make("sensor_msgs/PointField", name=n, offset=4 * i, datatype=real, count=1) for i, n in enumerate("xyz")]
        return self.make(
            "sensor_msgs/PointCloud2",
            header=self.store.header(0.0),
            height=rows,
            width=columns,
            fields=fields,
            is_bigendian=False,
            point_step=12,
            row_step=12 * columns,
            data=cloud.view(np.uint8).ravel(),
            is_dense=True,
        )


def record(motion: Motion, store: Store, write: Callable[[str, float, Any], None]) -> None:
    """All messages in order: `write` gets topic, time in s, and message."""
    messages = _Messages(store, motion)
    write("/ground/points", 0.0, messages.points())
    if abs(motion.ground.spacing[0] - motion.ground.spacing[1]) < _SAME_SPACING:
        write("/ground", 0.0, messages.grid_map())
    if motion.joint_names:
        write("/robot", 0.0, messages.shapes())
    for k, t in enumerate(motion.t):
        write("/tf", t, messages.transforms(k))
        if motion.joint_names:
            write("/joint_states", t, messages.joints(k))
        write("/odom", t, messages.odometry(k))
        write("/forces", t, messages.forces(k))
        for e, foot in enumerate(motion.foot_names):
            write(f"/feet/{foot}/wrench", t, messages.wrench(k, e))


CONVENTIONS = {
    "quaternions": "xyzw, as in ROS",
    "tf": "every frame is a child of world; FOOT_contact has the axes of the world, and wrenches are in it",
    "odom": "the twist is in the frame of the base, as ROS has it",
    "time": "from 0 s, the start of the plan",
}
