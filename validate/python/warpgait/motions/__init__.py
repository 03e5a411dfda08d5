"""Motions for trainers, robots and viewers: one exporter a file, all from one `Motion`. `FORMATS` is the registry.

A new format is a file here with a `Format`, an entry in `FORMATS`, a row in docs/exports.md, and a test that reads it back.
"""

from __future__ import annotations

from . import amp, isaaclab, lerobot, locomujoco, mcap, mjcf, mjlab, rerun, rosbag, tables, usd
from .format import Format
from .motion import Motion
from .sampling import motion_of_plan, motion_of_replay

FORMATS: dict[str, Format] = {
    each.name: each
    for each in (
        tables.CSV,
        tables.JSON,
        tables.PARQUET,
        amp.FORMAT,
        isaaclab.FORMAT,
        mjlab.FORMAT,
        locomujoco.FORMAT,
        lerobot.FORMAT,
        mjcf.FORMAT,
        mcap.FORMAT,
        rosbag.ROS_1,
        rosbag.ROS_2,
        rerun.FORMAT,
        usd.FORMAT,
    )
}
"""Every format by its name."""

__all__ = ["FORMATS", "Format", "Motion", "motion_of_plan", "motion_of_replay"]
