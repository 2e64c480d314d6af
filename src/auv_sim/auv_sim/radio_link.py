"""One link of the radio at work: what it does to each frame, drawn from the link's own stream."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgs_json.randomness import agent_rng

if TYPE_CHECKING:
    from auv_sim.radio_model import LinkModel


@dataclass(frozen=True, slots=True)
class CopyDraws:
    """What was drawn for one copy of a frame; each is even in [0, 1)."""

    jitter: float
    corrupted: float
    where: float
    value: float


@dataclass(frozen=True, slots=True)
class FrameDraws:
    """What was drawn for a frame when it was said, before anything happened to it."""

    bad_time: float
    lost: float
    lost_in_bad_time: float
    duplicated: float
    first: CopyDraws
    second: CopyDraws


_DRAWS = 4 + 2 * 4


@dataclass(frozen=True, slots=True)
class Copy:
    """What arrives of a frame."""

    payload: bytes
    heard_s: float
    is_intact: bool


class RadioLink:
    """
    Draws the fate of frames from one station to another.

    There is one stream per link, and every frame takes equally many draws from it, whatever they
    are used for: so nothing on another link changes this one, and a frame that is blocked does
    not change the fate of the next.
    """

    __slots__ = ('_as_of_s', '_model', '_rng', '_was_bad')

    def __init__(self, model: LinkModel, seed: int, speaker: str, receiver: str) -> None:
        self._model = model
        self._rng = agent_rng(seed, f'radio {speaker} > {receiver}')
        self._was_bad: bool | None = None
        self._as_of_s = 0.0

    def draw(self) -> FrameDraws:
        """Return the draws of the next frame."""
        bad_time, lost, lost_in_bad_time, duplicated, *copies = self._rng.random(_DRAWS).tolist()
        return FrameDraws(
            bad_time=bad_time,
            lost=lost,
            lost_in_bad_time=lost_in_bad_time,
            duplicated=duplicated,
            first=CopyDraws(*copies[:4]),
            second=CopyDraws(*copies[4:]),
        )

    def transmission_s(self, frame_bytes: int) -> float:
        """Return how long a frame is on the air."""
        return self._model.transmission_s(frame_bytes)

    def is_lost(self, draws: FrameDraws, start_s: float, distance_share: float) -> bool:
        """Return whether a frame is lost; to be asked in the order of transmission."""
        bursts, is_bad = self._model.bursts, False
        if bursts is not None:
            ago_s = start_s - self._as_of_s
            is_bad = draws.bad_time < bursts.bad_probability(self._was_bad, ago_s)
            self._was_bad, self._as_of_s = is_bad, start_s
            is_bad = is_bad and draws.lost_in_bad_time < bursts.loss
        return is_bad or draws.lost < self._model.loss_at(distance_share)

    def copies(self, payload: bytes, draws: FrameDraws, end_s: float) -> list[Copy]:
        """Return what arrives of a frame that is not lost."""
        copies = [self._copy(payload, draws.first, end_s)]
        if draws.duplicated < self._model.duplicates:
            copies.append(self._copy(payload, draws.second, end_s))
        return copies

    def _copy(self, payload: bytes, draws: CopyDraws, end_s: float) -> Copy:
        heard_s = end_s + self._model.latency_s + draws.jitter * self._model.jitter_s
        if draws.corrupted >= self._model.corruption:
            return Copy(payload, heard_s, is_intact=True)
        return Copy(_corrupted(payload, draws), heard_s, is_intact=False)


def _corrupted(payload: bytes, draws: CopyDraws) -> bytes:
    """Return a payload with one byte replaced by another one."""
    at = int(draws.where * len(payload))
    other = (payload[at] + 1 + int(draws.value * 255)) % 256
    return payload[:at] + bytes([other]) + payload[at + 1 :]
