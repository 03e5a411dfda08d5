"""Trajectories of LocoMuJoCo 1.x: an archive of what MuJoCo knows of each frame, with the parts of the model that it checks.

Its loader refuses members that it does not know, so the certificate is in `metadata`, as JSON. No member needs pickle.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..arrays import Array
from .format import Format, write_npz
from .motion import Motion

_MODEL = (
    "body_rootid",
    "body_weldid",
    "body_mocapid",
    "body_pos",
    "body_quat",
    "body_ipos",
    "body_iquat",
    "site_bodyid",
    "site_pos",
    "site_quat",
)
_DATA = ("xpos", "xquat", "cvel", "subtree_com", "site_xpos", "site_xmat")


def _dynamic(motion: Motion) -> dict[str, Array]:
    """MuJoCo's quantities of each frame, (K, …)."""
    model = motion.model
    data = mujoco.MjData(model)
    found: dict[str, list[Array]] = {name: [] for name in _DATA}
    for qpos, qvel in zip(motion.qpos, motion.qvel, strict=True):
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        for name in _DATA:
            found[name].append(getattr(data, name).copy())
    return {name: np.array(values) for name, values in found.items()}


def _write(motion: Motion, target: Path) -> None:
    model = motion.model
    members: dict[str, Any] = {
        "joint_names": np.array([model.joint(i).name for i in range(model.njnt)]),
        "body_names": np.array([model.body(i).name for i in range(model.nbody)]),
        "site_names": np.array([model.site(i).name for i in range(model.nsite)]),
        "frequency": np.array(motion.rate),
        "metadata": np.array(FORMAT.facts_json(motion)),
        "njnt": np.array(model.njnt),
        "jnt_type": model.jnt_type,
        "nbody": np.array(model.nbody),
        "nsite": np.array(model.nsite),
        **{name: getattr(model, name) for name in _MODEL},
        "qpos": motion.qpos,
        "qvel": motion.qvel,
        **_dynamic(motion),
        "split_points": np.array([0, len(motion.t)]),
    }
    write_npz(target, members)


FORMAT = Format(
    name="locomujoco",
    purpose="LocoMuJoCo 1.x, Trajectory.load",
    ending=".locomujoco.npz",
    write=_write,
    conventions={
        "order": "MuJoCo's, with the world and the free joint",
        "quaternions": "wxyz",
        "qvel": "MuJoCo's: the base's angular velocity is in the base frame",
    },
    rate=100.0,
)
