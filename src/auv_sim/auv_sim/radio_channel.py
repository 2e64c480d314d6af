"""
The radio channel: who hears whom, decided from true positions.

Radio does not reach under water and not beyond its range, and may be dead for a time. Nothing an
agent does can change that: vehicles never address each other's topics, and what they say comes
here first.
"""

from __future__ import annotations

import enum
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import msgspec

from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.geometry import Point, is_before, within_range
from msgs_json.messages import BlockReason, Name, RadioStatus, Seconds


class StationKind(enum.Enum):
    """What carries a radio."""

    AUV = 'auv'
    UAV = 'uav'
    C3 = 'c3'


_LINKS = frozenset(
    {
        (StationKind.AUV, StationKind.UAV),
        (StationKind.UAV, StationKind.AUV),
        (StationKind.UAV, StationKind.C3),
        (StationKind.C3, StationKind.UAV),
    }
)
"""Who has a radio link with whom; C3's own radio speaks only with the UAV."""


class RadioOutage(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A time in which a station's radio is dead: nobody hears it, and it hears nobody."""

    station: Name
    from_s: Seconds
    until_s: Seconds
    """The first moment at which it works again."""

    def __post_init__(self) -> None:
        if self.until_s < self.from_s:
            raise ValueError(f'until_s is {self.until_s:g}; allowed: at least {self.from_s:g}')

    def holds_at(self, now_s: float) -> bool:
        """Return whether the radio is dead at a time."""
        return not is_before(now_s, self.from_s) and is_before(now_s, self.until_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelModel:
    """The physics of the channel."""

    range_m: float
    max_message_bytes: int
    outages: tuple[RadioOutage, ...] = ()


@dataclass(slots=True)
class _Station:
    kind: StationKind
    position: Point | None = None
    z_m: float = 0.0
    next_seq: int = 0
    """Number of what it says next: a station counts without a gap, and nothing is lost so far."""
    restart_seq: int | None = None
    """Number with which it begins after a restart, where it has said nothing since."""


class RadioChannel:
    """Gates what is said; owns the true positions and the counters."""

    def __init__(self, model: ChannelModel, stations: dict[str, StationKind]) -> None:
        self._model = model
        self._stations = {name: _Station(kind) for name, kind in stations.items()}
        self._delivered = 0
        self._blocked: Counter[BlockReason] = Counter()

    def locate(self, name: str, position: Point, z_m: float) -> None:
        """Note where a station truly is; height in metres, negative under water."""
        station = self._stations[name]
        station.position, station.z_m = position, z_m

    def expect(self, name: str, next_seq: int) -> None:
        """Note that a station came up, and with which number it begins."""
        self._stations[name].restart_seq = next_seq

    def deliveries(
        self, said: Iterable[tuple[str, bytes]], now_s: float
    ) -> list[tuple[str, bytes]]:
        """
        Return who hears what of all that was said, in the order in which it was said.

        Parameters
        ----------
        said
            Station that spoke (known from its topic, whatever the message claims) and payload.
        now_s
            When it was said.

        Returns
        -------
        list of (str, bytes)
            Receiving station and payload, unchanged.

        """
        heard = []
        for speaker, payload in said:
            verdict = self._verdict(speaker, payload, now_s)
            if isinstance(verdict, BlockReason):
                self._blocked[verdict] += 1
            else:
                self._delivered += 1
                heard.append((verdict, payload))
        return heard

    def status(self) -> RadioStatus:
        """Return the counters since the start."""
        return RadioStatus(
            delivered=self._delivered,
            blocked={reason.value: self._blocked[reason] for reason in BlockReason},
        )

    def _verdict(self, speaker: str, payload: bytes, now_s: float) -> str | BlockReason:
        """Return the name of the receiver, or why nobody hears the message."""
        too_long = len(payload) > self._model.max_message_bytes
        try:
            envelope = codec.open_envelope(payload)
        except MessageError:
            return BlockReason.SIZE if too_long else BlockReason.MALFORMED
        source, target = self._stations[speaker], self._stations.get(envelope.dst)
        if envelope.src == speaker and envelope.seq == source.restart_seq:
            source.next_seq, source.restart_seq = envelope.seq, None
        if envelope.src != speaker or envelope.seq > source.next_seq:
            return BlockReason.UNKNOWN_SENDER  # somebody else, on the station's topic
        if envelope.seq < source.next_seq:
            return BlockReason.REPLAY
        source.next_seq += 1
        if target is None or (source.kind, target.kind) not in _LINKS:
            return BlockReason.UNKNOWN_SENDER
        if too_long:
            return BlockReason.SIZE
        try:
            codec.open_body(envelope)
        except MessageError:
            return BlockReason.MALFORMED
        if source.z_m < 0 or target.z_m < 0:
            return BlockReason.SUBMERGED
        if source.position is None or target.position is None:
            return BlockReason.RANGE
        if not within_range(source.position.distance_m(target.position), self._model.range_m):
            return BlockReason.RANGE
        if any(
            outage.station in (speaker, envelope.dst) and outage.holds_at(now_s)
            for outage in self._model.outages
        ):
            return BlockReason.LOSS  # last: it counts what nothing but the outage has cost
        return envelope.dst
