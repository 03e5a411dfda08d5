"""Every format is read back, by the target's own loader where it is on PyPI, else as its loader does, and compared with the plan to 1e-6."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import warpgait
from warpgait.arrays import Array
from warpgait.commands.export import export
from warpgait.geometry import rotation_from_wxyz
from warpgait.model import find_model, indices, load_robot
from warpgait.motions import FORMATS, Motion
from warpgait.motions.mjcf import keyframes
from warpgait.openloop import rolled_postures
from warpgait.plan import Plan, read_plan
from warpgait.reference import Reference, sample

NEAR = 1e-6
SINGLE = 2e-6  # of numbers that a loader has in single precision, some of them beyond 8


class Expected:
    """What a plan says at a rate, found without the exporters: the reference of the replay's controller, and forward kinematics."""

    def __init__(self, path: Path) -> None:
        self.plan: Plan = read_plan(path)
        self.model: Any = load_robot(find_model(self.plan.robot.name), self.plan.robot.gravity)
        self.index = indices(self.model, self.plan.foot_names)
        _, self.rolling = rolled_postures(self.plan, self.model, self.index)

    def at(self, rate: float) -> Reference:
        return sample(self.plan, rate, self.index.radius, self.rolling)

    def feet(self, qpos: Array) -> Array:
        """Centers of the feet (K, E, 3) of postures (K, nq)."""
        data = mujoco.MjData(self.model)
        found = np.zeros((len(qpos), len(self.index.feet), 3))
        for k, row in enumerate(qpos):
            data.qpos[:] = row
            mujoco.mj_kinematics(self.model, data)
            found[k] = data.site_xpos[self.index.site]
        return found

    def require(self, rate: float, quaternion_wxyz: Any, position: Any, joints: Any, tolerance: float = NEAR) -> None:
        """Refuse a base pose and joint angles (in the model's order) that do not put trunk and feet where the plan has them."""
        reference = self.at(rate)
        turned = rotation_from_wxyz(np.asarray(quaternion_wxyz, float)).as_matrix()
        np.testing.assert_allclose(turned, reference.rotation, atol=tolerance)
        qpos = np.hstack([np.asarray(part, float) for part in (position, quaternion_wxyz, joints)])
        np.testing.assert_allclose(self.feet(qpos), reference.foot, atol=tolerance)


@pytest.fixture(scope="module")
def expected(walk_plan: Path) -> Expected:
    return Expected(walk_plan)


@pytest.fixture
def write(walk_plan: Path, tmp_path: Path) -> Any:
    """Exports the walk; returns file and motion."""

    def run(name: str, **options: Any) -> tuple[Path, Motion]:
        written, motion = export(walk_plan, FORMATS[name], tmp_path / f"out{FORMATS[name].ending}", **options)
        assert all(path.is_file() for path in written)
        return tmp_path / f"out{FORMATS[name].ending}", motion

    return run


def require_facts(facts: dict[str, Any], name: str, plan: Plan) -> None:
    """Order of joints and quaternions, frames, and the certificate of this very plan."""
    assert facts["format"]["name"] == name and facts["joint_names"][:3] == ["LF_HAA", "LF_HFE", "LF_KFE"]
    assert facts["conventions"]["world"].startswith("x forward")
    certificate = facts["certificate"]
    assert certificate["plan"]["sha256"] == plan.sha256 and certificate["all_laws_hold"] is True
    assert {law["name"] for law in certificate["laws"]} > {"newton_rms", "friction", "reach"}
    assert 0 < certificate["margins"]["joint_torque"] < 1 and 0 < certificate["margins"]["joint_speed"] < 1
    assert certificate["replay"]["verdict"] is None


def test_csv(write: Any, expected: Expected) -> None:
    path, motion = write("csv")
    lines = path.read_text().splitlines()
    facts = {k: json.loads(v) for k, v in (line[2:].split(": ", 1) for line in lines if line.startswith("# "))}
    require_facts(facts, "csv", expected.plan)
    table = np.genfromtxt(path, delimiter=",", names=True, comments="#", skip_header=len(facts))
    assert len(table) == len(expected.plan.t) and motion.rate == 200

    def columns(*names: str) -> Array:
        return np.stack([table[name] for name in names], -1)

    position = columns(*(f"base_position_{a}" for a in "xyz"))
    quaternion = columns(*(f"base_quaternion_{a}" for a in "wxyz"))
    expected.require(200, quaternion, position, columns(*(f"{j}_position" for j in motion.joint_names)))
    com = columns(*(f"center_of_mass_{a}" for a in "xyz"))
    np.testing.assert_allclose(com, expected.plan.base_position, atol=NEAR)
    for e, foot in enumerate(expected.plan.foot_names):
        contact = columns(*(f"{foot}_contact_position_{a}" for a in "xyz"))
        np.testing.assert_allclose(contact, expected.plan.foot_position[:, e], atol=NEAR)
        np.testing.assert_array_equal(table[f"{foot}_contact"] > 0, expected.plan.foot_contact[:, e])
    with np.load(path.with_name("walk.ground.npz")) as ground:
        np.testing.assert_array_equal(ground["heights"], expected.plan.terrain.heights)
        np.testing.assert_allclose(ground["origin"], expected.plan.terrain.origin, atol=1e-12)
        assert str(ground["layout"]) == "y-up"


def test_json(write: Any, expected: Expected) -> None:
    path, _ = write("json", rate=40.0)
    data = json.loads(path.read_text())
    require_facts(data, "json", expected.plan)
    expected.require(40, data["base_quaternion_wxyz"], data["base_position"], data["joint_position"])
    np.testing.assert_allclose(data["foot_force"], expected.at(40).force, atol=NEAR)
    np.testing.assert_array_equal(data["ground"]["heights"], expected.plan.terrain.heights)


def test_parquet(write: Any, expected: Expected) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path, motion = write("parquet", rate=100.0)
    table = parquet.read_table(path)
    require_facts(json.loads(table.schema.metadata[b"warpgait"]), "parquet", expected.plan)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    joints = np.stack([columns[f"{j}_position"] for j in motion.joint_names], -1)
    position = np.stack([columns[f"base_position_{a}"] for a in "xyz"], -1)
    expected.require(100, np.stack([columns[f"base_quaternion_{a}"] for a in "wxyz"], -1), position, joints)


def test_amp_frames_are_as_its_loader_cuts_them(write: Any, expected: Expected) -> None:
    path, motion = write("amp")
    data = json.loads(path.read_text())
    require_facts(data["warpgait"], "amp", expected.plan)
    assert data["LoopMode"] == "Clamp" and data["FrameDuration"] == 0.02 and data["MotionWeight"] == 1.0
    frames = np.array(data["Frames"])
    assert frames.shape == (len(motion.t), 61)
    ends = np.cumsum([3, 4, 12, 12, 3, 3, 12])
    position, xyzw, joints, toes, linear, angular, speeds, toe_speeds = np.split(frames, ends, axis=1)
    # FR, FL, RR, RL: the right front leg first.
    assert data["JointNames"] == [f"{leg}_{j}" for leg in ("RF", "LF", "RH", "LH") for j in ("HAA", "HFE", "KFE")]
    order = [data["JointNames"].index(name) for name in motion.joint_names]
    expected.require(50, xyzw[:, [3, 0, 1, 2]], position, joints[:, order])
    turned = rotation_from_wxyz(xyzw[:, [3, 0, 1, 2]])
    reference = expected.at(50)
    for i, foot in enumerate(("RF", "LF", "RH", "LH")):
        e = expected.plan.foot_names.index(foot)
        world = position + turned.apply(toes[:, 3 * i : 3 * i + 3])
        np.testing.assert_allclose(world, reference.foot[:, e], atol=NEAR)
    # A loader turns both velocities of the base from its frame to the world.
    np.testing.assert_allclose(turned.apply(angular), reference.angular_velocity, atol=NEAR)
    np.testing.assert_allclose(turned.apply(linear), motion.base_linear_velocity, atol=NEAR)
    fine, _ = write("amp", rate=1000.0)
    close = np.array(json.loads(fine.read_text())["Frames"])
    for speed, place in ((toe_speeds, slice(19, 31)), (speeds, slice(7, 19)), (turned.apply(linear), slice(0, 3))):
        np.testing.assert_allclose(np.gradient(close[:, place], 1e-3, axis=0)[::20][1:-1], speed[1:-1], atol=0.02)


def test_isaaclab_as_its_loader_reads_it(write: Any, expected: Expected) -> None:
    path, motion = write("isaaclab")
    with np.load(path) as data:  # pickles are refused
        dofs, bodies = data["dof_names"].tolist(), data["body_names"].tolist()
        assert data["fps"] == 50 and data["body_rotations"].dtype == np.float32
        require_facts(json.loads(str(data["warpgait"])), "isaaclab", expected.plan)
        base = bodies.index("base")
        joints = data["dof_positions"][:, [dofs.index(name) for name in motion.joint_names]]
        position, quaternion = data["body_positions"], data["body_rotations"]
        expected.require(50, quaternion[:, base], position[:, base], joints, SINGLE)
        np.testing.assert_allclose(data["body_angular_velocities"][:, base], expected.at(50).angular_velocity, atol=SINGLE)
        # The body's frame moves as its velocities say.
        _, fine = write("isaaclab", rate=1000.0)
        shank = bodies.index("RH_SHANK")
        speed = np.gradient(fine.body_position[:, shank], 1e-3, axis=0)[::20]
        np.testing.assert_allclose(data["body_linear_velocities"][1:-1, shank], speed[1:-1], atol=0.01)


def test_mjlab_in_the_order_of_mujoco(write: Any, expected: Expected) -> None:
    path, _ = write("mjlab")
    model = expected.model
    with np.load(path) as data:
        assert data["fps"].tolist() == [50.0]
        require_facts(json.loads(str(data["warpgait"])), "mjlab", expected.plan)
        assert data["body_names"].tolist() == [model.body(i).name for i in range(1, model.nbody)]
        assert data["joint_names"].tolist() == [model.joint(i).name for i in range(1, model.njnt)]
        expected.require(50, data["body_quat_w"][:, 0], data["body_pos_w"][:, 0], data["joint_pos"], SINGLE)
        K, B = len(data["joint_pos"]), model.nbody - 1
        assert data["body_lin_vel_w"].shape == data["body_ang_vel_w"].shape == (K, B, 3)
        assert data["joint_vel"].shape == (K, 12)


def test_locomujoco_has_the_members_that_its_loader_knows(write: Any, expected: Expected) -> None:
    path, motion = write("locomujoco")
    # The fields of TrajectoryInfo, TrajectoryModel and TrajectoryData of loco-mujoco 1.0; others are refused there.
    known = {"joint_names", "frequency", "body_names", "site_names", "metadata", "njnt", "jnt_type", "nbody", "nsite"}
    known |= {"body_rootid", "body_weldid", "body_mocapid", "body_pos", "body_quat", "body_ipos", "body_iquat"}
    known |= {"site_bodyid", "site_pos", "site_quat", "qpos", "qvel", "xpos", "xquat", "cvel", "subtree_com"}
    known |= {"site_xpos", "site_xmat", "split_points"}
    with np.load(path) as data:
        assert set(data.files) == known
        require_facts(json.loads(data["metadata"].tolist()), "locomujoco", expected.plan)
        qpos = data["qpos"]
        assert data["frequency"].tolist() == 100 and data["split_points"].tolist() == [0, len(qpos)]
        assert data["joint_names"].tolist() == ["root", *motion.joint_names] and data["njnt"] == 13
        expected.require(100, qpos[:, 3:7], qpos[:, :3], qpos[:, 7:])
        feet = [data["site_names"].tolist().index(foot) for foot in expected.plan.foot_names]
        np.testing.assert_allclose(data["site_xpos"][:, feet], expected.at(100).foot, atol=NEAR)
        assert data["cvel"].shape == (len(qpos), 14, 6) and data["site_xmat"].shape == (len(qpos), 4, 9)


def test_locomujoco_is_read_by_its_own_loader(write: Any, expected: Expected) -> None:
    reason = "pip install jax flax trimesh mujoco-mjx; pip install --no-deps loco-mujoco"
    own = pytest.importorskip("loco_mujoco.trajectory.dataclasses", reason=reason, exc_type=ImportError)
    path, motion = write("locomujoco")
    found = own.Trajectory.load(str(path), backend=np)
    assert found.info.joint_names == ["root", *motion.joint_names] and found.info.frequency == 100
    qpos = np.asarray(found.data.qpos)
    expected.require(100, qpos[:, 3:7], qpos[:, :3], qpos[:, 7:])


def test_lerobot_as_version_3_is_laid_out(write: Any, expected: Expected) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path, motion = write("lerobot")
    info = json.loads((path / "meta/info.json").read_text())
    require_facts(info["warpgait"], "lerobot", expected.plan)
    assert info["codebase_version"] == "v3.0" and info["fps"] == 50 and info["splits"] == {"train": "0:1"}
    episodes = parquet.read_table(path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    K = len(motion.t)
    assert len(episodes) == 1 and episodes[0]["length"] == episodes[0]["dataset_to_index"] == info["total_frames"] == K
    place = {"chunk_index": episodes[0]["data/chunk_index"], "file_index": episodes[0]["data/file_index"]}
    table = parquet.read_table(path / info["data_path"].format(**place))
    assert set(table.column_names) == set(info["features"])
    for name, feature in info["features"].items():
        kind = table.schema.field(name).type
        if feature["shape"] == [1]:
            assert str(kind).replace("float", "float32").replace("float3232", "float32") in (feature["dtype"], "float32")
        else:
            assert kind.list_size == feature["shape"][0] == len(feature["names"]) and str(kind.value_type) == "float"
    state = np.array(table["observation.state"].to_pylist())
    names = info["features"]["observation.state"]["names"]
    assert names[3:7] == [f"base_quaternion_{a}" for a in "wxyz"]
    expected.require(50, state[:, 3:7], state[:, :3], state[:, 13:25], SINGLE)
    np.testing.assert_array_equal(np.array(table["action"].to_pylist())[:-1], state[1:, 13:25])
    np.testing.assert_allclose(table["timestamp"].to_numpy(), motion.t, atol=1e-6)
    stats = json.loads((path / "meta/stats.json").read_text())
    assert set(stats) == set(info["features"]) and stats["observation.state"]["count"] == [K]
    np.testing.assert_allclose(stats["action"]["mean"], np.mean(table["action"].to_pylist(), 0), atol=1e-9)
    tasks = parquet.read_table(path / "meta/tasks.parquet")
    pandas = json.loads(tasks.schema.metadata[b"pandas"])
    assert tasks[pandas["index_columns"][0]].to_pylist() == episodes[0]["tasks"]


def test_lerobot_is_read_by_the_reader_of_rerun(write: Any, expected: Expected) -> None:
    reader = pytest.importorskip("rerun.experimental", reason='pip install "warpgait[rerun]"')
    path, _ = write("lerobot")
    chunks = [
        chunk.to_record_batch() for chunk in reader.LeRobotReader(path).stream(0) if chunk.entity_path == "/observation.state"
    ]
    state = np.array(next(chunk for chunk in chunks if chunk.num_rows > 1).column("Scalars:scalars").to_pylist())
    expected.require(50, state[:, 3:7], state[:, :3], state[:, 13:25], SINGLE)


def test_a_mujoco_scene_holds_the_motion_and_the_ground(write: Any, expected: Expected) -> None:
    path, motion = write("mujoco")
    scene = mujoco.MjModel.from_xml_path(str(path))
    t, qpos, _ = keyframes(scene)
    np.testing.assert_allclose(t, motion.t, atol=NEAR)
    expected.require(50, qpos[:, 3:7], qpos[:, :3], qpos[:, 7:])
    number = mujoco.mj_name2id(scene, mujoco.mjtObj.mjOBJ_TEXT, "warpgait")
    first = scene.text_adr[number]
    text = bytes(np.asarray(scene.text_data)).decode()[first : first + scene.text_size[number] - 1]
    require_facts(json.loads(text), "mujoco", expected.plan)
    # A ray straight down finds the ground where the plan has it.
    data = mujoco.MjData(scene)
    mujoco.mj_forward(scene, data)
    ground = warpgait.load(expected.plan.path).terrain
    hit = np.zeros(1, np.int32)
    for x, y in ((-1.1, 0.5), (1.0, 0.9), (0.2, -1.1)):
        down = mujoco.mj_ray(scene, data, np.array([x, y, 5.0]), np.array([0.0, 0.0, -1.0]), None, 1, -1, hit)
        assert 5.0 - down == pytest.approx(float(ground.height([x, y])), abs=2e-3) and scene.geom(int(hit[0])).name == "ground"


def require_messages(found: dict[str, list[Any]], motion: Motion, expected: Expected) -> None:
    """Refuse messages of ROS by topic that do not say what the plan says at 50 Hz."""
    joints = np.array([m.position for m in found["/joint_states"]])
    assert list(found["/joint_states"][0].name) == list(motion.joint_names)

    def moving(name: str) -> tuple[Array, Array]:
        frames = [next(f for f in m.transforms if f.child_frame_id == name).transform for m in found["/tf"]]
        moves = [[f.translation.x, f.translation.y, f.translation.z] for f in frames]
        return np.array(moves), np.array([[f.rotation.w, f.rotation.x, f.rotation.y, f.rotation.z] for f in frames])

    position, quaternion = moving("base")
    expected.require(50, quaternion, position, joints)
    reference = expected.at(50)
    for e, foot in enumerate(expected.plan.foot_names):
        wrenches = found[f"/feet/{foot}/wrench"]
        assert wrenches[0].header.frame_id == f"{foot}_contact"
        forces = [[m.wrench.force.x, m.wrench.force.y, m.wrench.force.z] for m in wrenches]
        np.testing.assert_allclose(forces, reference.force[:, e], atol=NEAR)
        np.testing.assert_allclose(moving(f"{foot}_contact")[0], motion.contact_position[:, e], atol=NEAR)
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in found["/joint_states"]]
    np.testing.assert_allclose(stamps, motion.t, atol=1e-9)
    cloud = found["/ground/points"][0]
    points = np.frombuffer(bytes(cloud.data), np.float32).reshape(cloud.height, cloud.width, 3)
    np.testing.assert_allclose(points[..., 2], expected.plan.terrain.heights, atol=1e-6)
    assert len(found["/robot"][0].markers) > 20 and len(found["/forces"]) == len(motion.t)


def test_mcap_is_read_by_its_own_reader(write: Any, expected: Expected) -> None:
    reader = pytest.importorskip("mcap_ros2.reader")
    path, motion = write("mcap", rate=50.0)
    found: dict[str, list[Any]] = {}
    for message in reader.read_ros2_messages(path):
        found.setdefault(message.channel.topic, []).append(message.ros_msg)
    require_messages(found, motion, expected)
    with path.open("rb") as file:
        own = importlib.import_module("mcap.reader").make_reader(file)
        facts = next(m for m in own.iter_metadata() if m.name == "warpgait").metadata["facts"]
    require_facts(json.loads(facts), "mcap", expected.plan)


@pytest.mark.parametrize("name", ["rosbag1", "rosbag2"])
def test_bags_are_read_by_rosbags(write: Any, expected: Expected, name: str) -> None:
    highlevel = pytest.importorskip("rosbags.highlevel", reason='pip install "warpgait[ros]"')
    path, motion = write(name, rate=50.0)
    found: dict[str, list[Any]] = {}
    with highlevel.AnyReader([path]) as reader:
        for connection, at, content in reader.messages():
            message = reader.deserialize(content, connection.msgtype)
            found.setdefault(connection.topic, []).append(message)
            if connection.topic == "/tf":
                stamp = message.transforms[0].header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == at
    require_messages(found, motion, expected)
    require_facts(json.loads(found["/warpgait/facts"][0].data), name, expected.plan)


@pytest.mark.parametrize("name", ["mcap", "rosbag1", "rosbag2"])
def test_the_grid_map_in_a_recording_is_the_ground(write: Any, expected: Expected, tmp_path: Path, name: str) -> None:
    pytest.importorskip("mcap"), pytest.importorskip("rosbags")
    path, _ = write(name, rate=10.0)
    from warpgait.terrain import convert

    convert(path, "/ground", "elevation", -1, tmp_path / "back.npz")
    with np.load(tmp_path / "back.npz") as back:
        np.testing.assert_allclose(back["heights"][::-1, ::-1].T, expected.plan.terrain.heights, atol=1e-6)


def test_rerun_is_read_by_its_own_reader(write: Any, expected: Expected) -> None:
    reader = pytest.importorskip("rerun.chunk", reason='pip install "warpgait[rerun]"')
    path, motion = write("rerun", rate=50.0)
    found: dict[str, dict[str, Any]] = {}
    for chunk in reader.RrdReader(path).stream():
        batch = chunk.to_record_batch()
        columns = {name.rpartition(":")[2]: batch.column(name) for name in batch.schema.names}
        found.setdefault(chunk.entity_path, {}).update(columns)

    def numbers(entity: str, component: str) -> Array:
        return np.array(found[f"/{entity}"][component].to_pylist(), float)[:, 0]

    np.testing.assert_allclose([t.total_seconds() for t in found["/world/robot/base"]["time"].to_pylist()], motion.t, atol=1e-6)
    position = numbers("world/robot/base", "translation")
    quaternion = np.roll(numbers("world/robot/base", "quaternion"), 1, axis=-1)
    joints = np.stack([numbers(f"joint_position/{joint}", "scalars") for joint in motion.joint_names], -1)
    expected.require(50, quaternion, position, joints)
    reference = expected.at(50)
    for e, foot in enumerate(expected.plan.foot_names):
        forces = np.stack([numbers(f"force/{foot}/{axis}", "scalars") for axis in "xyz"], -1)
        np.testing.assert_allclose(forces, reference.force[:, e], atol=NEAR)
        np.testing.assert_allclose(numbers(f"world/feet/{foot}", "origins"), motion.contact_position[:, e], atol=NEAR)
    points = np.array(found["/world/ground"]["vertex_positions"].to_pylist()[0])
    np.testing.assert_allclose(points[:, 2], expected.plan.terrain.heights.ravel(), atol=NEAR)
    corners = points[np.array(found["/world/ground"]["triangle_indices"].to_pylist()[0])]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()
    require_facts(json.loads(found["/facts"]["text"].to_pylist()[0][0]), "rerun", expected.plan)


def test_usd_is_read_by_its_own_library(write: Any, expected: Expected) -> None:
    usd = pytest.importorskip("pxr.Usd")
    geometry = importlib.import_module("pxr.UsdGeom")
    path, motion = write("usd")
    stage = usd.Stage.Open(str(path))
    assert geometry.GetStageUpAxis(stage) == "Z" and geometry.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetTimeCodesPerSecond() == 50 and stage.GetEndTimeCode() == len(motion.t) - 1
    require_facts(json.loads(stage.GetDefaultPrim().GetCustomDataByKey("warpgait")), "usd", expected.plan)
    shank = geometry.Xformable(stage.GetPrimAtPath("/World/anymal_c/LF_SHANK"))
    assert [p.GetTypeName() for p in shank.GetPrim().GetChildren()][-1] == "Sphere"
    e = expected.plan.foot_names.index("LF")
    foot = geometry.Xformable(shank.GetPrim().GetChildren()[-1])
    places = [foot.ComputeLocalToWorldTransform(k).ExtractTranslation() for k in range(len(motion.t))]
    np.testing.assert_allclose(np.array(places), expected.at(50).foot[:, e], atol=NEAR)
    mesh = geometry.Mesh(stage.GetPrimAtPath("/World/ground"))
    heights = np.array(mesh.GetPointsAttr().Get())[:, 2].reshape(expected.plan.terrain.heights.shape)
    np.testing.assert_allclose(heights, expected.plan.terrain.heights, atol=1e-6)


def test_between_the_samples_of_a_plan_its_splines_are_exported(write: Any, expected: Expected) -> None:
    _, motion = write("json", rate=73.0)
    exact = warpgait.load(expected.plan.path)
    base, feet = exact.base(motion.t), exact.feet(motion.t)
    np.testing.assert_allclose(motion.base_quaternion_wxyz, base.quaternion_wxyz, atol=NEAR)
    np.testing.assert_allclose(motion.center_of_mass, base.position, atol=NEAR)
    np.testing.assert_allclose(motion.contact_position, feet.position, atol=NEAR)
    np.testing.assert_allclose(motion.foot_force, feet.force * feet.contact[..., None], atol=NEAR)
    standing = feet.contact.all(1)
    center = feet.position + expected.index.radius * feet.normal
    # A standing foot rolls by less than a centimeter and a half about its contact point.
    assert np.abs(motion.foot_position - center)[standing].max() < 0.015
