"""All that a report shows of a mission, gathered from its messages in one pass."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from c3_station.bag import BagFacts, BagReader
from c3_station.node_params import C3, UAV
from c3_station.scenario_files import scenario_from_json
from c3_station.summary import LoggedEvent, Summarizer, Summary, mission_start_s
from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.geometry import Point
from msgs_json.messages import MissionStarted, Sample, SampleBatch
from msgs_json.ros_messages import (
    NANOSECONDS,
    ClockTime,
    Odometry,
    RosMessage,
    Text,
    TrackPath,
    odometry_from_cdr,
    text_from_cdr,
)
from msgs_json.topics import CLOCK, ODOM, RADIO_RX, ROUTE, STRING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from c3_station.scenario import Scenario
    from c3_station.summary import Record
    from msgs_json.messages import ContactState

_store = get_typestore(Stores.ROS2_JAZZY)


@dataclass(slots=True)
class Track:
    """Where a vehicle was, tick by tick; lists of the same length."""

    times_s: list[float] = field(default_factory=list)
    positions: list[Point] = field(default_factory=list)
    z_m: list[float] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionRecord:
    """A mission as recorded; times are seconds since it was started."""

    scenario: Scenario | None
    """None where the record does not hold the beginning of the mission."""
    summary: Summary
    facts: BagFacts
    events: tuple[LoggedEvent, ...]
    """By time."""
    tracks: dict[str, Track]
    """By vehicle."""
    routes: tuple[tuple[float, tuple[Point, ...]], ...]
    """The worst-case route of each sortie from C3 to C3, with the time it was published."""
    survey: dict[tuple[str, int], Sample]
    """What was delivered to C3, by AUV and sample number."""
    contacts: dict[str, tuple[tuple[float, ContactState | None], ...]]
    """By AUV: when C3 changed its mind about what its silence means."""


def read_mission(bag: Path) -> MissionRecord:
    """
    Return a mission from its bag.

    Raises
    ------
    BagError
        There is no such bag, or it is broken.
    ScenarioError
        The recorded scenario is not one that this version can read.

    """
    with BagReader(bag) as reader:
        return gather_mission(bag_records(reader), reader.facts)


def bag_records(reader: BagReader) -> Iterator[Record]:
    """Yield the messages of a bag that reports use, decoded, by time."""
    for message in reader.messages():
        try:
            value = _decoded(message.ros_type, message.cdr)
        except (ValueError, SerdeError, struct.error):
            continue  # not what its topic says; whoever takes it seriously counts it
        if value is not None:
            yield message.topic, message.log_time_ns / NANOSECONDS, value


def gather_mission(records: Iterable[Record], facts: BagFacts) -> MissionRecord:
    """Return a mission from its messages, in any order within a tick."""
    summarizer = Summarizer()
    tracks: dict[str, Track] = {}
    routes: list[tuple[float, tuple[Point, ...]]] = []
    survey: dict[tuple[str, int], Sample] = {}
    for topic, _, message in records:
        summarizer.message(topic, message)
        match message:
            case Odometry() if topic.endswith(f'/{ODOM.name}'):
                track = tracks.setdefault(topic.split('/')[1], Track())
                track.times_s.append(message.stamp_s)
                track.positions.append(message.position)
                track.z_m.append(message.z_m)
            case TrackPath() if topic == ROUTE.resolve(f'/{UAV}'):
                routes.append((message.stamp_s, message.points))
            case Text() if topic == RADIO_RX.resolve(f'/{C3}'):
                _add_delivered(message.data, survey)
    start_s = mission_start_s(summarizer.events)
    for track in tracks.values():
        track.times_s = [time_s - start_s for time_s in track.times_s]
    events = (
        LoggedEvent(each.stamp_s - start_s, each.source, each.event) for each in summarizer.events
    )
    return MissionRecord(
        scenario=_scenario(summarizer.events),
        summary=summarizer.summary(facts),
        facts=facts,
        events=tuple(sorted(events, key=lambda each: each.stamp_s)),
        tracks=tracks,
        routes=tuple((time_s - start_s, points) for time_s, points in routes),
        survey=survey,
        contacts={
            auv: tuple((stamp_s - start_s, contact) for stamp_s, contact in changes)
            for auv, changes in summarizer.contacts.items()
        },
    )


def _decoded(ros_type: str, cdr: bytes) -> RosMessage | None:
    if ros_type == STRING:
        return Text(text_from_cdr(cdr))
    if ros_type == ODOM.ros_type:
        return odometry_from_cdr(cdr)
    if ros_type in (CLOCK.ros_type, ROUTE.ros_type):
        message: Any = _store.deserialize_cdr(cdr, ros_type)
        if ros_type == CLOCK.ros_type:
            return ClockTime(time_s=_time_s(message.clock))
        positions = [pose.pose.position for pose in message.poses]
        return TrackPath(
            stamp_s=_time_s(message.header.stamp),
            points=tuple(Point(east_m=each.x, north_m=each.y) for each in positions),
        )
    return None


def _time_s(time: Any) -> float:  # noqa: ANN401  message classes are made at run time
    seconds: int = time.sec
    fraction: int = time.nanosec
    return seconds + fraction / NANOSECONDS


def _add_delivered(payload: bytes, survey: dict[tuple[str, int], Sample]) -> None:
    """Add what a batch brought; C3 hears each one, and what it refuses is none."""
    try:
        _, body = codec.decode(payload)
    except MessageError:
        return
    if isinstance(body, SampleBatch):
        for sample in body.samples:
            survey[sample.auv, sample.number] = sample


def _scenario(events: Iterable[LoggedEvent]) -> Scenario | None:
    for each in events:
        if isinstance(each.event, MissionStarted):
            return scenario_from_json(each.event.scenario)
    return None
