"""Motion files of mjlab and BeyondMimic (whole_body_tracking): an archive of joints, and of poses and velocities of the bodies.

The loaders read no names. mjlab takes joints and bodies in the order of MuJoCo, depth first, which is the order here; BeyondMimic on Isaac
Sim has PhysX's order, breadth first, so `joint_names` and `body_names` are in the file for those who must sort.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .format import Format, write_npz
from .motion import Motion


def _write(motion: Motion, target: Path) -> None:
    single = np.float32
    write_npz(
        target,
        {
            "fps": np.array([motion.rate], single),
            "joint_pos": motion.joint_position.astype(single),
            "joint_vel": motion.joint_velocity.astype(single),
            "body_pos_w": motion.body_position.astype(single),
            "body_quat_w": motion.body_quaternion_wxyz.astype(single),
            "body_lin_vel_w": motion.body_linear_velocity.astype(single),
            "body_ang_vel_w": motion.body_angular_velocity.astype(single),
            "joint_names": np.array(motion.joint_names),
            "body_names": np.array(motion.body_names),
            "warpgait": np.array(FORMAT.facts_json(motion)),
        },
    )


FORMAT = Format(
    name="mjlab",
    purpose="mjlab's tracking task, and BeyondMimic after sorting by name",
    ending=".mjlab.npz",
    write=_write,
    conventions={
        "body_quat_w": "wxyz",
        "order": "joints and bodies as in the model, depth first, without the world; body_lin_vel_w of the origins of the bodies' frames",
        "numbers": "float32, as its loader has them",
    },
    rate=50.0,
)
