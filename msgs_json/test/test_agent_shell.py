from __future__ import annotations

from typing import TYPE_CHECKING

import hypothesis.strategies as st
import pytest
from hypothesis import given

from msgs_json import codec
from msgs_json.agent import Log, Output, Publish, Refuse, Transmit
from msgs_json.agent_shell import AgentShell, Frame, Speaker
from msgs_json.codec import Refusal
from msgs_json.geometry import Point
from msgs_json.messages import (
    Acknowledged,
    Acknowledgement,
    Hello,
    Message,
    MessageRefused,
    Missed,
    MissionState,
    MissionStatus,
    NodeKind,
)
from msgs_json.ros_messages import Odometry, Text
from msgs_json.topics import MISSION_EVENTS, MISSION_STATUS, ODOM, RADIO_TX

if TYPE_CHECKING:
    from msgs_json.topics import Topic

ACKNOWLEDGEMENT = Acknowledgement(acknowledges=Acknowledged.SURFACING_REPORT, reference=0)
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


def sent(
    body: Message = ACKNOWLEDGEMENT, *, src: str = 'uav', dst: str = 'auv_1', seq: int = 0
) -> bytes:
    return codec.encode(body, src=src, dst=dst, seq=seq, stamp_s=3.0)


def opened(frame: Frame) -> tuple[Topic, codec.Envelope, Message]:
    assert isinstance(frame.message, Text)
    return (frame.topic, *codec.decode(frame.message.data))


# --- outwards ------------------------------------------------------------------------------------


def test_speech_is_addressed_and_goes_to_the_radio() -> None:
    (frame,) = AgentShell(ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))).tick(3.0)
    topic, envelope, body = opened(frame)
    assert topic is RADIO_TX
    assert (envelope.src, envelope.dst, envelope.stamp) == ('auv_1', 'uav', 3.0)
    assert body == ACKNOWLEDGEMENT


def test_ros_messages_are_published_as_they_are() -> None:
    assert AgentShell(ScriptedAgent(Publish(ODOM, ODOMETRY))).tick(3.0) == [Frame(ODOM, ODOMETRY)]


def test_json_is_published_in_an_envelope_to_everyone() -> None:
    (frame,) = AgentShell(ScriptedAgent(Publish(MISSION_STATUS, STATUS))).tick(3.0)
    topic, envelope, body = opened(frame)
    assert topic is MISSION_STATUS
    assert (envelope.schema, envelope.dst, body) == ('MissionStatus', '*', STATUS)


def test_an_event_is_stamped_with_when_it_happened() -> None:
    event = Missed(sortie=1, auv='auv_2')
    (frame,) = AgentShell(ScriptedAgent(Log(event, 2.0))).tick(3.0)
    topic, envelope, body = opened(frame)
    assert topic is MISSION_EVENTS
    assert (envelope.schema, envelope.stamp, body) == ('MissionEvent', 2.0, event)


def test_frames_keep_the_order_of_what_was_said_and_are_counted_per_topic() -> None:
    event = Log(Missed(sortie=1, auv='auv_2'), 2.0)
    speech = Transmit('uav', ACKNOWLEDGEMENT)
    shell = AgentShell(ScriptedAgent(speech, event, speech))
    frames = [*shell.tick(3.0), *shell.tick(4.0)]
    assert [frame.topic for frame in frames] == [*(RADIO_TX, MISSION_EVENTS, RADIO_TX)] * 2
    assert [opened(frame)[1].seq for frame in frames] == [0, 0, 1, 2, 1, 3]


def test_what_is_said_in_slices_of_work_is_counted_on() -> None:
    shell = AgentShell(HardWorker(Transmit('uav', ACKNOWLEDGEMENT), slices=2))
    assert not shell.is_busy
    frames = shell.tick(3.0)
    while shell.is_busy:
        frames += shell.work(3.0)
    assert [opened(frame)[1].seq for frame in frames] == [0, 1, 2]


def test_an_agent_without_such_work_is_never_busy() -> None:
    shell = AgentShell(ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT)))
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


# --- inwards -------------------------------------------------------------------------------------


def test_a_peer_is_heard() -> None:
    agent = ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))
    (frame,) = AgentShell(agent).receive(sent(), 3.0)
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
    shell = AgentShell(agent)
    event = refusal(shell.receive(data, 3.0))
    assert (event.sender, event.reason) == (sender, reason.value)
    assert path in event.detail
    assert shell.receive(data, 4.0) == []
    assert shell.refused == {(sender, reason): 2}
    assert agent.heard == []


def test_each_sender_and_each_reason_is_logged() -> None:
    shell = AgentShell(ScriptedAgent())
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
    shell = AgentShell(ScriptedAgent(refuse))
    event = refusal(shell.receive(sent(), 3.0))
    assert event == MessageRefused(
        sender='uav', reason='contradictory', detail='path must start at [4, 7]'
    )
    assert shell.receive(sent(), 4.0) == []
    assert shell.refused == {('uav', Refusal.CONTRADICTORY): 2}


@given(st.lists(st.binary(max_size=60), max_size=5))
def test_noise_never_reaches_the_agent(noise: list[bytes]) -> None:
    agent = ScriptedAgent(Transmit('uav', ACKNOWLEDGEMENT))
    shell = AgentShell(agent)
    frames = [frame for data in noise for frame in shell.receive(data, 3.0)]
    assert agent.heard == []
    assert shell.refused.total() == len(noise)
    assert len(frames) == min(1, len(noise))
