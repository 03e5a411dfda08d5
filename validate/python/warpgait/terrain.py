"""Elevation maps in recordings of ROS as grounds for scenarios.

    python -m warpgait.terrain recording.bag --topic /elevation_map --layer elevation -o ground.npz

reads a `grid_map_msgs/GridMap` from a bag of ROS 1, a bag of ROS 2 or an MCAP file. It needs rosbags: pip install "warpgait[ros]".
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .arguments import Parser
from .console import ERROR, complain, emit, run
from .errors import InputError
from .files import ensure_outputs
from .ground import write_terrain

_MESSAGE = "grid_map_msgs/msg/GridMap"
_TURN = 1e-6  # parts of a quaternion that count as a turn


def unrolled(message: Any, layer: str) -> npt.NDArray[np.float64]:
    """A layer of a `GridMap`, a[i, j] with i against x and j against y, its circular buffer unrolled so that a[0, 0] has the largest x and y."""
    if layer not in message.layers:
        raise InputError(f'layer "{layer}": there is none; the message has {", ".join(message.layers) or "no layers"}')
    data = message.data[list(message.layers).index(layer)]
    sizes = [(dimension.label, int(dimension.size)) for dimension in data.layout.dim]
    labels = [label for label, _ in sizes]
    if sorted(labels) != ["column_index", "row_index"]:
        raise InputError(f'layer "{layer}": dimensions {labels}, expected column_index and row_index')
    values = np.asarray(data.data, dtype=float)[int(data.layout.data_offset) :]
    shape = tuple(size for _, size in sizes)
    if values.size != shape[0] * shape[1]:
        raise InputError(f'layer "{layer}": {values.size} values do not make {shape[0]} x {shape[1]}')
    cells = values.reshape(shape)
    if labels[0] == "column_index":  # as Eigen stores a matrix
        cells = cells.T
    cells = np.roll(cells, (-int(message.outer_start_index), -int(message.inner_start_index)), axis=(0, 1))
    return np.where(np.isfinite(cells), cells, np.nan)


def read_grid_map(recording: Path, topic: str, number: int = -1) -> Any:
    """The message of a topic with this number, from 0; negative ones count from the end."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.highlevel.anyreader import AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise InputError('reading ROS recordings needs rosbags: pip install "warpgait[ros]"') from error
    if not recording.exists():
        raise InputError(f"{recording}: there is no such file or folder")
    try:
        with AnyReader([recording], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            maps = sorted({c.topic for c in reader.connections if c.msgtype == _MESSAGE})
            connections = [c for c in reader.connections if c.topic == topic and c.msgtype == _MESSAGE]
            if not connections:
                raise InputError(f"{recording}: no {_MESSAGE} on {topic}; topics with one: {', '.join(maps) or 'none'}")
            count = sum(c.msgcount for c in connections)
            wanted = number if number >= 0 else count + number
            for at, (connection, _, raw) in enumerate(reader.messages(connections=connections)):
                if at == wanted:
                    return reader.deserialize(raw, connection.msgtype)
    except InputError:
        raise
    except (AnyReaderError, OSError, ValueError, KeyError, AssertionError, RuntimeError) as error:
        raise InputError(f"{recording}: not a recording of ROS that can be read: {error}") from error
    raise InputError(f"{recording}: {topic} has {count} messages; there is no number {number}")


def convert(recording: Path, topic: str, layer: str, number: int, output: Path) -> str:
    """Write a layer of a `GridMap` as a ground; returns what it is."""
    message = read_grid_map(recording, topic, number)
    turn = message.info.pose.orientation
    if max(abs(turn.x), abs(turn.y), abs(turn.z)) > _TURN:
        raise InputError(f"{recording}: the map on {topic} is turned; ground must not be turned")
    heights = unrolled(message, layer)
    center = message.info.pose.position
    spacing = float(message.info.resolution)
    write_terrain(output, heights, spacing=spacing, layout="grid-map", origin=(float(center.x), float(center.y)))
    unknown = int(np.isnan(heights).sum())
    rows, columns = heights.shape
    return f"{layer}: {rows} x {columns} cells of {spacing:g} m around x = {center.x:.3f}, y = {center.y:.3f} m, {unknown} without data"


def main(words: list[str] | None = None) -> int:
    """Convert; returns 0, or 2 on bad input."""
    parser = Parser(
        prog="python -m warpgait.terrain",
        description="Write a layer of a grid_map in a ROS bag or an MCAP file as a ground for scenarios.",
    )
    parser.add_argument("recording", type=Path, help="a .bag file of ROS 1, the folder of a ROS 2 bag, or an .mcap file")
    parser.add_argument("--topic", required=True, help="the topic of the grid_map_msgs/GridMap")
    parser.add_argument("--layer", default="elevation", help="the layer with heights in m (default: elevation)")
    parser.add_argument("--message", type=int, default=-1, help="which message, from 0; default: -1, the last")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the .npz file to write")
    options = parser.parse_args(words)
    try:
        ensure_outputs([options.output], [options.recording])
        emit(convert(options.recording, options.topic, options.layer, options.message, options.output))
    except (InputError, OSError) as error:
        complain(error)
        return ERROR
    emit(f"wrote {options.output}; look at it with: warpgait terrain show {options.output}")
    return 0


if __name__ == "__main__":
    raise SystemExit(run(main))
