from __future__ import annotations

import re

import pytest
from rosbags.typesys import Stores, get_typestore

from msgs_json import topics
from msgs_json.topics import (
    CLOCK,
    EXPLORATION_MAP,
    MISSION_EVENTS,
    ODOM,
    RADIO_RX,
    RADIO_TX,
    STRING,
    TOPICS,
    VEHICLE_ODOM,
    WORLD_GO,
    WORLD_HELLO,
    WORLD_READY,
    Qos,
    Topic,
)


def test_all_topics_of_the_module_are_listed_once() -> None:
    declared = [thing for thing in vars(topics).values() if isinstance(thing, Topic)]
    assert list(TOPICS) == declared
    assert len({topic.name for topic in TOPICS}) == len(TOPICS)


@pytest.mark.parametrize('topic', TOPICS, ids=lambda topic: topic.name)
def test_topic_is_legal_and_of_a_standard_type(topic: Topic) -> None:
    assert re.fullmatch('/?[a-z_]+(/[a-z_]+)*', topic.name)
    assert topic.ros_type in get_typestore(Stores.ROS2_JAZZY).types
    assert topic.is_json == (topic.ros_type == STRING)
    assert topic.publishers
    assert topic.content


def test_relative_names_are_placed_by_the_namespace() -> None:
    assert ODOM.resolve('/auv_1') == '/auv_1/odom'
    assert RADIO_TX.resolve('/fleet/auv_1/') == '/fleet/auv_1/radio/tx'
    assert ODOM.resolve('/') == '/odom'


def test_absolute_names_are_the_same_everywhere() -> None:
    assert CLOCK.resolve('/world') == CLOCK.resolve('/') == '/clock'


@pytest.mark.parametrize('qos', Qos)
def test_profile_says_why(qos: Qos) -> None:
    assert qos.value.depth >= 1
    assert qos.value.why


def test_only_what_a_vehicle_measures_is_best_effort() -> None:
    # A reliable subscription does not connect to a best-effort publisher.
    assert [topic for topic in TOPICS if not topic.qos.value.reliable] == [VEHICLE_ODOM]


def test_what_must_be_complete_is_not_latched_and_what_comes_late_is() -> None:
    assert {RADIO_TX.qos, RADIO_RX.qos, MISSION_EVENTS.qos, ODOM.qos} == {Qos.STREAM}
    assert EXPLORATION_MAP.qos is Qos.LATCHED  # REP-2003
    assert {WORLD_HELLO.qos, WORLD_GO.qos, WORLD_READY.qos} == {Qos.HANDSHAKE}
    assert not Qos.STREAM.value.transient_local
    assert Qos.LATCHED.value.transient_local
    assert Qos.HANDSHAKE.value.transient_local
