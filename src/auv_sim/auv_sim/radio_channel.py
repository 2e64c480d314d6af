"""
The radio channel: who hears whom and when, decided from true positions.

Radio does not reach under water and not beyond its range, and may be dead for a time. Nothing an
agent does can change that: vehicles never address each other's topics, and what they say comes
here first. What else may happen to it on the way is said by the `ChannelModel`; an ideal one
delivers everything at once and as it is.

Stations are where they were last located until they are located again, once per tick. A frame
needs its two stations at the surface and within range of each other at every tick at which it is
on the air, from the tick in which its transmission begins. It is heard at the first tick that is
not before its time, if the receiver is at the surface and within range then.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from auv_sim.radio_link import RadioLink
from auv_sim.radio_model import IDEAL, LINKED_KINDS, StationKind
from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.geometry import Point, is_before, within_range
from msgs_json.messages import BlockReason, RadioStatus

if TYPE_CHECKING:
    from auv_sim.radio_link import FrameDraws
    from auv_sim.radio_model import ChannelModel
    from msgs_json.authentication import Authenticator


class Delivery(NamedTuple):
    """What a station hears."""

    receiver: str
    payload: bytes
    is_intact: bool
    """Whether these are the bytes that were said."""


@dataclass(slots=True)
class _Frame:
    """A frame that waits for its transmission, or is on the air."""

    speaker: str
    receiver: str
    payload: bytes
    number: int
    """Counted over all that was said."""
    draws: FrameDraws
    start_s: float
    end_s: float
    has_begun: bool = False


class _Arrival(NamedTuple):
    """A copy of a frame that will be heard; compared in the order in which copies are heard."""

    heard_s: float
    number: int
    copy: int
    speaker: str
    delivery: Delivery


@dataclass(slots=True)
class _Station:
    kind: StationKind
    position: Point | None = None
    z_m: float = 0.0
    next_seq: int = 0
    """Number of what it says next: a station counts without a gap, and nothing is lost so far."""
    restart_seq: int | None = None
    """Number with which it begins after a restart, where it has said nothing since."""
    said: list[tuple[str, bytes]] = field(default_factory=list)
    """Receiver and payload of what it has said since the last round of the radio."""
    frames: deque[_Frame] = field(default_factory=deque)
    """In order of transmission."""
    free_s: float = -math.inf
    """When its radio has sent all of them."""

    def frames_waiting(self, now_s: float) -> int:
        """Return how many of its frames are not on the air yet."""
        return sum(is_before(now_s, frame.start_s) for frame in self.frames)


class RadioChannel:
    """
    Gates what is said; owns the true positions and the counters.

    Parameters
    ----------
    model
        What happens on the way.
    stations
        Kind of each station by name, in the order in which their messages are gated.
    tick_s
        How long stations are where they were located.
    authenticator
        Tells what was signed with the mission's key; None where nothing is signed.

    """

    def __init__(
        self,
        model: ChannelModel,
        stations: dict[str, StationKind],
        *,
        tick_s: float,
        authenticator: Authenticator | None = None,
    ) -> None:
        self._model = model
        self._tick_s = tick_s
        self._authenticator = authenticator
        self._stations = {name: _Station(kind) for name, kind in stations.items()}
        self._links = _links(model, stations)
        """Of all pairs with a radio link; none where all of them are ideal."""
        self._arrivals: list[_Arrival] = []
        """What is on its way behind the speaker's radio; a heap."""
        self._frames_sent = 0
        self._delivered = 0
        self._duplicated = 0
        self._corrupted = 0
        self._blocked: Counter[BlockReason] = Counter()

    def locate(self, name: str, position: Point, z_m: float) -> None:
        """Note where a station truly is; height in metres, negative under water."""
        station = self._stations[name]
        station.position, station.z_m = position, z_m

    def expect(self, name: str, next_seq: int) -> None:
        """Note that a station came up, and with which number it begins."""
        self._stations[name].restart_seq = next_seq

    def say(self, speaker: str, payload: bytes) -> int | None:
        """
        Take a payload from a station's topic; it is gated in the next round of the radio.

        Parameters
        ----------
        speaker
            Station on whose topic the payload was published, whatever it claims.
        payload
            Unchanged.

        Returns
        -------
        int or None
            Its number, if the station itself has said this, even if nobody will hear it. None for
            what somebody else put on its topic; that is blocked at once.

        """
        too_long = len(payload) > self._model.max_message_bytes
        try:
            envelope = codec.open_envelope(payload)
        except MessageError:
            self._blocked[BlockReason.SIZE if too_long else BlockReason.MALFORMED] += 1
            return None
        station = self._stations[speaker]
        stranger = self._stranger(envelope, speaker, payload)
        if stranger is not None:
            self._blocked[stranger] += 1
            return None
        station.next_seq = envelope.seq + 1
        receiver = self._stations.get(envelope.dst)
        problem = None
        if receiver is None or (station.kind, receiver.kind) not in LINKED_KINDS:
            problem = BlockReason.UNKNOWN_SENDER
        elif too_long:
            problem = BlockReason.SIZE
        else:
            try:
                codec.open_body(envelope)
            except MessageError:
                problem = BlockReason.MALFORMED
        if problem is None:
            station.said.append((envelope.dst, payload))
        else:
            self._blocked[problem] += 1
        return envelope.seq

    def deliveries(self, now_s: float) -> list[Delivery]:
        """
        Return who hears what in the next round of the radio.

        That is what was said since the last round, where it takes no time, and in the first round
        of a tick also what is due by then. The order is that of the times at which it is heard,
        and at one time that in which it was said: in the order of the stations, then as spoken.
        """
        return self._modelled(now_s) if self._links else self._ideal(now_s)

    @property
    def under_way(self) -> int:
        """Return how many frames, and copies of frames, are neither delivered nor blocked yet."""
        stations = self._stations.values()
        return len(self._arrivals) + sum(len(each.said) + len(each.frames) for each in stations)

    def status(self) -> RadioStatus:
        """Return the counters since the start."""
        return RadioStatus(
            delivered=self._delivered,
            blocked={reason.value: self._blocked[reason] for reason in BlockReason},
            duplicated=self._duplicated,
            corrupted=self._corrupted,
        )

    # --- who speaks ------------------------------------------------------------------------------

    def _stranger(
        self, envelope: codec.Envelope, speaker: str, payload: bytes
    ) -> BlockReason | None:
        """Return why an envelope is not what the station has said, None if it is."""
        if envelope.src != speaker:
            return BlockReason.UNKNOWN_SENDER
        if self._authenticator is not None and not self._authenticator.check(payload):
            return BlockReason.AUTH
        station = self._stations[speaker]
        if envelope.seq == station.restart_seq:
            station.next_seq, station.restart_seq = envelope.seq, None
        if envelope.seq < station.next_seq:
            return BlockReason.REPLAY
        if envelope.seq > station.next_seq and self._authenticator is None:
            # Anybody could leave a gap, and turn all that is true into replays.
            return BlockReason.UNKNOWN_SENDER
        return None

    # --- what happens on the way -----------------------------------------------------------------

    def _ideal(self, now_s: float) -> list[Delivery]:
        heard = []
        for speaker, station in self._stations.items():
            if not station.said:
                continue  # like most, in most rounds
            for receiver, payload in station.said:
                obstacle = self._obstacle(speaker, receiver, now_s)
                if obstacle is not None:
                    self._blocked[obstacle] += 1
                else:
                    self._delivered += 1
                    heard.append(Delivery(receiver, payload, is_intact=True))
            station.said.clear()
        return heard

    def _modelled(self, now_s: float) -> list[Delivery]:
        for speaker, station in self._stations.items():
            for receiver, payload in station.said:
                self._queue(speaker, receiver, payload, now_s)
            station.said.clear()
            self._transmit(station, now_s)
        heard = []
        while self._arrivals and not is_before(now_s, self._arrivals[0].heard_s):
            arrival = heapq.heappop(self._arrivals)
            delivery = arrival.delivery
            obstacle = self._obstacle(arrival.speaker, delivery.receiver, now_s, is_sent=True)
            if obstacle is not None:
                self._blocked[obstacle] += 1
            else:
                self._delivered += 1
                self._corrupted += not delivery.is_intact
                heard.append(delivery)
        return heard

    def _queue(self, speaker: str, receiver: str, payload: bytes, now_s: float) -> None:
        """Let a station's radio send a frame, once it has sent those before."""
        station, link = self._stations[speaker], self._links[speaker, receiver]
        draws = link.draw()
        start_s = max(now_s, station.free_s)
        if is_before(now_s, start_s) and station.frames_waiting(now_s) >= self._model.queue_frames:
            self._blocked[BlockReason.BANDWIDTH] += 1
            return
        station.free_s = start_s + link.transmission_s(len(payload))
        number, self._frames_sent = self._frames_sent, self._frames_sent + 1
        station.frames.append(
            _Frame(speaker, receiver, payload, number, draws, start_s, station.free_s)
        )

    def _transmit(self, station: _Station, now_s: float) -> None:
        """Send what a station's radio sends before the next tick."""
        next_s = now_s + self._tick_s
        while station.frames and is_before(station.frames[0].start_s, next_s):
            frame = station.frames[0]
            obstacle = self._obstacle(frame.speaker, frame.receiver, now_s)
            if not frame.has_begun:
                frame.has_begun = True
                if self._is_lost(frame) and obstacle is None:
                    obstacle = BlockReason.LOSS
            if obstacle is None and is_before(next_s, frame.end_s):
                return  # still on the air at the next tick
            station.frames.popleft()
            if obstacle is None:
                self._send_on(frame)
            else:
                self._blocked[obstacle] += 1

    def _is_lost(self, frame: _Frame) -> bool:
        distance_m = self._distance_m(frame.speaker, frame.receiver)
        link = self._links[frame.speaker, frame.receiver]
        return link.is_lost(frame.draws, frame.start_s, distance_m / self._model.range_m)

    def _send_on(self, frame: _Frame) -> None:
        """Let all copies of a frame that was transmitted arrive in their time."""
        link = self._links[frame.speaker, frame.receiver]
        copies = link.copies(frame.payload, frame.draws, frame.end_s)
        self._duplicated += len(copies) - 1
        for index, copy in enumerate(copies):
            delivery = Delivery(frame.receiver, copy.payload, copy.is_intact)
            arrival = _Arrival(copy.heard_s, frame.number, index, frame.speaker, delivery)
            heapq.heappush(self._arrivals, arrival)

    # --- where everybody is ----------------------------------------------------------------------

    def _obstacle(
        self, speaker: str, receiver: str, now_s: float, *, is_sent: bool = False
    ) -> BlockReason | None:
        """Return why a frame does not get through; once it is sent its speaker may dive."""
        if self._stations[receiver].z_m < 0 or (not is_sent and self._stations[speaker].z_m < 0):
            return BlockReason.SUBMERGED
        if not within_range(self._distance_m(speaker, receiver), self._model.range_m):
            return BlockReason.RANGE
        for outage in self._model.outages:
            is_used = outage.station == receiver or (not is_sent and outage.station == speaker)
            if is_used and outage.holds_at(now_s):
                return BlockReason.LOSS  # last: it counts what nothing but the outage has cost
        return None

    def _distance_m(self, speaker: str, receiver: str) -> float:
        """Return the distance between two stations; infinite where one was never seen."""
        here, there = self._stations[speaker].position, self._stations[receiver].position
        return math.inf if here is None or there is None else here.distance_m(there)


def _links(
    model: ChannelModel, stations: dict[str, StationKind]
) -> dict[tuple[str, str], RadioLink]:
    """Return all links; none where all of them are ideal."""
    models = {
        (speaker, receiver): model.link_model(speaker, receiver)
        for speaker, speaker_kind in stations.items()
        for receiver, receiver_kind in stations.items()
        if (speaker_kind, receiver_kind) in LINKED_KINDS
    }
    if all(link == IDEAL for link in models.values()):
        return {}
    return {pair: RadioLink(link, model.seed, *pair) for pair, link in models.items()}
