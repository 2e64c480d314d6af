"""No sample is lost or doubled between AUV and C3, whatever links and processes do."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from msgs_json import codec
from msgs_json.authentication import Authenticator
from msgs_json.custody import BATCHES_MAX, SampleCustody, samples_per_frame
from msgs_json.geometry import Point
from msgs_json.messages import (
    LegOutcome,
    Message,
    Sample,
    SampleBatch,
    SampleReceipt,
    SampleSpan,
    SurfacingReport,
)
from msgs_json.number_set import NumberSet
from msgs_json.store import MemoryStore

if TYPE_CHECKING:
    from collections.abc import Iterable

Key = tuple[str, int]

RESPONSE_S = 2.0
FRAME_BYTES = 1536
"""So small that a few samples fill it."""
PER_FRAME = samples_per_frame(FRAME_BYTES)

LONGEST_NAME = 'a' * 32
LONGEST_NUMBER = 2**53
LONGEST_TIME_S = 12345678901.123456
LONGEST_VALUE = -1.2345678901234567e-300


def sample(number: int, auv: str = 'auv_1') -> Sample:
    return Sample(
        auv=auv, number=number, cell=(number % 7, 2), entered_s=10.0 * number, value=number / 7
    )


def span(first: int, until: int, auv: str = 'auv_1') -> SampleSpan:
    return SampleSpan(auv=auv, first=first, until=until)


def custody_of(*numbers: int, store: MemoryStore | None = None) -> SampleCustody:
    custody = SampleCustody(store or MemoryStore(), FRAME_BYTES, RESPONSE_S)
    custody.take(sample(number) for number in numbers)
    return custody


def numbers(batches: Iterable[SampleBatch]) -> list[list[int]]:
    return [[each.number for each in batch.samples] for batch in batches]


def keys(spans: Iterable[SampleSpan]) -> set[Key]:
    return {(each.auv, number) for each in spans for number in range(each.first, each.until)}


# --- batches fit into a frame --------------------------------------------------------------------


def signed_bytes(body: Message) -> int:
    payload = codec.encode(
        body, src=LONGEST_NAME, dst=LONGEST_NAME, seq=LONGEST_NUMBER, stamp_s=LONGEST_TIME_S
    )
    return len(Authenticator(b'k' * 32).sign(payload))


def longest_messages(samples: int) -> tuple[Message, Message]:
    longest = Sample(
        auv=LONGEST_NAME,
        number=LONGEST_NUMBER,
        cell=(999, 999),
        entered_s=LONGEST_TIME_S,
        value=LONGEST_VALUE,
    )
    report = SurfacingReport(
        auv=LONGEST_NAME,
        leg_id=LONGEST_NUMBER,
        outcome=LegOutcome.COMPLETED,
        moves_done=LONGEST_NUMBER,
        cell=(999, 999),
        position=Point(east_m=LONGEST_VALUE, north_m=LONGEST_VALUE),
        surfaced_s=LONGEST_TIME_S,
        samples_taken=LONGEST_NUMBER,
        samples=(longest,) * samples,
    )
    return report, SampleBatch(samples=(longest,) * samples)


@pytest.mark.parametrize('frame_bytes', [*range(720, 732), 1400, 65_536, 1_048_576])
def test_what_is_called_a_frame_full_fits_and_wastes_little(frame_bytes: int) -> None:
    samples = samples_per_frame(frame_bytes)
    assert samples >= 1
    report, batch = longest_messages(samples)
    assert signed_bytes(report) <= frame_bytes
    assert signed_bytes(batch) <= frame_bytes
    # The bound takes times as a little longer than they can be: 6 bytes of each sample.
    assert signed_bytes(longest_messages(samples + 1)[0]) > 0.95 * frame_bytes


def test_what_is_kept_is_said_oldest_first_a_frame_full_at_a_time() -> None:
    custody = custody_of(*range(PER_FRAME + 2))
    assert numbers(custody.batches(0.0)) == [
        list(range(PER_FRAME)),
        list(range(PER_FRAME, PER_FRAME + 2)),
    ]


def test_only_so_many_batches_are_said_until_a_receipt_shows_that_they_get_across() -> None:
    custody = custody_of(*range(10 * PER_FRAME))
    assert len(custody.batches(0.0)) == BATCHES_MAX
    assert len(custody.batches(1.0)) == 10 - BATCHES_MAX
    assert custody.batches(1.5) == []


# --- what is said, and when again ----------------------------------------------------------------


def test_what_was_said_is_not_said_again_before_an_answer_can_be_here() -> None:
    custody = custody_of(0, 1)
    assert numbers(custody.batches(5.0)) == [[0, 1]]
    custody.take([sample(2)])
    assert numbers(custody.batches(6.0)) == [[2]]
    assert numbers(custody.batches(7.0)) == [[0, 1]]
    assert numbers(custody.batches(8.0)) == [[2]]


def test_what_went_with_a_report_is_not_said_in_a_batch_right_after() -> None:
    custody = custody_of(*range(PER_FRAME + 1))
    assert [each.number for each in custody.first_batch(5.0)] == list(range(PER_FRAME))
    assert numbers(custody.batches(5.0)) == [[PER_FRAME]]
    # A report is the AUV's cry at every tick; it holds what nobody is known to hold.
    assert [each.number for each in custody.first_batch(6.0)] == list(range(PER_FRAME))


def test_where_answers_come_at_once_nothing_is_said_twice_at_a_time() -> None:
    custody = SampleCustody(MemoryStore(), FRAME_BYTES, response_s=0.0)
    custody.take([sample(0)])
    assert numbers(custody.batches(5.0)) == [[0]]
    assert custody.batches(5.0) == []
    assert numbers(custody.batches(6.0)) == [[0]]


def test_what_the_next_one_holds_is_not_said_again_but_kept() -> None:
    custody = custody_of(0, 1, 2)
    custody.batches(0.0)
    custody.passed_on(SampleReceipt(held=(span(0, 1), span(2, 3)), at_c3=()))
    assert numbers(custody.batches(2.0)) == [[1]]
    custody.passed_on(SampleReceipt(held=(span(0, 3),), at_c3=()))
    assert custody.batches(9.0) == []
    assert custody.first_batch(9.0) == ()
    assert custody.spans == (span(0, 3),)


def test_what_is_at_c3_is_forgotten() -> None:
    custody = custody_of(0, 1, 2)
    custody.passed_on(SampleReceipt(held=(span(1, 2),), at_c3=(span(0, 1),)))
    assert custody.spans == (span(1, 3),)
    custody.passed_on(SampleReceipt(held=(), at_c3=(span(0, 3),)))
    assert custody.spans == ()
    assert custody.batches(9.0) == []


def test_a_receipt_that_overtook_another_costs_no_sample() -> None:
    custody = custody_of(0, 1)
    custody.passed_on(SampleReceipt(held=(), at_c3=(span(0, 1),)))
    custody.passed_on(SampleReceipt(held=(span(0, 1),), at_c3=()))  # said before
    assert numbers(custody.batches(0.0)) == [[1]]
    assert custody.receipt('auv_1').at_c3 == (span(0, 1),)


def test_a_receipt_for_one_auv_says_nothing_of_another() -> None:
    custody = custody_of(0)
    custody.take([sample(0, 'auv_2')])
    custody.passed_on(SampleReceipt(held=(span(0, 1),), at_c3=()))
    custody.passed_on(SampleReceipt(held=(span(0, 1, 'auv_2'),), at_c3=()))
    assert custody.batches(9.0) == []


@pytest.mark.parametrize(
    ('receipt', 'told'),
    [
        (SampleReceipt(held=(), at_c3=()), [0, 1, 2]),
        (SampleReceipt(held=(), at_c3=(span(0, 1),)), [1, 2]),
        (SampleReceipt(held=(span(0, 1, 'auv_2'),), at_c3=(span(0, 1),)), [1, 2]),
    ],
    ids=['all', 'all_that_is_not_at_c3', 'all_of_one_auv'],
)
def test_who_holds_no_longer_what_it_held_is_told_again(
    receipt: SampleReceipt, told: list[int]
) -> None:
    # Its store is gone, or it never had one that outlived its process.
    custody = custody_of(0, 1, 2)
    custody.passed_on(SampleReceipt(held=(span(0, 3),), at_c3=()))
    custody.passed_on(receipt)
    assert numbers(custody.batches(0.0)) == [told]


def test_a_receipt_for_what_is_not_kept_yet_relieves_of_it_when_it_comes() -> None:
    custody = custody_of()
    custody.passed_on(SampleReceipt(held=(), at_c3=(span(0, 2),)))
    custody.take([sample(1), sample(2)])
    assert custody.spans == (span(2, 3),)


# --- what is said to the one before --------------------------------------------------------------


def test_a_receipt_names_all_of_one_auv_and_why() -> None:
    custody = custody_of(0, 1, 2, 5, 7)
    custody.take([sample(0, 'auv_2')])
    custody.passed_on(SampleReceipt(held=(), at_c3=(span(0, 2),)))
    assert custody.receipt('auv_1') == SampleReceipt(
        held=(span(2, 3), span(5, 6), span(7, 8)), at_c3=(span(0, 2),)
    )
    assert custody.receipt('auv_2') == SampleReceipt(held=(span(0, 1, 'auv_2'),), at_c3=())
    assert custody.receipt('auv_3') == SampleReceipt(held=(), at_c3=())


def test_all_of_an_auv_is_here_when_no_number_is_missing() -> None:
    custody = custody_of(0, 2)
    assert custody.has_all('auv_1', 1)
    assert not custody.has_all('auv_1', 2)
    custody.passed_on(SampleReceipt(held=(), at_c3=(span(0, 2),)))
    assert custody.has_all('auv_1', 3)
    assert not custody.has_all('auv_1', 4)
    assert custody.has_all('auv_2', 0)
    assert not custody.has_all('auv_2', 1)


def test_all_but_some_numbers_may_be_enough() -> None:
    custody = custody_of(0, 2)
    assert custody.has_all('auv_1', 3, frozenset({1}))
    assert not custody.has_all('auv_1', 4, frozenset({1}))


def test_what_is_never_taken_over_holds_up_nothing_else() -> None:
    """The next one on the way refuses more of it than is said at a time."""
    custody = custody_of(*range(PER_FRAME * (BATCHES_MAX + 1)))
    assert numbers(custody.batches(0.0))[0][0] == 0
    assert numbers(custody.batches(5.0))[0][0] == PER_FRAME * BATCHES_MAX
    assert numbers(custody.batches(5.0))[0][0] == PER_FRAME * (BATCHES_MAX - 1)


def test_a_process_after_this_one_keeps_the_same_in_the_same_order() -> None:
    store = MemoryStore()
    custody = custody_of(*range(12), store=store)  # 10 comes before 2 where keys are sorted
    custody.passed_on(SampleReceipt(held=(span(4, 6),), at_c3=(span(0, 3),)))
    store.commit()
    custody.take([sample(12)])  # and dies before that is stored
    again = custody_of(store=store.reopened())
    assert again.spans == (span(3, 12),)
    assert again.receipt('auv_1').at_c3 == (span(0, 3),)
    assert numbers(again.batches(0.0))[0] == list(range(3, 3 + PER_FRAME))


def test_what_was_repeated_is_not_stored_again() -> None:
    store = MemoryStore()
    custody = custody_of(0, 1, store=store)
    receipt = SampleReceipt(held=(), at_c3=(span(0, 1),))
    custody.passed_on(receipt)
    store.commit()
    custody.take([sample(0), sample(1)])
    custody.passed_on(receipt)
    assert not store.is_changed


# --- AUV -> UAV -> C3, with links that lose, double and reorder, and processes that die ----------


@dataclass
class Keeper:
    """An agent with custody of samples, whose process may die."""

    store: MemoryStore = field(default_factory=MemoryStore)
    said_s: dict[Key, float] = field(default_factory=dict)
    """When this process said a sample last."""

    def __post_init__(self) -> None:
        self.custody = SampleCustody(self.store, FRAME_BYTES, RESPONSE_S)

    def die(self) -> None:
        self.store = self.store.reopened()
        self.said_s = {}
        self.custody = SampleCustody(self.store, FRAME_BYTES, RESPONSE_S)

    def report(self, now_s: float) -> tuple[Sample, ...]:
        batch = self.custody.first_batch(now_s)
        self.note_said(batch, now_s)
        return batch

    def batches(self, now_s: float) -> list[SampleBatch]:
        batches = self.custody.batches(now_s)
        for batch in batches:
            for each in batch.samples:
                said_s = self.said_s.get((each.auv, each.number), -math.inf)
                assert now_s - said_s >= RESPONSE_S
            self.note_said(batch.samples, now_s)
        return batches

    def note_said(self, samples: tuple[Sample, ...], now_s: float) -> None:
        assert len(samples) <= PER_FRAME
        self.said_s |= {(each.auv, each.number): now_s for each in samples}


class Station:
    """C3, as plain as can be."""

    def __init__(self) -> None:
        self.samples: dict[Key, Sample] = {}
        self.count = 0

    def take(self, samples: tuple[Sample, ...]) -> SampleReceipt:
        for each in samples:
            if (each.auv, each.number) not in self.samples:
                self.samples[each.auv, each.number] = each
                self.count += 1
        spans = []
        for auv in dict.fromkeys(each.auv for each in samples):
            held = NumberSet()
            for name, number in self.samples:
                if name == auv:
                    held.add(number, number + 1)
            spans += [SampleSpan(auv=auv, first=a, until=b) for a, b in held.spans]
        return SampleReceipt(held=(), at_c3=tuple(spans))


AUVS = ('auv_1', 'auv_2')
auvs = st.sampled_from(AUVS)
fates = st.sampled_from(['stored', 'stored', 'dies before', 'dies after'])
"""Of who receives something: it answers; it dies with nothing stored; or stored and not said."""


class Custody(RuleBasedStateMachine):
    """Any order of samples, meetings, deliveries, losses, copies and deaths."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = 0.0
        self.taken: dict[Key, Sample] = {}
        self.auvs = {name: Keeper() for name in AUVS}
        self.uav = Keeper()
        self.c3 = Station()
        self.promised: set[Key] = set()
        """What the UAV has ever said that it holds."""
        # What is on the air; anything of it may come next, or never.
        self.to_uav: deque[tuple[str, tuple[Sample, ...]]] = deque()
        self.to_auv: deque[tuple[str, SampleReceipt]] = deque()
        self.to_c3: deque[SampleBatch] = deque()
        self.from_c3: deque[SampleReceipt] = deque()

    @rule(auv=auvs, count=st.integers(1, 2 * PER_FRAME))
    def survey(self, auv: str, count: int) -> None:
        first = sum(name == auv for name, _ in self.taken)
        new = [sample(number, auv) for number in range(first, first + count)]
        self.auvs[auv].custody.take(new)
        self.auvs[auv].store.commit()
        self.taken |= {(each.auv, each.number): each for each in new}

    @rule(seconds=st.sampled_from([1.0, RESPONSE_S, 60.0]))
    def wait(self, seconds: float) -> None:
        self.now_s += seconds

    @rule(auv=auvs)
    def auv_reports(self, auv: str) -> None:
        self.to_uav.append((auv, self.auvs[auv].report(self.now_s)))

    @rule()
    def uav_is_at_c3(self) -> None:
        self.to_c3 += self.uav.batches(self.now_s)

    @precondition(lambda self: self.to_uav)
    @rule(fate=fates)
    def uav_hears_auv(self, fate: str) -> None:
        auv, samples = self.to_uav.popleft()
        self.uav.custody.take(samples)
        if fate != 'dies before':
            self.uav.store.commit()
            if fate == 'stored':
                receipt = self.uav.custody.receipt(auv)
                self.promised |= keys(receipt.held) | keys(receipt.at_c3)
                self.to_auv.append((auv, receipt))
                return
        self.uav.die()

    @precondition(lambda self: self.to_auv)
    @rule(fate=fates)
    def auv_hears_uav(self, fate: str) -> None:
        name, receipt = self.to_auv.popleft()
        auv = self.auvs[name]
        auv.custody.passed_on(receipt)
        if fate != 'dies before':
            auv.store.commit()
            if fate == 'stored':
                self.to_uav += [(name, batch.samples) for batch in auv.batches(self.now_s)]
                return
        auv.die()

    @precondition(lambda self: self.to_c3)
    @rule()
    def c3_hears_uav(self) -> None:
        self.from_c3.append(self.c3.take(self.to_c3.popleft().samples))

    @precondition(lambda self: self.from_c3)
    @rule(fate=fates)
    def uav_hears_c3(self, fate: str) -> None:
        self.uav.custody.passed_on(self.from_c3.popleft())
        if fate != 'dies before':
            self.uav.store.commit()
        if fate != 'stored':
            self.uav.die()

    @rule(what=st.sampled_from(['overtake', 'overtake', 'copy', 'lose']), data=st.data())
    def the_air_does_something(self, what: str, data: st.DataObject) -> None:
        air = [each for each in (self.to_uav, self.to_auv, self.to_c3, self.from_c3) if each]
        if not air:
            return
        link = data.draw(st.sampled_from(air))
        match what:
            case 'overtake':
                link.rotate(data.draw(st.integers(1, len(link))))
            case 'copy':
                link.append(link[0])
            case 'lose':
                link.popleft()

    @invariant()
    def nobody_forgets_what_is_not_at_c3(self) -> None:
        at_c3 = self.c3.samples.keys()
        for auv in AUVS:
            own = {key for key in self.taken if key[0] == auv}
            assert own <= keys(self.auvs[auv].custody.spans) | at_c3
        assert self.promised <= keys(self.uav.custody.spans) | at_c3

    @invariant()
    def c3_has_each_sample_once_and_as_it_was_taken(self) -> None:
        assert self.c3.count == len(self.c3.samples)
        assert self.c3.samples.items() <= self.taken.items()

    def teardown(self) -> None:
        """At last the links are good and nobody dies: all of it arrives, and is forgotten."""
        contacts = 3 + len(self.taken) // (BATCHES_MAX * PER_FRAME)
        for _ in range(contacts):
            for name in AUVS:
                self.now_s += RESPONSE_S
                self.auv_reports(name)
                while self.to_uav or self.to_auv:
                    while self.to_uav:
                        self.uav_hears_auv('stored')
                    while self.to_auv:
                        self.auv_hears_uav('stored')
            self.uav_is_at_c3()
            while self.to_c3:
                self.c3_hears_uav()
            while self.from_c3:
                self.uav_hears_c3('stored')
        assert self.c3.samples == self.taken
        for keeper in (self.uav, *self.auvs.values()):
            assert keeper.custody.spans == ()
            keeper.die()
            assert keeper.custody.spans == ()


TestCustody = Custody.TestCase
TestCustody.settings = settings(max_examples=40, stateful_step_count=40)
