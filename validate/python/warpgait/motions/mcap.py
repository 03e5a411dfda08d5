"""MCAP files with messages of ROS 2, for Foxglove, RViz and ROS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..files import replacing
from .format import Format
from .motion import Motion
from .ros import CONVENTIONS, Store, record


def _write(motion: Motion, target: Path) -> None:
    library, store = FORMAT.require("mcap.writer"), Store(FORMAT.require("rosbags.typesys"), version=2)
    channels: dict[str, int] = {}
    with replacing(target) as temporary, temporary.open("wb") as file:
        writer = library.Writer(file)
        writer.start(profile="ros2", library="warpgait")
        writer.add_metadata("warpgait", {"facts": FORMAT.facts_json(motion)})

        def write(topic: str, t: float, message: Any) -> None:
            kind = message.__msgtype__
            if topic not in channels:
                definition = store.types.generate_msgdef(kind, ros_version=2)[0]
                schema = writer.register_schema(name=kind, encoding="ros2msg", data=definition.encode())
                channels[topic] = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            at = round(t * 1e9)
            writer.add_message(channels[topic], log_time=at, data=store.content(message), publish_time=at)

        record(motion, store, write)
        writer.finish()


FORMAT = Format(
    name="mcap",
    purpose="Foxglove, RViz, ROS 2: tf, joint states, odometry, wrenches, grid map, points, shapes",
    ending=".mcap",
    write=_write,
    conventions=CONVENTIONS,
    joints=False,
    ground=True,
)
