"""What robots that nobody looked at before had in their files: names, shapes, inertias and joints that import must cope with, or refuse clearly."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from test_importer import SIDES, URDF, leg, pup, swap

from warpgait import importer
from warpgait.assemble import is_backward
from warpgait.inertia import nearest_moments
from warpgait.model import load_spec
from warpgait.skeleton import Skeleton

SPEED = ["--speed-limit", "10"]


def skeleton_of(path: Path, *words: str) -> Skeleton:
    return importer.read(path, importer.arguments([str(path), *words]))


def refusal(path: Path, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert importer.main([str(path), "-o", str(path.with_name("out")), *words]) == 2
    message = capsys.readouterr().err
    assert message.startswith("error: ") and message.count("\n") == 1, message
    assert message.count(path.name) == 1, message
    return message


def cube(folder: Path) -> str:
    """A mesh that is a cube with edges of 6 cm, whose principal axes are arbitrary."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    lines = [f"v {0.03 * x + 0.001} {0.03 * y} {0.03 * z - 0.002 * x * y}" for x, y, z in corners]
    faces = [
        (1, 2, 4),
        (1, 4, 3),
        (5, 8, 6),
        (5, 7, 8),
        (1, 6, 2),
        (1, 5, 6),
        (3, 4, 8),
        (3, 8, 7),
        (1, 3, 7),
        (1, 7, 5),
        (2, 6, 8),
        (2, 8, 4),
    ]
    (folder / "cube.obj").write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in faces)]) + "\n")
    return '<asset><mesh name="cube" file="cube.obj"/></asset><worldbody>'


def test_boxes_of_an_mjcfs_meshes_lie_along_the_axes_of_their_files(tmp_path: Path) -> None:
    """MuJoCo turns a mesh into its principal axes; of a cube that is about round, they lie anywhere, and boxes along them reach out of it."""
    path = tmp_path / "pup.xml"
    hip = '<geom type="sphere" size="0.02" mass="0.5" contype="0" conaffinity="0"/>'
    text = pup().replace("<worldbody>", cube(tmp_path)).replace(hip, '<geom type="mesh" mesh="cube" mass="0.5"/>')
    path.write_text(text)
    for robot_leg in skeleton_of(path, *SPEED).legs:
        link = robot_leg.links[0]
        corners = np.concatenate([shape.corners() for shape in link.shapes]) - link.anchor
        assert np.abs(np.ptp(corners, axis=0) - 0.06).max() < 0.006


SCENE = '<body name="ball" pos="2 0 0.1"><freejoint/><geom type="sphere" size="0.1"/></body></worldbody>'


def test_what_floats_in_a_scene_beside_the_robot_is_no_part_of_it(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    camera = '<camera name="watch" mode="targetbody" target="ball"/>'
    path.write_text(pup().replace("</worldbody>", SCENE).replace("<worldbody>", f"<worldbody>{camera}"))
    found = skeleton_of(path, *SPEED)
    assert found.base.body == "trunk" and len(found.legs) == 4
    assert any('"ball"' in note for note in found.notes)


def test_the_only_body_with_legs_floats_if_the_file_does_not_say_so(tmp_path: Path) -> None:
    path = tmp_path / "pup.xml"
    path.write_text(pup().replace("<freejoint/>", ""))
    found = skeleton_of(path, *SPEED)
    assert found.base.body == "trunk" and any('"trunk" floats' in note for note in found.notes)


def test_legs_that_hang_on_the_world_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As in the MJCF that MuJoCo's compiler makes of a URDF, which takes the base for a part of the world."""
    path = tmp_path / "pup.xml"
    text = pup().replace('<body name="trunk" pos="0 0 0.4"><freejoint/>', "").replace("</body></worldbody>", "</worldbody>")
    path.write_text(text)
    message = refusal(path, capsys, *SPEED)
    assert '"fl_a"' in message and "no base" in message


def test_textures_and_skins_need_not_be_there(tmp_path: Path) -> None:
    path = tmp_path / "pup.xml"
    asset = '<asset><texture name="fur" type="2d" file="fur.png"/><material name="fur" texture="fur"/></asset><worldbody>'
    path.write_text(pup().replace("<worldbody>", asset).replace('size="0.2 0.1 0.05"', 'size="0.2 0.1 0.05" material="fur"'))
    assert len(skeleton_of(path, *SPEED).legs) == 4


def test_a_closed_loop_names_the_bodies_that_it_ties(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pup.xml"
    loop = '<equality><connect body1="fl_c" body2="fr_c" anchor="0 0 0"/></equality></mujoco>'
    path.write_text(pup().replace("</mujoco>", loop))
    message = refusal(path, capsys, *SPEED)
    assert '"fl_c" and "fr_c"' in message


def test_the_nearest_moments_are_those_of_a_body() -> None:
    for moments in ([1.0, 2.0, 5.0], [3.0, 3.0, 3.0], [0.1, 0.2, 0.29], [1e-6, 1.0, 4.0]):
        nearest = np.sort(nearest_moments(np.array(moments)))
        assert nearest[0] > 0 and nearest[2] < nearest[0] + nearest[1]
        if moments[2] < moments[0] + moments[1]:
            np.testing.assert_allclose(nearest, moments, rtol=1e-9)


def test_impossible_inertias_of_a_urdf_are_mended_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, moment = tmp_path / "dog.urdf", 0.7 * 0.1**2 / 6
    path.write_text(URDF.replace(f'ixx="{moment}"', f'ixx="{5 * moment}"'))
    assert "--mend-inertias" in refusal(path, capsys)
    found = skeleton_of(path, "--mend-inertias")
    assert sum('"fl_hip", "fr_hip", "rl_hip", "rr_hip"' in note for note in found.notes) == 1
    np.testing.assert_allclose(np.linalg.eigvalsh(found.legs[0].links[0].inertia)[2] / moment, 5.0, rtol=0.2)


def test_impossible_inertias_of_an_mjcf_are_mended_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "pup.xml", tmp_path / "out"
    inertial = '<inertial pos="0 0 0" mass="0.5" diaginertia="0.001 0.001 0.009"/>'
    path.write_text(pup().replace('range="-0.9 0.9"/>', f'range="-0.9 0.9"/>{inertial}'))
    assert "inertia" in refusal(path, capsys, *SPEED)
    assert importer.main([str(path), "-o", str(out), "--mend-inertias", *SPEED]) == 0
    assert '"fl_a"' in capsys.readouterr().out
    assert load_spec(out.with_suffix(".xml")).compile().nbody > 12


def test_the_inertia_of_something_larger_than_the_robot_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Some files say 1 kg m², or 100, of every link, because a simulation once took those of the shapes instead."""
    path, moment = tmp_path / "dog.urdf", 0.7 * 0.1**2 / 6
    same = [f'i{a}="{moment}"' for a in ("xx", "yy", "zz")]
    path.write_text(URDF.replace(" ".join(same), " ".join(word.replace(f"{moment}", "1") for word in same)))
    message = refusal(path, capsys)
    assert '"fl_hip"' in message and "1.2 m" in message and "put its inertia right" in message


ELEMENTS: dict[str, tuple[Callable[[str], str], list[str]]] = {
    "four angles": (
        swap('<origin xyz="0.2 0.05 0"/>', '<origin xyz="0.2 0.05 0" rpy="0 0 0 0"/>'),
        ['"fl_roll"', "rpy", "3 numbers"],
    ),
    "words for a place": (swap('<origin xyz="0.2 0.05 0"/>', '<origin xyz="0.2 left 0"/>'), ['"fl_roll"', "left"]),
    "no direction": (swap('<axis xyz="0 -1 0"/>', '<axis xyz="0 0 0"/>'), ['"fl_pitch"', "no direction"]),
    "two axes": (swap('<axis xyz="0 -1 0"/>', '<axis xyz="0 -1 0"/><axis xyz="0 1 0"/>'), ['"fl_pitch"', "2 different <axis>"]),
    "a flat box": (swap('<box size="0.03 0.03 0.18"/>', '<box size="0.03 0 0.18"/>'), ['"fl_thigh"', "size"]),
    "a ball of no size": (swap('<sphere radius="0.02"/>', '<sphere radius="0"/>'), ['"fl_foot"', "radius"]),
    "a ball without a size": (swap('<sphere radius="0.02"/>', "<sphere/>"), ['"fl_foot"', "no radius"]),
    "no shape": (swap('<sphere radius="0.02"/>', ""), ['"fl_foot"', "nothing"]),
    "an unknown shape": (swap('<sphere radius="0.02"/>', '<torus r="1"/>'), ['"fl_foot"', "<torus>"]),
    "two joints of one name": (swap('name="fl_knee"', 'name="fr_knee"'), ['"fr_knee"', "no other joint"]),
    "a joint without a name": (swap('<joint name="fl_knee" ', "<joint "), ["every joint needs a name"]),
    "a mesh scaled by two numbers": (
        swap('<sphere radius="0.02"/>', '<mesh filename="a.stl" scale="1 1"/>'),
        ['"fl_foot"', "scale", "3 numbers"],
    ),
}


@pytest.mark.parametrize("what", ELEMENTS)
def test_elements_of_a_urdf_that_are_none_are_refused_by_name(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, words = ELEMENTS[what]
    path = tmp_path / "dog.urdf"
    path.write_text(change(URDF))
    message = refusal(path, capsys)
    assert all(word in message for word in words), message


def test_what_a_urdf_says_twice_alike_counts_once_and_what_is_not_its_own_not(tmp_path: Path) -> None:
    path, axis = tmp_path / "dog.urdf", '<axis xyz="0 -1 0"/>'
    extra = '<collision_checking><capsule name="test"/></collision_checking>'  # of another program
    path.write_text(URDF.replace(axis, axis + axis).replace("</inertial>", f"</inertial>{extra}"))
    assert len(skeleton_of(path).legs) == 4


def test_all_absent_limits_are_asked_for_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "pup.xml"
    path.write_text(pup().split("<actuator>")[0].replace('<joint range="-2.6 2.6"/>', "") + "</mujoco>")
    message = refusal(path, capsys)
    assert "--speed-limit" in message and "--torque-limit" in message
    path.write_text(path.read_text().replace('range="-0.9 0.9"', ""))
    assert all(flag in refusal(path, capsys) for flag in ("--speed-limit", "--torque-limit", "--range"))


def test_values_may_begin_with_a_minus() -> None:
    options = importer.arguments(["a.urdf", "--range", "-3,2", "--forward", "-x", "--stance", "-0.1,0.7,-1.4"])
    assert (options.range, options.forward, options.stance) == ([-3.0, 2.0], "-x", [-0.1, 0.7, -1.4])


def test_slow_joints_have_a_long_cycle(tmp_path: Path) -> None:
    path = tmp_path / "dog.urdf"
    path.write_text(URDF)
    found = importer.build(path, "dog", importer.arguments([str(path), "--speed-limit", "2"]))
    assert found.robot.gait_cycle == pytest.approx(3.0)
    assert any("slowest joint" in note for note in found.skeleton.notes)


def test_legs_whose_names_look_backward_are_noticed(tmp_path: Path) -> None:
    path = tmp_path / "dog.urdf"
    text = URDF
    for short, long in (("fl", "front_left"), ("fr", "front_right"), ("rl", "rear_left"), ("rr", "rear_right")):
        text = text.replace(f'"{short}_', f'"{long}_')
    path.write_text(text)
    for forward, backward in (("x", False), ("-x", True)):
        legs = skeleton_of(path, "--forward", forward).legs
        assert is_backward(legs, [robot_leg.foot for robot_leg in legs]) == backward


def test_parts_that_hit_each_other_in_a_given_stance_are_noted(tmp_path: Path) -> None:
    path = tmp_path / "dog.urdf"
    path.write_text(URDF.replace('<cylinder radius="0.01" length="0.16"/>', '<box size="0.02 0.3 0.02"/>'))
    found = importer.build(path, "dog", importer.arguments([str(path), "--stance", "0,-0.7,-1.4"]))
    assert any("in the stance" in note and "hits" in note for note in found.skeleton.notes), found.skeleton.notes


def test_contact_points_are_below_the_trunk(tmp_path: Path) -> None:
    """Legs that spread far to the sides reach beside the trunk, too, but there is no ground there that the trunk is not in."""
    path = tmp_path / "wide.urdf"
    text = URDF[: URDF.index('<link name="fl_hip">')] + "\n".join(leg(name) for name in SIDES) + "</robot>"
    path.write_text(text.replace('lower="-0.9" upper="0.9"', 'lower="-2.5" upper="2.5"').replace("0.4 0.2 0.1", "0.4 0.1 0.3"))
    robot = importer.build(path, "wide", importer.arguments([str(path)])).robot
    floor = robot.torso.center[2] - robot.torso.half_size[2]
    assert all(box.center[2] + box.half_size[2] <= floor for box in robot.reach)


def test_an_mjcf_compiles_with_what_was_left_out(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    key = '<keyframe><key name="home" qpos="0 0 0.4 1 0 0 0  0 0 -1 0 0 -1 0 0 -1 0 0 -1  2 0 0.1 1 0 0 0"/></keyframe></mujoco>'
    path.write_text(pup().replace("</worldbody>", SCENE).replace("</mujoco>", key))
    assert mujoco.MjModel.from_xml_path(str(path)).nkey == 1
    found = skeleton_of(path, *SPEED)
    assert found.key == {} and any("keyframes" in note for note in found.notes)
