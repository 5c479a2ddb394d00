import struct
from array import array
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.errors import InputError
from lme.perception.point_cloud import Projection, cloud_points, point_times, to_scan

SEEDS = st.integers(0, 2**32 - 1)
FLOAT32, FLOAT64, INT16 = 7, 8, 3


def field(name, offset, datatype=FLOAT32, count=1):
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=count)


XYZ = (field("x", 0), field("y", 4), field("z", 8))


def message(points, order="<", letter="f", offsets=(0, 4, 8), point_step=16, padding=0, fields=None):
    """A cloud (rows, columns, 3) packed value by value, the bytes between filled with rubbish."""
    rows, columns, _ = points.shape
    datatype = {"f": FLOAT32, "d": FLOAT64}[letter]
    row_step = columns * point_step + padding
    data = bytearray(b"\xa5" * (rows * row_step))
    for i in range(rows):
        for j in range(columns):
            for value, offset in zip(points[i, j], offsets, strict=True):
                struct.pack_into(order + letter, data, i * row_step + j * point_step + offset, value)
    named = [field(name, offset, datatype) for name, offset in zip("xyz", offsets, strict=True)]
    return SimpleNamespace(
        height=rows,
        width=columns,
        fields=fields or named,
        is_bigendian=order == ">",
        point_step=point_step,
        row_step=row_step,
        data=bytes(data),
    )


@given(
    SEEDS,
    st.sampled_from("<>"),
    st.sampled_from(
        [("f", (0, 4, 8), 12), ("f", (9, 1, 17), 26), ("d", (0, 8, 16), 24), ("d", (20, 4, 12), 33)]
    ),
    st.integers(0, 9),
)
def test_a_packed_cloud_is_read_back(seed, order, layout, padding):
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, 5.0, (rng.integers(1, 5), rng.integers(1, 7), 3)).astype(np.float32)
    points[rng.random(points.shape) < 0.1] = np.nan
    letter, offsets, point_step = layout
    read = cloud_points(message(points, order, letter, offsets, point_step, padding))
    np.testing.assert_array_equal(read, points.reshape(-1, 3))


@pytest.mark.parametrize(
    "kind", [bytes, bytearray, memoryview, lambda b: np.frombuffer(b, np.uint8), lambda b: array("B", b)]
)
def test_data_may_be_any_kind_of_bytes(kind):
    points = np.arange(6.0).reshape(1, 2, 3)
    cloud = message(points)
    cloud.data = kind(cloud.data)
    np.testing.assert_array_equal(cloud_points(cloud), points[0])


def test_extra_fields_of_a_cloud_are_ignored_in_any_order():
    points = np.arange(9.0).reshape(1, 3, 3)
    cloud = message(points, point_step=20)
    cloud.fields = [field("ring", 12, INT16), *reversed(cloud.fields), field("rgb", 16, 6, 4)]
    np.testing.assert_array_equal(cloud_points(cloud), points[0])


def test_a_cloud_of_one_row_may_leave_its_row_step_zero():
    points = np.arange(6.0).reshape(1, 2, 3)
    cloud = message(points)
    cloud.row_step = 0
    np.testing.assert_array_equal(cloud_points(cloud), points[0])


@pytest.mark.parametrize(("height", "width"), [(0, 0), (1, 0), (0, 5)])
def test_an_empty_message_is_an_empty_cloud(height, width):
    cloud = SimpleNamespace(
        height=height, width=width, fields=XYZ, is_bigendian=False, point_step=12, row_step=0, data=b""
    )
    assert cloud_points(cloud).shape == (0, 3)


def test_a_message_of_rosbags_is_read_and_projected():
    rosbags = pytest.importorskip("rosbags.typesys")
    types = rosbags.get_typestore(rosbags.Stores.ROS2_HUMBLE).types
    points = np.array([[2.0, 0.0, 0.5], [0.0, 3.0, 0.5]], np.float32)
    make = types["sensor_msgs/msg/PointField"]
    cloud = types["sensor_msgs/msg/PointCloud2"](
        header=None,
        height=1,
        width=2,
        fields=[make(name, 4 * axis, FLOAT32, 1) for axis, name in enumerate("xyz")],
        is_bigendian=False,
        point_step=12,
        row_step=24,
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=True,
    )
    scan = to_scan(cloud_points(cloud), Projection())
    assert (scan.ranges[180], scan.ranges[270]) == (2.0, 3.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"fields": XYZ[:2]},
        {"fields": ()},
        {"fields": (field("x", 0, INT16), *XYZ[1:])},
        {"fields": (*XYZ[:2], field("z", 8, 99))},
        {"fields": (field("x", 0, FLOAT32, 3), *XYZ[1:])},
        {"fields": (*XYZ[:2], field("z", 14))},
        {"data": bytes(63)},
        {"row_step": 31},
        {"row_step": 40},
    ],
)
def test_a_message_that_does_not_hold_together_is_refused(changes, says):
    cloud = message(np.zeros((2, 2, 3)))
    vars(cloud).update(changes)
    with says.raises(InputError):
        cloud_points(cloud)


UINT32 = 6
STAMP = 1_700_000_000_123_456_789  # [ns]
AFTER = np.array([0.0, 0.0125, 0.05, 0.0999])  # [s]


def timed(name, datatype, values, order="<"):
    """Four points with the time of each in a field after z."""
    letter = {FLOAT32: "f", FLOAT64: "d", UINT32: "I"}[datatype]
    data = b"".join(struct.pack(f"{order}fff{letter}", 1.0, 2.0, 3.0, value) for value in values)
    step = len(data) // len(values)
    fields = [*XYZ, field(name, 12, datatype)]
    return SimpleNamespace(
        height=1, width=len(values), fields=fields, is_bigendian=order == ">", point_step=step,
        row_step=len(data), data=data,
    )  # fmt: skip


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("name", "datatype", "values"),
    [
        ("timestamp", FLOAT64, STAMP + 1e9 * AFTER),  # livox_ros_driver2
        ("timestamp", FLOAT64, 1e-9 * STAMP + AFTER),  # HesaiLidar_ROS_2.0, rslidar_sdk
        ("time", FLOAT32, AFTER),  # velodyne, unilidar_sdk
        ("t", UINT32, (1e9 * AFTER).astype(int)),  # ouster-ros
    ],
    ids=["Livox", "Hesai", "Velodyne", "Ouster"],
)
def test_the_times_of_points_as_drivers_give_them(name, datatype, values, order):
    cloud = timed(name, datatype, [value.item() for value in values], order)
    np.testing.assert_allclose(point_times(cloud, STAMP), AFTER, atol=1e-6)
    np.testing.assert_array_equal(cloud_points(cloud), np.tile([1.0, 2.0, 3.0], (4, 1)))


@pytest.mark.parametrize(
    ("name", "values"),
    [("intensity", AFTER), ("time", 0.0 * AFTER), ("time", 50.0 + AFTER), ("time", AFTER + np.nan)],
    ids=["none", "all at once", "of another clock", "not a number"],
)
def test_a_cloud_that_does_not_say_when_its_points_were_measured(name, values):
    assert point_times(timed(name, FLOAT32, values.tolist()), STAMP) is None


def test_an_empty_cloud_has_no_times():
    cloud = timed("time", FLOAT32, AFTER.tolist())
    cloud.width, cloud.data = 0, b""
    assert point_times(cloud, STAMP) is None
