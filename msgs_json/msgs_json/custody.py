"""
Custody of samples: whoever has taken one over keeps it until it is told that C3 has it.

An AUV keeps its own samples and gives them to the UAV, which keeps them and gives them to C3. Both
do it in the same way: samples are said in batches that fit into a frame of the radio, receipts
name all that need not be said again (a selective acknowledgement), and what did not get across in
one contact gets across in the next.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec

from msgs_json.frame_size import WIDE_COUNT, WIDE_FLOAT, WIDE_NAME, signed_envelope_bytes
from msgs_json.geometry import Point, is_before
from msgs_json.messages import (
    LegOutcome,
    Sample,
    SampleBatch,
    SampleReceipt,
    SampleSpan,
    SurfacingReport,
)
from msgs_json.number_set import NumberSet

if TYPE_CHECKING:
    from collections.abc import Iterable

    from msgs_json.store import Store

BATCHES_MAX = 8
"""So many batches are said at a time; the next ones when a receipt shows that these get across."""

SAMPLE = 'sample'
"""Kind of the entries of a store that are samples."""
_AT_C3 = 'at_c3'

_WIDE_SAMPLE = Sample(
    auv=WIDE_NAME, number=WIDE_COUNT, cell=(999, 999), entered_s=WIDE_FLOAT, value=WIDE_FLOAT
)
_SAMPLE_BYTES = len(msgspec.json.encode(_WIDE_SAMPLE)) + len(',')
_OTHER_BYTES = signed_envelope_bytes(
    SurfacingReport(
        auv=WIDE_NAME,
        leg_id=WIDE_COUNT,
        outcome=LegOutcome.COMPLETED,
        moves_done=WIDE_COUNT,
        cell=(999, 999),
        position=Point(east_m=WIDE_FLOAT, north_m=WIDE_FLOAT),
        surfaced_s=WIDE_FLOAT,
        samples_taken=WIDE_COUNT,
        samples=(),
    )
)
"""Of a report beside its samples; of a batch it is less."""


def samples_per_frame(frame_bytes: int) -> int:
    """Return how many samples a message of at most so many bytes holds; one from 720 bytes on."""
    return (frame_bytes - _OTHER_BYTES) // _SAMPLE_BYTES


def sample_key(auv: str, number: int) -> str:
    """Return the key of a sample in a store."""
    return f'{auv}/{number}'


def sample_spans(auv: str, numbers: NumberSet) -> tuple[SampleSpan, ...]:
    """Return numbers of samples of an AUV as messages say them."""
    return tuple(SampleSpan(auv=auv, first=first, until=until) for first, until in numbers.spans)


class SampleCustody:
    """
    The samples that an agent keeps until C3 has them, and what the next one on the way holds.

    Parameters
    ----------
    store
        Keeps samples, and which ones are at C3, across a crash.
    frame_bytes
        The longest message that the radio carries in one piece.
    response_s
        How long an answer by radio takes at most; what was said is not said again before.

    """

    def __init__(self, store: Store, frame_bytes: int, response_s: float) -> None:
        self._store = store
        self._batch_samples = samples_per_frame(frame_bytes)
        self._response_s = response_s
        self._kept = _in_order(store.load(SAMPLE, Sample).values())
        spans = store.load(_AT_C3, tuple[tuple[int, int], ...])
        self._at_c3 = {auv: NumberSet.from_spans(each) for auv, each in spans.items()}
        self._passed_on: dict[str, NumberSet] = {}
        """By AUV, what the next one on the way said that it holds."""
        self._said_s: dict[tuple[str, int], float] = {}
        self._waiting: tuple[Sample, ...] | None = None
        """What the next one on the way is not known to hold; None where that has changed."""

    def take(self, samples: Iterable[Sample]) -> None:
        """Take samples over; those that are kept, or at C3, change nothing."""
        new = [sample for sample in samples if not self.has(sample.auv, sample.number)]
        if new:
            self._kept, self._waiting = _in_order([*self._kept.values(), *new]), None
        for sample in new:
            self._store.put(SAMPLE, sample_key(sample.auv, sample.number), sample)

    def has(self, auv: str, number: int) -> bool:
        """Return whether a sample is kept, or at C3."""
        return (auv, number) in self._kept or number in self._at_c3.get(auv, ())

    def has_all(
        self, auv: str, samples_taken: int, without: NumberSet | frozenset[int] = frozenset()
    ) -> bool:
        """Return whether all samples of an AUV, but some numbers, are kept, or at C3."""
        at_c3 = self._at_c3.get(auv)
        first = at_c3.prefix if at_c3 is not None else 0
        return all(
            number in without or self.has(auv, number) for number in range(first, samples_taken)
        )

    @property
    def spans(self) -> tuple[SampleSpan, ...]:
        """Return what is kept, by AUV."""
        auvs = dict.fromkeys(auv for auv, _ in self._kept)
        return tuple(span for auv in auvs for span in self._held(auv))

    # --- to the next one on the way --------------------------------------------------------------

    def first_batch(self, now_s: float) -> tuple[Sample, ...]:
        """Return the oldest samples that are to be passed on, as many as fit into a frame."""
        batch = []
        for sample in self._to_pass_on():
            batch.append(sample)
            self._said_s[sample.auv, sample.number] = now_s
            if len(batch) == self._batch_samples:
                break
        return tuple(batch)

    def batches(self, now_s: float) -> list[SampleBatch]:
        """Return what is to be passed on and was not said of late."""
        size = self._batch_samples
        due = [sample for sample in self._to_pass_on() if self._is_due(sample, now_s)]
        # Said longest ago, or never, first: what is never taken over holds up nothing else.
        due = sorted(due, key=self._last_said_s)[: BATCHES_MAX * size]
        for sample in due:
            self._said_s[sample.auv, sample.number] = now_s
        return [
            SampleBatch(samples=tuple(due[first : first + size]))
            for first in range(0, len(due), size)
        ]

    def passed_on(self, receipt: SampleReceipt) -> None:
        """Note what the next one on the way holds, and forget what is at C3."""
        held: dict[str, list[tuple[int, int]]] = {}
        for span in receipt.held:
            held.setdefault(span.auv, []).append((span.first, span.until))
        for span in receipt.at_c3:
            held.setdefault(span.auv, [])
            self._forget(span)
        self._passed_on |= {auv: NumberSet.from_spans(spans) for auv, spans in held.items()}
        if not held:
            self._passed_on = {}  # It names nobody, for it has lost all that it held.
        self._waiting = None

    def _forget(self, span: SampleSpan) -> None:
        at_c3 = self._at_c3.setdefault(span.auv, NumberSet())
        before = at_c3.spans
        at_c3.add(span.first, span.until)
        if at_c3.spans == before:
            return
        self._store.put(_AT_C3, span.auv, at_c3.spans)
        for auv, number in list(self._kept):
            if auv == span.auv and number in at_c3:
                del self._kept[auv, number]
                self._said_s.pop((auv, number), None)
                self._store.drop(SAMPLE, sample_key(auv, number))

    def _to_pass_on(self) -> tuple[Sample, ...]:
        """Return what is kept and the next one on the way is not known to hold."""
        if self._waiting is None:
            self._waiting = tuple(
                sample
                for (auv, number), sample in self._kept.items()
                if number not in self._passed_on.get(auv, ())
            )
        return self._waiting

    def _is_due(self, sample: Sample, now_s: float) -> bool:
        said_s = self._last_said_s(sample)
        return now_s > said_s and not is_before(now_s, said_s + self._response_s)

    def _last_said_s(self, sample: Sample) -> float:
        return self._said_s.get((sample.auv, sample.number), -math.inf)

    # --- to the one before on the way ------------------------------------------------------------

    def receipt(self, auv: str) -> SampleReceipt:
        """Return what an AUV need not say again."""
        return SampleReceipt(
            held=self._held(auv),
            at_c3=sample_spans(auv, self._at_c3.get(auv, NumberSet())),
        )

    def _held(self, auv: str) -> tuple[SampleSpan, ...]:
        numbers = NumberSet()
        for name, number in self._kept:
            if name == auv:
                numbers.add(number, number + 1)
        return sample_spans(auv, numbers)


def _in_order(samples: Iterable[Sample]) -> dict[tuple[str, int], Sample]:
    """Return samples in the order in which they are said, which a crash does not change."""
    by_key = {(sample.auv, sample.number): sample for sample in samples}
    return dict(sorted(by_key.items()))
