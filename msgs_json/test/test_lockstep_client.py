from __future__ import annotations

from msgs_json import codec
from msgs_json.agent import Output, Publish, Transmit
from msgs_json.agent_shell import AgentSetting, AgentShell, Frame
from msgs_json.drivers import VehicleUnavailableError
from msgs_json.geometry import Point
from msgs_json.guarded_agent import GuardedAgent
from msgs_json.lockstep_client import AgentClient
from msgs_json.messages import Acknowledged, Acknowledgement, Done, Go, Message, Tick
from msgs_json.ros_messages import Odometry, Text
from msgs_json.store import MemoryStore
from msgs_json.topics import ODOM, RADIO_TX, WORLD_DONE

WORD = Acknowledgement(acknowledges=Acknowledged.PATH_ASSIGNMENT, reference=0)

LIFE = 7


class LateVehicle:
    """An agent whose vehicle fails at the first ticks, or whenever the agent hears something."""

    name = 'auv_1'
    peers = frozenset({'uav'})
    finished = False

    def __init__(self, failures: int) -> None:
        self.failures = failures
        self.ticks: list[float] = []

    def tick(self, now_s: float) -> list[Output]:
        self.ticks.append(now_s)
        if len(self.ticks) <= self.failures:
            raise VehicleUnavailableError('no pose yet')
        odometry = Odometry(
            stamp_s=now_s,
            child_frame_id='auv_1/base_link',
            position=Point(east_m=1.0, north_m=2.0),
            z_m=0.0,
            heading_rad=0.0,
            speed_mps=0.0,
        )
        return [Publish(ODOM, odometry), Transmit('uav', WORD)]

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        raise VehicleUnavailableError('no pose any more')


class HardWorker(LateVehicle):
    """Answers what it hears in slices."""

    is_busy = False
    slices = 3

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        self.is_busy = True
        return [Transmit('uav', WORD)]

    def work(self, now_s: float) -> list[Output]:
        self.slices -= 1
        self.is_busy = self.slices > 0
        return [Transmit('uav', WORD)]


def client_of(agent: LateVehicle) -> AgentClient:
    shell = AgentShell(agent, AgentSetting(store=MemoryStore(), authenticator=None))
    client = AgentClient(GuardedAgent(shell, lambda _: None), life=LIFE)
    client.go(go(0, LIFE))
    return client


def go(number: int, life: int) -> Go:
    return Go(number=number, lives={'uav': 1, 'auv_1': life})


def tick(number: int) -> Tick:
    return Tick(tick=number, time_s=float(number), published=None)


def heard() -> bytes:
    return codec.encode(WORD, src='uav', dst='auv_1', seq=0, stamp_s=0.0)


def topics(frames: list[Frame]) -> list[str]:
    return [frame.topic.name for frame in frames]


def done(frames: list[Frame]) -> Done:
    message = frames[-1].message
    assert isinstance(message, Text)
    body = codec.decode(message.data)[1]
    assert isinstance(body, Done)
    return body


WHOLE_ANSWER = [ODOM.name, RADIO_TX.name, WORLD_DONE.name]


def test_a_repeated_tick_is_answered_from_the_counts() -> None:
    agent = LateVehicle(failures=0)
    client = client_of(agent)
    first = client.tick(tick(0))
    again = client.tick(tick(0))
    assert topics(first) == WHOLE_ANSWER
    assert topics(again) == [WORLD_DONE.name]
    assert done(again) == done(first)
    assert agent.ticks == [0.0]


def test_a_tick_in_which_the_vehicle_failed_is_tried_again_until_it_goes_well() -> None:
    agent = LateVehicle(failures=2)
    client = client_of(agent)
    # No word of being done: the world must not go on before the radio of the good try is there.
    assert client.tick(tick(0)) == []
    assert client.tick(tick(0)) == []
    answer = client.tick(tick(0))
    assert topics(answer) == WHOLE_ANSWER
    assert (done(answer).sent, done(answer).published) == (1, 2)
    assert topics(client.tick(tick(0))) == [WORLD_DONE.name]
    assert agent.ticks == [0.0, 0.0, 0.0]


def test_what_is_heard_before_the_good_try_does_not_answer_the_tick() -> None:
    client = client_of(LateVehicle(failures=1))
    client.tick(tick(0))
    assert client.hear(heard()) == []


def test_a_vehicle_that_fails_at_a_message_does_not_repeat_its_tick() -> None:
    agent = LateVehicle(failures=0)
    client = client_of(agent)
    client.tick(tick(0))
    assert topics(client.hear(heard())) == [WORLD_DONE.name]
    assert topics(client.tick(tick(0))) == [WORLD_DONE.name]
    assert agent.ticks == [0.0]


def test_a_busy_agent_says_so_after_every_slice_until_its_work_is_done() -> None:
    client = client_of(HardWorker(failures=0))
    assert not done(client.tick(tick(0))).busy
    answers = [client.hear(heard())]
    while client.is_busy:
        answers.append(client.work())
    assert [topics(answer) for answer in answers] == [[RADIO_TX.name, WORLD_DONE.name]] * 4
    assert [done(answer).busy for answer in answers] == [True, True, True, False]
    # Whatever is sent meanwhile is counted, and so is what the work began with.
    assert [done(answer).sent for answer in answers] == [2, 3, 4, 5]
    assert {done(answer).received for answer in answers} == {1}


def test_a_tick_that_is_repeated_to_a_busy_agent_is_not_over() -> None:
    agent = HardWorker(failures=0)
    client = client_of(agent)
    client.tick(tick(0))
    client.hear(heard())
    again = client.tick(tick(0))
    assert topics(again) == [WORLD_DONE.name]
    assert done(again).busy
    assert (agent.ticks, agent.slices) == ([0.0], 3)
