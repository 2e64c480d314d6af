"""
Attempts to cheat the radio, in a mission that must go on as if nobody had tried.

What a vehicle says reaches another only through the channel model, which knows who speaks and
where everybody truly is. Each attempt is blocked and counted under its reason; what physics lets
through is refused by the agent that hears it. All of this without a key: what is signed is looked
at last.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import msgspec
import pytest

from auv_sim.kernel import run_mission
from auv_sim.world_params import make_world
from c3_station.in_process import make_agents
from c3_station.node_params import mission_params
from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, Sortie, Uav
from msgs_json import codec
from msgs_json.agent import Agent, Output, Transmit
from msgs_json.agent_shell import AgentSetting, AgentShell, Frame
from msgs_json.authentication import Authenticator
from msgs_json.geometry import GridSpec, Point
from msgs_json.key_file import new_key
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Event,
    Leg,
    LegOutcome,
    Message,
    MessageRefused,
    MissionCompleted,
    PathAssignment,
    RadioStatus,
    RecoveryOrder,
    RecoveryReason,
    SortieReport,
    SurfacingReport,
)
from msgs_json.ros_messages import Odometry, Text
from msgs_json.store import MemoryStore
from msgs_json.topics import MISSION_EVENTS, ODOM, RADIO_STATUS, RADIO_TX

MALLORY = 'mallory'
"""A vehicle with a radio that belongs to no mission; for the channel it is one more AUV."""

C3 = Point(east_m=20.0, north_m=-10.0)
FAR_AWAY = Point(east_m=20.0, north_m=-30.1)  # out of the UAV's 20 m when it is at home
AT_HOME_S = 4  # a tick at which the UAV still waits at C3

PARAMS = mission_params(
    Scenario(
        name='bay',
        description='two AUVs, sixteen cells',
        region=GridSpec(cols=4, rows=4, cell_m=10.0),
        c3=C3,
        uav=Uav(speed_mps=4.0),
        auvs=(
            Auv(name='auv_1', initial_path=((0, 0), (1, 0))),
            Auv(name='auv_2', initial_path=((3, 3), (2, 3))),
        ),
        radio=Radio(range_m=20.0),
        sortie=Sortie(limit_s=60.0),
        planner=PlannerChoice(name='ecc2009', path_cells=3),
        max_mission_s=1000.0,
    )
)


@dataclass(frozen=True, slots=True)
class Mission:
    """What a mission was, without the radio's noise."""

    log: list[tuple[float, str, Event]] = field(default_factory=list)
    refused: list[tuple[str, MessageRefused]] = field(default_factory=list)
    radio: dict[str, int] = field(default_factory=dict)
    """The channel's counters: delivered, and blocked by reason."""


Shells = dict[str, AgentShell]


def fly(
    meddle: Callable[[Shells], None] = lambda _: None, authenticator: Authenticator | None = None
) -> Mission:
    """Fly the mission with Mallory in the water, silent unless `meddle` says more."""

    def setting(_: str) -> AgentSetting:
        return AgentSetting(store=MemoryStore(), authenticator=authenticator)

    shells = make_agents(PARAMS, setting) | {MALLORY: Mallory()}
    meddle(shells)
    mission = Mission()

    def note(_: str, frame: Frame) -> None:
        if frame.topic not in (MISSION_EVENTS, RADIO_STATUS):
            return
        assert isinstance(frame.message, Text)
        envelope, body = codec.decode(frame.message.data)
        match body:
            case MessageRefused():
                mission.refused.append((envelope.src, body))
            case Event():
                mission.log.append((envelope.stamp, envelope.src, body))
            case RadioStatus():
                mission.radio.update(body.blocked | {'delivered': body.delivered})

    stations = msgspec.structs.replace(PARAMS.world, auvs=(*PARAMS.world.auvs, MALLORY))
    run_mission(make_world(stations, authenticator), shells, note)
    return mission


@functools.cache
def honest() -> Mission:
    mission = fly()
    assert isinstance(mission.log[-1][2], MissionCompleted)
    assert mission.refused == []
    return mission


def assert_unchanged(mission: Mission) -> None:
    assert mission.log == honest().log


def counted(mission: Mission) -> Counter[str]:
    """Return what the channel counted more than in the honest mission."""
    return Counter(mission.radio) - Counter(honest().radio)


# --- Mallory, who speaks raw bytes ---------------------------------------------------------------


class Mallory(AgentShell):
    """
    A radio in strange hands: says any bytes, from anywhere.

    It has a seat in the kernel like an agent's, so all it can do is publish on its own topics.
    """

    is_busy = False

    def __init__(self, position: Point = C3, z_m: float = 0.0) -> None:
        self._odometry = Odometry(
            stamp_s=0.0,
            child_frame_id='mallory/base_link',
            position=position,
            z_m=z_m,
            heading_rad=0.0,
            speed_mps=0.0,
        )
        self.said: dict[int, list[bytes]] = {}
        """By tick."""
        self.heard: list[bytes] = []

    def tick(self, now_s: float) -> list[Frame]:
        speech = [Frame(RADIO_TX, Text(payload)) for payload in self.said.get(int(now_s), [])]
        return [Frame(ODOM, self._odometry), *speech]

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        self.heard.append(data)
        return []


def sent(body: Message, *, src: str, dst: str, seq: int = 0) -> bytes:
    return codec.encode(body, src=src, dst=dst, seq=seq, stamp_s=1.0)


TRAP = PathAssignment(
    auv='auv_1',
    leg=Leg(leg_id=1, path=((1, 0), (1, 1)), surface_deadline_s=1e6),
)
LIE = SurfacingReport(
    auv='auv_1',
    leg_id=0,
    outcome=LegOutcome.COMPLETED,
    moves_done=1,
    cell=(1, 0),
    position=Point(east_m=15.0, north_m=5.0),
    surfaced_s=10.0,
    samples_taken=0,
    samples=(),
)
EMPTY_REPORT = SortieReport(
    sortie=1,
    departed_s=0.0,
    returned_s=1.0,
    meetings=(),
    missed=(),
    not_reached=(),
    lost=('auv_1', 'auv_2'),
    cargo=(),
    next_sortie=None,
)
"""If C3 believed it, the mission would be over."""
MY_REPORT = sent(LIE, src=MALLORY, dst='uav')


@pytest.mark.parametrize(
    ('payloads', 'where', 'z_m', 'reasons'),
    [
        # In the name of others.
        ([sent(TRAP, src='uav', dst='auv_1')], C3, 0.0, {'unknown_sender': 1}),
        ([sent(LIE, src='auv_1', dst='uav')], C3, 0.0, {'unknown_sender': 1}),
        ([sent(EMPTY_REPORT, src='uav', dst='c3')], C3, 0.0, {'unknown_sender': 1}),
        ([sent(LIE, src='nobody', dst='uav')], C3, 0.0, {'unknown_sender': 1}),
        # In its own name, to those with whom an AUV has no link.
        ([sent(TRAP, src=MALLORY, dst='auv_1')], C3, 0.0, {'unknown_sender': 1}),
        ([sent(EMPTY_REPORT, src=MALLORY, dst='c3')], C3, 0.0, {'unknown_sender': 1}),
        ([sent(LIE, src=MALLORY, dst='*')], C3, 0.0, {'unknown_sender': 1}),
        # From where nobody can hear it.
        ([MY_REPORT], C3, -0.1, {'submerged': 1}),
        ([MY_REPORT], FAR_AWAY, 0.0, {'range': 1}),
        # Not what the radio carries.
        ([MY_REPORT + b' ' * 1_100_000], C3, 0.0, {'size': 1}),
        ([b'[' * 1_100_000], C3, 0.0, {'size': 1}),
        ([b'', b'hello', b'\xff', b'{}', b'[' * 60_000], C3, 0.0, {'malformed': 5}),
        ([MY_REPORT.replace(b'"auth":null', b'"auth":7')], C3, 0.0, {'malformed': 1}),
        # Again, and from the future.
        ([MY_REPORT] * 4, FAR_AWAY, 0.0, {'range': 1, 'replay': 3}),
        ([sent(LIE, src=MALLORY, dst='uav', seq=10**9)], C3, 0.0, {'unknown_sender': 1}),
    ],
    ids=[
        *('as_the_uav', 'as_an_auv', 'as_the_uav_to_c3', 'as_nobody'),
        *('to_an_auv', 'to_c3', 'to_everyone'),
        *('under_water', 'out_of_range'),
        *('too_long', 'too_long_noise', 'noise', 'other_envelope'),
        *('replay', 'from_the_future'),
    ],
)
def test_nothing_gets_through_and_each_attempt_counts_under_its_reason(
    payloads: list[bytes], where: Point, z_m: float, reasons: dict[str, int]
) -> None:
    mallory = Mallory(where, z_m)
    mallory.said[AT_HOME_S] = payloads
    mission = fly(lambda shells: shells.update({MALLORY: mallory}))
    assert_unchanged(mission)
    assert counted(mission) == reasons
    assert mission.refused == []
    assert mallory.heard == []


def test_what_physics_lets_through_is_refused_by_who_hears_it() -> None:
    mallory = Mallory(C3)
    mallory.said[AT_HOME_S] = [
        sent(body, src=MALLORY, dst='uav', seq=seq)
        for seq, body in enumerate((LIE, TRAP, EMPTY_REPORT, LIE))
    ]
    mission = fly(lambda shells: shells.update({MALLORY: mallory}))
    assert_unchanged(mission)
    assert counted(mission) == {'delivered': 4}
    ((node, event),) = mission.refused  # once per sender and reason
    assert (node, event.sender, event.reason) == ('uav', MALLORY, 'unknown_sender')


def test_an_eavesdropper_hears_nothing_and_cannot_replay_what_others_said() -> None:
    said_by_auv_1 = sent(LIE, src='auv_1', dst='uav', seq=0)  # what it will say first, bit by bit
    mallory = Mallory(C3)
    mallory.said = {tick: [said_by_auv_1] for tick in range(0, 50, 5)}
    mission = fly(lambda shells: shells.update({MALLORY: mallory}))
    assert_unchanged(mission)
    assert counted(mission) == {'unknown_sender': 10}
    assert mallory.heard == []


# --- members of the mission that lie -------------------------------------------------------------


def make_lie(agent: Agent, lie: Transmit) -> None:
    """Let a member of the mission also say what it should not, at every tick."""
    honest_tick = agent.tick

    def tick(now_s: float) -> list[Output]:
        return [lie, *honest_tick(now_s)]

    agent.tick = tick  # type: ignore[method-assign]


def acknowledged(what: Acknowledged, reference: int) -> Acknowledgement:
    return Acknowledgement(acknowledges=what, reference=reference)


@pytest.mark.parametrize(
    ('liar', 'lie', 'reason'),
    [
        ('auv_2', Transmit('uav', LIE), 'unexpected'),  # for auv_1
        (
            'auv_2',
            Transmit('uav', msgspec.structs.replace(LIE, auv='auv_2', leg_id=99)),
            'contradictory',
        ),
        ('auv_2', Transmit('uav', EMPTY_REPORT), 'unexpected'),
        ('auv_2', Transmit('uav', TRAP), 'unexpected'),
        ('auv_2', Transmit('uav', acknowledged(Acknowledged.PATH_ASSIGNMENT, 99)), None),
        ('auv_2', Transmit('uav', acknowledged(Acknowledged.SORTIE_REPORT, 1)), None),
        ('auv_2', Transmit('auv_1', TRAP), None),  # no link
        ('auv_2', Transmit('c3', EMPTY_REPORT), None),  # no link
        ('c3', Transmit('uav', LIE), 'unexpected'),
        ('c3', Transmit('uav', acknowledged(Acknowledged.PATH_ASSIGNMENT, 1)), None),
        ('uav', Transmit('c3', msgspec.structs.replace(EMPTY_REPORT, sortie=99)), 'contradictory'),
        ('uav', Transmit('c3', LIE), 'unexpected'),
        (
            'uav',
            Transmit(
                'auv_1', RecoveryOrder(auv='auv_1', leg_id=99, reason=RecoveryReason.EXPLORED)
            ),
            'unexpected',
        ),
        (
            'uav',
            Transmit(
                'auv_1',
                PathAssignment(
                    auv='auv_1',
                    leg=Leg(leg_id=99, path=((0, 0), (0, 1)), surface_deadline_s=1e6),
                ),
            ),
            'contradictory',
        ),
    ],
    ids=lambda value: value.body.__class__.__name__ if isinstance(value, Transmit) else None,
)
def test_lies_of_members_change_nothing(liar: str, lie: Transmit, reason: str | None) -> None:
    mission = fly(lambda shells: make_lie(shells[liar].agent, lie))
    assert_unchanged(mission)
    assert (reason in {event.reason for _, event in mission.refused}) == (reason is not None)
    assert {event.sender for _, event in mission.refused} == ({liar} if reason else set())


# --- a channel that were broken ------------------------------------------------------------------


class Haunted(AgentShell):
    """An agent whose radio also hears strangers, and others in the name of its peers."""

    def __init__(self, shell: AgentShell) -> None:
        self._shell = shell
        self.agent = agent = shell.agent
        peer = min(agent.peers)
        bodies = (TRAP, LIE, EMPTY_REPORT, acknowledged(Acknowledged.MISSION_ORDER, 0))
        self.ghosts = [
            payload
            for body in bodies
            for payload in (
                sent(body, src=MALLORY, dst=agent.name),
                sent(body, src=agent.name, dst=agent.name),
                sent(body, src=peer, dst=MALLORY),
                sent(body, src=peer, dst='*'),
                sent(body, src=peer, dst=agent.name)[:-40],
            )
        ]

    @property
    def is_busy(self) -> bool:
        return self._shell.is_busy

    def tick(self, now_s: float) -> list[Frame]:
        frames = self._shell.tick(now_s)
        return frames + [frame for ghost in self.ghosts for frame in self.receive(ghost, now_s)]

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        return self._shell.receive(data, now_s)

    def work(self, now_s: float) -> list[Frame]:
        return self._shell.work(now_s)


@pytest.mark.parametrize('name', ['c3', 'uav', 'auv_1'])
def test_strangers_are_not_obeyed_even_if_they_could_be_heard(name: str) -> None:
    mission = fly(lambda shells: shells.update({name: Haunted(shells[name])}))
    assert_unchanged(mission)
    assert {node for node, _ in mission.refused} == {name}
    assert {event.reason for _, event in mission.refused} == {
        *('unknown_sender', 'not_addressed', 'malformed')
    }


# --- with a key ----------------------------------------------------------------------------------


@functools.cache
def signed() -> Mission:
    """Fly the honest mission with everything signed: it is the same, but for the signatures."""
    mission = fly(authenticator=Authenticator(new_key()))
    assert_unchanged(mission)
    assert mission.radio == honest().radio
    return mission


def test_the_channel_carries_nothing_that_is_not_signed() -> None:
    mallory = Mallory(C3)
    mallory.said[AT_HOME_S] = [
        MY_REPORT,
        Authenticator(new_key()).sign(MY_REPORT),
        sent(LIE, src='auv_1', dst='uav'),
        MY_REPORT[:-1],
    ]
    mission = fly(lambda shells: shells.update({MALLORY: mallory}), Authenticator(new_key()))
    assert mission.log == signed().log
    assert Counter(mission.radio) - Counter(signed().radio) == {
        'auth': 2,
        'unknown_sender': 1,
        'malformed': 1,
    }


@pytest.mark.parametrize('name', ['c3', 'uav', 'auv_1'])
def test_strangers_without_the_key_are_told_by_their_signature(name: str) -> None:
    authenticator = Authenticator(new_key())
    mission = fly(lambda shells: shells.update({name: Haunted(shells[name])}), authenticator)
    assert mission.log == signed().log
    assert {node for node, _ in mission.refused} == {name}
    assert {event.reason for _, event in mission.refused} == {'auth'}


def test_the_mission_of_these_tests_does_depend_on_what_is_heard() -> None:
    # Else they could not fail: a true word too many, and it is another mission.
    mission = fly(lambda shells: make_lie(shells['uav'].agent, Transmit('auv_1', TRAP)))
    assert mission.log != honest().log
