"""All that a report shows of a mission, gathered from its messages in one pass."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from c3_station.bag import BagFacts, BagReader
from c3_station.node_params import C3, UAV
from c3_station.scenario_files import scenario_from_json
from c3_station.summary import LoggedEvent, Summarizer, Summary, digest, mission_start_s
from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.geometry import Point
from msgs_json.messages import DirectiveTaken, MissionStarted, Sample, SampleBatch
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
from msgs_json.topics import CLOCK, ODOM, RADIO_RX, RADIO_TX, ROUTE, STRING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from c3_station.scenario import Scenario
    from c3_station.summary import Record
    from msgs_json.geometry import Cell, GridSpec
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
    strange: int
    """Messages to C3 that the UAV did not say: damaged or forged; none of it is in `survey`."""
    contacts: dict[str, tuple[tuple[float, ContactState | None], ...]]
    """By AUV: when C3 changed its mind about what its silence means."""
    delivered: tuple[tuple[float, float], ...]
    """Share of the region of which C3 has samples, by its own count: each change."""

    def regions(self, scenario: Scenario) -> tuple[tuple[float, GridSpec], ...]:
        """Return what was to be surveyed: as ordered, and from when the UAV flew by another."""
        regions = [(0.0, scenario.region)]
        for each in self.events:
            if isinstance(each.event, DirectiveTaken):
                region = replace(scenario.region, masked=each.event.directive.masked)
                if region != regions[-1][1]:
                    regions.append((each.stamp_s, region))
        return tuple(regions)

    def taken_out(self, scenario: Scenario) -> frozenset[Cell]:
        """Return the cells of the order that the operator did not want surveyed in the end."""
        _, region = self.regions(scenario)[-1]
        return frozenset(region.masked) - frozenset(scenario.region.masked)


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
    deliveries = _Deliveries()
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
            case Text() if topic == RADIO_TX.resolve(f'/{UAV}'):
                deliveries.said(message.data)
            case Text() if topic == RADIO_RX.resolve(f'/{C3}'):
                deliveries.heard(message.data)
    start_s = mission_start_s(summarizer.events)
    for track in tracks.values():
        track.times_s = [time_s - start_s for time_s in track.times_s]
    events = (
        LoggedEvent(each.stamp_s - start_s, each.source, each.event) for each in summarizer.events
    )
    scenario = _scenario(summarizer.events)
    survey, strange = deliveries.survey(scenario)
    return MissionRecord(
        scenario=scenario,
        summary=summarizer.summary(facts),
        facts=facts,
        events=tuple(sorted(events, key=lambda each: each.stamp_s)),
        tracks=tracks,
        routes=tuple((time_s - start_s, points) for time_s, points in routes),
        survey=survey,
        strange=strange,
        contacts={
            auv: tuple((stamp_s - start_s, contact) for stamp_s, contact in changes)
            for auv, changes in summarizer.contacts.items()
        },
        delivered=tuple((stamp_s - start_s, share) for stamp_s, share in summarizer.delivered),
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


class _Deliveries:
    """
    What C3 heard by radio, as far as the UAV said it.

    C3 refuses by its key what was damaged on the way, or forged. A bag has no key: genuine is what
    is the same as something that the UAV said, byte for byte. Where the bag does not hold what the
    UAV said (at sea that may be on another graph), all is genuine but what cannot be.
    """

    def __init__(self) -> None:
        self._said: set[bytes] = set()
        """Digests, as the keys of what was heard."""
        self._heard: dict[bytes, tuple[Sample, ...] | None] = {}
        """The samples that each message brought; None where it cannot be read."""

    def said(self, payload: bytes) -> None:
        """Take what the UAV said."""
        self._said.add(digest(payload))

    def heard(self, payload: bytes) -> None:
        """Take what C3 heard; some of it several times."""
        try:
            _, body = codec.decode(payload)
        except MessageError:
            samples = None
        else:
            samples = body.samples if isinstance(body, SampleBatch) else ()
        self._heard[digest(payload)] = samples

    def survey(self, scenario: Scenario | None) -> tuple[dict[tuple[str, int], Sample], int]:
        """Return the samples by AUV and number, and how many messages were not genuine."""
        survey: dict[tuple[str, int], Sample] = {}
        strange = 0
        for key, samples in self._heard.items():
            is_said = key in self._said or not self._said
            if is_said and samples is not None and _can_be(samples, scenario):
                for sample in samples:
                    survey.setdefault((sample.auv, sample.number), sample)
            else:
                strange += 1
        return survey, strange


def _can_be(samples: Iterable[Sample], scenario: Scenario | None) -> bool:
    """Return whether samples are of AUVs and cells of the mission, as C3 demands it, too."""
    if scenario is None:
        return True
    auvs = {auv.name for auv in scenario.auvs}
    return all(
        sample.auv in auvs and scenario.region.problem_with(sample.cell) is None
        for sample in samples
    )


def _scenario(events: Iterable[LoggedEvent]) -> Scenario | None:
    for each in events:
        if isinstance(each.event, MissionStarted):
            return scenario_from_json(each.event.scenario)
    return None
