"""A LeRobot data set, version 3.0, with one episode: a folder of Parquet tables and JSON.

`observation.state` is the base's pose and velocities, then joint angles and speeds; `action` is the joint angles of the next frame, which is
what a position-controlled robot would be told. Names of all numbers are in `meta/info.json`. One key differs from a data set of LeRobot's own:
`meta/info.json` has `warpgait`, with conventions and certificate.
"""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..files import write_bytes, write_text
from .format import Format
from .motion import Motion, whole_rate

_VERSION = "v3.0"
_QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
_CHUNK = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_FIRST = _CHUNK.format(chunk_index=0, file_index=0)
_INFO, _STATS, _TASKS = "meta/info.json", "meta/stats.json", "meta/tasks.parquet"
_EPISODES, _DATA = f"meta/episodes/{_FIRST}", f"data/{_FIRST}"

Values = npt.NDArray[Any]


def _names(motion: Motion) -> dict[str, list[str]]:
    axes, quaternion = "xyz", "wxyz"
    base = [f"base_position_{a}" for a in axes] + [f"base_quaternion_{a}" for a in quaternion]
    base += [f"base_linear_velocity_{a}" for a in axes] + [f"base_angular_velocity_{a}" for a in axes]
    return {
        "observation.state": base + [f"{j}.pos" for j in motion.joint_names] + [f"{j}.vel" for j in motion.joint_names],
        "action": [f"{j}.pos" for j in motion.joint_names],
        "observation.effort": [f"{j}.torque" for j in motion.joint_names],
        "observation.contact": list(motion.foot_names),
        "observation.foot_force": [f"{foot}_{a}" for foot in motion.foot_names for a in axes],
    }


def _features(motion: Motion) -> dict[str, Values]:
    """What is recorded of each frame, (K, n)."""
    q = motion.joint_position
    state = [motion.base_position, motion.base_quaternion_wxyz, motion.base_linear_velocity, motion.base_angular_velocity]
    return {
        "observation.state": np.hstack([*state, q, motion.joint_velocity]).astype(np.float32),
        "action": np.vstack([q[1:], q[-1:]]).astype(np.float32),
        "observation.effort": motion.joint_torque.astype(np.float32),
        "observation.contact": motion.foot_contact.astype(np.float32),
        "observation.foot_force": motion.foot_force.reshape(len(q), -1).astype(np.float32),
    }


def _counters(motion: Motion, rate: int) -> dict[str, Values]:
    """The columns that every data set has, (K,)."""
    K = len(motion.t)
    zero = np.zeros(K, np.int64)
    return {
        "timestamp": (np.arange(K) / rate).astype(np.float32),
        "frame_index": np.arange(K),
        "episode_index": zero,
        "index": np.arange(K),
        "task_index": zero,
    }


def _statistics(values: Values) -> dict[str, list[float]]:
    columns = values.reshape(len(values), -1).astype(float)
    found = {"min": columns.min(0), "max": columns.max(0), "mean": columns.mean(0), "std": columns.std(0)}
    found |= {f"q{round(100 * q):02d}": np.quantile(columns, q, axis=0) for q in _QUANTILES}
    return {name: each.tolist() for name, each in found.items()} | {"count": [len(columns)]}


def _write(motion: Motion, target: Path) -> None:
    arrow, parquet = FORMAT.require("pyarrow"), FORMAT.require("pyarrow.parquet")
    rate, names = whole_rate(motion, "LeRobot"), _names(motion)
    features, counters = _features(motion), _counters(motion, rate)
    statistics = {name: _statistics(values) for name, values in {**features, **counters}.items()}
    task = f"walk over the ground of {motion.name}"
    K = len(motion.t)

    def table(file: str, content: Any) -> None:
        buffer = io.BytesIO()
        parquet.write_table(content, buffer, compression="snappy")
        write_bytes(target / file, buffer.getvalue())

    lists = {n: arrow.FixedSizeListArray.from_arrays(arrow.array(v.ravel()), v.shape[1]) for n, v in features.items()}
    table(_DATA, arrow.table({**lists, **counters}))
    episode: dict[str, list[Any]] = {
        "episode_index": [0],
        "tasks": [[task]],
        "length": [K],
        "data/chunk_index": [0],
        "data/file_index": [0],
        "dataset_from_index": [0],
        "dataset_to_index": [K],
        "meta/episodes/chunk_index": [0],
        "meta/episodes/file_index": [0],
    }
    for name, found in statistics.items():
        episode |= {f"stats/{name}/{key}": [value] for key, value in found.items()}
    table(_EPISODES, arrow.table(episode))
    # LeRobot finds a task by the index of a pandas frame.
    index = "__index_level_0__"
    tasks = arrow.table({"task_index": np.zeros(1, np.int64), index: [task]})
    numbers: dict[str, Any] = {
        "name": "task_index",
        "field_name": "task_index",
        "pandas_type": "int64",
        "numpy_type": "int64",
        "metadata": None,
    }
    texts: dict[str, Any] = {
        "name": None,
        "field_name": index,
        "pandas_type": "unicode",
        "numpy_type": "object",
        "metadata": None,
    }
    pandas: dict[str, Any] = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [numbers, texts],
        "pandas_version": "2.0.0",
    }
    table(_TASKS, tasks.replace_schema_metadata({"pandas": json.dumps(pandas)}))
    declared: dict[str, Any] = {n: {"dtype": "float32", "shape": [v.shape[1]], "names": names[n]} for n, v in features.items()}
    declared |= {n: {"dtype": str(v.dtype), "shape": [1], "names": None} for n, v in counters.items()}
    info: dict[str, Any] = {
        "codebase_version": _VERSION,
        "robot_type": motion.robot,
        "total_episodes": 1,
        "total_frames": K,
        "total_tasks": 1,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": rate,
        "splits": {"train": "0:1"},
        "data_path": f"data/{_CHUNK}",
        "video_path": None,
        "features": declared,
        "warpgait": FORMAT.facts(motion),
    }
    write_text(target / _STATS, json.dumps(statistics, indent=2, allow_nan=False) + "\n")
    write_text(target / _INFO, json.dumps(info, indent=2, allow_nan=False) + "\n")


FORMAT = Format(
    name="lerobot",
    purpose="LeRobot 3.0, one episode",
    ending=".lerobot",
    write=_write,
    conventions={
        "observation.state": "base position 3, quaternion wxyz 4, linear velocity 3, angular velocity 3 (world), joint angles, joint speeds",
        "action": "joint angles of the next frame",
        "numbers": "float32",
    },
    rate=50.0,
    files=(_DATA, _EPISODES, _TASKS, _STATS, _INFO),
)
