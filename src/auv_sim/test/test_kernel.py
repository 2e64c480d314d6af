from __future__ import annotations

import pytest

from auv_sim.kernel import run_mission
from auv_sim.radio_model import ChannelModel, RadioOutage, StationKind
from auv_sim.world import HARD_STOP, WORLD, World, WorldSpec
from msgs_json import codec
from msgs_json.agent import Output, Publish, Transmit
from msgs_json.agent_shell import AgentSetting, AgentShell, Frame
from msgs_json.geometry import Point
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Message,
    MissionStopped,
    RadioStatus,
)
from msgs_json.ros_messages import ClockTime, Odometry, Text
from msgs_json.store import MemoryStore
from msgs_json.topics import CLOCK, MISSION_EVENTS, ODOM, RADIO_RX, RADIO_STATUS, RADIO_TX

ORIGIN = Point(east_m=0.0, north_m=0.0)


def word(number: int) -> Acknowledgement:
    return Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=number)


class Speaker:
    """Lies at a place, says what it is told to at each tick, answers a number with the next."""

    def __init__(
        self,
        name: str,
        diary: list[str],
        *,
        says: dict[float, list[tuple[str, int]]] | None = None,
        answers_up_to: int = 0,
        east_m: float = 0.0,
    ) -> None:
        self.name = name
        self.peers = frozenset({'c3', 'uav', 'auv_1', 'auv_2'})
        self.finished = False
        self.east_m = east_m
        self._diary = diary
        self._says = says or {}
        self._answers_up_to = answers_up_to

    def tick(self, now_s: float) -> list[Output]:
        self._diary.append(f'{now_s:g} {self.name} ticks')
        odometry = Odometry(
            stamp_s=now_s,
            child_frame_id=self.name,
            position=Point(east_m=self.east_m, north_m=0.0),
            z_m=0.0,
            heading_rad=0.0,
            speed_mps=0.0,
        )
        said = [Transmit(dst, word(number)) for dst, number in self._says.get(now_s, [])]
        return [Publish(ODOM, odometry), *said]

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        assert isinstance(message, Acknowledgement)
        number = message.reference
        self._diary.append(f'{now_s:g} {self.name} hears {number} from {src}')
        return [Transmit(src, word(number + 1))] if number < self._answers_up_to else []


def world(
    *, max_mission_s: float = 2.0, tick_s: float = 1.0, outages: tuple[RadioOutage, ...] = ()
) -> World:
    kinds = {'c3': StationKind.C3, 'uav': StationKind.UAV}
    kinds |= {'auv_1': StationKind.AUV, 'auv_2': StationKind.AUV}
    return World(
        WorldSpec(
            stations=kinds,
            c3_position=ORIGIN,
            channel=ChannelModel(range_m=20.0, max_message_bytes=4096, outages=outages),
            tick_s=tick_s,
            max_mission_s=max_mission_s,
        )
    )


def shell(agent: Speaker) -> AgentShell:
    return AgentShell(agent, AgentSetting(store=MemoryStore(), authenticator=None))


def fly(the_world: World, *agents: Speaker) -> list[tuple[str, Frame]]:
    frames: list[tuple[str, Frame]] = []
    shells = {agent.name: shell(agent) for agent in agents}
    run_mission(the_world, shells, lambda name, frame: frames.append((name, frame)))
    return frames


def fleet(diary: list[str], **said: dict[float, list[tuple[str, int]]]) -> list[Speaker]:
    names = ('c3', 'uav', 'auv_1', 'auv_2')
    return [Speaker(name, diary, says=said.get(name), answers_up_to=3) for name in names]


def json_of(frame: Frame) -> Message:
    assert isinstance(frame.message, Text)
    return codec.decode(frame.message.data)[1]


def test_all_tick_in_order_before_anybody_hears() -> None:
    diary: list[str] = []
    fly(world(max_mission_s=1.0), *fleet(diary, auv_1={0.0: [('uav', 3)]}))
    assert diary == [
        *('0 c3 ticks', '0 uav ticks', '0 auv_1 ticks', '0 auv_2 ticks'),
        '0 uav hears 3 from auv_1',
        *('1 c3 ticks', '1 uav ticks', '1 auv_1 ticks', '1 auv_2 ticks'),
    ]


def test_a_conversation_ends_within_its_tick() -> None:
    diary: list[str] = []
    fly(world(max_mission_s=1.0), *fleet(diary, auv_1={0.0: [('uav', 0)]}))
    heard = [line for line in diary if 'hears' in line]
    assert heard == [
        '0 uav hears 0 from auv_1',
        '0 auv_1 hears 1 from uav',
        '0 uav hears 2 from auv_1',
        '0 auv_1 hears 3 from uav',
    ]


def test_each_round_is_gated_in_agent_order_not_in_order_of_answers() -> None:
    diary: list[str] = []
    said: dict[str, dict[float, list[tuple[str, int]]]] = {
        'auv_2': {0.0: [('uav', 0)]},
        'auv_1': {0.0: [('uav', 0)]},
        'c3': {0.0: [('uav', 4)]},
        'uav': {0.0: [('auv_2', 2), ('c3', 2)]},
    }
    fly(world(max_mission_s=1.0), *fleet(diary, **said))
    rounds = [line.removeprefix('0 ') for line in diary if 'hears' in line]
    assert rounds == [
        # What was said at the tick: c3's first, then uav's as spoken, auv_1's, auv_2's.
        *('uav hears 4 from c3', 'auv_2 hears 2 from uav', 'c3 hears 2 from uav'),
        *('uav hears 0 from auv_1', 'uav hears 0 from auv_2'),
        # The answers, in agent order again.
        *('uav hears 3 from c3', 'auv_1 hears 1 from uav', 'auv_2 hears 1 from uav'),
        'uav hears 3 from auv_2',
        *('uav hears 2 from auv_1', 'uav hears 2 from auv_2'),
        *('auv_1 hears 3 from uav', 'auv_2 hears 3 from uav'),
    ]


def test_the_order_of_the_mapping_does_not_matter() -> None:
    said = {'auv_1': {0.0: [('uav', 0)]}, 'auv_2': {0.0: [('uav', 0)]}}
    diaries: list[list[str]] = [[], []]
    fly(world(), *fleet(diaries[0], **said))
    fly(world(), *reversed(fleet(diaries[1], **said)))
    assert diaries[0] == diaries[1]


def test_true_positions_are_those_of_the_tick() -> None:
    diary: list[str] = []
    agents = fleet(diary, auv_1={0.0: [('uav', 3)], 1.0: [('uav', 3)]})
    far_away = agents[2]
    far_away.east_m = 21.0
    ticked = far_away.tick

    def approach(now_s: float) -> list[Output]:
        far_away.east_m = 20.0 if now_s >= 1.0 else 21.0
        return ticked(now_s)

    far_away.tick = approach  # type: ignore[method-assign]
    fly(world(max_mission_s=1.0), *agents)
    assert [line for line in diary if 'hears' in line] == ['1 uav hears 3 from auv_1']


def test_a_silent_station_is_not_heard_until_its_radio_works_again() -> None:
    diary: list[str] = []
    outage = RadioOutage(station='auv_1', from_s=2.0, until_s=4.0)
    ticks = [float(number) for number in range(6)]
    said = {
        'auv_1': {tick: [('uav', 9)] for tick in ticks},
        'auv_2': {tick: [('uav', 8)] for tick in ticks},
        'uav': {tick: [('auv_1', 7)] for tick in ticks},
    }
    frames = fly(world(max_mission_s=5.0, outages=(outage,)), *fleet(diary, **said))
    heard = [line for line in diary if 'hears' in line]
    assert [line[0] for line in heard if 'from auv_1' in line] == ['0', '1', '4', '5']
    assert [line[0] for line in heard if 'auv_1 hears' in line] == ['0', '1', '4', '5']
    assert [line[0] for line in heard if 'from auv_2' in line] == list('012345')
    status = json_of(frames[-1][1])
    assert isinstance(status, RadioStatus)
    assert (status.delivered, status.blocked['loss']) == (14, 4)


def test_everything_is_shown_in_the_namespace_of_its_agent() -> None:
    frames = fly(world(max_mission_s=1.0), *fleet([], auv_1={0.0: [('uav', 3)]}))
    shown = [(name, frame.topic) for name, frame in frames]
    assert shown[:7] == [
        (WORLD, CLOCK),
        *(('c3', ODOM), ('uav', ODOM), ('auv_1', ODOM), ('auv_1', RADIO_TX), ('auv_2', ODOM)),
        ('uav', RADIO_RX),
    ]
    said, heard = (frame.message for _, frame in frames if frame.topic in (RADIO_TX, RADIO_RX))
    assert said == heard


@pytest.mark.parametrize(
    ('tick_s', 'max_mission_s', 'ticks'), [(1.0, 3.0, 4), (0.1, 0.3, 4), (2.0, 3.0, 2)]
)
def test_it_stops_at_the_hard_stop_and_says_so(
    tick_s: float, max_mission_s: float, ticks: int
) -> None:
    frames = fly(world(tick_s=tick_s, max_mission_s=max_mission_s), *fleet([]))
    times = [frame.message.time_s for _, frame in frames if isinstance(frame.message, ClockTime)]
    assert times == pytest.approx([number * tick_s for number in range(ticks)])
    (stopped,) = [json_of(frame) for _, frame in frames if frame.topic is MISSION_EVENTS]
    assert stopped == MissionStopped(reason=HARD_STOP, node=None)


def test_it_stops_when_c3_says_so_after_the_tick_is_over() -> None:
    diary: list[str] = []
    agents = fleet(diary, auv_1={0.0: [('uav', 0)]})
    agents[0].finished = True
    frames = fly(world(max_mission_s=100.0), *agents)
    assert [line for line in diary if line.startswith('1 ')] == []
    assert diary[-1] == '0 auv_1 hears 3 from uav'
    assert all(frame.topic is not MISSION_EVENTS for _, frame in frames)


def test_the_counters_of_the_radio_come_last() -> None:
    frames = fly(world(), *fleet([], auv_1={0.0: [('uav', 3), ('auv_2', 0)]}))
    name, frame = frames[-1]
    assert (name, frame.topic) == (WORLD, RADIO_STATUS)
    status = json_of(frame)
    assert isinstance(status, RadioStatus)
    assert status.delivered == 1
    assert status.blocked['unknown_sender'] == 1


def test_time_is_counted_in_ticks_and_not_added_up() -> None:
    the_world = world(tick_s=0.1)
    the_world.tick = 3
    assert the_world.now_s == 3 * 0.1
    assert [frame.message for frame in (the_world.clock(),)] == [ClockTime(time_s=3 * 0.1)]
