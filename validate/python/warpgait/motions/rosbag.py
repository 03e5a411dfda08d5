"""Bags of ROS 1 and ROS 2, with the messages of the MCAP files; the facts are a message on `/warpgait/facts`."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..files import write_bytes
from .format import Format
from .motion import Motion
from .ros import CONVENTIONS, Store, record

_METADATA, _DATABASE = "metadata.yaml", "motion.db3"


def _fill(form: Format, motion: Motion, store: Store, bag: Any) -> None:
    """Write all messages to a bag."""
    connections: dict[str, Any] = {}

    def write(topic: str, t: float, message: Any) -> None:
        if topic not in connections:
            connections[topic] = bag.add_connection(topic, message.__msgtype__, typestore=store.types)
        bag.write(connections[topic], round(t * 1e9), store.content(message))

    write("/warpgait/facts", 0.0, store.make("std_msgs/String", data=form.facts_json(motion)))
    record(motion, store, write)


def _write(motion: Motion, target: Path) -> None:
    library, store = ROS_1.require("rosbags.rosbag1"), Store(ROS_1.require("rosbags.typesys"), version=1)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "motion.bag"
        with library.Writer(made) as bag:
            _fill(ROS_1, motion, store, bag)
        write_bytes(target, made.read_bytes())


def _write_folder(motion: Motion, target: Path) -> None:
    library, store = ROS_2.require("rosbags.rosbag2"), Store(ROS_2.require("rosbags.typesys"), version=2)
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "motion"
        with library.Writer(made, version=8) as bag:
            _fill(ROS_2, motion, store, bag)
        for name in (_DATABASE, _METADATA):
            write_bytes(target / name, (made / name).read_bytes())


def _format(name: str, purpose: str, ending: str, write: Callable[[Motion, Path], None], files: tuple[str, ...] = ()) -> Format:
    conventions = CONVENTIONS | {"facts": "a std_msgs/String on /warpgait/facts"}
    return Format(name, purpose, ending, write, conventions, joints=False, ground=True, extra="ros", files=files)


ROS_1 = _format("rosbag1", "rosbag, rqt, RViz of ROS 1: what the MCAP file has", ".bag", _write)
ROS_2 = _format(
    "rosbag2", "ros2 bag, RViz of ROS 2: what the MCAP file has, in SQLite", ".rosbag2", _write_folder, (_DATABASE, _METADATA)
)
