"""Motion files of Isaac Lab's AMP tasks: an archive with names, angles, and poses and velocities of the bodies.

Isaac Lab's loader finds joints and bodies by name, so their order is free. It takes quaternions as w, x, y, z.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .format import Format, write_npz
from .motion import Motion, whole_rate


def _write(motion: Motion, target: Path) -> None:
    single = np.float32
    write_npz(
        target,
        {
            "fps": np.array(whole_rate(motion, "Isaac Lab"), np.int64),
            "dof_names": np.array(motion.joint_names),
            "body_names": np.array(motion.body_names),
            "dof_positions": motion.joint_position.astype(single),
            "dof_velocities": motion.joint_velocity.astype(single),
            "body_positions": motion.body_position.astype(single),
            "body_rotations": motion.body_quaternion_wxyz.astype(single),
            "body_linear_velocities": motion.body_linear_velocity.astype(single),
            "body_angular_velocities": motion.body_angular_velocity.astype(single),
            "warpgait": np.array(FORMAT.facts_json(motion)),
        },
    )


FORMAT = Format(
    name="isaaclab",
    purpose="Isaac Lab's motion loader (humanoid_amp and tasks like it)",
    ending=".isaaclab.npz",
    write=_write,
    conventions={
        "body_rotations": "wxyz",
        "dof_names": "the loader finds joints and bodies by name",
        "numbers": "float32, as its loader has them",
    },
    rate=50.0,
)
