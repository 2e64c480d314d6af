"""What a radio that is not ideal does to frames: properties, and the figures that it is told."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import dataclass, field, replace

import hypothesis.strategies as st
import pytest
from hypothesis import given

from auv_sim.radio_channel import Delivery, RadioChannel
from auv_sim.radio_model import (
    Bursts,
    ChannelModel,
    Link,
    LinkModel,
    LossOverDistance,
    RadioOutage,
    StationKind,
)
from msgs_json import codec
from msgs_json.geometry import Point
from msgs_json.messages import Acknowledged, Acknowledgement, BlockReason

STATIONS = {
    'c3': StationKind.C3,
    'uav': StationKind.UAV,
    'auv_1': StationKind.AUV,
    'auv_2': StationKind.AUV,
}
PAIRS = [('c3', 'uav'), ('uav', 'c3')] + [
    pair for name in ('auv_1', 'auv_2') for pair in ((name, 'uav'), ('uav', name))
]
RANGE_M = 20.0
HERE = Point(east_m=0.0, north_m=0.0)


def payload(src: str, dst: str, seq: int) -> bytes:
    body = Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=seq)
    return codec.encode(body, src=src, dst=dst, seq=seq, stamp_s=0.0)


FRAME_BYTES = len(payload('auv_1', 'uav', 0))


@dataclass
class Sea:
    """A channel of which one is told everything: what was said when, and what was heard when."""

    model: ChannelModel
    tick_s: float = 1.0
    tick: int = 0
    said: dict[bytes, tuple[str, str, float]] = field(default_factory=dict)
    """Speaker, receiver and time by payload."""
    heard: list[tuple[float, Delivery]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.channel = RadioChannel(self.model, STATIONS, tick_s=self.tick_s)
        self.seq: Counter[str] = Counter()
        for name in STATIONS:
            self.channel.locate(name, HERE, 0.0)

    @property
    def now_s(self) -> float:
        return self.tick * self.tick_s

    def say(self, src: str, dst: str) -> bytes:
        data = payload(src, dst, self.seq[src])
        assert self.channel.say(src, data) == self.seq[src]
        self.seq[src] += 1
        self.said[data] = (src, dst, self.now_s)
        return data

    def round(self) -> list[Delivery]:
        heard = self.channel.deliveries(self.now_s)
        self.heard += [(self.now_s, delivery) for delivery in heard]
        return heard

    def tick_on(self, ticks: int = 1) -> None:
        """Go on from tick to tick, with a round of the radio in each."""
        for _ in range(ticks):
            self.tick += 1
            self.round()

    def run(self, ticks: int, *pairs: tuple[str, str]) -> None:
        """Say a frame on each link in this tick, and in those after it."""
        for number in range(ticks):
            self.tick += number > 0
            for src, dst in pairs:
                self.say(src, dst)
            self.round()

    def blocked(self) -> dict[str, int]:
        return {name: count for name, count in self.channel.status().blocked.items() if count}


def sea(link: LinkModel, *links: Link, tick_s: float = 1.0, seed: int = 0, queue: int = 16) -> Sea:
    model = ChannelModel(
        range_m=RANGE_M,
        max_message_bytes=4096,
        link=link,
        links=links,
        seed=seed,
        queue_frames=queue,
    )
    return Sea(model, tick_s)


def link(src: str, dst: str, **changes: float) -> Link:
    return Link(speaker=src, receiver=dst, **changes)


# --- whatever the radio and whatever happens -----------------------------------------------------

shares = st.sampled_from([0.0, 0.0, 0.1, 0.5, 1.0])
link_models = st.builds(
    LinkModel,
    loss=st.one_of(shares, st.builds(LossOverDistance, at_zero=shares, at_range=shares)),
    bursts=st.none() | st.just(Bursts(good_s=5.0, bad_s=2.0, loss=0.9)),
    latency_s=st.sampled_from([0.0, 0.0, 0.3, 1.0, 2.5]),
    jitter_s=st.sampled_from([0.0, 0.0, 0.5, 3.0]),
    bytes_per_s=st.sampled_from([None, 50.0, 150.0, 1000.0]),
    duplicates=shares,
    corruption=shares,
)
channel_models = st.builds(
    ChannelModel,
    range_m=st.just(RANGE_M),
    max_message_bytes=st.just(4096),
    queue_frames=st.sampled_from([1, 3, 16]),
    link=link_models,
    links=st.sampled_from([(), (link('auv_1', 'uav', loss=1.0),)]),
    outages=st.sampled_from([(), (RadioOutage(station='auv_2', from_s=3.0, until_s=6.0),)]),
    seed=st.integers(0, 2**32),
)
doings = st.lists(
    st.one_of(
        st.tuples(st.just('say'), st.sampled_from(PAIRS)),
        st.tuples(
            st.just('move'),
            st.sampled_from(sorted(STATIONS)),
            st.sampled_from([0.0, 10.0, 21.0]),
            st.sampled_from([0.0, 0.0, -5.0]),
        ),
        st.tuples(st.just('round')),
        st.tuples(st.just('tick')),
    ),
    max_size=40,
)


@given(channel_models, st.sampled_from([1.0, 0.5, 0.3]), doings)
def test_frames_are_conserved_and_heard_in_time_by_who_can_hear(
    model: ChannelModel, tick_s: float, doings: list[tuple[object, ...]]
) -> None:
    the_sea = Sea(model, tick_s)
    where = dict.fromkeys(STATIONS, (0.0, 0.0))

    def check(heard: list[Delivery]) -> None:
        status = the_sea.channel.status()
        frames = len(the_sea.said) + status.duplicated
        blocked = sum(status.blocked.values())
        assert frames == status.delivered + blocked + the_sea.channel.under_way
        assert status.delivered == len(the_sea.heard)
        assert status.corrupted == sum(not each.is_intact for _, each in the_sea.heard)
        for delivery in heard:
            assert where[delivery.receiver][1] == 0.0
            assert (delivery.payload in the_sea.said) == delivery.is_intact
            if not delivery.is_intact:
                continue
            src, dst, said_s = the_sea.said[delivery.payload]
            assert dst == delivery.receiver
            assert abs(where[src][0] - where[dst][0]) <= RANGE_M
            link = model.link_model(src, dst)
            least_s = link.transmission_s(len(delivery.payload)) + link.latency_s
            assert the_sea.now_s >= said_s + least_s - 1e-6
            outages = [outage for outage in model.outages if outage.station == dst]
            assert not any(outage.holds_at(the_sea.now_s) for outage in outages)
            assert link.loss != 1.0

    for doing in doings:
        match doing:
            case ('say', (str(src), str(dst))):
                the_sea.say(src, dst)
            case ('move', str(name), float(east_m), float(z_m)):
                where[name] = (east_m, z_m)
                the_sea.channel.locate(name, Point(east_m=east_m, north_m=0.0), z_m)
            case ('tick',):
                the_sea.tick += 1
                check(the_sea.round())
            case _:
                check(the_sea.round())
    if model.link.bytes_per_s is None:  # else there may be a queue for longer
        check(the_sea.round())
        the_sea.tick += 100
        check(the_sea.round())
        assert the_sea.channel.under_way == 0


@given(channel_models, doings)
def test_the_same_seed_has_the_same_outcome(
    model: ChannelModel, doings: list[tuple[object, ...]]
) -> None:
    def outcome() -> list[tuple[float, Delivery]]:
        the_sea = Sea(model)
        for doing in doings:
            match doing:
                case ('say', (str(src), str(dst))):
                    the_sea.say(src, dst)
                case ('tick',):
                    the_sea.tick_on()
        return the_sea.heard

    assert outcome() == outcome()


@given(link_models, st.integers(1, 30))
def test_without_jitter_frames_are_heard_in_the_order_in_which_they_were_said(
    model: LinkModel, frames: int
) -> None:
    the_sea = sea(replaced(model, jitter_s=0.0, corruption=0.0, duplicates=0.0))
    the_sea.run(frames, ('auv_1', 'uav'), ('auv_1', 'uav'))
    the_sea.tick_on(100)
    in_order = {data: number for number, data in enumerate(the_sea.said)}
    numbers = [in_order[delivery.payload] for _, delivery in the_sea.heard]
    assert numbers == sorted(numbers)


def replaced(model: LinkModel, **changes: float) -> LinkModel:
    return LinkModel(
        **{name: getattr(model, name) for name in LinkModel.__struct_fields__} | changes
    )


# --- loss ----------------------------------------------------------------------------------------


def assert_share(count: int, total: int, share: float) -> None:
    """Fail where a count is 5 standard deviations from what is expected: once in 2 million."""
    deviation = math.sqrt(total * share * (1 - share))
    assert abs(count - total * share) <= 5 * deviation


@pytest.mark.parametrize('loss', [0.0, 0.05, 0.3, 0.6, 1.0])
def test_the_share_that_is_lost_is_the_one_asked_for(loss: float) -> None:
    the_sea = sea(LinkModel(loss=loss))
    the_sea.run(3000, ('auv_1', 'uav'))
    assert_share(the_sea.channel.status().blocked['loss'], 3000, loss)
    assert the_sea.channel.status().delivered == 3000 - the_sea.channel.status().blocked['loss']


def test_what_is_lost_with_a_smaller_share_is_lost_with_a_larger_one_too() -> None:
    def heard(loss: float) -> set[float]:
        the_sea = sea(LinkModel(loss=loss))
        the_sea.run(300, ('auv_1', 'uav'))
        return {now_s for now_s, _ in the_sea.heard}

    assert heard(0.6) < heard(0.3) < heard(0.1)


@pytest.mark.parametrize(('east_m', 'share'), [(0.0, 0.1), (10.0, 0.3), (20.0, 0.9), (14.14, 0.5)])
def test_loss_may_grow_with_the_square_of_the_distance(east_m: float, share: float) -> None:
    the_sea = sea(LinkModel(loss=LossOverDistance(at_zero=0.1, at_range=0.9)))
    the_sea.channel.locate('auv_1', Point(east_m=east_m, north_m=0.0), 0.0)
    the_sea.run(3000, ('auv_1', 'uav'))
    assert_share(the_sea.channel.status().blocked['loss'], 3000, share)


def test_bad_times_come_and_go_with_the_lengths_asked_for() -> None:
    the_sea = sea(LinkModel(bursts=Bursts(good_s=9.0, bad_s=6.0)), tick_s=0.5)
    ticks = 7_000
    the_sea.run(ticks, ('auv_1', 'uav'))
    heard_in = {round(now_s / 0.5) for now_s, _ in the_sea.heard}
    is_bad = [tick not in heard_in for tick in range(ticks)]
    times = [(bad, len(list(run)) * 0.5) for bad, run in itertools.groupby(is_bad)]
    for bad, mean_s in ((True, 6.0), (False, 9.0)):
        lengths = [length_s for each, length_s in times if each is bad]
        assert len(lengths) > 180
        # What changes twice between two ticks is not seen, so that times look a little longer.
        assert sum(lengths) / len(lengths) == pytest.approx(mean_s, rel=0.3)
    assert the_sea.channel.status().blocked['loss'] / ticks == pytest.approx(0.4, rel=0.2)


def test_bad_times_cost_their_share_and_come_on_top_of_other_loss() -> None:
    the_sea = sea(LinkModel(loss=0.2, bursts=Bursts(good_s=1.0, bad_s=1.0, loss=0.5)), tick_s=10.0)
    the_sea.run(4000, ('auv_1', 'uav'))
    assert_share(the_sea.channel.status().blocked['loss'], 4000, 1 - 0.8 * (1 - 0.5 * 0.5))


def test_a_bad_time_lasts_for_all_that_is_said_at_once() -> None:
    the_sea = sea(LinkModel(bursts=Bursts(good_s=1.0, bad_s=1.0)), tick_s=5.0)
    the_sea.run(200, *[('auv_1', 'uav')] * 5)
    heard = Counter(now_s for now_s, _ in the_sea.heard)
    assert set(heard.values()) == {5}
    assert 60 < len(heard) < 140


# --- links ---------------------------------------------------------------------------------------


def test_a_link_may_be_dead_in_one_direction() -> None:
    the_sea = sea(LinkModel(), link('auv_1', 'uav', loss=1.0))
    the_sea.run(50, *PAIRS)
    links = Counter(the_sea.said[delivery.payload][:2] for _, delivery in the_sea.heard)
    assert links == dict.fromkeys([pair for pair in PAIRS if pair != ('auv_1', 'uav')], 50)


def test_what_a_link_does_not_say_is_as_on_all_others() -> None:
    model = ChannelModel(
        range_m=RANGE_M,
        max_message_bytes=4096,
        link=LinkModel(loss=0.1, latency_s=2.0, bytes_per_s=100.0),
        links=(Link(speaker='uav', receiver='c3', loss=0.0, bytes_per_s=None),),
    )
    assert model.link_model('uav', 'c3') == LinkModel(latency_s=2.0)
    assert model.link_model('c3', 'uav') == model.link


def test_what_is_said_elsewhere_does_not_change_what_happens_on_a_link() -> None:
    model = LinkModel(loss=0.5, jitter_s=3.0, duplicates=0.3, corruption=0.2)

    def outcome(*others: tuple[str, str]) -> list[tuple[float, Delivery]]:
        the_sea = sea(model)
        the_sea.run(100, *others, ('uav', 'auv_1'), *others)
        return [each for each in the_sea.heard if each[1].receiver == 'auv_1']

    def without_numbers(outcome: list[tuple[float, Delivery]]) -> list[tuple[float, bool]]:
        return [(now_s, delivery.is_intact) for now_s, delivery in outcome]

    assert outcome(('c3', 'uav'), ('auv_2', 'uav')) == outcome()
    assert without_numbers(outcome(('uav', 'c3'))) == without_numbers(outcome())


def test_a_frame_that_is_blocked_does_not_change_what_happens_to_the_next() -> None:
    model = LinkModel(loss=0.5, jitter_s=3.0, duplicates=0.3, corruption=0.2)

    def heard_after(first_z_m: float) -> list[tuple[float, Delivery]]:
        the_sea = sea(model)
        the_sea.channel.locate('auv_1', HERE, first_z_m)
        the_sea.run(20, ('auv_1', 'uav'))
        the_sea.channel.locate('auv_1', HERE, 0.0)
        the_sea.tick_on(10)
        the_sea.heard.clear()
        the_sea.run(100, ('auv_1', 'uav'))
        return the_sea.heard

    assert heard_after(-5.0) == heard_after(0.0)


def test_another_seed_and_another_direction_have_another_outcome() -> None:
    def lost(seed: int, src: str, dst: str) -> list[float]:
        the_sea = sea(LinkModel(loss=0.5), seed=seed)
        the_sea.run(50, (src, dst))
        return [now_s for now_s, _ in the_sea.heard]

    outcomes = [lost(0, 'auv_1', 'uav'), lost(1, 'auv_1', 'uav'), lost(0, 'uav', 'auv_1')]
    assert all(a != b for a, b in itertools.combinations(outcomes, 2))


# --- time ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('latency_s', 'tick_s', 'ticks'),
    [(0.0, 1.0, 0), (0.001, 1.0, 1), (1.0, 1.0, 1), (1.001, 1.0, 2), (0.3, 0.1, 3), (0.9, 0.3, 3)],
)
def test_a_frame_is_heard_at_the_first_tick_not_before_its_time(
    latency_s: float, tick_s: float, ticks: int
) -> None:
    the_sea = sea(LinkModel(latency_s=latency_s, corruption=1e-9), tick_s=tick_s)
    the_sea.tick = 7
    said = the_sea.say('auv_1', 'uav')
    the_sea.round()
    the_sea.tick_on(10)
    assert the_sea.heard == [(pytest.approx((7 + ticks) * tick_s), Delivery('uav', said, True))]


def test_jitter_is_even_up_to_its_bound_and_makes_frames_overtake() -> None:
    the_sea = sea(LinkModel(jitter_s=4.0))
    the_sea.run(2000, ('auv_1', 'uav'))
    the_sea.tick_on(5)
    late_s = [now_s - the_sea.said[each.payload][2] for now_s, each in the_sea.heard]
    counts = Counter(late_s)
    assert set(counts) == {1.0, 2.0, 3.0, 4.0}
    for count in counts.values():
        assert_share(count, 2000, 0.25)
    numbers = [list(the_sea.said).index(each.payload) for _, each in the_sea.heard[:200]]
    assert numbers != sorted(numbers)


def test_what_is_due_in_one_tick_is_heard_in_order_of_time_even_across_stations() -> None:
    the_sea = sea(
        LinkModel(),
        link('c3', 'uav', latency_s=0.8),
        link('auv_1', 'uav', latency_s=0.2),
        link('auv_2', 'uav', latency_s=0.2),
    )
    late = the_sea.say('auv_2', 'uav'), the_sea.say('auv_1', 'uav'), the_sea.say('c3', 'uav')
    at_once = the_sea.say('uav', 'c3')
    assert [each.payload for each in the_sea.round()] == [at_once]
    the_sea.tick += 1
    now = the_sea.say('uav', 'auv_1')
    expected = [late[1], late[0], late[2], now]  # stations in their order where times are the same
    assert [each.payload for each in the_sea.round()] == expected
    assert the_sea.round() == []


def test_who_has_dived_meanwhile_is_not_reached_but_is_still_heard() -> None:
    the_sea = sea(LinkModel(latency_s=0.5))
    the_sea.say('uav', 'auv_1')
    acknowledgement = the_sea.say('auv_1', 'uav')
    assert the_sea.round() == []
    the_sea.tick += 1
    the_sea.channel.locate('auv_1', HERE, -5.0)
    assert [each.payload for each in the_sea.round()] == [acknowledgement]
    assert the_sea.blocked() == {'submerged': 1}


@pytest.mark.parametrize(
    ('east_m', 'z_m', 'reason'), [(21.0, 0.0, 'range'), (0.0, -5.0, 'submerged')]
)
@pytest.mark.parametrize('speaker', ['uav', 'auv_1'])
def test_contact_may_end_in_the_middle_of_a_frame(
    speaker: str, east_m: float, z_m: float, reason: str
) -> None:
    receiver = 'auv_1' if speaker == 'uav' else 'uav'
    the_sea = sea(LinkModel(bytes_per_s=FRAME_BYTES / 2.5))
    the_sea.say(speaker, receiver)
    the_sea.round()
    the_sea.tick_on(1)
    the_sea.channel.locate('auv_1', Point(east_m=east_m, north_m=0.0), z_m)
    the_sea.tick_on(1)
    the_sea.channel.locate('auv_1', HERE, 0.0)
    the_sea.tick_on(5)
    assert the_sea.heard == []
    assert the_sea.blocked() == {reason: 1}


def test_a_frame_that_waits_needs_its_speaker_at_the_surface_when_it_begins() -> None:
    the_sea = sea(LinkModel(bytes_per_s=FRAME_BYTES / 1.5))
    frames = [the_sea.say('auv_1', 'uav') for _ in range(3)]
    the_sea.round()  # on the air from 0 to 1.5 s, 1.5 to 3 s, 3 to 4.5 s
    the_sea.tick_on(1)
    the_sea.tick_on(1)
    the_sea.channel.locate('auv_1', HERE, -5.0)
    the_sea.tick_on(5)
    assert [each.payload for _, each in the_sea.heard] == frames[:2]
    assert the_sea.blocked() == {'submerged': 1}


def test_whose_radio_dies_is_not_heard_any_more() -> None:
    outage = RadioOutage(station='auv_1', from_s=2.0, until_s=4.0)
    model = ChannelModel(
        range_m=RANGE_M, max_message_bytes=4096, link=LinkModel(latency_s=0.5), outages=(outage,)
    )
    the_sea = Sea(model)
    the_sea.run(6, ('auv_1', 'uav'), ('uav', 'auv_1'))
    the_sea.tick_on(1)
    heard_s = {name: [s for s, d in the_sea.heard if d.receiver == name] for name in STATIONS}
    assert heard_s['uav'] == [1.0, 2.0, 5.0, 6.0]  # said at 0, 1, 4, 5 s
    assert heard_s['auv_1'] == [1.0, 5.0, 6.0]  # that of 1 s would be heard at 2 s
    assert the_sea.blocked() == {'loss': 5}


# --- bandwidth -----------------------------------------------------------------------------------


@given(
    st.floats(20.0, 2000.0),
    st.lists(st.integers(0, 4), max_size=20),
    st.sampled_from([1, 4, 100]),
    st.sampled_from([0.5, 1.0]),
)
def test_no_radio_sends_more_than_its_bandwidth_over_any_time(
    bytes_per_s: float, frames_per_tick: list[int], queue: int, tick_s: float
) -> None:
    the_sea = sea(LinkModel(bytes_per_s=bytes_per_s), queue=queue, tick_s=tick_s)
    for number in frames_per_tick:
        the_sea.tick_on(1)
        the_sea.run(1, *([('uav', 'c3'), ('uav', 'auv_1')] * 2)[:number])
    the_sea.tick_on(math.ceil(the_sea.channel.under_way * 200 / bytes_per_s / tick_s) + 1)
    assert the_sea.channel.under_way == 0
    times = [(now_s, len(each.payload)) for now_s, each in the_sea.heard]
    for first in range(len(times)):
        total = 0
        for now_s, size in times[first:]:
            # All of these were sent after the tick before the first of them was heard, but for
            # the part of the first that was sent before.
            total += size
            window_s = now_s - times[first][0] + tick_s
            assert total <= window_s * bytes_per_s + times[first][1] + 1e-6


def test_a_frame_takes_the_time_of_its_bytes_and_the_next_waits_for_it() -> None:
    the_sea = sea(LinkModel(bytes_per_s=FRAME_BYTES / 2.0, latency_s=0.5))
    for _ in range(3):
        the_sea.say('auv_1', 'uav')
    the_sea.say('uav', 'c3')  # a radio of its own
    the_sea.round()
    the_sea.tick_on(10)
    assert [now_s for now_s, each in the_sea.heard if each.receiver == 'uav'] == [3.0, 5.0, 7.0]
    (c3_s,) = [now_s for now_s, each in the_sea.heard if each.receiver == 'c3']
    assert c3_s == 3.0


def test_links_of_one_radio_may_have_speeds_of_their_own_and_share_its_time() -> None:
    the_sea = sea(LinkModel(), link('uav', 'auv_1', bytes_per_s=FRAME_BYTES / 2.5))
    slow, fast = the_sea.say('uav', 'auv_1'), the_sea.say('uav', 'c3')
    the_sea.round()
    the_sea.tick_on(5)
    assert the_sea.heard == [
        (3.0, Delivery('auv_1', slow, True)),
        (3.0, Delivery('c3', fast, True)),
    ]


@pytest.mark.parametrize('queue', [1, 2, 5])
def test_what_does_not_fit_the_queue_is_blocked(queue: int) -> None:
    the_sea = sea(LinkModel(bytes_per_s=FRAME_BYTES / 1.0), queue=queue)
    frames = [the_sea.say('auv_1', 'uav') for _ in range(9)]
    the_sea.round()
    assert the_sea.blocked() == {'bandwidth': 8 - queue}  # one is on the air at once
    the_sea.tick_on(20)
    assert [each.payload for _, each in the_sea.heard] == frames[: 1 + queue]
    the_sea.say('auv_1', 'uav')
    the_sea.tick_on(2)
    assert the_sea.channel.status().delivered == queue + 2


# --- copies --------------------------------------------------------------------------------------


def test_the_share_that_comes_twice_is_the_one_asked_for() -> None:
    the_sea = sea(LinkModel(duplicates=0.3))
    the_sea.run(2000, ('auv_1', 'uav'))
    times_heard = Counter(each.payload for _, each in the_sea.heard)
    assert set(times_heard.values()) == {1, 2}
    status = the_sea.channel.status()
    assert status.duplicated == sum(count == 2 for count in times_heard.values())
    assert status.delivered == 2000 + status.duplicated
    assert_share(status.duplicated, 2000, 0.3)


def test_copies_come_at_times_of_their_own() -> None:
    the_sea = sea(LinkModel(duplicates=1.0, jitter_s=10.0))
    said = the_sea.say('auv_1', 'uav')
    the_sea.round()
    the_sea.tick_on(11)
    (first_s, first), (second_s, second) = the_sea.heard
    assert first.payload == second.payload == said
    assert first_s < second_s


def test_corruption_changes_one_byte_of_the_share_asked_for() -> None:
    the_sea = sea(LinkModel(corruption=0.3, duplicates=0.5))
    the_sea.run(2000, ('auv_1', 'uav'))
    status = the_sea.channel.status()
    assert_share(status.corrupted, status.delivered, 0.3)
    places, values = Counter[int](), Counter[int]()
    said = list(the_sea.said)
    for now_s, delivery in the_sea.heard:
        original = said[round(now_s)]
        different = [
            place
            for place, (a, b) in enumerate(zip(original, delivery.payload, strict=True))
            if a != b
        ]
        assert len(different) == (not delivery.is_intact)
        places.update(different)
        values.update(delivery.payload[place] for place in different)
    assert min(places) < 10
    assert max(places) > FRAME_BYTES - 10
    assert len(places) > FRAME_BYTES / 2
    assert len(values) > 200


def test_every_reason_that_a_radio_can_have_is_counted() -> None:
    the_sea = sea(LinkModel(loss=0.5, bytes_per_s=FRAME_BYTES / 1.0), queue=1)
    the_sea.run(40, *[('auv_1', 'uav')] * 3, ('uav', 'c3'))
    the_sea.channel.locate('auv_1', HERE, -5.0)
    the_sea.channel.locate('uav', Point(east_m=50.0, north_m=0.0), 0.0)
    the_sea.run(5, ('auv_1', 'uav'), ('uav', 'c3'))
    the_sea.tick_on(5)
    reasons = {BlockReason.LOSS, BlockReason.BANDWIDTH, BlockReason.SUBMERGED, BlockReason.RANGE}
    assert set(the_sea.blocked()) == {reason.value for reason in reasons}


def test_an_ideal_link_beside_one_that_is_not_is_ideal() -> None:
    some = sea(LinkModel(), link('uav', 'c3', loss=0.5))
    none = Sea(replace(some.model, links=()))
    others = [pair for pair in PAIRS if pair != ('uav', 'c3')]
    for each in (some, none):
        each.run(20, *others)
    assert some.heard == none.heard
    assert len(some.heard) == 20 * len(others)
