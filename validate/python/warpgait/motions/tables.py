"""CSV, JSON and Parquet: one column for each number, one row for each frame."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..files import write_bytes, write_text
from .format import Format
from .motion import Motion

_AXES = ("x", "y", "z")
_QUATERNION = ("w", "x", "y", "z")


def columns(motion: Motion) -> dict[str, Array]:
    """The columns (K,) of a table, in order. Names end in the axis; those of joints and feet begin with what is meant."""
    table: dict[str, Array] = {"time": motion.t}

    def add(name: str, values: Array, parts: tuple[str, ...] = _AXES) -> None:
        for part, column in zip(parts, values.T, strict=True):
            table[f"{name}_{part}"] = column

    add("base_position", motion.base_position)
    add("base_quaternion", motion.base_quaternion_wxyz, _QUATERNION)
    add("base_linear_velocity", motion.base_linear_velocity)
    add("base_angular_velocity", motion.base_angular_velocity)
    add("center_of_mass", motion.center_of_mass)
    for j, joint in enumerate(motion.joint_names):
        table[f"{joint}_position"] = motion.joint_position[:, j]
    for j, joint in enumerate(motion.joint_names):
        table[f"{joint}_velocity"] = motion.joint_velocity[:, j]
    for j, joint in enumerate(motion.joint_names):
        table[f"{joint}_torque"] = motion.joint_torque[:, j]
    for e, foot in enumerate(motion.foot_names):
        add(f"{foot}_foot_position", motion.foot_position[:, e])
        add(f"{foot}_contact_position", motion.contact_position[:, e])
        add(f"{foot}_force", motion.foot_force[:, e])
        table[f"{foot}_contact"] = motion.foot_contact[:, e].astype(float)
    return table


def ground_as_data(motion: Motion) -> dict[str, Any]:
    """The ground as plain data."""
    ground = motion.ground
    return {"heights": ground.heights.tolist(), "origin": ground.origin.tolist(), "spacing": ground.spacing.tolist()}


def _write_csv(motion: Motion, target: Path) -> None:
    table = columns(motion)
    text = io.StringIO()
    for key, value in CSV.facts(motion).items():
        text.write(f"# {key}: {json.dumps(value, allow_nan=False)}\n")
    text.write(",".join(table) + "\n")
    np.savetxt(text, np.column_stack(list(table.values())), fmt="%.17g", delimiter=",")
    write_text(target, text.getvalue())


def _write_json(motion: Motion, target: Path) -> None:
    data = JSON.facts(motion) | {
        "time": motion.t.tolist(),
        "base_position": motion.base_position.tolist(),
        "base_quaternion_wxyz": motion.base_quaternion_wxyz.tolist(),
        "base_linear_velocity": motion.base_linear_velocity.tolist(),
        "base_angular_velocity": motion.base_angular_velocity.tolist(),
        "center_of_mass": motion.center_of_mass.tolist(),
        "joint_position": motion.joint_position.tolist(),
        "joint_velocity": motion.joint_velocity.tolist(),
        "joint_torque": motion.joint_torque.tolist(),
        "body_position": motion.body_position.tolist(),
        "body_quaternion_wxyz": motion.body_quaternion_wxyz.tolist(),
        "foot_position": motion.foot_position.tolist(),
        "contact_position": motion.contact_position.tolist(),
        "foot_force": motion.foot_force.tolist(),
        "foot_contact": motion.foot_contact.tolist(),
        "foot_normal": motion.foot_normal.tolist(),
        "ground": ground_as_data(motion),
    }
    write_text(target, json.dumps(data, allow_nan=False) + "\n")


def _write_parquet(motion: Motion, target: Path) -> None:
    arrow, parquet = PARQUET.require("pyarrow"), PARQUET.require("pyarrow.parquet")
    table = arrow.table(columns(motion))
    content = io.BytesIO()
    parquet.write_table(table.replace_schema_metadata({"warpgait": PARQUET.facts_json(motion)}), content, compression="zstd")
    write_bytes(target, content.getvalue())


_COLUMNS = {"columns": "base_quaternion_w, _x, _y, _z; joints by name; contact is 1 or 0"}

CSV = Format(
    name="csv",
    purpose="anyone; lines that begin with # hold conventions and certificate",
    ending=".csv",
    write=_write_csv,
    conventions=_COLUMNS,
    joints=False,
)
JSON = Format(
    name="json",
    purpose="anyone; arrays by frame",
    ending=".json",
    write=_write_json,
    conventions={"quaternion_order": "wxyz"},
    joints=False,
    ground=True,
)
PARQUET = Format(
    name="parquet",
    purpose="pandas, polars, DuckDB; conventions and certificate in the metadata of the schema, key warpgait",
    ending=".parquet",
    write=_write_parquet,
    conventions=_COLUMNS,
    joints=False,
)
