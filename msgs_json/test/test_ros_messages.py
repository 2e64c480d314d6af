"""Against two independent readers of CDR: rosbags' typestore and rclpy."""

from __future__ import annotations

import importlib
import math
import struct
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from rclpy.serialization import deserialize_message
from rosbags.typesys import Stores, get_typestore

from msgs_json.geometry import Point
from msgs_json.ros_messages import (
    ClockTime,
    ColouredCells,
    Diagnostic,
    Diagnostics,
    Markers,
    Occupancy,
    Odometry,
    PoseSetpoint,
    RosMessage,
    Text,
    TrackPath,
    clock_from_cdr,
    nanoseconds,
    odometry_from_cdr,
    text_from_cdr,
    to_cdr,
)

STORE = get_typestore(Stores.ROS2_JAZZY)

HERE, THERE = Point(east_m=45.0, north_m=75.0), Point(east_m=-3.5, north_m=1e6)

MESSAGES: dict[str, list[RosMessage]] = {
    'std_msgs/msg/String': [Text(b''), Text('{"väl": "😀"}'.encode())],
    'nav_msgs/msg/Odometry': [
        Odometry(
            stamp_s=14.25,
            child_frame_id='auv_1/base_link',
            position=HERE,
            z_m=-5.0,
            heading_rad=2.5,
            speed_mps=1.0,
        )
    ],
    'nav_msgs/msg/Path': [
        TrackPath(stamp_s=6.0, points=(HERE, THERE), z_m=30.0),
        TrackPath(stamp_s=6.0, points=()),
    ],
    'geometry_msgs/msg/PoseStamped': [
        PoseSetpoint(stamp_s=1.5, position=HERE, z_m=-5.0, heading_rad=-math.pi / 2)
    ],
    'nav_msgs/msg/OccupancyGrid': [
        Occupancy(stamp_s=44.0, cell_m=10.0, values=((0, -1, -1), (-1, -1, 100)))
    ],
    'visualization_msgs/msg/MarkerArray': [
        Markers(
            stamp_s=44.0,
            cells=(
                ColouredCells(
                    name='survey',
                    centres=(HERE, THERE),
                    colours=((0.0, 0.5, 1.0), (1.0, 1.0, 0.25)),
                    width_m=10.0,
                ),
                ColouredCells(name='c3', centres=(), colours=(), width_m=5.0),
            ),
        ),
        Markers(stamp_s=0.0, cells=()),
    ],
    'diagnostic_msgs/msg/DiagnosticArray': [
        Diagnostics(
            stamp_s=10.0,
            statuses=(
                Diagnostic(name='c3: mission', level=1, message='x', values=(('leg', '3'),)),
                Diagnostic(name='c3: auv_1', level=0, message='', values=()),
            ),
        )
    ],
    'rosgraph_msgs/msg/Clock': [ClockTime(time_s=1234.000000001)],
}
CASES = [(ros_type, message) for ros_type, some in MESSAGES.items() for message in some]
each_case = pytest.mark.parametrize(
    ('ros_type', 'message'), CASES, ids=[f'{t.rpartition("/")[2]}-{m!r:.30}' for t, m in CASES]
)


def read(ros_type: str, message: RosMessage) -> Any:  # noqa: ANN401  ROS enters here
    return STORE.deserialize_cdr(to_cdr(message), ros_type)


@each_case
def test_bytes_are_those_of_the_typestore(ros_type: str, message: RosMessage) -> None:
    cdr = to_cdr(message)
    plain = bytes(STORE.serialize_cdr(read(ros_type, message), ros_type))
    assert plain + bytes(-len(plain) % 4) == cdr  # DDS delivers whole words


@each_case
@pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")  # lark, of rclpy's making
def test_bytes_are_read_the_same_by_rclpy(ros_type: str, message: RosMessage) -> None:
    package, _, name = ros_type.split('/')
    ros_class = getattr(importlib.import_module(f'{package}.msg'), name)
    assert same(deserialize_message(to_cdr(message), ros_class), read(ros_type, message))


def same(by_rclpy: Any, by_typestore: Any) -> bool:  # noqa: ANN401
    """Compare two deserialized messages field by field."""
    if hasattr(by_rclpy, 'get_fields_and_field_types'):
        return all(
            same(getattr(by_rclpy, name), getattr(by_typestore, name))
            for name in by_rclpy.get_fields_and_field_types()
        )
    if isinstance(by_rclpy, str):
        return bool(by_rclpy == by_typestore)
    if isinstance(by_rclpy, bytes):  # rclpy's octet
        return by_rclpy == bytes([by_typestore])
    if hasattr(by_rclpy, '__len__'):
        return len(by_rclpy) == len(by_typestore) and all(
            same(a, b) for a, b in zip(by_rclpy, by_typestore, strict=True)
        )
    return bool(by_rclpy == by_typestore)


# --- what the fields mean ------------------------------------------------------------------------


def test_odometry_is_in_the_map_frame_with_speed_forward() -> None:
    (message,) = MESSAGES['nav_msgs/msg/Odometry']
    odometry = read('nav_msgs/msg/Odometry', message)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ('map', 'auv_1/base_link')
    assert (odometry.header.stamp.sec, odometry.header.stamp.nanosec) == (14, 250_000_000)
    position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    assert (position.x, position.y, position.z) == (45.0, 75.0, -5.0)
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(2.5)
    assert math.hypot(turn.z, turn.w) == pytest.approx(1.0)
    assert (turn.x, turn.y) == (0.0, 0.0)
    assert odometry.twist.twist.linear.x == 1.0
    assert odometry.twist.twist.linear.y == odometry.twist.twist.angular.z == 0.0


def test_paths_have_a_pose_per_point() -> None:
    path = read('nav_msgs/msg/Path', MESSAGES['nav_msgs/msg/Path'][0])
    places = [
        (pose.pose.position.x, pose.pose.position.y, pose.pose.position.z) for pose in path.poses
    ]
    assert places == [(45.0, 75.0, 30.0), (-3.5, 1e6, 30.0)]
    assert {pose.header.frame_id for pose in path.poses} == {'map'}


def test_occupancy_runs_east_then_north_from_the_south_west() -> None:
    grid = read('nav_msgs/msg/OccupancyGrid', MESSAGES['nav_msgs/msg/OccupancyGrid'][0])
    assert (grid.info.width, grid.info.height, grid.info.resolution) == (3, 2, 10.0)
    np.testing.assert_array_equal(grid.data, [0, -1, -1, -1, -1, 100])
    assert (grid.info.origin.position.x, grid.info.origin.orientation.w) == (0.0, 1.0)


def test_markers_are_cubes_with_a_colour_each() -> None:
    survey, station = read(
        'visualization_msgs/msg/MarkerArray', MESSAGES['visualization_msgs/msg/MarkerArray'][0]
    ).markers
    assert (survey.ns, survey.id, survey.type, survey.action) == ('survey', 0, 6, 0)
    assert (station.ns, station.id) == ('c3', 1)
    assert [(point.x, point.y) for point in survey.points] == [(45.0, 75.0), (-3.5, 1e6)]
    assert [(c.r, c.g, c.b, c.a) for c in survey.colors] == [(0, 0.5, 1, 1), (1, 1, 0.25, 1)]
    assert (survey.scale.x, survey.scale.y) == (10.0, 10.0)


# --- there and back ------------------------------------------------------------------------------

finite = st.floats(-1e7, 1e7)
frame_names = st.text(
    st.characters(exclude_categories=['Cs'], exclude_characters='\0'), min_size=1, max_size=20
)


@given(
    st.builds(
        Odometry,
        stamp_s=st.integers(0, 10**9).map(lambda milliseconds: milliseconds / 1000),
        child_frame_id=frame_names,
        position=st.builds(Point, east_m=finite, north_m=finite),
        z_m=finite,
        heading_rad=st.floats(-3.14, 3.14),
        speed_mps=st.floats(0, 100),
    )
)
def test_odometry_survives_the_way_there_and_back(odometry: Odometry) -> None:
    received = odometry_from_cdr(to_cdr(odometry))
    assert received.position == odometry.position
    assert (received.z_m, received.speed_mps) == (odometry.z_m, odometry.speed_mps)
    assert received.child_frame_id == odometry.child_frame_id
    assert received.stamp_s == pytest.approx(odometry.stamp_s, abs=1e-9)
    assert received.heading_rad == pytest.approx(odometry.heading_rad, abs=1e-12)


@given(frame_names, frame_names)
def test_odometry_of_any_frame_is_read(frame: str, child: str) -> None:
    message = read('nav_msgs/msg/Odometry', MESSAGES['nav_msgs/msg/Odometry'][0])
    message.header.frame_id, message.child_frame_id = frame, child
    received = odometry_from_cdr(bytes(STORE.serialize_cdr(message, 'nav_msgs/msg/Odometry')))
    assert (received.position, received.child_frame_id) == (HERE, child)


@given(st.binary(max_size=50))
def test_text_survives_the_way_there_and_back(data: bytes) -> None:
    assert text_from_cdr(to_cdr(Text(data))) == data


def test_text_is_read_from_a_big_endian_machine() -> None:
    assert text_from_cdr(b'\x00\x00\x00\x00' + struct.pack('>I', 4) + b'abc\0') == b'abc'


@pytest.mark.parametrize('time_s', [0.0, 14.0, 0.1 + 0.2, 1e9 + 1e-7])
def test_clock_survives_the_way_there_and_back(time_s: float) -> None:
    assert clock_from_cdr(to_cdr(ClockTime(time_s=time_s))) == pytest.approx(time_s, abs=1e-9)


@pytest.mark.parametrize(
    ('time_s', 'expected'), [(0.3, 300_000_000), (0.1 + 0.2, 300_000_000), (14.0, 14 * 10**9)]
)
def test_nanoseconds_are_rounded(time_s: float, expected: int) -> None:
    assert nanoseconds(time_s) == expected


# --- whatever arrives ----------------------------------------------------------------------------


@given(st.binary(max_size=800))
def test_noise_is_refused_or_read(cdr: bytes) -> None:
    for reader in (text_from_cdr, odometry_from_cdr, clock_from_cdr):
        try:
            reader(cdr)
        except ValueError:
            pass


ODOMETRY_CDR = to_cdr(MESSAGES['nav_msgs/msg/Odometry'][0])


@given(st.integers(0, len(ODOMETRY_CDR) - 1), st.binary(min_size=1, max_size=8))
def test_damaged_odometry_is_refused_or_finite(place: int, noise: bytes) -> None:
    cdr = ODOMETRY_CDR[:place] + noise + ODOMETRY_CDR[place + len(noise) :]
    try:
        odometry = odometry_from_cdr(cdr)
    except ValueError:
        return
    position = odometry.position
    assert all(map(math.isfinite, (position.east_m, position.north_m, odometry.z_m)))


@pytest.mark.parametrize('length', [0, 3, 8, 60, 100])
def test_cut_off_odometry_is_refused(length: int) -> None:
    with pytest.raises(ValueError, match='nav_msgs/msg/Odometry'):
        odometry_from_cdr(ODOMETRY_CDR[:length])


def test_odometry_and_clock_of_another_encoding_are_refused() -> None:
    # Read as if it were this one, every position would be wrong.
    message = read('nav_msgs/msg/Odometry', MESSAGES['nav_msgs/msg/Odometry'][0])
    cdr = bytes(STORE.serialize_cdr(message, 'nav_msgs/msg/Odometry', little_endian=False))
    with pytest.raises(ValueError, match='little-endian'):
        odometry_from_cdr(cdr)
    with pytest.raises(ValueError, match='little-endian'):
        clock_from_cdr(b'\x00\x00\x00\x00' + bytes(8))


@pytest.mark.parametrize('value', [math.nan, math.inf])
def test_odometry_that_is_not_finite_is_refused(value: float) -> None:
    message = read('nav_msgs/msg/Odometry', MESSAGES['nav_msgs/msg/Odometry'][0])
    message.pose.pose.position.z = value
    with pytest.raises(ValueError, match='not finite'):
        odometry_from_cdr(bytes(STORE.serialize_cdr(message, 'nav_msgs/msg/Odometry')))


@pytest.mark.parametrize(
    'cdr',
    [b'', b'\0\1\0\0', b'\0\1\0\0\0\0\0\0', b'\0\1\0\0\5\0\0\0ab\0', b'\1\1\0\0\1\0\0\0\0'],
    ids=['nothing', 'header', 'length_zero', 'too_short', 'other_encoding'],
)
def test_what_is_no_string_is_refused(cdr: bytes) -> None:
    with pytest.raises(ValueError, match='std_msgs/msg/String'):
        text_from_cdr(cdr)
