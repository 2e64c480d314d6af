"""Which topics a mission's bag holds: all that a run consists of, without the lockstep's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from auv_sim.world import WORLD
from c3_station.node_params import C3, UAV
from msgs_json.topics import (
    CLOCK,
    DIAGNOSTICS,
    EXPLORATION_MAP,
    MARKERS,
    MISSION_EVENTS,
    MISSION_STATUS,
    ODOM,
    PATH,
    RADIO_RX,
    RADIO_STATUS,
    RADIO_TX,
    ROUTE,
    SETPOINT,
    VEHICLE_ODOM,
    Topic,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from c3_station.scenario import Scenario

TOPICS_DRIVER = 'topics'
"""The driver that talks to an autopilot over topics, which are recorded too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedTopic:
    """One topic of a bag."""

    name: str
    """Absolute: namespace and relative name."""
    topic: Topic
    publisher: str
    """The node that publishes it, or words where it is more than one."""


def mission_topics(scenario: Scenario) -> tuple[RecordedTopic, ...]:
    """
    Return every topic that is recorded, in a fixed order.

    The lockstep's ticks and hand-shake are left out: they say how a run was driven, not what
    happened in it, and a run without ROS has none.
    """
    return (
        RecordedTopic(name=CLOCK.name, topic=CLOCK, publisher=WORLD),
        RecordedTopic(name=MISSION_EVENTS.name, topic=MISSION_EVENTS, publisher='every node'),
        RecordedTopic(name=DIAGNOSTICS.name, topic=DIAGNOSTICS, publisher=C3),
        *_of_node(C3, (EXPLORATION_MAP, MARKERS, MISSION_STATUS, RADIO_TX)),
        *_of_node(UAV, (ODOM, ROUTE, RADIO_TX, *_driver_topics(scenario.uav.driver))),
        *(
            recorded
            for auv in scenario.auvs
            for recorded in _of_node(auv.name, (ODOM, PATH, RADIO_TX, *_driver_topics(auv.driver)))
        ),
        *_of_node(WORLD, (RADIO_STATUS,)),
        *(
            RecordedTopic(name=RADIO_RX.resolve(f'/{name}'), topic=RADIO_RX, publisher=WORLD)
            for name in (C3, UAV, *(auv.name for auv in scenario.auvs))
        ),
    )


def _of_node(name: str, topics: Iterable[Topic]) -> Iterable[RecordedTopic]:
    for topic in topics:
        publisher = 'autopilot' if topic is VEHICLE_ODOM else name
        yield RecordedTopic(name=topic.resolve(f'/{name}'), topic=topic, publisher=publisher)


def _driver_topics(driver: str) -> tuple[Topic, ...]:
    return (SETPOINT, VEHICLE_ODOM) if driver == TOPICS_DRIVER else ()
