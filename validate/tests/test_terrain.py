"""Grounds from arrays and from recordings of ROS."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from warpgait.errors import InputError
from warpgait.ground import write_terrain
from warpgait.terrain import main, unrolled

DEFINITION = """
grid_map_msgs/GridMapInfo info
string[] layers
string[] basic_layers
std_msgs/Float32MultiArray[] data
uint16 outer_start_index
uint16 inner_start_index
================================================================================
MSG: grid_map_msgs/GridMapInfo
std_msgs/Header header
float64 resolution
float64 length_x
float64 length_y
geometry_msgs/Pose pose
"""


def heights() -> npt.NDArray[np.float32]:
    """a[i, j] of 7 x 5, i against x and j against y; the same from no other side."""
    i, j = np.mgrid[0:7, 0:5]
    return np.asarray(0.01 * (6 - i) + 0.001 * (4 - j) ** 2, dtype=np.float32)


def message(array: npt.NDArray[np.float32], make: Any = None, start: tuple[int, int] = (0, 0)) -> Any:
    """A GridMap around x = 2, y = 1, its circular buffer rolled to `start`; `make` gives the type of a part by its name."""
    make = make or (lambda _: lambda **fields: SimpleNamespace(**fields))
    rolled = np.roll(array, start, axis=(0, 1))
    rows, columns = array.shape
    dimension = make("std_msgs/msg/MultiArrayDimension")
    layout = make("std_msgs/msg/MultiArrayLayout")(
        dim=[
            dimension(label="column_index", size=columns, stride=rows * columns),
            dimension(label="row_index", size=rows, stride=rows),
        ],
        data_offset=0,
    )
    data = make("std_msgs/msg/Float32MultiArray")(layout=layout, data=rolled.T.ravel())
    stamp = make("builtin_interfaces/msg/Time")(sec=0, nanosec=0)
    pose = make("geometry_msgs/msg/Pose")(
        position=make("geometry_msgs/msg/Point")(x=2.0, y=1.0, z=0.0),
        orientation=make("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0),
    )
    info = make("grid_map_msgs/msg/GridMapInfo")(
        header=make("std_msgs/msg/Header")(stamp=stamp, frame_id="map"), resolution=0.02, length_x=0.14, length_y=0.1, pose=pose
    )
    return make("grid_map_msgs/msg/GridMap")(
        info=info,
        layers=["elevation"],
        basic_layers=["elevation"],
        data=[data],
        outer_start_index=start[0],
        inner_start_index=start[1],
    )


def test_arrays_are_written_with_spacing_place_and_layout(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    for layout, corner in (("picture", (1.96, 0.94)), ("y-up", (1.96, 0.94)), ("x-y", (1.94, 0.96)), ("grid-map", (1.94, 0.96))):
        write_terrain(path, heights(), spacing=0.02, layout=layout, origin=(2.0, 1.0))
        ground = np.load(path)
        np.testing.assert_allclose(ground["origin"], corner, atol=1e-12)
        assert str(ground["layout"]) == layout and ground["spacing"] == 0.02
        np.testing.assert_array_equal(ground["heights"], heights())
    write_terrain(path, np.full((5, 5), 200, dtype=np.int16), spacing=0.1, height_scale=0.005)
    np.testing.assert_allclose(np.load(path)["heights"], 1.0)
    masked = np.ma.masked_equal(np.array([[-9999.0, 1.0, 2.0, 3.0]] * 4), -9999.0)
    write_terrain(path, masked, spacing=0.1)
    assert np.isnan(np.load(path)["heights"][:, 0]).all()
    for array, options, what in (
        (np.zeros(9), {}, "two dimensions"),
        (np.zeros((3, 9)), {}, "at least 4"),
        (np.full((5, 5), np.inf), {}, "finite"),
        (np.zeros((5, 5), dtype=complex), {}, "numbers"),
        (np.zeros((5, 5), dtype=np.int16), {}, "height_scale is missing"),
        (np.zeros((5, 5)), {"height_scale": 0.0}, "other than 0"),
        (np.zeros((5, 5)), {"layout": "xy"}, "picture, y-up, x-y, grid-map"),
        (np.zeros((5, 5)), {"spacing": 0.0}, "from 0.001"),
        (np.zeros((5, 5)), {"origin": (0.0, np.nan)}, "x and y"),
        (np.zeros((5, 5)), {"origin": (0.0, 0.0, 0.0)}, "x and y"),
    ):
        with pytest.raises(InputError, match=what):
            write_terrain(path, array, **{"spacing": 0.02, **options})  # type: ignore[arg-type]


def test_circular_buffers_are_unrolled() -> None:
    for start in ((0, 0), (3, 0), (6, 4)):
        np.testing.assert_array_equal(unrolled(message(heights(), start=start), "elevation"), heights())
    with pytest.raises(InputError, match="the message has elevation"):
        unrolled(message(heights()), "height")


@pytest.mark.parametrize("kind", ["ros1", "ros2", "mcap"])
def test_recordings_of_ros_are_read(tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(DEFINITION, "grid_map_msgs/msg/GridMap"))

    def make(name: str) -> Any:
        def build(**fields: Any) -> Any:
            if name == "std_msgs/msg/Header" and kind == "ros1":
                fields["seq"] = 0
            return store.types[name](**fields)

        return build

    first = heights().copy()
    first[0, 0] = np.nan
    messages = [message(first, make), message(heights(), make, (2, 3))]
    path = tmp_path / ("a.bag" if kind == "ros1" else "a")
    writer: Any = Writer1(path)
    if kind != "ros1":
        writer = Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3)
    with writer:
        connection = writer.add_connection("/map", "grid_map_msgs/msg/GridMap", typestore=store)
        for time, item in enumerate(messages):
            serialize = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr
            writer.write(connection, time, serialize(item, "grid_map_msgs/msg/GridMap"))
    output = tmp_path / "ground.npz"
    recordings = [path, *path.glob("*.mcap")] if kind == "mcap" else [path]
    for recording in recordings:
        output.unlink(missing_ok=True)
        assert main([str(recording), "--topic", "/map", "-o", str(output)]) == 0, capsys.readouterr().err
        ground = np.load(output)
        np.testing.assert_array_equal(ground["heights"], heights())
        assert str(ground["layout"]) == "grid-map" and ground["spacing"] == 0.02
        np.testing.assert_allclose(ground["origin"], (1.94, 0.96), atol=1e-12)
    assert main([str(path), "--topic", "/map", "--message", "0", "-o", str(output)]) == 0
    assert np.isnan(np.load(output)["heights"][0, 0])
    capsys.readouterr()
    for words, what in (
        (["--topic", "/none"], "topics with one: /map"),
        (["--topic", "/map", "--layer", "height"], "the message has elevation"),
        (["--topic", "/map", "--message", "9"], "/map has 2 messages"),
    ):
        assert main([str(path), *words, "-o", str(output)]) == 2
        assert what in capsys.readouterr().err
    broken = tmp_path / "broken.bag"
    broken.write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    assert main([str(broken), "--topic", "/map", "-o", str(output)]) == 2
    assert "not a recording of ROS" in capsys.readouterr().err
