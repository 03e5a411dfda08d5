"""AMP motion files of the legged_gym family (AMP_for_hardware and what came from it): JSON with 61 numbers a frame.

Position 3, quaternion 4 (x, y, z, w), joints 12, toes in the base frame 12, linear velocity 3, angular velocity 3, joint speeds 12, toe
speeds 12. Legs FR, FL, RR, RL; loaders turn them into FL, FR, RL, RR. Loaders turn both velocities of the base from the base frame to the
world, so that is the frame in which they are written; toe speeds are the rates of the toes' places in the base frame.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import write_text
from .format import Format, corners, leg_joints
from .motion import Motion, turned_back, xyzw

LEGS = ("FR", "FL", "RR", "RL")


def _write(motion: Motion, target: Path) -> None:
    names = corners(motion)
    legs = leg_joints(motion)
    if any(len(legs[names[leg]]) != 3 for leg in LEGS):
        raise InputError(f"--to amp: a frame has room for three joints a leg; {motion.robot} has others")
    feet = [motion.foot_names.index(names[leg]) for leg in LEGS]
    joints = [joint for leg in LEGS for joint in legs[names[leg]]]
    K = len(motion.t)
    quaternion = motion.base_quaternion_wxyz
    toes = motion.in_base(motion.foot_position)
    spin = turned_back(quaternion, motion.base_angular_velocity)
    relative = turned_back(quaternion, motion.foot_velocity - motion.base_linear_velocity[:, None])
    toe_speed = relative - np.cross(spin[:, None], toes)
    frames = np.hstack(
        [
            motion.base_position,
            xyzw(quaternion),
            motion.joint_position[:, joints],
            toes[:, feet].reshape(K, 12),
            turned_back(quaternion, motion.base_linear_velocity),
            spin,
            motion.joint_velocity[:, joints],
            toe_speed[:, feet].reshape(K, 12),
        ]
    )
    data = {
        "LoopMode": "Clamp",
        "FrameDuration": 1 / motion.rate,
        "EnableCycleOffsetPosition": True,
        "EnableCycleOffsetRotation": True,
        "MotionWeight": 1.0,
        "JointNames": [motion.joint_names[j] for j in joints],
        "Frames": frames.tolist(),
        "warpgait": FORMAT.facts(motion),
    }
    write_text(target, json.dumps(data, allow_nan=False) + "\n")


FORMAT = Format(
    name="amp",
    purpose="AMP loaders of the legged_gym family (AMP_for_hardware)",
    ending=".amp.txt",
    write=_write,
    conventions={
        "frame": "position 3, quaternion xyzw 4, joints 12, toes 12, linear velocity 3, angular velocity 3, joint speeds 12, toe speeds 12",
        "legs": "FR, FL, RR, RL, each from the hip down; JointNames",
        "joint_zero": "that of the robot's own model",
        "velocities": "of the base: in the base frame; of the toes: rates of their places in the base frame",
    },
    rate=50.0,
)
