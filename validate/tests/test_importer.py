"""Imports a robot that these tests write, and refuses what is no robot."""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from warpgait import importer
from warpgait.kinematics import legs
from warpgait.mjcf import foot_names
from warpgait.model import composite, indices, load_spec, stand
from warpgait.model import foot_names as feet_of

SIDES = {"fl": (1, 1), "fr": (1, -1), "rl": (-1, 1), "rr": (-1, -1)}


def inertial(mass: float, x: float = 0.0, y: float = 0.0, z: float = 0.0, size: float = 0.1) -> str:
    moment = mass * size**2 / 6
    return (
        f'<inertial><origin xyz="{x} {y} {z}"/><mass value="{mass}"/>'
        f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def joint(name: str, parent: str, child: str, xyz: str, axis: str, low: float, high: float, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{xyz}"/><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="30" velocity="20"/></joint>'
    )


def leg(name: str) -> str:
    x, y = SIDES[name]
    parts = [
        f'<link name="{name}_hip">{inertial(0.7)}</link>',
        joint(f"{name}_roll", "trunk", f"{name}_hip", f"{0.2 * x} {0.05 * y} 0", "1 0 0", -0.9, 0.9),
        f'<link name="{name}_thigh">{inertial(1.0, z=-0.05)}<collision><origin xyz="0 0 -0.1"/>'
        '<geometry><box size="0.03 0.03 0.18"/></geometry></collision></link>',
        joint(f"{name}_pitch", f"{name}_hip", f"{name}_thigh", f"0 {0.08 * y} 0.01", "0 -1 0", -3.0, 1.5),
        f'<link name="{name}_calf">{inertial(0.2, z=-0.1)}<visual><geometry><mesh filename="package://absent/calf.dae"/></geometry></visual>'
        '<collision><origin xyz="0 0 -0.09"/><geometry><cylinder radius="0.01" length="0.16"/></geometry></collision></link>',
        joint(f"{name}_knee", f"{name}_thigh", f"{name}_calf", "0 0 -0.21", "0 1 0", -2.7, -0.8),
        f'<link name="{name}_foot">{inertial(0.05, size=0.02)}'
        '<collision><geometry><sphere radius="0.02"/></geometry></collision></link>',
        f'<joint name="{name}_end" type="fixed"><origin xyz="0 0 -0.21"/><parent link="{name}_calf"/><child link="{name}_foot"/></joint>',
    ]
    return "\n".join(parts)


def head() -> str:
    return f'<link name="head">{inertial(0.5)}</link>' + joint("neck", "trunk", "head", "0.3 0 0.1", "0 0 1", -1, 1)


URDF = (
    f'<robot name="dog"><link name="trunk">{inertial(7.0, 0.01)}<collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision></link>'
    + "\n".join(leg(name) for name in SIDES)
    + head()
    + "</robot>"
)


@pytest.fixture(scope="module")
def dog(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dog")
    (folder / "dog.urdf").write_text(URDF)
    assert importer.main([str(folder / "dog.urdf"), "-o", str(folder / "dog"), "--quiet"]) == 0
    return folder / "dog"


def test_the_import_has_the_masses_joints_and_feet_of_the_file(dog: Path) -> None:
    robot = tomllib.loads(dog.with_suffix(".toml").read_text())
    assert robot["mass"] == pytest.approx(7.0 + 4 * (0.7 + 1.0 + 0.2 + 0.05) + 0.5)
    assert [foot["name"] for foot in robot["feet"]] == ["LF", "RF", "LH", "RH"]
    for foot, side in zip(robot["feet"], ("fl", "fr", "rl", "rr"), strict=True):
        x, y = SIDES[side]
        joints = foot["leg"]["joints"]
        assert [j["name"] for j in joints] == [f"{side}_roll", f"{side}_pitch", f"{side}_knee"]
        assert [j["axis"] for j in joints] == [[1, 0, 0], [0, -1, 0], [0, 1, 0]]
        assert joints[1]["position"] == pytest.approx([0, 0.08 * y, 0.01])
        assert joints[2]["mass"] == pytest.approx(0.25)  # calf and foot
        assert joints[2]["center"] == pytest.approx([0, 0, -(0.2 * 0.1 + 0.05 * 0.21) / 0.25], abs=1e-6)
        assert (joints[0]["speed_limit"], joints[0]["torque_limit"]) == (20, 30)
        assert foot["leg"]["foot"] == pytest.approx([0, 0, -0.21]) and foot["leg"]["foot_radius"] == 0.02
        assert np.sign(foot["nominal"]).tolist() == [x, y, -1]


def test_the_model_is_the_robot_of_the_robot_file(dog: Path) -> None:
    robot = tomllib.loads(dog.with_suffix(".toml").read_text())
    model = load_spec(dog.with_suffix(".xml")).compile()
    data = mujoco.MjData(model)
    stand(model, data)
    body = composite(model, data)
    assert body.mass == pytest.approx(robot["mass"], rel=1e-5)
    assert body.inertia == pytest.approx(np.array(robot["inertia"]), abs=1e-5)
    index = indices(model, feet_of(model))
    assert index.speed_limit == pytest.approx(np.full((4, 3), 20.0))
    center = data.xpos[index.base] + body.center_of_mass
    for e, found in enumerate(legs(model, index.feet)):
        foot = robot["feet"][e]
        assert data.site_xpos[index.site[e]] - center - [0, 0, 0.02] == pytest.approx(foot["nominal"], abs=2e-4)
        q, possible = found.inverse(data.site_xpos[index.site[e]] - data.xpos[index.base])
        assert possible and q == pytest.approx(foot["leg"]["stance"], abs=1e-3)
        assert q == pytest.approx(data.qpos[index.qpos[e]], abs=1e-6)
    # Left and right are mirror images, and the knees bend as their limits allow.
    assert robot["feet"][0]["nominal"][1] == pytest.approx(-robot["feet"][1]["nominal"][1], abs=1e-3)
    assert all(-2.7 < foot["leg"]["stance"][2] < -0.8 for foot in robot["feet"])


def test_what_belongs_to_no_leg_is_held_still_and_said(dog: Path) -> None:
    found = importer.read(dog.with_suffix(".urdf"), importer.arguments([str(dog.with_suffix(".urdf"))]))
    assert any("neck" in note for note in found.notes)
    assert found.base.mass == pytest.approx(7.5)


def test_a_frame_with_a_mass_of_rounding_errors_has_none(tmp_path: Path) -> None:
    """MuJoCo refuses such inertias; CAD programs export them for the frames of sensors."""
    frame = """<link name="lidar"><inertial><mass value="4.2e-15"/>
        <inertia ixx="1.7e-27" iyy="1.7e-27" izz="1.7e-27" ixy="-3e-45" ixz="8e-44" iyz="-9e-47"/></inertial></link>
        <joint name="lidar_fixed" type="fixed"><parent link="trunk"/><child link="lidar"/></joint>"""
    (tmp_path / "dog.urdf").write_text(URDF.replace("</robot>", frame + "</robot>"))
    found = importer.read(tmp_path / "dog.urdf", importer.arguments([str(tmp_path / "dog.urdf")]))
    assert found.base.mass == pytest.approx(7.5)


MJCF = """<mujoco model="pup"><compiler angle="radian" autolimits="true"/><default><geom contype="1"/><joint range="-2.6 2.6"/></default>
<worldbody><body name="trunk" pos="0 0 0.4"><freejoint/><geom type="box" size="0.2 0.1 0.05" mass="6"/>
%s</body></worldbody><actuator>%s</actuator></mujoco>"""
PUP_LEG = """<body name="{0}_a" pos="{1} {2} 0"><joint name="{0}_1" axis="1 0 0" range="-0.9 0.9"/><geom type="sphere" size="0.02" mass="0.5" contype="0" conaffinity="0"/>
<body name="{0}_b" pos="0 {3} 0"><joint name="{0}_2" axis="0 1 0"/><geom type="capsule" size="0.01" fromto="0 0 -0.02 0 0 -0.15" mass="0.5"/>
<body name="{0}_c" pos="0 0 -0.2"><joint name="{0}_3" axis="0 1 0" range="-2.6 -0.6"/><geom type="capsule" size="0.01" fromto="0 0 -0.02 0 0 -0.15" mass="0.2"/>
<geom type="sphere" size="0.018" pos="0 0 -0.2" mass="0.02"/></body></body></body>
"""


def pup() -> str:
    bodies = "".join(PUP_LEG.format(n, 0.2 * x, 0.05 * y, 0.08 * y) for n, (x, y) in SIDES.items())
    motors = "".join(f'<motor joint="{n}_{j}" ctrlrange="-20 20"/>' for n in SIDES for j in (1, 2, 3))
    return MJCF % (bodies, motors)


def test_an_mjcf_asks_for_speed_limits_and_has_torques_of_its_motors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pup.xml"
    path.write_text(pup())
    assert importer.main([str(path), "-o", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert "fl_1" in message and "--speed-limit" in message and message.count("\n") == 1
    assert not (tmp_path / "out.xml").exists()
    found = importer.read(path, importer.arguments([str(path), "--speed-limit", "10,11,12"]))
    assert [link.limits.speed for link in found.legs[0].links] == [10, 11, 12]
    assert [link.limits.torque for link in found.legs[0].links] == [20, 20, 20]
    assert found.legs[0].radius == 0.018


def test_meshes_of_an_mjcf_that_touch_nothing_need_not_be_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pup.xml"
    inertial = '<freejoint/><inertial pos="0 0 0" mass="6" diaginertia="0.1 0.1 0.1"/>'
    asset = '<asset><mesh name="skin" file="absent.stl"/></asset><worldbody>'
    for collides in (0, 1):
        skin = f'{inertial}<geom type="mesh" mesh="skin" contype="{collides}" conaffinity="0"/>'
        path.write_text(pup().replace("<freejoint/>", skin).replace("<worldbody>", asset))
        options = ["--speed-limit", "10"]
        if collides:
            assert importer.main([str(path), "-o", str(tmp_path / "out"), *options]) == 2
            message = capsys.readouterr().err
            assert "pup.xml" in message and "absent.stl" in message and message.count("\n") == 1, message
            options.append("--without-meshes")
        found = importer.read(path, importer.arguments([str(path), *options]))
        assert found.base.mass == pytest.approx(6.0)
        assert any("skin" in note for note in found.notes) == bool(collides)


def test_an_output_never_replaces_the_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pup.xml"
    path.write_text(pup())
    assert importer.main([str(path), "-o", str(tmp_path / "pup"), "--speed-limit", "10"]) == 2
    assert "pup.xml" in capsys.readouterr().err and path.read_text() == pup()


def test_an_mjcf_may_include_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, speed = tmp_path / "pup.xml", ["--speed-limit", "10"]
    (tmp_path / "motors.xml").write_text("<mujoco><actuator>" + pup().split("<actuator>")[1])
    path.write_text(pup().split("<actuator>")[0] + '<include file="motors.xml"/></mujoco>')
    found = importer.read(path, importer.arguments([str(path), *speed]))
    assert [link.limits.torque for link in found.legs[0].links] == [20, 20, 20]
    (tmp_path / "motors.xml").unlink()
    assert importer.main([str(path), "-o", str(tmp_path / "out"), *speed]) == 2
    message = capsys.readouterr().err
    assert "pup.xml" in message and "motors.xml" in message and message.count("\n") == 1, message


def test_a_closed_loop_of_an_mjcf_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pup.xml"
    loop = '<equality><connect name="bar" body1="fl_c" body2="fr_c" anchor="0 0 0"/></equality></mujoco>'
    path.write_text(pup().replace("</mujoco>", loop))
    assert importer.main([str(path), "-o", str(tmp_path / "out"), "--speed-limit", "10"]) == 2
    message = capsys.readouterr().err
    assert '"bar"' in message and "closed loops" in message and message.count("\n") == 1, message


@pytest.mark.parametrize("forward", ["x", "y"])
def test_a_robot_with_legs_of_two_joints(forward: str, tmp_path: Path) -> None:
    text = fixed(URDF, ".._roll")
    if forward == "y":  # the same robot, turned in its base frame
        turned = '<link name="mount"/><joint name="turn" type="fixed"><origin rpy="0 0 1.5707963267948966"/><parent link="mount"/><child link="trunk"/></joint>'
        text = text.replace('<link name="trunk">', turned + '<link name="trunk">', 1)
    (tmp_path / "dog.urdf").write_text(text)
    assert importer.main([str(tmp_path / "dog.urdf"), "-o", str(tmp_path / "dog"), "--quiet", "--forward", forward]) == 0
    robot = tomllib.loads((tmp_path / "dog.toml").read_text())
    model = load_spec(tmp_path / "dog.xml").compile()
    index = indices(model, feet_of(model))
    assert index.qpos.shape == (4, 2) and model.nu == 8
    data = mujoco.MjData(model)
    stand(model, data)
    center = data.xpos[index.base] + composite(model, data).center_of_mass
    for e, found in enumerate(legs(model, index.feet)):
        foot = robot["feet"][e]
        assert [j["axis"] for j in foot["leg"]["joints"]] == [[0, -1, 0], [0, 1, 0]]
        assert foot["nominal"][1] == pytest.approx(0.13 * SIDES[index.joint_names[2 * e][:2]][1], abs=1e-3)
        # The foot keeps to its plane; along and up it has room.
        box = foot["reach"]
        assert box["center"][1] == pytest.approx(foot["nominal"][1], abs=1e-3) and box["half_size"][1] < 0.005
        assert min(box["half_size"][0], box["half_size"][2]) > 0.04
        q, possible = found.inverse(data.site_xpos[index.site[e]] - data.xpos[index.base])
        assert possible and q == pytest.approx(data.qpos[index.qpos[e]], abs=1e-6)
        assert data.site_xpos[index.site[e]] - center - [0, 0, 0.02] == pytest.approx(foot["nominal"], abs=1e-3)
        assert not found.inverse(data.site_xpos[index.site[e]] - data.xpos[index.base] + [0, 0.05, 0])[1]


def ankles(text: str) -> str:
    """The dog with a fourth joint in each leg, at the center of its foot."""
    limit = '<axis xyz="0 1 0"/><limit lower="-0.5" upper="0.5" effort="9" velocity="9"/>'
    return re.sub(r'(<joint name=".._end" type=)"fixed"(.*?)</joint>', rf'\1"revolute"\2{limit}</joint>', text)


def test_a_joint_that_only_turns_the_foot_is_held_still_by_an_option(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "dog.urdf"
    path.write_text(ankles(URDF))
    assert importer.main([str(path), "-o", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert "fl_end" in message and "on the spot" in message and "--freeze fl_end" in message and message.count("\n") == 1, message
    found = importer.read(path, importer.arguments([str(path), "--freeze", "*_end=0.1"]))
    assert [[link.joint for link in leg.links][-1] for leg in found.legs] == ["fl_knee", "fr_knee", "rl_knee", "rr_knee"]
    assert all(leg.links[-1].mass == pytest.approx(0.25) for leg in found.legs)  # calf and foot


def short() -> str:
    """A robot so short that front and hind thighs hit each other where the knees bend toward each other."""
    text = pup().replace('range="-2.6 -0.6"', 'range="-2.6 2.6"').replace('size="0.01" fromto', 'size="0.03" fromto')
    return text.replace('"0.2 ', '"0.14 ').replace('"-0.2 ', '"-0.14 ')


def test_legs_in_the_middle_bend_their_knees_alike(tmp_path: Path) -> None:
    """Two legs, of hips a little before the base's origin or behind it, whose knees could bend either way."""
    path = tmp_path / "biped.urdf"
    for ahead in ("0.01", "-0.01"):
        legs = "".join(
            leg(name).replace("-2.7, -0.8", "").replace('lower="-2.7" upper="-0.8"', 'lower="-2.7" upper="2.7"')
            for name in ("fl", "fr")
        )
        legs = legs.replace('lower="-3.0" upper="1.5"', 'lower="-3.0" upper="3.0"').replace('xyz="0.2 ', f'xyz="{ahead} ')
        trunk = URDF[: URDF.index('<link name="fl_hip">')]
        path.write_text(f"{trunk}{legs}</robot>")
        found = importer.build(path, "biped", importer.arguments([str(path)]))
        hips, knees = zip(*(robot_leg.stance[1:] for robot_leg in found.robot.legs), strict=True)
        np.testing.assert_allclose(np.ptp([hips, knees], axis=1), 0.0, atol=1e-3)
        assert hips[0] > 0.0 and knees[0] > 0.0  # about -y and y: ahead, and back


def test_equal_spheres_are_a_sole_whose_middle_is_the_foot(tmp_path: Path) -> None:
    path, one = tmp_path / "dog.urdf", '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
    sole = "".join(
        one.replace("<geometry>", f'<origin xyz="{x} {y} 0"/><geometry>') for x in (-0.03, 0.05) for y in (-0.02, 0.02)
    )
    feet = []
    for foot in (one, sole):
        path.write_text(URDF.replace(one, foot))
        found = importer.build(path, "dog", importer.arguments([str(path)]))
        feet.append(np.array([robot_leg.foot for robot_leg in found.skeleton.legs]))
    np.testing.assert_allclose(feet[1] - feet[0], [[0.01, 0.0, 0.0]] * 4, atol=1e-9)


def test_a_computed_stance_keeps_the_legs_apart(tmp_path: Path) -> None:
    path = tmp_path / "short.xml"
    knees = {}
    for name, text in (("long", short().replace('"0.14 ', '"0.3 ').replace('"-0.14 ', '"-0.3 ')), ("short", short())):
        path.write_text(text)
        found = importer.build(path, name, importer.arguments([str(path), "--speed-limit", "10"]))
        knees[name] = np.sign([leg.stance[2] for leg in found.robot.legs]).tolist()
        assert any("hit each other" in note for note in found.skeleton.notes) == (name == "short")
    assert knees == {"long": [-1, -1, 1, 1], "short": [-1, -1, -1, -1]}


def swap(old: str, new: str, count: int = 1) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert old in text, old
        return text.replace(old, new, count)

    return change


def fixed(text: str, names: str) -> str:
    """The URDF with the joints of a pattern fixed."""
    return re.sub(rf'(<joint name="{names}" type=)"revolute"(.*?)<limit[^>]*/>', r'\1"fixed"\2', text)


LOOP = joint("loop", "fr_calf", "fl_calf", "0 0 0", "0 1 0", -1, 1)
LIMIT = r'(<joint name="fl_knee".*?)<limit[^>]*/>'
BAD = {
    "not XML": (swap("</robot>", ""), [":"], "not XML"),
    "another root": (lambda text: text.replace("<robot", "<sdf", 1).replace("</robot>", "</sdf>"), [], "<sdf>"),
    "xacro": (swap('value="7.0"', 'value="${mass}"'), [], "xacro"),
    "two parents": (swap("</robot>", LOOP + "</robot>"), ['"fl_calf"'], "two parents"),
    "cycle": (
        swap('<parent link="trunk"/><child link="fl_hip"/>', '<parent link="fl_foot"/><child link="fl_hip"/>'),
        [],
        "cycle",
    ),
    "unknown link": (swap('<parent link="trunk"/>', '<parent link="torso"/>'), ['"torso"'], "not in the file"),
    "two links of one name": (swap('<link name="head">', '<link name="trunk">'), ['"trunk"'], "no other link"),
    "negative mass": (swap('<mass value="1.0"/>', '<mass value="-1.0"/>'), ['"fl_thigh"'], "-1 kg"),
    "no mass": (swap(inertial(1.0, z=-0.05), ""), ['"fl_thigh"'], "mass of"),
    "words for a mass": (swap('<mass value="1.0"/>', '<mass value="heavy"/>'), ['"fl_thigh"'], "heavy"),
    "no body's inertia": (swap('ixx="0.0116', 'ixx="1.0116'), ['"trunk"'], "principal moments"),
    "absent mesh": (
        swap('<sphere radius="0.02"/>', '<mesh filename="package://dog/foot.stl"/>'),
        ['"fl_foot"', "dog/foot.stl"],
        "not there",
    ),
    "no limits": (lambda text: re.sub(LIMIT, r"\1<limit effort='9' velocity='9'/>", text, count=1), ['"fl_knee"'], "--range"),
    "no torque": (
        lambda text: re.sub(LIMIT, r"\1<limit lower='-2' upper='-1' velocity='9'/>", text, count=1),
        ['"fl_knee"'],
        "--torque-limit",
    ),
    "sliding joint": (swap('name="fl_knee" type="revolute"', 'name="fl_knee" type="prismatic"'), ['"fl_knee"'], "no hinge"),
    "unknown type": (swap('name="fl_knee" type="revolute"', 'name="fl_knee" type="hinge"'), ['"fl_knee"'], "its type"),
    "mimic": (swap('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="fl_pitch"/>'), ['"fl_knee"'], "mimic"),
    "a leg of two joints and three of three": (lambda text: fixed(text, "fl_roll"), ['"fl_foot" 2', '"fr_foot" 3'], "--freeze"),
    "a leg of one joint": (lambda text: fixed(fixed(text, "fl_roll"), "fl_pitch"), ['"fl_calf"', "fl_knee"], "has 1 joints"),
    "two joints that are no pitch and pitch": (
        lambda text: fixed(text, ".._pitch"),
        ['"fl_calf"', "[1.0, 0.0, 0.0]"],
        "--forward",
    ),
    "zero mass": (swap('<mass value="1.0"/>', '<mass value="0.0"/>'), ['"fl_thigh"'], "mass"),
    "continuous": (swap('name="fl_knee" type="revolute"', 'name="fl_knee" type="continuous"'), ['"fl_knee"'], "--range"),
    "wheels": (
        lambda text: re.sub(
            r'(<joint name=".._end" type=)"fixed"(.*?)</joint>', r'\1"continuous"\2<axis xyz="0 1 0"/></joint>', text
        ),
        ['"fl_foot"', "fl_end"],
        "as that of a wheel does",
    ),
    "no legs": (lambda text: text.replace('type="revolute"', 'type="fixed"'), [], "there are no legs"),
}


@pytest.mark.parametrize("what", BAD)
def test_what_is_no_robot_is_refused_in_one_line(what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change, names, words = BAD[what]
    path = tmp_path / "bad.urdf"
    path.write_text(change(URDF))
    assert importer.main([str(path), "-o", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err
    assert message.startswith("error: ") and message.count("\n") == 1
    assert "bad.urdf" in message and words in message, message
    assert all(name in message for name in names), message
    assert {p.name for p in tmp_path.iterdir()} == {"bad.urdf"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--feet", "nose"], 'no link "nose"'),
        (["--freeze", "tail"], 'no joint "tail"'),
        (["--freeze", "neck=left"], "--freeze"),
        (["--freeze", "neck=2"], "-1 to 1 rad"),
        (["--stance", "0,1"], "--stance"),
        (["--stance", "0,1,0"], '"fl_knee"'),
        (["-o", "../.x"], "not the name"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dog.urdf"
    path.write_text(URDF)
    assert importer.main([str(path), *options]) == 2
    message = capsys.readouterr().err
    assert words in message and message.count("\n") == 1, message


def test_feet_are_named_by_their_place() -> None:
    four = [np.array([x, y, 0.0]) for x, y in ((-1, 1), (1, -1), (1, 1), (-1, -1))]
    assert foot_names(four) == ["LH", "RF", "LF", "RH"]
    assert foot_names([np.array([0.0, y, 0]) for y in (-0.1, 0.1)]) == ["R", "L"]
    six = [np.array([x, y, 0.0]) for x in (1, 0, -1) for y in (1, -1)]
    assert foot_names(six) == ["LF", "RF", "LM", "RM", "LH", "RH"]
