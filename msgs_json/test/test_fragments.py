"""Messages longer than a frame come across whole, whatever the link does to their fragments."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Iterable

import hypothesis.strategies as st
import pytest
from hypothesis import given
from msgspec.structs import replace

from msgs_json import codec
from msgs_json.authentication import Authenticator
from msgs_json.codec import MessageError, Refusal
from msgs_json.fragments import (
    DATA_BYTES_MIN,
    FRAME_BYTES_MIN,
    MESSAGE_BYTES_MAX,
    TRANSFERS_MAX,
    WINDOW,
    Incoming,
    Outgoing,
)
from msgs_json.frame_size import WIDE_COUNT, WIDE_FLOAT, WIDE_NAME
from msgs_json.messages import Fragment, FragmentReceipt, Message

SCHEMA = 'MissionOrder'
BODY = bytes(range(256)) * 4
"""Fragments do not look into it."""

Handed = tuple[str, bytes]


def cut(
    body: bytes = BODY, schema: str = SCHEMA, data_bytes: int = DATA_BYTES_MIN
) -> list[Fragment]:
    """Return all fragments of a message, cut by hand; 1024 bytes with the schema make 22."""
    outgoing = Outgoing(FRAME_BYTES_MIN)
    transfer = outgoing.fragments('uav', schema, body)[0].transfer
    content = schema.encode() + b'\n' + body
    parts = [content[at : at + data_bytes] for at in range(0, len(content), data_bytes)]
    return [
        Fragment(transfer=transfer, index=index, total=len(parts), data=part)
        for index, part in enumerate(parts)
    ]


# --- a frame holds a fragment --------------------------------------------------------------------


def signed_bytes(body: Message) -> int:
    envelope = codec.encode(body, src=WIDE_NAME, dst=WIDE_NAME, seq=WIDE_COUNT, stamp_s=WIDE_FLOAT)
    return len(Authenticator(b'k' * 32).sign(envelope))


@pytest.mark.parametrize('frame_bytes', [*range(FRAME_BYTES_MIN, FRAME_BYTES_MIN + 9), 512, 4096])
def test_signed_fragments_fill_a_frame_and_never_exceed_it(frame_bytes: int) -> None:
    body = b'{' * 1_500_000  # indices of as many digits as possible, in the shortest frame
    fragment = Outgoing(frame_bytes).fragments('uav', SCHEMA, body)[1]
    longest = replace(fragment, index=65_535, total=65_536)
    assert frame_bytes - 4 < signed_bytes(longest) <= frame_bytes


def test_a_receipt_fits_into_the_shortest_frame() -> None:
    longest = FragmentReceipt(transfer='f' * 16, missing=(65_535,) * WINDOW)
    assert signed_bytes(longest) <= FRAME_BYTES_MIN


def test_a_shorter_frame_is_refused() -> None:
    with pytest.raises(ValueError, match=rf'frame_bytes is 256; .* at least {FRAME_BYTES_MIN}'):
        Outgoing(256)


def test_a_message_too_long_for_any_receiver_is_refused() -> None:
    longest = MESSAGE_BYTES_MAX - len(f'{SCHEMA}\n')
    assert Outgoing(4096).fragments('uav', SCHEMA, bytes(longest))
    with pytest.raises(ValueError, match=r'has 16,777,217 bytes; .* 16,777,216 in'):
        Outgoing(4096).fragments('uav', SCHEMA, bytes(longest + 1))
    with pytest.raises(ValueError, match='at most 3,145,728 in fragments of 48'):
        Outgoing(FRAME_BYTES_MIN).fragments('uav', SCHEMA, bytes(longest))


# --- over any link -------------------------------------------------------------------------------


class Link:
    """One direction of a bad radio; what it delays comes with what is said next."""

    def __init__(self, seed: int, *, loss: float, fault: float, corruption: float) -> None:
        self._rng = random.Random(seed)
        self._loss, self._fault, self._corruption = loss, fault, corruption
        self._late: list[bytes] = []

    def carry(self, bodies: Iterable[Message]) -> list[Message]:
        frames, self._late = self._late, []
        for body in bodies:
            frame = codec.encode(body, src='a', dst='b', seq=0, stamp_s=0.0)
            copies = 0 if self._chance(self._loss) else 1 + self._chance(self._fault)
            for _ in range(copies):
                heard = self._corrupted(frame) if self._chance(self._corruption) else frame
                (self._late if self._chance(self._fault) else frames).append(heard)
        if self._chance(self._fault):
            self._rng.shuffle(frames)
        return [body for frame in frames if (body := self._understood(frame)) is not None]

    def _chance(self, probability: float) -> bool:
        return self._rng.random() < probability

    def _corrupted(self, frame: bytes) -> bytes:
        at = self._rng.randrange(len(frame))
        return frame[:at] + bytes([self._rng.randrange(32, 127)]) + frame[at + 1 :]

    def _understood(self, frame: bytes) -> Message | None:
        try:
            return codec.decode(frame)[1]
        except MessageError:
            return None


class Talk:
    """Two agents and the link between them."""

    def __init__(self, there: Link, back: Link, frame_bytes: int = FRAME_BYTES_MIN) -> None:
        self.outgoing, self.incoming = Outgoing(frame_bytes), Incoming()
        self._there, self._back = there, back
        self.said: list[Fragment] = []
        """In the last repetition."""

    def repeat(self, *messages: Handed) -> list[Handed]:
        """Say every message once; return what was handed over."""
        handed = []
        self.said = []
        for schema, body in messages:
            fragments = self.outgoing.fragments('b', schema, body)
            assert 1 <= len(fragments) <= WINDOW
            self.said += fragments
        receipts = []
        for fragment in self._there.carry(self.said):
            if not isinstance(fragment, Fragment):
                continue
            try:
                receipt, message = self.incoming.take('a', fragment)
            except MessageError:
                continue
            receipts.append(receipt)
            handed += [message] if message is not None else []
        for receipt in self._back.carry(receipts):
            if isinstance(receipt, FragmentReceipt):
                self.outgoing.receipt('b', receipt)
        return handed


def ideal(frame_bytes: int = FRAME_BYTES_MIN) -> Talk:
    return Talk(*[Link(0, loss=0.0, fault=0.0, corruption=0.0) for _ in range(2)], frame_bytes)


bodies = st.builds(
    lambda seed, size: random.Random(seed).randbytes(size),
    st.integers(0, 9),
    st.sampled_from([0, 1, 2, 34, 35, 36, 1000]) | st.integers(0, 2500),
)
messages = st.tuples(st.sampled_from([SCHEMA, 'SortieReport']), bodies)
links = st.builds(
    Link,
    st.integers(0, 2**32),
    loss=st.floats(0.0, 0.6),
    fault=st.floats(0.0, 0.5),
    corruption=st.floats(0.0, 0.02),
)


@given(
    sent=st.lists(messages, min_size=1, max_size=3, unique=True),
    there=links,
    back=links,
    frame_bytes=st.integers(FRAME_BYTES_MIN, 1000),
)
def test_all_that_is_said_comes_across_and_nothing_else(
    sent: list[Handed], there: Link, back: Link, frame_bytes: int
) -> None:
    talk = Talk(there, back, frame_bytes)
    unheard = set(sent)
    for _ in range(3000):
        handed = talk.repeat(*sent)
        assert set(handed) <= set(sent)
        unheard -= set(handed)
        if not unheard:
            return
    raise AssertionError(f'{len(unheard)} of {len(sent)} never came across')


@given(body=bodies, data=st.data())
def test_a_sender_that_restarts_says_only_what_is_missing_after_one_receipt(
    body: bytes, data: st.DataObject
) -> None:
    fragments = cut(body)
    incoming = Incoming()
    held = data.draw(st.sets(st.sampled_from(range(len(fragments)))))
    for index in held:
        incoming.take('a', fragments[index])
    restarted = Outgoing(FRAME_BYTES_MIN)
    said = restarted.fragments('b', SCHEMA, body)
    assert said == fragments[:WINDOW]
    receipt, _ = incoming.take('a', said[0])  # the only one that comes across
    missing = [fragment for fragment in fragments[1:] if fragment.index not in held]
    while missing:
        restarted.receipt('b', receipt)
        said = restarted.fragments('b', SCHEMA, body)
        assert said == missing[:WINDOW]
        receipt, message = [incoming.take('a', fragment) for fragment in said][-1]
        missing = missing[WINDOW:]
        assert message == (None if missing else (SCHEMA, body))
    assert receipt.missing == ()


def test_a_receiver_that_restarts_gets_it_anew() -> None:
    talk = ideal()
    assert talk.repeat((SCHEMA, BODY)) == []
    talk.incoming = Incoming()
    repetitions = [talk.repeat((SCHEMA, BODY)) for _ in range(3)]
    assert repetitions == [[], [], [(SCHEMA, BODY)]]  # 8 to 15, 0 to 7, and the rest


def test_on_a_good_link_nothing_is_said_twice() -> None:
    talk = ideal()
    said = []
    while talk.repeat((SCHEMA, BODY)) == []:
        said += talk.said
    assert said + talk.said == cut()


def test_two_messages_at_a_time_do_not_disturb_each_other() -> None:
    talk = ideal()
    messages = [(SCHEMA, BODY), ('SortieReport', BODY)]
    repetitions = [talk.repeat(*messages) for _ in range(3)]
    assert repetitions == [[], [], messages]


def test_receivers_are_told_apart() -> None:
    outgoing, incoming = Outgoing(FRAME_BYTES_MIN), Incoming()
    for fragment in outgoing.fragments('auv_1', SCHEMA, BODY):
        receipt, _ = incoming.take('uav', fragment)
    outgoing.receipt('auv_1', receipt)
    outgoing.receipt('auv_2', receipt)
    assert outgoing.fragments('auv_1', SCHEMA, BODY)[0].index == WINDOW
    assert outgoing.fragments('auv_2', SCHEMA, BODY)[0].index == 0


def test_of_many_transfers_the_least_recent_is_begun_anew() -> None:
    outgoing = Outgoing(FRAME_BYTES_MIN)
    bodies = [BODY + bytes([number]) for number in range(TRANSFERS_MAX + 1)]
    for body in (*bodies[:-1], bodies[0], bodies[-1]):
        transfer = outgoing.fragments('uav', SCHEMA, body)[0].transfer
        outgoing.receipt('uav', FragmentReceipt(transfer=transfer, missing=(20,)))
    firsts = [outgoing.fragments('uav', SCHEMA, body)[0].index for body in bodies[2:] + bodies[:2]]
    assert firsts == [*[20] * (TRANSFERS_MAX - 1), 20, 0]


@pytest.mark.parametrize('missing', [(), (22, 65_535)])
def test_a_receipt_of_everything_or_nonsense_leaves_one_fragment_to_say(
    missing: tuple[int, ...],
) -> None:
    outgoing = Outgoing(FRAME_BYTES_MIN)
    (first, *_) = outgoing.fragments('uav', SCHEMA, BODY)
    outgoing.receipt('uav', FragmentReceipt(transfer=first.transfer, missing=missing))
    assert outgoing.fragments('uav', SCHEMA, BODY) == [first]


def test_a_receipt_that_names_more_than_the_window_gets_no_more() -> None:
    outgoing = Outgoing(FRAME_BYTES_MIN)
    transfer = outgoing.fragments('uav', SCHEMA, BODY)[0].transfer
    outgoing.receipt('uav', FragmentReceipt(transfer=transfer, missing=tuple(range(3, 20))))
    said = outgoing.fragments('uav', SCHEMA, BODY)
    assert [fragment.index for fragment in said] == list(range(3, 3 + WINDOW))


def test_a_receipt_of_what_was_never_said_changes_nothing() -> None:
    outgoing = Outgoing(FRAME_BYTES_MIN)
    stray = FragmentReceipt(transfer='0' * 16, missing=())
    outgoing.receipt('uav', stray)
    before = outgoing.fragments('uav', SCHEMA, BODY)
    outgoing.receipt('uav', stray)
    assert outgoing.fragments('uav', SCHEMA, BODY) == before
    assert set(outgoing._missing) == {'uav'}
    assert set(outgoing._missing['uav']) == {before[0].transfer}


# --- what is complete is handed over with every repetition ---------------------------------------


def test_while_its_receipts_are_lost_it_is_handed_over_once_per_repetition() -> None:
    talk = ideal()
    short = (SCHEMA, bytes(300))
    talk.outgoing.receipt = lambda src, receipt: None  # type: ignore[method-assign]
    repetitions = [talk.repeat(short) for _ in range(4)]
    assert repetitions == [[short]] * 4
    assert len(talk.said) == 7


def test_once_it_is_known_to_be_complete_one_fragment_repeats_it() -> None:
    talk = ideal()
    while talk.repeat((SCHEMA, BODY)) == []:
        pass
    for _ in range(3):
        assert talk.repeat((SCHEMA, BODY)) == [(SCHEMA, BODY)]
        assert talk.said == cut()[:1]


@given(st.lists(st.sampled_from(range(22)), min_size=1, max_size=22, unique=True))
def test_the_part_of_a_repetition_that_is_heard_hands_it_over_once_at_most(
    heard: list[int],
) -> None:
    incoming, fragments = Incoming(), cut()
    for fragment in fragments:
        _, message = incoming.take('c3', fragment)
    assert message == (SCHEMA, BODY)
    answers = [incoming.take('c3', fragments[index]) for index in sorted(heard)]
    assert [answer for _, answer in answers] == [message, *[None] * (len(heard) - 1)]
    assert {receipt.missing for receipt, _ in answers} == {()}


# --- what makes no sense -------------------------------------------------------------------------


def refused(incoming: Incoming, fragment: Fragment, refusal: Refusal, text: str) -> None:
    with pytest.raises(MessageError, match=text) as error:
        incoming.take('c3', fragment)
    assert (error.value.refusal, error.value.sender) == (refusal, 'c3')


def test_an_index_out_of_range_is_refused() -> None:
    fragment = replace(cut()[0], index=22)
    text = r'`\$.body.index` is 22; must be less than total, 22'
    refused(Incoming(), fragment, Refusal.MALFORMED, text)


def test_a_fragment_with_next_to_nothing_in_it_is_refused_unless_it_is_the_last() -> None:
    fragments = cut(data_bytes=DATA_BYTES_MIN - 1)
    refused(Incoming(), fragments[0], Refusal.MALFORMED, r'`\$.body.data` has 47 bytes')
    assert Incoming().take('c3', fragments[-1])[0].missing == tuple(range(WINDOW))


@pytest.mark.parametrize('taken', [1, 22], ids=['partial', 'complete'])
def test_another_total_is_refused_and_the_transfer_begins_anew(taken: int) -> None:
    incoming, otherwise = Incoming(), cut(data_bytes=100)
    for fragment in cut()[:taken]:
        incoming.take('c3', fragment)
    refused(incoming, otherwise[0], Refusal.CONTRADICTORY, 'total` is 11; it was 22 in transfer')
    for fragment in otherwise:
        receipt, message = incoming.take('c3', fragment)
    assert (receipt.missing, message) == ((), (SCHEMA, BODY))


def test_what_does_not_add_up_is_refused_and_begins_anew() -> None:
    incoming, fragments = Incoming(), cut()
    incoming.take('c3', replace(fragments[0], data=b'x' * DATA_BYTES_MIN))
    for fragment in fragments[:-1]:
        incoming.take('c3', fragment)
    refused(incoming, fragments[-1], Refusal.CONTRADICTORY, 'do not add up')
    for fragment in fragments:
        _, message = incoming.take('c3', fragment)
    assert message == (SCHEMA, BODY)


@pytest.mark.parametrize('schema', ['Fragment', 'FragmentReceipt', 'Tick', 'x' * 1000, '', 'é'])
def test_what_is_not_said_in_fragments_is_refused(schema: str) -> None:
    *fragments, last = cut(b'{}' * 100, schema)
    incoming = Incoming()
    for fragment in fragments:
        incoming.take('c3', fragment)
    refused(incoming, last, Refusal.UNKNOWN_SCHEMA, 'in fragments come Acknowledgement, ')


def test_content_without_a_schema_is_refused() -> None:
    outgoing = Outgoing(FRAME_BYTES_MIN)
    (said,) = outgoing.fragments('uav', '', b'')
    assert said.data == b'\n'
    refused(Incoming(), said, Refusal.UNKNOWN_SCHEMA, "hold a ''")


def test_a_message_longer_than_allowed_is_refused_and_forgotten() -> None:
    incoming = Incoming(bytes_max=DATA_BYTES_MIN * 5)
    fragments = cut()
    for fragment in fragments[:5]:
        incoming.take('c3', fragment)
    refused(incoming, fragments[5], Refusal.NOT_POSSIBLE, 'has 288 bytes so far; at most 240')
    assert incoming.take('c3', fragments[6])[0].missing[0] == 0


def test_more_transfers_than_allowed_push_out_the_least_recent_of_their_sender_alone() -> None:
    incoming = Incoming()
    every = [cut(BODY + bytes([number])) for number in range(TRANSFERS_MAX + 1)]
    incoming.take('uav', every[1][0])
    for fragments in (*every[:-1], every[0], every[-1]):
        incoming.take('c3', fragments[0])
    lacks_first = {
        number: 0 in incoming.take('c3', fragments[2])[0].missing
        for number, fragments in (*enumerate(every[2:], 2), (0, every[0]))
    }
    assert not any(lacks_first.values())
    assert 0 in incoming.take('c3', every[1][2])[0].missing
    assert 0 not in incoming.take('uav', every[1][2])[0].missing


def bytes_held(incoming: Incoming, src: str) -> int:
    transfers = incoming._transfers[src].values()
    return sum(
        sum(map(len, each.parts.values())) + (0 if each.message is None else len(each.message[1]))
        for each in transfers
    )


def test_a_complete_message_is_kept_once() -> None:
    incoming = Incoming()
    for fragment in cut():
        incoming.take('c3', fragment)
    assert bytes_held(incoming, 'c3') == len(BODY)


hostile_fragments = st.one_of(
    st.builds(
        Fragment,
        transfer=st.integers(0, 12).map(lambda number: f'{number:016x}'),
        index=st.integers(0, 5) | st.integers(0, 65_535),
        total=st.integers(1, 5) | st.integers(1, 65_536),
        data=st.integers(1, 400).map(bytes),
    ),
    st.integers(0, 12).flatmap(lambda number: st.sampled_from(cut(BODY + bytes([number])))),
)


@given(st.lists(st.tuples(st.sampled_from(['uav', 'c3']), hostile_fragments), max_size=60))
def test_memory_is_bounded_whatever_is_sent(said: list[tuple[str, Fragment]]) -> None:
    incoming = Incoming(bytes_max=2000)
    for src, fragment in said:
        with contextlib.suppress(MessageError):
            receipt, _ = incoming.take(src, fragment)
            assert len(receipt.missing) <= WINDOW
        for sender, transfers in incoming._transfers.items():
            assert len(transfers) <= TRANSFERS_MAX
            assert bytes_held(incoming, sender) <= 2000
