"""The log of an agent has no gap in the bag, whenever its machine goes down."""

from __future__ import annotations

import hypothesis.strategies as st
from hypothesis import given

from msgs_json.agent import Log, Output
from msgs_json.agent_shell import AgentSetting, AgentShell
from msgs_json.guarded_agent import GuardedAgent
from msgs_json.lockstep_client import AgentClient
from msgs_json.log_tail import LogTail
from msgs_json.messages import Go, Message, Missed, Tick
from msgs_json.ros_messages import Text
from msgs_json.store import MemoryStore
from msgs_json.topics import MISSION_EVENTS


class Diarist:
    """Logs a number in each tick, and keeps in its store which one is next."""

    name = 'auv_1'
    peers = frozenset({'uav'})
    finished = False

    def __init__(self, store: MemoryStore) -> None:
        self._store = store
        self.count = store.load('count', int).get('', 0)

    def tick(self, now_s: float) -> list[Output]:
        self.count += 1
        self._store.put('count', '', self.count)
        return [Log(Missed(sortie=self.count, auv='auv_2'), now_s)]

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        return []


class Machine:
    """An agent in lockstep with a recorder that lags."""

    def __init__(self) -> None:
        self.store = MemoryStore()
        self.bag: list[bytes] = []
        """What has reached the recorder, in its order."""
        self.on_disk = 0
        """So much of it outlives the machine."""
        self.ticks = 0
        self.asked_for: int | None = None
        self.boot()

    def boot(self) -> None:
        self.agent = Diarist(self.store)
        shell = AgentShell(self.agent, AgentSetting(store=self.store, authenticator=None))
        self.client = AgentClient(GuardedAgent(shell, lambda _: None), life=self.ticks)
        self.client.go(Go(number=0, lives={'auv_1': self.ticks}))

    def tick(self, asks: bool) -> int:
        """Return how many entries of the log were published."""
        if self.asked_for is not None:
            self.on_disk = self.asked_for
        self.asked_for = len(self.bag) if asks else None
        number = self.ticks
        self.ticks += 1
        published = self.asked_for
        frames = self.client.tick(Tick(tick=number, time_s=float(number), published=published))
        said = [
            frame.message.data
            for frame in frames
            if frame.topic is MISSION_EVENTS and isinstance(frame.message, Text)
        ]
        self.bag += said
        return len(said)

    def go_down(self, lost: int) -> None:
        """Lose so many of the messages that are not on the disk, and start again."""
        del self.bag[max(self.on_disk, len(self.bag) - lost) :]
        self.on_disk, self.asked_for = len(self.bag), None
        self.store = self.store.reopened()
        self.boot()


@given(st.lists(st.sampled_from(['tick', 'ask']) | st.integers(0, 40), max_size=60))
def test_what_is_logged_is_in_the_bag_whenever_the_machine_goes_down(
    inputs: list[str | int],
) -> None:
    machine = Machine()
    for each in inputs:
        if isinstance(each, int):
            machine.go_down(lost=each)
        else:
            machine.tick(asks=each == 'ask')
            assert len(set(machine.bag)) == machine.agent.count


def test_what_is_in_the_bag_is_not_said_again() -> None:
    machine = Machine()
    for asks in (False, False, True, False):
        machine.tick(asks)
    machine.go_down(lost=0)
    # Of the tick in which the recorder was asked, that of the tick after, and a new one.
    assert machine.tick(asks=False) == 3
    assert machine.tick(asks=False) == 1


def test_without_a_recorder_some_of_the_latest_are_kept() -> None:
    store = MemoryStore()
    tail = LogTail(store)
    tail.recorded(0)
    entries = [b'%d' % number for number in range(1000)]
    for entry in entries:
        tail.keep([entry])
    store.commit()
    kept = LogTail(store.reopened()).say_again()
    assert kept == entries[-256:]


def test_where_nobody_lags_what_was_said_is_dropped_with_the_next() -> None:
    store = MemoryStore()
    tail = LogTail(store)
    tail.keep([b'first', b'second'])
    tail.keep([b'third'])
    store.commit()
    assert LogTail(store.reopened()).say_again() == [b'third']
