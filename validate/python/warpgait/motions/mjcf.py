"""A MuJoCo scene: one MJCF file with the robot, the ground as a heightfield, and a keyframe for each frame of the motion."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..arrays import Array
from ..files import write_bytes
from ..scene import world_spec
from .format import Format
from .motion import Motion


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.12g}" for value in values)


def _write(motion: Motion, target: Path) -> None:
    assert motion.model_path is not None  # of a format with joints
    spec = world_spec(motion.model_path, motion.ground, motion.friction, motion.model.opt.gravity)
    if spec.meshes or spec.textures:  # the file may lie anywhere
        spec.meshdir = str((motion.model_path.parent / spec.meshdir).resolve())
    spec.compile()
    root = ElementTree.fromstring(spec.to_xml())
    size = root.find("size")
    if size is not None:
        size.attrib.pop("nkey", None)
    keys = root.find("keyframe")
    if keys is None:
        keys = ElementTree.SubElement(root, "keyframe")
    for t, qpos, qvel in zip(motion.t, motion.qpos, motion.qvel, strict=True):
        frame = {"name": f"t={t:.6g}", "time": f"{t:.12g}", "qpos": _numbers(qpos), "qvel": _numbers(qvel)}
        ElementTree.SubElement(keys, "key", frame)
    custom = root.find("custom")
    if custom is None:
        custom = ElementTree.SubElement(root, "custom")
    for text in custom.findall("text"):  # MuJoCo writes them as CDATA, which ElementTree does not keep
        text.attrib.setdefault("data", text.text or " ")
        text.text = None
    ElementTree.SubElement(custom, "text", {"name": "warpgait", "data": FORMAT.facts_json(motion)})
    write_bytes(target, ElementTree.tostring(root, encoding="utf-8") + b"\n")


def keyframes(model: object) -> tuple[Array, Array, Array]:
    """Times (K,), qpos (K, nq) and qvel (K, nv) of the keyframes of a motion in a loaded scene; that of the stance is left out."""
    names = [model.key(i).name for i in range(model.nkey)]  # type: ignore[attr-defined]
    own = np.array([name.startswith("t=") for name in names])
    return model.key_time[own], model.key_qpos[own], model.key_qvel[own]  # type: ignore[attr-defined]


FORMAT = Format(
    name="mujoco",
    purpose="MuJoCo and its viewer: robot, heightfield, a keyframe for each frame",
    ending=".scene.xml",
    write=_write,
    conventions={
        "keyframes": "named t=SECONDS; qpos: base position, base quaternion wxyz, joints as in the model; qvel: base linear velocity in the world, angular in the base frame, joint speeds",
        "ground": "the heightfield terrain, with half a meter of level margin around it",
    },
    rate=50.0,
    ground=True,
)
