"""The world as a node: simulated time and radio for all agents, in lockstep."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from rclpy.duration import Duration

from auv_sim.conductor import NUDGE_S, Addressed, Conductor, Phase
from auv_sim.world import WORLD
from auv_sim.world_params import WorldParams, make_world
from msgs_json.authentication import Authenticator
from msgs_json.host_node import HostedNode, run
from msgs_json.key_file import read_key
from msgs_json.messages import Done, Hello, Message, Ready
from msgs_json.namespaces import agent_namespaces
from msgs_json.node_exit import NodeExit
from msgs_json.refusals import body_decoder
from msgs_json.ros_messages import Odometry, odometry_from_cdr, text_from_cdr, to_cdr
from msgs_json.topics import (
    CLOCK,
    MISSION_EVENTS,
    ODOM,
    RADIO_RX,
    RADIO_STATUS,
    RADIO_TX,
    WORLD_DONE,
    WORLD_GO,
    WORLD_HELLO,
    WORLD_READY,
    WORLD_TICK,
    WORLD_WAITING,
    Topic,
)

BodyT = TypeVar('BodyT', bound=Message)

_LAST_WORDS = Duration(seconds=0.3)
"""How long the last message may take to reach everybody, where no recorder confirms it."""
_COMPLAIN_NUDGES = 20
"""A start that does not get on is reported every 10 s."""


class WorldNode(HostedNode):
    """Carries what the conductor hears and says, and paces it."""

    def __init__(self) -> None:
        # It makes the simulated time, and runs on the steady clock itself.
        super().__init__('world', '/world', use_sim_time=False)
        with self.setup():
            params = self.params(WorldParams)
            key = read_key(params.key_file) if params.key_file else None
            self._world = make_world(params, Authenticator(key) if key is not None else None)
            namespaces = agent_namespaces(self._world.order, params.namespaces)
            self._conductor = Conductor(
                self._world,
                recorder=params.recorder,
                start_timeout_s=params.start_timeout_s,
                reply_timeout_s=params.reply_timeout_s,
                restarted=params.restarted,
                rejoin_timeout_s=params.rejoin_timeout_s,
            )
        self._is_due = True
        """The next tick may begin."""
        self._is_paced = params.rate > 0
        self._is_over = False
        self._start_nudges = 0
        self._topic_publishers = {
            (WORLD, topic.name): self.raw_publisher(topic)
            for topic in (CLOCK, WORLD_TICK, WORLD_WAITING, MISSION_EVENTS, RADIO_STATUS)
        }
        for name, namespace in namespaces.items():
            self._topic_publishers[name, RADIO_RX.name] = self.raw_publisher(RADIO_RX, namespace)
            self.listen(RADIO_TX, text_from_cdr, partial(self._said, name), namespace)
            if name != self._world.c3:
                self.listen(ODOM, odometry_from_cdr, partial(self._saw, name), namespace)
        self._take(WORLD_DONE, Done, self._conductor.done)
        self._take(WORLD_READY, Ready, self._conductor.ready)
        # The order matters: the subscription to hello and the publisher of go come last.
        self._take(WORLD_HELLO, Hello, self._conductor.hello)
        self._topic_publishers[WORLD, WORLD_GO.name] = self.raw_publisher(WORLD_GO)
        self.every(NUDGE_S, self._nudge)
        if self._is_paced:
            self.every(params.tick_s / params.rate, self._release)

    def close(self) -> None:
        """Note in the mission's log where it did not come to its end."""
        self._publish(self._conductor.interrupt())
        if self._conductor.is_cut_short:
            self._topic_publishers[WORLD, MISSION_EVENTS.name].wait_for_all_acked(_LAST_WORDS)

    def _take(
        self, topic: Topic, body: type[BodyT], act: Callable[[str, BodyT], list[Addressed]]
    ) -> None:
        self.listen(topic, body_decoder(body), lambda message: self._go_on(act(*message)))

    def _said(self, name: str, payload: bytes) -> None:
        self._go_on(self._conductor.said(name, payload))

    def _saw(self, name: str, odometry: Odometry) -> None:
        self._go_on(self._conductor.saw(name, odometry))

    def _nudge(self) -> None:
        if self._conductor.phase in (Phase.GATHERING, Phase.GREETING):
            self._start_nudges += 1
            if self._start_nudges % _COMPLAIN_NUDGES == 0:
                waiting_for = ', '.join(self._conductor.missing())
                self.log.info(f'{self._conductor.phase.value}: {waiting_for}')
        output = self._conductor.nudge()
        if any(frame.topic is WORLD_WAITING for _, frame in output):
            self.log.warning(f'waiting for {", ".join(self._conductor.missing())}')
        self._go_on(output)

    def _release(self) -> None:
        self._is_due = True
        self._go_on([])

    def _go_on(self, output: list[Addressed]) -> None:
        self._publish(output)
        phase = self._conductor.phase
        if phase is Phase.RESTING and self._is_due:
            self._is_due = not self._is_paced
            self._publish(self._conductor.begin_tick())
        elif phase is Phase.ENDED and not self._is_over:
            self._is_over = True
            code = self._conductor.exit_code
            say = self.log.info if code is NodeExit.OK else self.log.error
            say(f'mission over at {self._world.now_s:g} s: {self._conductor.verdict}')
            self.on_end(code)

    def _publish(self, output: list[Addressed]) -> None:
        for name, frame in output:
            self._topic_publishers[name, frame.topic.name].publish(to_cdr(frame.message))


def main() -> int:
    """Run the world."""
    return run(lambda: [WorldNode()])
