"""
What a radio does to frames, as data: share lost, latency, bandwidth, and so on, for each link.

A link is an ordered pair of stations: who speaks, and who is to hear it. As it stands here, with
every default, a radio is ideal: whatever is said in range is heard at once, as it was said.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import msgspec
from msgspec import UNSET, UnsetType

from msgs_json.geometry import is_before
from msgs_json.messages import Name, Seconds, Share

Latency = Annotated[float, msgspec.Meta(ge=0, le=1e5, extra_json_schema={'x-unit': 's'})]
MeanTime = Annotated[float, msgspec.Meta(ge=1e-3, le=1e7, extra_json_schema={'x-unit': 's'})]
BytesPerSecond = Annotated[float, msgspec.Meta(ge=1, le=1e12)]


class StationKind(enum.Enum):
    """What carries a radio."""

    AUV = 'auv'
    UAV = 'uav'
    C3 = 'c3'


LINKED_KINDS = frozenset(
    {
        (StationKind.AUV, StationKind.UAV),
        (StationKind.UAV, StationKind.AUV),
        (StationKind.UAV, StationKind.C3),
        (StationKind.C3, StationKind.UAV),
    }
)
"""Who has a radio link with whom; C3's own radio speaks only with the UAV."""


class _Part(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the parts of a model, which also stand in scenarios and parameters."""


class LossOverDistance(_Part, frozen=True):
    """
    Share of the frames that is lost, growing from one at no distance to one at the range.

    In between it grows with the square of the distance, as the path loss in free space does: half
    way out a quarter of the growth is reached.
    """

    at_zero: Share
    at_range: Share


class Bursts(_Part, frozen=True):
    """
    Good and bad times that follow each other (Gilbert-Elliott), for each link its own.

    The length of every time is drawn from an exponential distribution.
    """

    good_s: MeanTime
    """Mean length of a good time, in which nothing is lost that would not be lost anyway."""
    bad_s: MeanTime
    """Mean length of a bad time."""
    loss: Share = 1.0
    """Share of the frames that bad times cost, of those not lost anyway."""

    @property
    def bad_share(self) -> float:
        """Return the share of bad times in the long run."""
        return self.bad_s / (self.good_s + self.bad_s)

    def bad_probability(self, was_bad: bool | None, ago_s: float) -> float:
        """Return how likely it is a bad time now; None where the time before is not known."""
        if was_bad is None:
            return self.bad_share
        kept = math.exp(-ago_s * (1 / self.good_s + 1 / self.bad_s))
        return self.bad_share + (was_bad - self.bad_share) * kept


class LinkModel(_Part, frozen=True):
    """What happens to frames on the way from one station to another."""

    loss: Share | LossOverDistance = 0.0
    """Share of the frames that is lost; 1 is a link that is dead in this direction."""
    bursts: Bursts | None = None
    latency_s: Latency = 0.0
    """From the end of a frame's transmission until it is heard."""
    jitter_s: Latency = 0.0
    """What comes on top of that is drawn evenly from 0 up to this; so frames may overtake."""
    bytes_per_s: BytesPerSecond | None = None
    """How fast the speaker's radio sends on this link; None: frames take no time."""
    duplicates: Share = 0.0
    """Share of the frames that come twice, each copy with a jitter of its own."""
    corruption: Share = 0.0
    """Share of the copies in which one byte is another one when they are heard."""

    def loss_at(self, distance_share: float) -> float:
        """Return the share that is lost in good times at a distance, given as share of R."""
        if isinstance(self.loss, LossOverDistance):
            growth = self.loss.at_range - self.loss.at_zero
            return self.loss.at_zero + growth * min(distance_share, 1.0) ** 2
        return self.loss

    def transmission_s(self, frame_bytes: int) -> float:
        """Return how long a frame is on the air."""
        return 0.0 if self.bytes_per_s is None else frame_bytes / self.bytes_per_s

    def longest_way_s(self, frame_bytes: int) -> float:
        """Return how long a frame takes at most from when its transmission begins."""
        return self.transmission_s(frame_bytes) + self.latency_s + self.jitter_s


IDEAL = LinkModel()


class Link(_Part, frozen=True):
    """What is special about one link; keys that are not there are as on all other links."""

    speaker: Name = msgspec.field(name='from')
    receiver: Name = msgspec.field(name='to')
    loss: Share | LossOverDistance | UnsetType = UNSET
    bursts: Bursts | UnsetType | None = UNSET
    latency_s: Latency | UnsetType = UNSET
    jitter_s: Latency | UnsetType = UNSET
    bytes_per_s: BytesPerSecond | UnsetType | None = UNSET
    duplicates: Share | UnsetType = UNSET
    corruption: Share | UnsetType = UNSET

    def over(self, model: LinkModel) -> LinkModel:
        """Return the model of this link, given that of all others."""
        given = {
            name: value
            for name in LinkModel.__struct_fields__
            if (value := getattr(self, name)) is not UNSET
        }
        return msgspec.structs.replace(model, **given)


class RadioOutage(_Part, frozen=True):
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
    queue_frames: int = 16
    """So many frames wait while a radio is sending; what is said beyond that is blocked."""
    link: LinkModel = IDEAL
    """Of every link that is not listed below."""
    links: tuple[Link, ...] = ()
    outages: tuple[RadioOutage, ...] = ()
    seed: int = 0
    """Of all that is drawn."""

    def link_model(self, speaker: str, receiver: str) -> LinkModel:
        """Return the model of the link from one station to another."""
        for link in self.links:
            if (link.speaker, link.receiver) == (speaker, receiver):
                return link.over(self.link)
        return self.link


def link_problems(
    links: Sequence[Link], stations: Mapping[str, StationKind]
) -> Iterator[tuple[int, str, str]]:
    """Yield what is wrong with links between stations: the place of each, the key and why."""
    seen = set()
    for index, link in enumerate(links):
        pair = (link.speaker, link.receiver)
        strangers = [
            (key, name)
            for key, name in zip(('from', 'to'), pair, strict=True)
            if name not in stations
        ]
        for key, name in strangers:
            yield index, key, f'is {name!r}; allowed: {", ".join(stations)}'
        if not strangers and tuple(stations[name] for name in pair) not in LINKED_KINDS:
            yield (
                index,
                'to',
                f'is {link.receiver!r}, which never hears {link.speaker}; allowed: links between'
                ' an AUV and the UAV, or the UAV and C3',
            )
        if pair in seen:
            yield index, 'to', f'is {link.receiver!r}, and a link before is that one too'
        seen.add(pair)
