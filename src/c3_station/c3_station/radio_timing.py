"""How long the radio of a scenario takes: for one frame, for an answer, for a hand-over."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from auv_sim.radio_model import ChannelModel
from c3_station.scenario import UAV
from msgs_json.custody import BATCHES_MAX
from msgs_json.geometry import whole_ticks

COPIES_MAX = 8
LOST_MAX = 0.01
"""Share of the messages of which no copy may come across."""

if TYPE_CHECKING:
    from c3_station.scenario import Scenario


def way_s(scenario: Scenario, speaker: str, receiver: str) -> float:
    """
    Return how long the longest frame takes at most from a station to another, in whole ticks.

    It does not wait for other frames of its speaker, and it is not lost.
    """
    radio = scenario.radio
    model = ChannelModel(
        range_m=radio.range_m,
        max_message_bytes=radio.max_message_bytes,
        link=radio.link,
        links=radio.links,
    )
    link = model.link_model(speaker, receiver)
    ticks = whole_ticks(link.longest_way_s(radio.max_message_bytes) / scenario.tick_s)
    return ticks * scenario.tick_s


def round_trip_s(scenario: Scenario, one: str, other: str) -> float:
    """Return how long it takes at most until the answer to a frame is heard."""
    return way_s(scenario, one, other) + way_s(scenario, other, one)


def response_s(scenario: Scenario, speaker: str, receiver: str) -> float:
    """Return how long it takes at most until all that is said at a time is receipted."""
    batches_s = BATCHES_MAX * way_s(scenario, speaker, receiver)
    return batches_s + way_s(scenario, receiver, speaker)


def copies(scenario: Scenario) -> int:
    """
    Return how often each message is to be said at a time on a radio that loses.

    So often that one of nearly all messages is heard. Where frames take time they queue, and
    copies would cost more than they bring.
    """
    link = scenario.radio.link
    lost = 1.0 - (1.0 - link.loss_at(1.0)) * (1.0 - link.corruption)
    if lost == 0.0 or link.bytes_per_s is not None:
        return 1
    if lost == 1.0:
        return COPIES_MAX
    return min(COPIES_MAX, math.ceil(math.log(LOST_MAX) / math.log(lost)))


def least_handover_s(scenario: Scenario) -> float:
    """
    Return how long a hand-over takes with the AUV with which it takes longest.

    Its four frames come one after another: the AUV's report, the UAV's receipt and the next path,
    and the AUV's acknowledgement. All may be as long as a frame can be.
    """
    return max(2 * round_trip_s(scenario, auv.name, UAV) for auv in scenario.auvs)


def hearing_s(scenario: Scenario) -> float:
    """Return how long a frame of any AUV takes at most until the UAV hears it."""
    return max(way_s(scenario, auv.name, UAV) for auv in scenario.auvs)
