"""How long the radio of a scenario takes: for one frame, for an answer, for a hand-over."""

from __future__ import annotations

from typing import TYPE_CHECKING

from auv_sim.radio_model import ChannelModel
from c3_station.scenario import UAV
from msgs_json.geometry import whole_ticks

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


def least_handover_s(scenario: Scenario) -> float:
    """
    Return how long a hand-over takes with the AUV with which it takes longest.

    Its four frames come one after another: the AUV's report, the UAV's receipt and the next path,
    and the AUV's acknowledgement. All may be as long as a frame can be.
    """
    return max(2 * round_trip_s(scenario, auv.name, UAV) for auv in scenario.auvs)
