from __future__ import annotations

from typing import TYPE_CHECKING

import hypothesis.strategies as st
import pytest
from hypothesis import given

from msgs_json import codec
from msgs_json.agent import Agent, Log, Output, Publish, Refuse, Transmit
from msgs_json.agent_shell import AgentSetting, AgentShell, Frame, Speaker, recalled
from msgs_json.authentication import Authenticator
from msgs_json.codec import Refusal
from msgs_json.drivers import VehicleUnavailableError
from msgs_json.geometry import Point
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Directive,
    Event,
    Hello,
    Leg,
    Message,
    MessageRefused,
    Missed,
    MissionState,
    MissionStatus,
    NodeKind,
    PathAssignment,
    Pause,
    StorageFailed,
    StorageRestored,
)
from msgs_json.replay_window import WINDOW
from msgs_json.ros_messages import Odometry, Text
from msgs_json.store import MemoryStore, StoreError
from msgs_json.topics import MISSION_EVENTS, MISSION_STATUS, ODOM, RADIO_TX

if TYPE_CHECKING:
    from collections.abc import Mapping

    from msgs_json.store import Store
    from msgs_json.topics import Topic

KEY = Authenticator(b'the key of this mission, and of no other')
ACKNOWLEDGEMENT = Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=0)
ODOMETRY = Odometry(
    stamp_s=3.0,
    child_frame_id='auv_1/base_link',
    position=Point(east_m=1.0, north_m=2.0),
    z_m=0.0,
    heading_rad=0.0,
    speed_mps=0.0,
)
STATUS = MissionStatus(
    mission_id='m',
    state=MissionState.STARTING,
    sorties=0,
    cells_total=1,
    cells_delivered=0,
    samples_delivered=0,
    directive=Directive(
        revision=0, paused=False, aborted=False, recalled=(), sortie_limit_s=60.0, masked=()
    ),
    directive_taken=0,
    auvs=(),
)


class ScriptedAgent:
    """Says what it is told to, and remembers what it hears."""

    name = 'auv_1'
    peers = frozenset({'uav'})
    finished = False

    def __init__(self, *says: Output) -> None:
        self.says = list(says)
        self.heard: list[tuple[str, Message, float]] = []

    def tick(self, now_s: float) -> list[Output]:
        return self.says

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        self.heard.append((src, message, now_s))
        return self.says


class HardWorker(ScriptedAgent):
    """Has work to do once it was ticked, and says as much in every slice."""

    is_busy = False

    def __init__(self, *says: Output, slices: int) -> None:
        super().__init__(*says)
        self.slices = slices

    def tick(self, now_s: float) -> list[Output]:
        self.is_busy = True
        return super().tick(now_s)

    def work(self, now_s: float) -> list[Output]:
        self.slices -= 1
        self.is_busy = self.slices > 0
        return self.says


def shell_of(
    agent: Agent, key: Authenticator | None = None, store: Store | None = None
) -> AgentShell:
    store = MemoryStore() if store is None else store
    return AgentShell(agent, AgentSetting(store=store, authenticator=key))


def sent(
    body: Message = ACKNOWLEDGEMENT, *, src: str = 'uav', dst: str = 'auv_1', seq: int = 0
) -> bytes:
    return codec.encode(body, src=src, dst=dst, seq=seq, stamp_s=3.0)


def opened(frame: Frame) -> tuple[Topic, codec.Envelope, Message]:
    assert isinstance(frame.message, Text)
    return (frame.topic, *codec.decode(frame.message.data))


# --- outwards ------------------------------------------------------------------------------------


def test_speech_is_addressed_and_goes_to_the_radio() -> None:
    (frame,) = shell_of(ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))).tick(3.0)
    topic, envelope, body = opened(frame)
    assert topic is RADIO_TX
    assert (envelope.src, envelope.dst, envelope.stamp) == ('auv_1', 'uav', 3.0)
    assert body == ACKNOWLEDGEMENT


def test_ros_messages_are_published_as_they_are() -> None:
    assert shell_of(ScriptedAgent(Publish(ODOM, ODOMETRY))).tick(3.0) == [Frame(ODOM, ODOMETRY)]


def test_json_is_published_in_an_envelope_to_everyone() -> None:
    (frame,) = shell_of(ScriptedAgent(Publish(MISSION_STATUS, STATUS))).tick(3.0)
    topic, envelope, body = opened(frame)
    assert topic is MISSION_STATUS
    assert (envelope.schema, envelope.dst, body) == ('MissionStatus', '*', STATUS)


def test_an_event_is_stamped_with_when_it_happened() -> None:
    event = Missed(sortie=1, auv='auv_2')
    (frame,) = shell_of(ScriptedAgent(Log(event, 2.0))).tick(3.0)
    topic, envelope, body = opened(frame)
    assert topic is MISSION_EVENTS
    assert (envelope.schema, envelope.stamp, body) == ('MissionEvent', 2.0, event)


def test_frames_keep_the_order_of_what_was_said_and_are_counted_per_topic() -> None:
    event = Log(Missed(sortie=1, auv='auv_2'), 2.0)
    speech = Transmit('uav', ACKNOWLEDGEMENT)
    shell = shell_of(ScriptedAgent(speech, event, speech))
    frames = [*shell.tick(3.0), *shell.tick(4.0)]
    assert [frame.topic for frame in frames] == [*(RADIO_TX, MISSION_EVENTS, RADIO_TX)] * 2
    assert [opened(frame)[1].seq for frame in frames] == [0, 0, 1, 2, 1, 3]


def test_what_is_said_in_slices_of_work_is_counted_on() -> None:
    shell = shell_of(HardWorker(Transmit('uav', ACKNOWLEDGEMENT), slices=2))
    assert not shell.is_busy
    frames = shell.tick(3.0)
    while shell.is_busy:
        frames += shell.work(3.0)
    assert [opened(frame)[1].seq for frame in frames] == [0, 1, 2]


def test_an_agent_without_such_work_is_never_busy() -> None:
    shell = shell_of(ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT)))
    shell.tick(3.0)
    assert not shell.is_busy
    assert shell.work(3.0) == []


def test_a_speaker_counts_from_zero_on_every_topic() -> None:
    speaker = Speaker('world')
    hello = Hello(kind=NodeKind.AGENT, life=1)
    numbers = [
        opened(speaker.frame(topic, hello, 0.0))[1].seq for topic in (ODOM, RADIO_TX, ODOM, ODOM)
    ]
    assert numbers == [0, 0, 1, 2]


class CountingAuthenticator(Authenticator):
    """Notes how long is what it signs."""

    def __init__(self, key: bytes) -> None:
        super().__init__(key)
        self.signed_bytes: list[int] = []

    def sign(self, payload: bytes) -> bytes:
        signed = super().sign(payload)
        self.signed_bytes.append(len(signed))
        return signed


LONG_PATH = tuple((col, 0) for col in range(100))
LONG = PathAssignment(auv='auv_1', leg=Leg(leg_id=1, path=LONG_PATH, surface_deadline_s=60.0))


def frames_of_long(frame_bytes: int, key: Authenticator | None) -> list[tuple[int, str]]:
    """Return lengths and schemas of the frames in which a long message is said."""
    setting = AgentSetting(store=MemoryStore(), authenticator=key)
    shell = AgentShell(ScriptedAgent(Transmit('uav', LONG)), setting, frame_bytes=frame_bytes)
    frames = shell.tick(3.0)
    assert [opened(frame)[1].seq for frame in frames] == [*range(len(frames))]
    payloads = [frame.message.data for frame in frames if isinstance(frame.message, Text)]
    return [(len(payload), codec.open_envelope(payload).schema) for payload in payloads]


@pytest.mark.parametrize('is_signed', [True, False], ids=['signed', 'unsigned'])
def test_a_message_is_cut_up_where_its_frame_would_be_longer_than_allowed(
    is_signed: bool,
) -> None:
    key = CountingAuthenticator(b'k' * 32) if is_signed else None
    ((whole_bytes, schema),) = frames_of_long(4096, key)
    assert schema == 'PathAssignment'
    assert frames_of_long(whole_bytes, key) == [(whole_bytes, 'PathAssignment')]
    fragments = frames_of_long(whole_bytes - 1, key)
    assert [schema for _, schema in fragments] == ['Fragment'] * 2
    if key is not None:  # nothing is signed that is not said
        assert key.signed_bytes == [whole_bytes] * 2 + [each_bytes for each_bytes, _ in fragments]


# --- inwards -------------------------------------------------------------------------------------


def test_a_peer_is_heard() -> None:
    agent = ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))
    (frame,) = shell_of(agent).receive(sent(), 3.0)
    assert agent.heard == [('uav', ACKNOWLEDGEMENT, 3.0)]
    assert frame.topic is RADIO_TX


def refusal(frames: list[Frame]) -> MessageRefused:
    (frame,) = frames
    topic, _, body = opened(frame)
    assert topic is MISSION_EVENTS
    assert isinstance(body, MessageRefused)
    return body


@pytest.mark.parametrize(
    ('data', 'sender', 'reason', 'path'),
    [
        (b'hello?', '?', Refusal.MALFORMED, '`$`'),
        (sent(src='auv_2'), 'auv_2', Refusal.UNKNOWN_SENDER, '`$.src`'),
        (sent(src='auv_1'), 'auv_1', Refusal.UNKNOWN_SENDER, '`$.src`'),
        (sent(dst='auv_2'), 'uav', Refusal.NOT_ADDRESSED, '`$.dst`'),
        (sent(dst='*'), 'uav', Refusal.NOT_ADDRESSED, '`$.dst`'),
        (sent(STATUS), 'uav', Refusal.UNKNOWN_SCHEMA, '`$.schema`'),
        (sent(Hello(kind=NodeKind.AGENT, life=1)), 'uav', Refusal.UNKNOWN_SCHEMA, '`$.schema`'),
        (
            sent().replace(b'"reference":0', b'"reference":-1'),
            'uav',
            Refusal.MALFORMED,
            '`$.body.reference`',
        ),
        (
            sent().replace(b'"version":1', b'"version":9'),
            'uav',
            Refusal.UNKNOWN_SCHEMA,
            '`$.version`',
        ),
    ],
    ids=[
        *('no_json', 'stranger', 'itself', 'for_another', 'for_everyone'),
        *('not_by_radio', 'lockstep', 'bad_body', 'other_version'),
    ],
)
def test_what_may_not_be_heard_is_counted_and_logged_once(
    data: bytes, sender: str, reason: Refusal, path: str
) -> None:
    agent = ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))
    shell = shell_of(agent)
    event = refusal(shell.receive(data, 3.0))
    assert (event.sender, event.reason) == (sender, reason.value)
    assert path in event.detail
    assert shell.receive(data, 4.0) == []
    assert shell.refused == {(sender, reason): 2}
    assert agent.heard == []


def test_each_sender_and_each_reason_is_logged() -> None:
    shell = shell_of(ScriptedAgent())
    for data in (b'', sent(src='auv_2'), sent(src='auv_3'), sent(dst='auv_2'), b'[]', b'{}'):
        shell.receive(data, 3.0)
    assert shell.refused == {
        ('?', Refusal.MALFORMED): 3,
        ('auv_2', Refusal.UNKNOWN_SENDER): 1,
        ('auv_3', Refusal.UNKNOWN_SENDER): 1,
        ('uav', Refusal.NOT_ADDRESSED): 1,
    }


def test_what_the_agent_refuses_is_counted_the_same_way() -> None:
    refuse = Refuse('uav', Refusal.CONTRADICTORY, 'path must start at [4, 7]')
    shell = shell_of(ScriptedAgent(refuse))
    event = refusal(shell.receive(sent(), 3.0))
    assert event == MessageRefused(
        sender='uav', reason='contradictory', detail='path must start at [4, 7]'
    )
    assert shell.tick(4.0) == []  # this agent refuses whatever it is asked
    assert shell.receive(sent(), 4.0) == []
    assert shell.refused == {('uav', Refusal.CONTRADICTORY): 3}


@given(st.lists(st.binary(max_size=60), max_size=5))
def test_noise_never_reaches_the_agent(noise: list[bytes]) -> None:
    agent = ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))
    shell = shell_of(agent)
    frames = [frame for data in noise for frame in shell.receive(data, 3.0)]
    assert agent.heard == []
    assert shell.refused.total() == len(noise)
    assert len(frames) == min(1, len(noise))


def test_a_command_is_heard_where_the_operator_is_a_peer() -> None:
    agent = ScriptedAgent()
    agent.peers = frozenset({'uav', 'operator'})
    shell_of(agent, KEY).receive(KEY.sign(sent(Pause(), src='operator')), 3.0)
    assert agent.heard == [('operator', Pause(), 3.0)]


# --- no strangers --------------------------------------------------------------------------------


def signed(number: int, *, src: str = 'uav', dst: str = 'auv_1') -> bytes:
    """Return what the UAV says with this number, which is in the body as well."""
    return KEY.sign(sent(word(number), src=src, dst=dst, seq=number))


def word(number: int) -> Acknowledgement:
    return Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=number)


def numbers_heard(agent: ScriptedAgent) -> list[int]:
    return [body.reference for _, body, _ in agent.heard if isinstance(body, Acknowledgement)]


def test_what_goes_by_radio_is_signed_and_nothing_else() -> None:
    event = Log(Missed(sortie=1, auv='auv_2'), 2.0)
    speech = Transmit('uav', ACKNOWLEDGEMENT)
    agent = ScriptedAgent(speech, event, Publish(MISSION_STATUS, STATUS))
    by_radio, *others = shell_of(agent, KEY).tick(3.0)
    assert isinstance(by_radio.message, Text)
    assert KEY.check(by_radio.message.data)
    assert [opened(frame)[1].auth for frame in others] == [None, None]
    # What is signed is the same as without a key.
    (unsigned,) = shell_of(ScriptedAgent(speech)).tick(3.0)
    assert isinstance(unsigned.message, Text)
    assert by_radio.message.data == KEY.sign(unsigned.message.data)


@pytest.mark.parametrize(
    'data',
    [
        sent(),
        Authenticator(b'the key of another mission, from another day').sign(sent()),
        signed(0).replace(b'"reference":0', b'"reference":1'),
        signed(0).replace(b'"seq":0', b'"seq":1'),
        signed(0, src='c3').replace(b'"src":"c3"', b'"src":"uav"'),
        signed(0, dst='auv_2').replace(b'"dst":"auv_2"', b'"dst":"auv_1"'),
    ],
    ids=['unsigned', 'another_key', 'body', 'seq', 'src', 'dst'],
)
def test_a_forgery_is_refused_and_comes_from_nobody(data: bytes) -> None:
    agent = ScriptedAgent()
    shell = shell_of(agent, KEY)
    event = refusal(shell.receive(data, 3.0))
    assert (event.sender, event.reason) == ('?', 'auth')
    assert '`$.auth`' in event.detail
    assert shell.receive(data, 4.0) == []
    assert shell.refused == {('?', Refusal.AUTH): 2}
    assert shell.genuine_from is None
    assert agent.heard == []


def test_a_forgery_moves_no_window() -> None:
    # Else a stranger could have everything refused that the UAV says from then on.
    agent = ScriptedAgent()
    shell = shell_of(agent, KEY)
    shell.receive(sent(seq=2**53), 3.0)
    shell.receive(signed(0), 3.0)
    assert numbers_heard(agent) == [0]


def test_without_a_key_whoever_has_a_radio_is_believed() -> None:
    agent = ScriptedAgent()
    shell = shell_of(agent)
    for data in (sent(), sent(), signed(7)):
        shell.tick(3.0)
        shell.receive(data, 3.0)
    assert numbers_heard(agent) == [0, 0, 7]


@given(st.data())
def test_what_was_changed_on_the_way_is_refused(data: st.DataObject) -> None:
    payload = bytearray(signed(3))
    at = data.draw(st.integers(0, len(payload) - 1))
    payload[at] ^= data.draw(st.integers(1, 255))
    agent = ScriptedAgent()
    shell = shell_of(agent, KEY)
    shell.receive(bytes(payload), 3.0)
    assert {why for _, why in shell.refused} <= {Refusal.AUTH, Refusal.MALFORMED}
    assert shell.refused.total() == 1
    assert shell.genuine_from is None
    assert agent.heard == []


def counts(frames: list[Frame]) -> list[int]:
    """Return how often what is logged had been refused by then."""
    bodies = [opened(frame)[2] for frame in frames]
    return [body.count for body in bodies if isinstance(body, MessageRefused)]


def test_strangers_take_no_memory_whatever_they_call_themselves() -> None:
    store = MemoryStore()
    shell = shell_of(ScriptedAgent(), KEY, store)
    frames = []
    for number in range(1000):
        frames += shell.receive(sent(src=f'stranger_{number}'), 3.0)
    # Without a key a name is only a name.
    assert shell.refused == {('?', Refusal.AUTH): 1000}
    assert counts(frames) == [1, 10, 100, 1000]
    assert not store.is_changed


def test_without_a_key_some_strangers_are_told_apart_by_what_they_call_themselves() -> None:
    shell = shell_of(ScriptedAgent())
    frames = []
    for number in range(1000):
        frames += shell.receive(sent(src=f'stranger_{number}'), 3.0)
        frames += shell.receive(sent(src=f'stranger_{number}').replace(b'"body"', b'"bod"'), 3.0)
    assert shell.refused.total() == 2000
    senders = {sender for sender, _ in shell.refused}
    # 32 are told apart, and '?', who is one of them, sent nothing that could be opened.
    assert len(senders) == 33
    assert shell.refused['?', Refusal.MALFORMED] == 1000
    assert shell.refused['stranger_0', Refusal.UNKNOWN_SENDER] == 1
    assert shell.refused['(others)', Refusal.UNKNOWN_SENDER] == 1000 - 31
    # 31 strangers, all others and '?'; of these two now and then.
    assert sorted(counts(frames)) == [*[1] * 33, 10, 10, 100, 100, 1000]


def test_a_sender_who_is_told_apart_stays_so() -> None:
    shell = shell_of(ScriptedAgent())
    names = ['auv_9', *(f'stranger_{number}' for number in range(40)), 'auv_9']
    for name in names:
        shell.receive(sent(src=name), 3.0)
    assert shell.refused['auv_9', Refusal.UNKNOWN_SENDER] == 2


@pytest.mark.parametrize(
    ('data', 'who', 'who_without_key'),
    [
        (signed(0), 'uav', 'uav'),
        (signed(0, src='auv_2'), 'auv_2', 'auv_2'),
        (signed(0, dst='auv_2'), None, None),
        (sent(), None, 'uav'),
        (b'hello?', None, None),
        (KEY.sign(sent().replace(b'"reference":0', b'"reference":-1')), None, None),
    ],
    ids=['peer', 'no_peer', 'for_another', 'unsigned', 'no_json', 'bad_body'],
)
def test_genuine_is_what_somebody_with_the_key_said_to_this_agent(
    data: bytes, who: str | None, who_without_key: str | None
) -> None:
    # Whether it was taken or not: lockstep counts by it what the world has delivered.
    with_key, without = shell_of(ScriptedAgent(), KEY), shell_of(ScriptedAgent())
    with_key.receive(signed(9), 2.0)
    for shell in (with_key, without):
        shell.receive(data, 3.0)
    assert (with_key.genuine_from, without.genuine_from) == (who, who_without_key)


# --- replays -------------------------------------------------------------------------------------


def test_what_was_heard_is_not_heard_again() -> None:
    agent = ScriptedAgent()
    shell = shell_of(agent, KEY)
    assert shell.receive(signed(5), 3.0) == []
    event = refusal(shell.receive(signed(5), 3.0))
    assert (event.sender, event.reason) == ('uav', 'replay')
    assert '`$.seq` is 5' in event.detail
    assert shell.receive(signed(5), 4.0) == []
    assert shell.refused == {('uav', Refusal.REPLAY): 2}
    assert shell.genuine_from == 'uav'  # the radio itself may have doubled it
    assert numbers_heard(agent) == [5]


def test_messages_may_overtake_one_another_within_the_window() -> None:
    agent = ScriptedAgent()
    shell = shell_of(agent, KEY)
    for number in (WINDOW, 1, 0, WINDOW - 1):
        shell.receive(signed(number), 3.0)
    assert numbers_heard(agent) == [WINDOW, 1, WINDOW - 1]
    assert shell.refused == {('uav', Refusal.REPLAY): 1}


def test_each_sender_has_numbers_of_its_own() -> None:
    agent = ScriptedAgent()
    agent.peers = frozenset({'uav', 'c3'})
    shell = shell_of(agent, KEY)
    for src in ('uav', 'c3'):
        shell.receive(signed(5, src=src), 3.0)
    assert [src for src, *_ in agent.heard] == ['uav', 'c3']


CRASH = st.just('crash')


@given(st.lists(st.integers(0, 200) | st.integers(2**53 - 3, 2**53) | CRASH, max_size=30))
def test_no_number_is_heard_twice_by_all_processes_of_an_agent(inputs: list[int | str]) -> None:
    store = MemoryStore()
    agent = ScriptedAgent()
    shell = shell_of(agent, KEY, store)
    heard: list[int] = []
    for number in inputs:
        if isinstance(number, str):
            store = store.reopened()
            agent = ScriptedAgent()
            shell = shell_of(agent, KEY, store)
            continue
        before = len(agent.heard)
        shell.receive(signed(number), 3.0)
        if len(agent.heard) > before:
            assert number not in heard
            heard.append(number)
        else:
            assert number <= max(heard)  # what is newer than anything before is always heard


# --- a process dies, the next one goes on --------------------------------------------------------


class Diarist(ScriptedAgent):
    """Counts what it hears in its store, logs the count and says it by radio."""

    def __init__(self, store: Store) -> None:
        super().__init__()
        self._store = store
        self.count = store.load('count', int).get('', 0)
        self.fails = False

    def tick(self, now_s: float) -> list[Output]:
        if self.fails:
            raise VehicleUnavailableError('no position yet')
        return super().tick(now_s)

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        super().receive(src, message, now_s)
        self.count += 1
        self._store.put('count', '', self.count)
        return [
            Log(Missed(sortie=self.count, auv='auv_2'), now_s),
            Transmit('uav', word(self.count)),
            Publish(ODOM, ODOMETRY),
        ]


def diarist(store: Store) -> tuple[Diarist, AgentShell]:
    agent = Diarist(store)
    return agent, shell_of(agent, KEY, store)


def test_the_next_process_says_the_log_of_the_last_step_again_as_it_was_once() -> None:
    store = MemoryStore()
    _, shell = diarist(store)
    shell.receive(signed(0), 3.0)
    log, *_ = shell.receive(signed(1), 4.0)  # it may have died right here
    agent, shell = diarist(store.reopened())
    assert agent.count == 2
    assert shell.tick(5.0) == [log]
    assert opened(log)[2] == Missed(sortie=2, auv='auv_2')
    assert shell.tick(6.0) == []


def test_the_next_process_knows_when_anything_was_stored_last() -> None:
    store = MemoryStore()
    _, shell = diarist(store)
    assert shell.latest_s == 0.0
    shell.receive(signed(0), 3.5)
    shell.tick(9.0)  # changes nothing
    assert diarist(store.reopened())[1].latest_s == 3.5


def test_a_step_that_changed_nothing_leaves_the_log_of_the_one_before() -> None:
    store = MemoryStore()
    _, shell = diarist(store)
    log, *_ = shell.receive(signed(0), 3.0)
    shell.tick(4.0)
    shell.receive(b'noise', 4.0)
    _, shell = diarist(store.reopened())
    assert shell.tick(5.0) == [log]


def test_a_process_that_died_again_before_it_spoke_loses_no_log() -> None:
    store = MemoryStore()
    _, shell = diarist(store)
    log, *_ = shell.receive(signed(0), 3.0)
    store = store.reopened()
    diarist(store)
    _, shell = diarist(store.reopened())
    assert shell.tick(5.0) == [log]


def test_a_process_that_died_again_before_it_spoke_loses_no_log_though_it_stored_more() -> None:
    store = MemoryStore()
    _, shell = diarist(store)
    first, *_ = shell.receive(signed(0), 3.0)
    _, shell = diarist(store := store.reopened())
    second, *_ = shell.receive(signed(1), 4.0)  # in real time it may hear something before a tick
    _, shell = diarist(store.reopened())
    assert shell.tick(5.0) == [first, second]


def test_a_vehicle_that_fails_in_the_first_tick_costs_no_log() -> None:
    store = MemoryStore()
    _, shell = diarist(store)
    log, *_ = shell.receive(signed(0), 3.0)
    agent, shell = diarist(store.reopened())
    agent.fails = True
    with pytest.raises(VehicleUnavailableError):
        shell.tick(5.0)
    agent.fails = False
    assert shell.tick(6.0) == [log]


@given(st.lists(st.sampled_from(['hear', 'tick', 'noise', 'crash']), max_size=30))
def test_numbers_of_what_is_said_rise_over_all_processes(inputs: list[str]) -> None:
    store = MemoryStore()
    _, shell = diarist(store)
    said: list[Frame] = []
    for number, step in enumerate(inputs):
        match step:
            case 'hear':
                said += shell.receive(signed(number), 3.0)
            case 'tick':
                said += shell.tick(3.0)
            case 'noise':
                said += shell.receive(b'hello?', 3.0)
            case 'crash':
                store = store.reopened()
                _, shell = diarist(store)
    for topic in (RADIO_TX, MISSION_EVENTS):
        payloads = [
            frame.message.data
            for frame in said
            if frame.topic is topic and isinstance(frame.message, Text)
        ]
        numbers = [codec.open_envelope(data).seq for data in dict.fromkeys(payloads)]
        assert numbers == sorted(set(numbers))
        assert all(number <= 2**53 for number in numbers)
        if topic is RADIO_TX:
            assert len(payloads) == len(set(payloads))


# --- the vehicle of a process that dies ----------------------------------------------------------


class Glider:
    """Knows a number, and is told apart from other vehicles by it."""

    def __init__(self) -> None:
        self.known = b'0'

    def memory(self) -> bytes:
        return self.known

    def recall(self, memory: bytes) -> None:
        if not memory.isdigit():
            raise ValueError(f'{memory!r} is no number')
        self.known = memory


def test_a_vehicle_goes_on_where_that_of_the_process_before_was() -> None:
    store = MemoryStore()
    glider = Glider()
    shell = AgentShell(ScriptedAgent(), AgentSetting(store=store, authenticator=KEY), glider)
    shell.tick(3.0)
    glider.known = b'7'
    shell.tick(4.0)
    store = store.reopened()
    assert recalled(Glider(), store).known == b'7'


def test_a_vehicle_without_a_process_before_begins_anew() -> None:
    assert recalled(Glider(), MemoryStore()).known == b'0'


def test_a_vehicle_that_changes_nothing_is_not_stored_again() -> None:
    store = MemoryStore()
    glider = Glider()
    shell = AgentShell(ScriptedAgent(), AgentSetting(store=store, authenticator=KEY), glider)
    shell.tick(3.0)
    store.close()  # whoever commits now fails
    assert shell.tick(4.0) == []


def test_another_vehicle_than_the_one_before_is_an_error_that_says_so() -> None:
    store = MemoryStore()
    glider = Glider()
    glider.known = b'a propeller'
    AgentShell(ScriptedAgent(), AgentSetting(store=store, authenticator=KEY), glider).tick(3.0)
    with pytest.raises(StoreError, match="cannot be recalled: b'a propeller' is no number"):
        recalled(Glider(), store.reopened())


# --- a store that fails --------------------------------------------------------------------------


class FullStore(MemoryStore):
    """Takes nothing while it is full."""

    is_full = False

    def reopened(self) -> FullStore:
        store = FullStore()
        store._entries = self._entries
        self.close()
        return store

    def _write(self, changes: Mapping[tuple[str, str], bytes | None]) -> None:
        if self.is_full:
            raise StoreError('the disk is full')
        super()._write(changes)


def topics(frames: list[Frame]) -> list[Topic]:
    return [frame.topic for frame in frames]


def events(frames: list[Frame]) -> list[Event]:
    bodies = [opened(frame)[2] for frame in frames if frame.topic is MISSION_EVENTS]
    return [body for body in bodies if isinstance(body, Event)]


def test_while_nothing_can_be_stored_nothing_is_said_by_radio() -> None:
    store = FullStore()
    agent, shell = diarist(store)
    store.is_full = True
    frames = shell.receive(signed(0), 3.0)
    # The vehicle goes on, and people see it; they are told why nobody is answered, once.
    assert topics(frames) == [MISSION_EVENTS, ODOM, MISSION_EVENTS]
    first = [Missed(sortie=1, auv='auv_2'), StorageFailed(problem='the disk is full')]
    assert events(frames) == first
    assert events(shell.receive(signed(1), 4.0)) == [Missed(sortie=2, auv='auv_2')]
    assert agent.count == 2


def test_everything_goes_on_once_it_can_be_stored_again() -> None:
    store = FullStore()
    _, shell = diarist(store)
    store.is_full = True
    shell.receive(signed(0), 3.0)
    store.is_full = False
    # A tick that changes nothing itself is enough.
    assert events(shell.tick(4.0)) == [StorageRestored()]
    assert shell.tick(5.0) == []
    frames = shell.receive(signed(1), 6.0)
    assert topics(frames) == [MISSION_EVENTS, RADIO_TX, ODOM]
    _, envelope, body = opened(frames[1])
    assert body == word(2)
    assert envelope.seq == 0  # what was not said has no number: the radio looks for gaps
    assert diarist(store.reopened())[0].count == 2


def test_nothing_else_is_said_by_radio_either_while_something_is_not_stored() -> None:
    store = FullStore()
    agent = ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))
    shell = shell_of(agent, KEY, store)
    store.is_full = True
    assert RADIO_TX not in topics(shell.receive(signed(0), 3.0))
    assert RADIO_TX not in topics(shell.tick(4.0))
    store.is_full = False
    assert RADIO_TX in topics(shell.tick(5.0))


def test_a_process_that_cannot_store_at_all_does_not_begin() -> None:
    store = FullStore()
    store.is_full = True
    with pytest.raises(StoreError, match='the disk is full'):
        diarist(store)


@given(st.lists(st.sampled_from(['hear', 'tick', 'full', 'free', 'crash']), max_size=40))
def test_nobody_relies_on_what_a_crash_would_undo(inputs: list[str]) -> None:
    store = FullStore()
    agent, shell = diarist(store)
    said = 0
    for number, step in enumerate(inputs):
        frames: list[Frame] = []
        match step:
            case 'hear':
                frames = shell.receive(signed(number), 3.0)
            case 'tick':
                frames = shell.tick(3.0)
            case 'full' | 'free':
                store.is_full = step == 'full'
            case 'crash':
                store = store.reopened()
                agent, shell = diarist(store)
                assert agent.count >= said
        by_radio = [opened(frame)[2] for frame in frames if frame.topic is RADIO_TX]
        said = max(
            [said, *(body.reference for body in by_radio if isinstance(body, Acknowledgement))]
        )
        if step == 'hear':
            assert bool(by_radio) == (not store.is_full)
            assert Missed(sortie=agent.count, auv='auv_2') in events(frames)


def test_copies_are_said_and_heard_once_a_tick() -> None:
    agent = ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))
    setting = AgentSetting(store=MemoryStore(), authenticator=KEY)
    shell = AgentShell(agent, setting, copies=3)
    frames = shell.receive(signed(0), 3.0)
    assert len(frames) == 3
    assert len({frame.message for frame in frames}) == 3  # each has a number of its own
    assert shell.receive(KEY.sign(sent(seq=1)), 3.0) == []
    assert len(agent.heard) == 1
    shell.tick(4.0)
    assert len(shell.receive(KEY.sign(sent(seq=2)), 4.0)) == 3
