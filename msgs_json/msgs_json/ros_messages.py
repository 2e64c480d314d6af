"""
Standard ROS messages as plain values, and their CDR bytes.

Nodes publish these bytes as they are, and bags hold the same bytes, so that there is one
conversion for both. The layout comes from rosbags' typestore of ROS 2 Jazzy; only `Odometry`, sent
by every vehicle at every tick, is packed by hand (the tests compare it with the typestore's).
"""

from __future__ import annotations

import math
import struct
from functools import cache
from typing import Any

import msgspec
import numpy as np
from rosbags.typesys import Stores, get_typestore

from msgs_json.geometry import Point
from msgs_json.topics import STRING

MAP_FRAME = 'map'
NANOSECONDS = 1_000_000_000

_store = get_typestore(Stores.ROS2_JAZZY)


class Text(msgspec.Struct, frozen=True):
    """std_msgs/String: JSON, encoded as UTF-8."""

    data: bytes


class Odometry(msgspec.Struct, frozen=True, kw_only=True):
    """nav_msgs/Odometry in frame ``map``; twist is in the vehicle's frame (forward only)."""

    stamp_s: float
    child_frame_id: str
    position: Point
    z_m: float
    heading_rad: float
    speed_mps: float


class TrackPath(msgspec.Struct, frozen=True, kw_only=True):
    """nav_msgs/Path in frame ``map``, at a height."""

    stamp_s: float
    points: tuple[Point, ...]
    z_m: float = 0.0


class PoseSetpoint(msgspec.Struct, frozen=True, kw_only=True):
    """geometry_msgs/PoseStamped in frame ``map``."""

    stamp_s: float
    position: Point
    z_m: float
    heading_rad: float


class Occupancy(msgspec.Struct, frozen=True, kw_only=True):
    """nav_msgs/OccupancyGrid; values -1 (unknown) or 0 ... 100, row by row from the south."""

    stamp_s: float
    cell_m: float
    values: tuple[tuple[int, ...], ...]


class ColouredCells(msgspec.Struct, frozen=True, kw_only=True):
    """One marker: squares of a width, each with an (r, g, b) colour from 0 to 1."""

    name: str
    centres: tuple[Point, ...]
    colours: tuple[tuple[float, float, float], ...]
    width_m: float


class Markers(msgspec.Struct, frozen=True, kw_only=True):
    """visualization_msgs/MarkerArray in frame ``map``."""

    stamp_s: float
    cells: tuple[ColouredCells, ...]


class Diagnostic(msgspec.Struct, frozen=True, kw_only=True):
    """One diagnostic_msgs/DiagnosticStatus; level 0 OK, 1 WARN, 2 ERROR, 3 STALE."""

    name: str
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class Diagnostics(msgspec.Struct, frozen=True, kw_only=True):
    """diagnostic_msgs/DiagnosticArray."""

    stamp_s: float
    statuses: tuple[Diagnostic, ...]


class ClockTime(msgspec.Struct, frozen=True, kw_only=True):
    """rosgraph_msgs/Clock."""

    time_s: float


RosMessage = (
    Text | Odometry | TrackPath | PoseSetpoint | Occupancy | Markers | Diagnostics | ClockTime
)


def nanoseconds(time_s: float) -> int:
    """Return a time in whole nanoseconds."""
    return round(time_s * NANOSECONDS)


def prepare(ros_type: str) -> None:
    """Make the code for a message type now (some 10 ms), not when the first one is sent."""
    _store.get_msgdef(ros_type)


def to_cdr(message: RosMessage) -> bytes:
    """Return the little-endian CDR bytes of a message, encapsulation header included."""
    match message:
        case Text():
            return _text_cdr(message)
        case Odometry():
            return _odometry_cdr(message)
        case TrackPath():
            return _serialize('nav_msgs/msg/Path', _path(message))
        case PoseSetpoint():
            return _serialize('geometry_msgs/msg/PoseStamped', _setpoint(message))
        case Occupancy():
            return _serialize('nav_msgs/msg/OccupancyGrid', _occupancy(message))
        case Markers():
            return _serialize('visualization_msgs/msg/MarkerArray', _markers(message))
        case Diagnostics():
            return _serialize('diagnostic_msgs/msg/DiagnosticArray', _diagnostics(message))
        case ClockTime():
            return _serialize(
                'rosgraph_msgs/msg/Clock', _new('rosgraph_msgs/msg/Clock', _time(message.time_s))
            )


# --- String and Odometry by hand: they are on the hot path ---------------------------------------

_LITTLE_ENDIAN = b'\x00\x01\x00\x00'


def _text_cdr(text: Text) -> bytes:
    return _padded(_LITTLE_ENDIAN + struct.pack('<I', len(text.data) + 1) + text.data + b'\0')


def _padded(cdr: bytes) -> bytes:
    """Return the bytes as DDS delivers them: a multiple of 4, so that any two runs are equal."""
    return cdr + bytes(-len(cdr) % 4)


def text_from_cdr(cdr: bytes) -> bytes:
    """
    Return the UTF-8 bytes of a serialized std_msgs/String.

    Raises
    ------
    ValueError
        The bytes are not a serialized string.

    """
    if len(cdr) < 8 or cdr[:2] not in (b'\x00\x01', b'\x00\x00'):
        raise ValueError(f'not a serialized {STRING}')
    (length,) = struct.unpack_from('<I' if cdr[1] else '>I', cdr, 4)
    if not 1 <= length <= len(cdr) - 8:
        raise ValueError(f'not a serialized {STRING}: length {length} in {len(cdr)} bytes')
    return bytes(cdr[8 : 8 + length - 1])


def clock_from_cdr(cdr: bytes) -> float:
    """
    Return the seconds of a serialized rosgraph_msgs/Clock (little-endian).

    Raises
    ------
    ValueError
        The bytes are too short, or of another encoding.

    """
    _require_little_endian(cdr, 'rosgraph_msgs/msg/Clock')
    try:
        seconds, fraction = struct.unpack_from('<iI', cdr, 4)
    except struct.error as error:
        raise ValueError(f'not a serialized rosgraph_msgs/msg/Clock: {error}') from None
    return float(seconds + fraction / NANOSECONDS)


def _require_little_endian(cdr: bytes, ros_type: str) -> None:
    if cdr[:2] != _LITTLE_ENDIAN[:2]:  # the other two bytes are options, such as padding
        raise ValueError(f'not a serialized {ros_type} in little-endian CDR')


@cache
def _odometry_template(child_frame_id: str) -> tuple[bytes, int, int]:
    """Return the bytes of a zero odometry and the offsets of pose and twist."""
    zero = _new('geometry_msgs/msg/Vector3', 0.0, 0.0, 0.0)
    covariance = np.zeros(36)
    message = _new(
        'nav_msgs/msg/Odometry',
        _header(0.0),
        child_frame_id,
        _new('geometry_msgs/msg/PoseWithCovariance', _pose(_ORIGIN, 0.0, 0.0), covariance),
        _new(
            'geometry_msgs/msg/TwistWithCovariance',
            _new('geometry_msgs/msg/Twist', zero, zero),
            covariance,
        ),
    )
    template = _serialize('nav_msgs/msg/Odometry', message)
    pose = _odometry_pose_offset(len(MAP_FRAME), len(child_frame_id.encode()))
    return template, pose, pose + (7 + 36) * 8


def _odometry_pose_offset(frame_bytes: int, child_frame_bytes: int) -> int:
    # stamp, two strings (length, bytes, terminator), each aligned to 4; then doubles aligned to 8
    # as counted behind the 4 bytes of encapsulation.
    offset = 8 + 4 + frame_bytes + 1
    offset = -(-offset // 4) * 4 + 4 + child_frame_bytes + 1
    return 4 + -(-offset // 8) * 8


def _odometry_cdr(odometry: Odometry) -> bytes:
    template, pose, twist = _odometry_template(odometry.child_frame_id)
    cdr = bytearray(template)
    struct.pack_into('<iI', cdr, 4, *divmod(nanoseconds(odometry.stamp_s), NANOSECONDS))
    struct.pack_into(
        '<7d',
        cdr,
        pose,
        odometry.position.east_m,
        odometry.position.north_m,
        odometry.z_m,
        0.0,
        0.0,
        *_yaw_quaternion(odometry.heading_rad),
    )
    struct.pack_into('<d', cdr, twist, odometry.speed_mps)
    return bytes(cdr)


def odometry_from_cdr(cdr: bytes) -> Odometry:
    """
    Return a serialized nav_msgs/Odometry (any frame names, little-endian).

    Raises
    ------
    ValueError
        The bytes are too short or of another encoding, or a number in them is not finite.

    """
    _require_little_endian(cdr, 'nav_msgs/msg/Odometry')
    try:
        seconds, fraction, frame_bytes = struct.unpack_from('<iII', cdr, 4)
        child_at = 4 + -(-(12 + frame_bytes) // 4) * 4
        (child_bytes,) = struct.unpack_from('<I', cdr, child_at)
        child = bytes(cdr[child_at + 4 : child_at + 3 + child_bytes]).decode()
        pose = _odometry_pose_offset(frame_bytes - 1, child_bytes - 1)
        east_m, north_m, z_m, *quaternion = struct.unpack_from('<7d', cdr, pose)
        (speed_mps,) = struct.unpack_from('<d', cdr, pose + (7 + 36) * 8)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f'not a serialized nav_msgs/msg/Odometry: {error}') from None
    if not all(map(math.isfinite, (east_m, north_m, z_m, *quaternion, speed_mps))):
        raise ValueError('odometry holds a number that is not finite')
    return Odometry(
        stamp_s=seconds + fraction / NANOSECONDS,
        child_frame_id=child,
        position=Point(east_m=east_m, north_m=north_m),
        z_m=z_m,
        heading_rad=_yaw_rad(*quaternion),
        speed_mps=speed_mps,
    )


# --- everything else through the typestore ------------------------------------------------------

_ORIGIN = Point(east_m=0.0, north_m=0.0)


def _new(ros_type: str, *values: Any) -> Any:  # noqa: ANN401  message classes are made at run time
    return _store.types[ros_type](*values)


def _serialize(ros_type: str, message: Any) -> bytes:  # noqa: ANN401
    return _padded(bytes(_store.serialize_cdr(message, ros_type)))


def _time(time_s: float) -> Any:  # noqa: ANN401
    return _new('builtin_interfaces/msg/Time', *divmod(nanoseconds(time_s), NANOSECONDS))


def _header(stamp_s: float) -> Any:  # noqa: ANN401
    return _new('std_msgs/msg/Header', _time(stamp_s), MAP_FRAME)


def _yaw_quaternion(heading_rad: float) -> tuple[float, float]:
    """Return z and w of a rotation about the vertical."""
    return math.sin(heading_rad / 2.0), math.cos(heading_rad / 2.0)


def _yaw_rad(x: float, y: float, z: float, w: float) -> float:
    """Return the rotation about the vertical, whatever roll and pitch are."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _pose(position: Point, z_m: float, heading_rad: float) -> Any:  # noqa: ANN401
    return _new(
        'geometry_msgs/msg/Pose',
        _new('geometry_msgs/msg/Point', position.east_m, position.north_m, z_m),
        _new('geometry_msgs/msg/Quaternion', 0.0, 0.0, *_yaw_quaternion(heading_rad)),
    )


def _pose_stamped(stamp_s: float, position: Point, z_m: float, heading_rad: float) -> Any:  # noqa: ANN401
    return _new(
        'geometry_msgs/msg/PoseStamped', _header(stamp_s), _pose(position, z_m, heading_rad)
    )


def _path(path: TrackPath) -> Any:  # noqa: ANN401
    poses = [_pose_stamped(path.stamp_s, point, path.z_m, 0.0) for point in path.points]
    return _new('nav_msgs/msg/Path', _header(path.stamp_s), poses)


def _setpoint(setpoint: PoseSetpoint) -> Any:  # noqa: ANN401
    return _pose_stamped(setpoint.stamp_s, setpoint.position, setpoint.z_m, setpoint.heading_rad)


def _occupancy(grid: Occupancy) -> Any:  # noqa: ANN401
    values = np.array(grid.values, dtype=np.int8)
    rows, cols = values.shape
    info = _new(
        'nav_msgs/msg/MapMetaData',
        _time(grid.stamp_s),
        grid.cell_m,
        cols,
        rows,
        _pose(_ORIGIN, 0.0, 0.0),
    )
    return _new('nav_msgs/msg/OccupancyGrid', _header(grid.stamp_s), info, values.ravel())


def _markers(markers: Markers) -> Any:  # noqa: ANN401
    return _new(
        'visualization_msgs/msg/MarkerArray',
        [_marker(markers.stamp_s, number, cells) for number, cells in enumerate(markers.cells)],
    )


def _marker(stamp_s: float, number: int, cells: ColouredCells) -> Any:  # noqa: ANN401
    marker_type = _store.types['visualization_msgs/msg/Marker']
    colour = _store.types['std_msgs/msg/ColorRGBA']
    return marker_type(
        header=_header(stamp_s),
        ns=cells.name,
        id=number,
        type=6,  # CUBE_LIST
        action=0,
        pose=_pose(_ORIGIN, 0.0, 0.0),
        # A thin plate: depth is not to scale, the map is seen from above.
        scale=_new('geometry_msgs/msg/Vector3', cells.width_m, cells.width_m, 0.1),
        color=colour(1.0, 1.0, 1.0, 1.0),
        lifetime=_new('builtin_interfaces/msg/Duration', 0, 0),
        frame_locked=False,
        points=[
            _new('geometry_msgs/msg/Point', point.east_m, point.north_m, 0.0)
            for point in cells.centres
        ],
        colors=[colour(r, g, b, 1.0) for r, g, b in cells.colours],
        texture_resource='',
        texture=_new(
            'sensor_msgs/msg/CompressedImage', _header(stamp_s), '', np.zeros(0, dtype=np.uint8)
        ),
        uv_coordinates=[],
        text='',
        mesh_resource='',
        mesh_file=_new('visualization_msgs/msg/MeshFile', '', np.zeros(0, dtype=np.uint8)),
        mesh_use_embedded_materials=False,
    )


def _diagnostics(diagnostics: Diagnostics) -> Any:  # noqa: ANN401
    statuses = [
        _new(
            'diagnostic_msgs/msg/DiagnosticStatus',
            status.level,
            status.name,
            status.message,
            '',
            [_new('diagnostic_msgs/msg/KeyValue', key, value) for key, value in status.values],
        )
        for status in diagnostics.statuses
    ]
    return _new('diagnostic_msgs/msg/DiagnosticArray', _header(diagnostics.stamp_s), statuses)
