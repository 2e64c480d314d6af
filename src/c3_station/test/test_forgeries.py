"""Whatever a stranger says is refused by the key or by the number, and breaks no decoder."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
import pytest

from c3_station.forgeries import Forgery, ForgeryKind, Stranger
from msgs_json import codec
from msgs_json.authentication import Authenticator
from msgs_json.codec import MessageError, Refusal
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Leg,
    Message,
    PathAssignment,
    RecoveryOrder,
    RecoveryReason,
)
from msgs_json.replay_window import ReplayWindow

AUTHENTICATOR = Authenticator(b'k' * 32)

PATH = ((0, 0), (0, 1), (1, 1))
SAID: list[tuple[str, str, Message]] = [
    (
        'uav',
        'auv_1',
        PathAssignment(auv='auv_1', leg=Leg(leg_id=1, path=PATH, surface_deadline_s=30.0)),
    ),
    ('auv_1', 'uav', Acknowledgement(acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=1)),
    (
        'uav',
        'auv_2',
        RecoveryOrder(auv='auv_2', leg_id=4, reason=RecoveryReason.EXPLORED),
    ),
]
GENUINE = [
    AUTHENTICATOR.sign(codec.encode(body, src=src, dst=dst, seq=seq, stamp_s=14.0))
    for seq, (src, dst, body) in enumerate(SAID)
]

# These are messages as they should be, but for who said them, to whom, or when: without a key
# they would be believed.
BELIEVED_WITHOUT_A_KEY = {
    ForgeryKind.UNSIGNED,
    ForgeryKind.OTHER_KEY,
    ForgeryKind.RENUMBERED,
    ForgeryKind.OTHER_RECEIVER,
    ForgeryKind.UNKNOWN_SENDER,
}
NO_MESSAGES = {
    ForgeryKind.RANDOM_BYTES,
    ForgeryKind.CUT_OFF,
    ForgeryKind.NOT_UTF_8,
    ForgeryKind.DEEP_NESTING,
    ForgeryKind.HUGE_NUMBER,
    ForgeryKind.NO_NUMBER,
    ForgeryKind.LONG_NAME,
}


def forgeries(count: int, seed: int = 1) -> list[Forgery]:
    stranger = Stranger(np.random.default_rng(seed))
    for payload in GENUINE:
        stranger.hear(payload)
    return list(stranger.forgeries(count))


@pytest.fixture(scope='module')
def forged() -> list[Forgery]:
    return forgeries(200 * len(ForgeryKind))


class Receiver:
    """Who hears all messages of the mission, and what is forged after them."""

    def __init__(self) -> None:
        self.windows: dict[str, ReplayWindow] = {}

    def admits(self, payload: bytes) -> bool:
        if not AUTHENTICATOR.check(payload):
            return False
        envelope, _ = codec.decode(payload)
        window = self.windows.setdefault(envelope.src, ReplayWindow())
        if not window.is_fresh(envelope.seq):
            return False
        window.accept(envelope.seq)
        return True


def refusals(forged: Iterable[Forgery]) -> dict[ForgeryKind, Counter[Refusal | None]]:
    """Return what decoding says of forgeries, by their kind; None where it finds no fault."""
    found: dict[ForgeryKind, Counter[Refusal | None]] = {kind: Counter() for kind in ForgeryKind}
    for each in forged:
        try:
            codec.open_body(codec.open_envelope(each.payload))
        except MessageError as error:
            found[each.kind][error.refusal] += 1
        else:
            found[each.kind][None] += 1
    return found


def test_no_forgery_is_admitted(forged: list[Forgery]) -> None:
    receiver = Receiver()
    assert all(receiver.admits(payload) for payload in GENUINE)
    assert [each for each in forged if receiver.admits(each.payload)] == []


def test_none_is_admitted_by_a_receiver_that_was_restarted(forged: list[Forgery]) -> None:
    receiver = Receiver()
    assert all(receiver.admits(payload) for payload in GENUINE)
    receiver.windows = {
        src: ReplayWindow(window.highest) for src, window in receiver.windows.items()
    }
    assert [each for each in forged if receiver.admits(each.payload)] == []


def test_only_replays_are_signed(forged: list[Forgery]) -> None:
    signed = {each.kind for each in forged if AUTHENTICATOR.check(each.payload)}
    assert signed == {ForgeryKind.REPLAY}


def test_decoding_refuses_what_is_no_message_and_nothing_raises(forged: list[Forgery]) -> None:
    found = refusals(forged)
    for kind in NO_MESSAGES:
        assert set(found[kind]) <= {Refusal.MALFORMED, Refusal.UNKNOWN_SCHEMA}, kind
    assert set(found[ForgeryKind.UNKNOWN_SCHEMA]) == {Refusal.UNKNOWN_SCHEMA}
    assert set(found[ForgeryKind.OTHER_VERSION]) == {Refusal.UNKNOWN_SCHEMA}


def test_the_others_would_be_believed_without_a_key(forged: list[Forgery]) -> None:
    found = refusals(forged)
    for kind in BELIEVED_WITHOUT_A_KEY:
        assert set(found[kind]) == {None}, kind
    assert found[ForgeryKind.OTHER_BODY][None] > 0
    assert found[ForgeryKind.REPLAY][None] > 0


def test_there_are_as_many_as_asked_for_of_every_kind_in_turn() -> None:
    assert forgeries(0) == []
    assert [each.kind for each in forgeries(len(ForgeryKind))] == list(ForgeryKind)
    counts = Counter(each.kind for each in forgeries(3 * len(ForgeryKind) + 1))
    assert sorted(counts.values()) == [3] * (len(ForgeryKind) - 1) + [4]


def test_a_forgery_differs_from_all_that_was_said(forged: list[Forgery]) -> None:
    said_again = {each.kind for each in forged if each.payload in GENUINE}
    assert said_again == {ForgeryKind.REPLAY}


def test_the_same_seed_forges_the_same() -> None:
    assert forgeries(100, seed=5) == forgeries(100, seed=5)
    assert forgeries(100, seed=5) != forgeries(100, seed=6)


def test_a_stranger_that_has_heard_nothing_has_nothing_to_forge() -> None:
    with pytest.raises(ValueError, match='heard nothing'):
        next(Stranger(np.random.default_rng(1)).forgeries(1))


def test_kinds_go_on_where_the_last_ones_ended() -> None:
    stranger = Stranger(np.random.default_rng(0))
    for payload in GENUINE:
        stranger.hear(payload)
    one_by_one = [forgery.kind for _ in ForgeryKind for forgery in stranger.forgeries(1)]
    assert one_by_one == list(ForgeryKind)


def test_what_was_damaged_is_not_remembered() -> None:
    stranger = Stranger(np.random.default_rng(0))
    with pytest.raises(MessageError):
        stranger.hear(GENUINE[0].replace(b'"leg_id":1', b'"leg_id":x'))
