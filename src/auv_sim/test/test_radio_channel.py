from __future__ import annotations

import itertools
from collections import Counter

import hypothesis.strategies as st
import pytest
from hypothesis import given

from auv_sim.radio_channel import Delivery, RadioChannel
from auv_sim.radio_model import ChannelModel, RadioOutage, StationKind
from msgs_json import codec
from msgs_json.authentication import Authenticator
from msgs_json.geometry import Point
from msgs_json.messages import Acknowledged, Acknowledgement, BlockReason

STATIONS = {
    'c3': StationKind.C3,
    'uav': StationKind.UAV,
    'auv_1': StationKind.AUV,
    'auv_2': StationKind.AUV,
}
HERE = Point(east_m=100.0, north_m=100.0)
NOTHING_BLOCKED = dict.fromkeys([reason.value for reason in BlockReason], 0)


class Bench:
    """A channel with all stations at the surface of the same place."""

    def __init__(
        self,
        range_m: float = 20.0,
        outages: tuple[RadioOutage, ...] = (),
        authenticator: Authenticator | None = None,
    ) -> None:
        model = ChannelModel(range_m=range_m, max_message_bytes=512, outages=outages)
        self.channel = RadioChannel(model, STATIONS, tick_s=1.0, authenticator=authenticator)
        self.seq: Counter[str] = Counter()
        for name in STATIONS:
            self.channel.locate(name, HERE, 0.0)

    def payload(self, src: str, dst: str) -> bytes:
        """Return what a station says next."""
        body = Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)
        seq = self.seq[src]
        self.seq[src] += 1
        return codec.encode(body, src=src, dst=dst, seq=seq, stamp_s=0.0)

    def say(self, speaker: str, payload: bytes, now_s: float = 0.0) -> BlockReason | None:
        """Return why a message is blocked, None if it is delivered; check the counters."""
        before = self.channel.status()
        self.channel.say(speaker, payload)
        heard = self.channel.deliveries(now_s)
        after = self.channel.status()
        blocked = [
            BlockReason(reason)
            for reason, count in after.blocked.items()
            if count != before.blocked[reason]
        ]
        assert after.delivered - before.delivered == len(heard)
        assert len(heard) + len(blocked) == 1
        return blocked[0] if blocked else None


def test_the_receiver_gets_the_very_bytes() -> None:
    bench = Bench()
    payload = bench.payload('auv_1', 'uav')
    assert bench.channel.say('auv_1', payload) == 0
    assert bench.channel.deliveries(0.0) == [Delivery('uav', payload, is_intact=True)]
    assert bench.channel.deliveries(0.0) == []
    assert bench.channel.status().delivered == 1
    assert bench.channel.status().blocked == NOTHING_BLOCKED


@pytest.mark.parametrize(('src', 'dst'), list(itertools.product(STATIONS, repeat=2)))
def test_only_the_uav_is_linked_with_the_others(src: str, dst: str) -> None:
    bench = Bench()
    linked = src != dst and 'uav' in (src, dst)
    expected = None if linked else BlockReason.UNKNOWN_SENDER
    assert bench.say(src, bench.payload(src, dst)) is expected


@pytest.mark.parametrize('dst', ['auv_9', '*', 'world'])
def test_nobody_else_is_reached(dst: str) -> None:
    bench = Bench()
    assert bench.say('uav', bench.payload('uav', dst)) is BlockReason.UNKNOWN_SENDER


@given(st.floats(0, 100), st.floats(0, 100), st.floats(1, 100))
def test_range_is_a_disc_around_either(east_m: float, north_m: float, range_m: float) -> None:
    bench = Bench(range_m)
    there = Point(east_m=HERE.east_m + east_m, north_m=HERE.north_m + north_m)
    bench.channel.locate('auv_1', there, 0.0)
    distance_m = HERE.distance_m(there)
    expected = None if distance_m <= range_m * (1 + 1e-9) else BlockReason.RANGE
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is expected
    assert bench.say('uav', bench.payload('uav', 'auv_1')) is expected


def test_height_does_not_count_but_water_does() -> None:
    bench = Bench()
    bench.channel.locate('uav', HERE, 10_000.0)
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is None
    bench.channel.locate('auv_1', HERE, -0.01)
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is BlockReason.SUBMERGED
    assert bench.say('uav', bench.payload('uav', 'auv_1')) is BlockReason.SUBMERGED


def test_a_station_that_was_never_seen_is_out_of_range() -> None:
    bench = Bench()
    model = ChannelModel(range_m=20.0, max_message_bytes=512)
    bench.channel = RadioChannel(model, STATIONS, tick_s=1.0)
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is BlockReason.RANGE


@pytest.mark.parametrize(('length', 'expected'), [(512, None), (513, BlockReason.SIZE)])
def test_size_limit(length: int, expected: BlockReason | None) -> None:
    bench = Bench()
    payload = bench.payload('uav', 'c3')
    assert bench.say('uav', payload + b' ' * (length - len(payload))) is expected


def test_after_a_message_that_was_too_long_the_next_gets_through() -> None:
    bench = Bench()
    bench.say('uav', bench.payload('uav', 'c3') + b' ' * 1000)
    assert bench.say('uav', bench.payload('uav', 'c3')) is None


@pytest.mark.parametrize(
    ('payload', 'expected'),
    [
        (b'', BlockReason.MALFORMED),
        (b'{}', BlockReason.MALFORMED),
        (b'\xff\xfe', BlockReason.MALFORMED),
        (b'[' * 300, BlockReason.MALFORMED),
        (b'[' * 1_000_000, BlockReason.SIZE),
    ],
)
def test_what_is_no_envelope_is_malformed(payload: bytes, expected: BlockReason) -> None:
    bench = Bench()
    assert bench.say('auv_1', payload) is expected
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is None


def test_a_body_that_is_not_sound_is_heard_by_nobody_but_counts_as_said() -> None:
    bench = Bench()
    payload = bench.payload('auv_1', 'uav').replace(b'MissionOrder', b'Nonsense')
    assert bench.say('auv_1', payload) is BlockReason.MALFORMED
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is None


def test_who_speaks_in_another_name_is_unknown() -> None:
    bench = Bench()
    for name in ('auv_2', 'uav', 'c3', 'auv_9'):
        payload = bench.payload(name, 'uav' if name != 'uav' else 'auv_1')
        assert bench.say('auv_1', payload) is BlockReason.UNKNOWN_SENDER
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is None


def test_what_was_said_before_is_a_replay_wherever_its_speaker_is_now() -> None:
    bench = Bench()
    first, second = bench.payload('auv_1', 'uav'), bench.payload('auv_1', 'uav')
    assert [bench.say('auv_1', each) for each in (first, first, second, first, second)] == [
        *(None, BlockReason.REPLAY, None, BlockReason.REPLAY, BlockReason.REPLAY)
    ]


def test_what_was_blocked_cannot_be_replayed_either() -> None:
    bench = Bench()
    bench.channel.locate('auv_1', HERE, -5.0)
    payload = bench.payload('auv_1', 'uav')
    assert bench.say('auv_1', payload) is BlockReason.SUBMERGED
    bench.channel.locate('auv_1', HERE, 0.0)
    assert bench.say('auv_1', payload) is BlockReason.REPLAY


def test_numbers_from_the_future_are_not_the_stations_own() -> None:
    # Else one forged message with a high number would turn all true ones into replays.
    bench = Bench()
    true, forged = bench.payload('auv_1', 'uav'), bench.payload('auv_1', 'uav')
    assert bench.say('auv_1', forged) is BlockReason.UNKNOWN_SENDER
    assert bench.say('auv_1', true) is None


RESTARTED_AT = 1 << 32


def test_a_station_that_was_restarted_goes_on_with_the_number_that_it_told() -> None:
    bench = Bench()
    old = [bench.payload('auv_1', 'uav') for _ in range(3)]
    assert bench.say('auv_1', old[0]) is None
    bench.seq['auv_1'] = RESTARTED_AT
    new = bench.payload('auv_1', 'uav')
    assert bench.say('auv_1', new) is BlockReason.UNKNOWN_SENDER
    bench.channel.expect('auv_1', RESTARTED_AT)
    assert bench.say('auv_1', old[1]) is None  # it was under way when the station died
    assert bench.say('auv_1', new) is None
    assert bench.say('auv_1', old[2]) is BlockReason.REPLAY
    assert bench.say('auv_1', bench.payload('auv_1', 'uav')) is None


def signed(bench: Bench, src: str, dst: str, key: bytes = b'k' * 32) -> bytes:
    return Authenticator(key).sign(bench.payload(src, dst))


def test_with_the_key_nobody_else_can_use_up_a_stations_numbers() -> None:
    bench = Bench(authenticator=Authenticator(b'k' * 32))
    true = signed(bench, 'auv_1', 'uav')
    forged = bench.payload('auv_1', 'uav')
    stolen = signed(bench, 'auv_1', 'uav', key=b'x' * 32)
    damaged = signed(bench, 'auv_1', 'uav').replace(b'"reference":0', b'"reference":9')
    for strange in (forged, stolen, damaged):
        assert bench.say('auv_1', strange) is BlockReason.AUTH
    assert bench.say('auv_1', true) is None
    assert bench.say('auv_1', true) is BlockReason.REPLAY
    bench.seq['auv_1'] = RESTARTED_AT  # whoever has the key may leave a gap
    assert bench.say('auv_1', signed(bench, 'auv_1', 'uav')) is None


def test_what_is_a_stations_own_is_told_even_if_nobody_hears_it() -> None:
    bench = Bench()
    channel = bench.channel
    channel.locate('auv_1', HERE, -5.0)
    first = bench.payload('auv_1', 'uav')
    assert channel.say('auv_1', first) == 0
    assert channel.say('auv_1', first) is None
    assert channel.say('auv_1', b'?') is None
    assert channel.say('auv_1', bench.payload('auv_2', 'uav')) is None
    assert channel.say('auv_1', bench.payload('auv_1', 'uav') + b' ' * 1000) == 1
    assert channel.say('auv_1', bench.payload('auv_1', 'c3')) == 2
    body_not_sound = bench.payload('auv_1', 'uav').replace(b'MissionOrder', b'Nonsense')
    assert channel.say('auv_1', body_not_sound) == 3
    assert channel.deliveries(0.0) == []
    assert channel.status().blocked == NOTHING_BLOCKED | {
        'replay': 1,
        'malformed': 2,
        'unknown_sender': 2,
        'size': 1,
        'submerged': 1,
    }


def test_rounds_are_in_the_order_of_stations_and_every_message_counts_once() -> None:
    bench = Bench()
    bench.channel.locate('auv_2', HERE, -5.0)
    said = [
        ('auv_1', bench.payload('auv_1', 'uav')),
        ('auv_2', bench.payload('auv_2', 'uav')),
        ('uav', bench.payload('uav', 'auv_1')),
        ('uav', b'?'),
        ('c3', bench.payload('c3', 'uav')),
        ('uav', bench.payload('uav', 'c3')),
    ]
    for speaker, payload in said:
        bench.channel.say(speaker, payload)
    in_order_of_stations = [said[4], said[2], said[5], said[0]]
    assert [delivery.payload for delivery in bench.channel.deliveries(0.0)] == [
        payload for _, payload in in_order_of_stations
    ]
    status = bench.channel.status()
    assert status.delivered == 4
    assert status.blocked == NOTHING_BLOCKED | {'submerged': 1, 'malformed': 1}


# --- outages -------------------------------------------------------------------------------------

OUTAGE = RadioOutage(station='auv_1', from_s=100.0, until_s=220.0)


@pytest.mark.parametrize(
    ('now_s', 'expected'),
    [
        (99.9, None),
        (100.0 - 1e-9, BlockReason.LOSS),  # a tick that is meant to be at 100 s
        (219.9, BlockReason.LOSS),
        (220.0 - 1e-9, None),
        (1e6, None),
    ],
)
def test_a_dead_radio_neither_sends_nor_hears(now_s: float, expected: BlockReason | None) -> None:
    bench = Bench(outages=(OUTAGE,))
    assert bench.say('auv_1', bench.payload('auv_1', 'uav'), now_s) is expected
    assert bench.say('uav', bench.payload('uav', 'auv_1'), now_s) is expected
    for src, dst in (('auv_2', 'uav'), ('uav', 'auv_2'), ('uav', 'c3'), ('c3', 'uav')):
        assert bench.say(src, bench.payload(src, dst), now_s) is None


def test_a_station_may_have_many_outages_and_any_station_may() -> None:
    again = RadioOutage(station='auv_1', from_s=300.0, until_s=301.0)
    uav = RadioOutage(station='uav', from_s=10.0, until_s=11.0)
    bench = Bench(outages=(OUTAGE, again, uav))
    heard = [bench.say('auv_1', bench.payload('auv_1', 'uav'), t) for t in (5.0, 10.0, 150.0)]
    heard += [bench.say('auv_1', bench.payload('auv_1', 'uav'), t) for t in (250.0, 300.0)]
    assert heard == [None, BlockReason.LOSS, BlockReason.LOSS, None, BlockReason.LOSS]
    assert bench.say('c3', bench.payload('c3', 'uav'), 10.0) is BlockReason.LOSS


def test_lost_is_what_would_have_been_heard_without_the_outage() -> None:
    bench = Bench(outages=(OUTAGE,))
    bench.channel.locate('auv_1', HERE, -5.0)
    assert bench.say('auv_1', bench.payload('auv_1', 'uav'), 150.0) is BlockReason.SUBMERGED
    bench.channel.locate('auv_1', Point(east_m=0.0, north_m=0.0), 0.0)
    assert bench.say('auv_1', bench.payload('auv_1', 'uav'), 150.0) is BlockReason.RANGE


def test_what_was_lost_cannot_be_replayed_after_the_outage() -> None:
    bench = Bench(outages=(OUTAGE,))
    payload = bench.payload('auv_1', 'uav')
    assert bench.say('auv_1', payload, 150.0) is BlockReason.LOSS
    assert bench.say('auv_1', payload, 250.0) is BlockReason.REPLAY
    assert bench.say('auv_1', bench.payload('auv_1', 'uav'), 250.0) is None


def test_an_outage_does_not_end_before_it_begins() -> None:
    with pytest.raises(ValueError, match='until_s is 3; allowed: at least 4'):
        RadioOutage(station='auv_1', from_s=4.0, until_s=3.0)
