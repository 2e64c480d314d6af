"""How long the radio of a scenario takes: for one frame, for an answer, for a hand-over."""

from __future__ import annotations

from typing import TYPE_CHECKING

from auv_sim.radio_model import ChannelModel
from c3_station.scenario import C3, UAV
from msgs_json.custody import BATCHES_MAX
from msgs_json.geometry import TOLERANCE, whole_ticks

if TYPE_CHECKING:
    from collections.abc import Iterator

    from auv_sim.radio_model import LinkModel
    from c3_station.scenario import Scenario

COPIES_MAX = 8
LOST_MAX = 0.01
"""Share of the messages of which no copy may come across."""


def way_s(scenario: Scenario, speaker: str, receiver: str) -> float:
    """
    Return how long the longest frame takes at most from a station to another, in whole ticks.

    It does not wait for other frames of its speaker, and it is not lost.
    """
    link = _channel(scenario).link_model(speaker, receiver)
    ticks = whole_ticks(link.longest_way_s(scenario.radio.max_message_bytes) / scenario.tick_s)
    return ticks * scenario.tick_s


def _channel(scenario: Scenario) -> ChannelModel:
    radio = scenario.radio
    return ChannelModel(
        range_m=radio.range_m,
        max_message_bytes=radio.max_message_bytes,
        link=radio.link,
        links=radio.links,
    )


def round_trip_s(scenario: Scenario, one: str, other: str) -> float:
    """Return how long it takes at most until the answer to a frame is heard."""
    return way_s(scenario, one, other) + way_s(scenario, other, one)


def response_s(scenario: Scenario, speaker: str, receiver: str) -> float:
    """Return how long it takes at most until all that is said at a time is receipted."""
    batches_s = BATCHES_MAX * way_s(scenario, speaker, receiver)
    return batches_s + way_s(scenario, receiver, speaker)


def copies(scenario: Scenario, speaker: str) -> int:
    """
    Return how often a station is to say each message at a time on a radio that loses.

    So often that one of nearly all messages is heard at the edge of the range, on the worst of its
    links. Where frames take time they queue, and copies would cost more than they bring.
    """
    receivers = (C3, *(auv.name for auv in scenario.auvs)) if speaker == UAV else (UAV,)
    channel = _channel(scenario)
    links = [channel.link_model(speaker, receiver) for receiver in receivers]
    if any(link.bytes_per_s is not None for link in links):
        return 1
    return max(map(_copies_on, links))


def _copies_on(link: LinkModel) -> int:
    """Return how often a message is to be said at a time on a link."""
    times = list(_times(link))
    for number in range(1, COPIES_MAX):
        if sum(share * lost**number for share, lost in times) <= LOST_MAX * (1.0 + TOLERANCE):
            return number
    return COPIES_MAX


def _times(link: LinkModel) -> Iterator[tuple[float, float]]:
    """
    Yield good and bad times: their share, and what is lost of each copy at the edge of the range.

    All copies of a message are said in the same one of them. Times are left out that cost all that
    is said, even from near: they cost all copies, too.
    """
    bursts = link.bursts
    bad_share, lost_in_bad = (bursts.bad_share, bursts.loss) if bursts else (0.0, 0.0)
    for share, lost_in_time in ((1.0 - bad_share, 0.0), (bad_share, lost_in_bad)):
        kept = (1.0 - link.corruption) * (1.0 - lost_in_time)
        if kept * (1.0 - link.loss_at(0.0)) > 0.0:
            yield share, 1.0 - kept * (1.0 - link.loss_at(1.0))


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
