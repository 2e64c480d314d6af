"""The node that runs an agent: in lockstep with a world node, or in real time."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from rclpy.publisher import Publisher

from msgs_json.agent_params import AgentParams
from msgs_json.agent_shell import AgentSetting, AgentShell, Frame
from msgs_json.authentication import Authenticator
from msgs_json.drivers import DriverPorts
from msgs_json.guarded_agent import GuardedAgent
from msgs_json.host_node import STEADY_CLOCK, HostedNode, message_class, steady_us
from msgs_json.key_file import read_key
from msgs_json.lockstep_client import AgentClient
from msgs_json.messages import Go, Tick
from msgs_json.mission_clock import MissionClock
from msgs_json.refusals import body_decoder
from msgs_json.ros_messages import (
    NANOSECONDS,
    Odometry,
    RosMessage,
    odometry_from_cdr,
    text_from_cdr,
    to_cdr,
)
from msgs_json.sqlite_store import SqliteStore
from msgs_json.store import MemoryStore, Store
from msgs_json.topics import (
    CLOCK,
    RADIO_RX,
    WORLD_DONE,
    WORLD_GO,
    WORLD_HELLO,
    WORLD_READY,
    WORLD_TICK,
    Topic,
)

ParamsT = TypeVar('ParamsT', bound=AgentParams)

_AGENT_NAME = re.compile('[a-z][a-z0-9_]{0,31}')

_BOOT_ID = Path('/proc/sys/kernel/random/boot_id')
"""Another one after each boot of the machine (Linux)."""
_MICROSECONDS = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentKind(Generic[ParamsT]):
    """What distinguishes the nodes of AUV, UAV and C3."""

    node: str
    namespace: str
    """Where the node is placed unless the command line says otherwise."""
    params_type: type[ParamsT]
    make_agent: Callable[[ParamsT, DriverPorts, AgentSetting], AgentShell]
    tick_s: Callable[[ParamsT], float]
    """Length of a tick in real time."""
    publishes: tuple[Topic, ...]
    """Every topic of the agent's frames."""
    listens: tuple[Topic, ...] = ()
    """What the agent takes beside its radio, as if it came by that."""


class AgentNode(HostedNode):
    """
    Carries what an agent hears and says; which of the two clocks ticks it, ``use_sim_time`` says.

    True: lockstep, ticks come from the world. False: a timer ticks the agent, and messages are
    handed over as they arrive; the time is the ROS clock's at the start, and steady from then on.
    """

    def __init__(
        self,
        kind: AgentKind[ParamsT],
        namespace: str | None = None,
    ) -> None:
        """Create the node, one of several in a process where a namespace is given."""
        super().__init__(kind.node, namespace or kind.namespace, is_fixed=namespace is not None)
        self._topic_publishers = {
            topic.name: self.raw_publisher(topic) for topic in kind.publishes
        }
        with self.setup():
            params = self.params(kind.params_type, name=self.get_namespace().rpartition('/')[2])
            if not _AGENT_NAME.fullmatch(params.name):
                raise ValueError(
                    f'parameter name is {params.name!r}; it must be like auv_1 (place the node'
                    f' with --ros-args -r __ns:={kind.namespace})'
                )
            self._store = _open_store(params)
            setting = AgentSetting(store=self._store, authenticator=self._authenticator(params))
            shell = kind.make_agent(params, _Ports(self), setting)
        self._agent = GuardedAgent(shell, self.log.error)
        self._work: Callable[[], list[Frame]]
        if self.get_parameter('use_sim_time').value:
            self._join_lockstep(kind.listens)
        else:
            self._keep_time(kind.listens, kind.tick_s(params))

    def publish(self, frames: Iterable[Frame]) -> None:
        """Publish what the agent wants to say and show."""
        for frame in frames:
            self._topic_publishers[frame.topic.name].publish(to_cdr(frame.message))

    def _carry_on(self, frames: Iterable[Frame]) -> None:
        """Publish what came of a tick or a message, and let the agent do what that began."""
        self.publish(frames)
        # Nothing else is handled until it is done: whatever comes meanwhile comes after it.
        while self._agent.is_busy and not self.is_told_to_end():
            self.publish(self._work())

    def close(self) -> None:
        """Tell what was refused and what failed."""
        refused = sum(self.refusals.counts.values())
        failed = self._agent.driver_failures
        if refused or failed:
            self.log.warning(f'refused payloads: {refused}, driver failures: {failed}')
        self._store.close()

    def _authenticator(self, params: AgentParams) -> Authenticator | None:
        if params.key_file:
            return Authenticator(read_key(params.key_file))
        self.log.error(
            f'{params.name} HAS NO KEY: it believes whoever has a radio, and nobody with a key'
            ' believes it (parameter key_file)'
        )
        return None

    # --- real time -------------------------------------------------------------------------------

    def _keep_time(self, listens: tuple[Topic, ...], tick_s: float) -> None:
        clock = MissionClock(
            self._store,
            ros_s=self.get_clock().now().nanoseconds / NANOSECONDS,
            steady_s=_steady_s(),
            boot_id=_BOOT_ID.read_text().strip(),
            latest_s=self._agent.latest_s,
        )
        self._work = lambda: self._agent.work(clock.now_s(_steady_s()))

        def on_tick() -> None:
            self._carry_on(self._agent.tick(clock.now_s(_steady_s())))

        def on_heard(data: bytes) -> None:
            self._carry_on(self._agent.receive(data, clock.now_s(_steady_s())))

        for topic in (RADIO_RX, *listens):
            self.listen(topic, text_from_cdr, on_heard)
        self.create_timer(tick_s, on_tick, clock=STEADY_CLOCK)

    # --- lockstep --------------------------------------------------------------------------------

    def _join_lockstep(self, listens: Iterable[Topic]) -> None:
        client = AgentClient(self._agent, life=steady_us())
        self._work = client.work

        # A tick brings its time with it, and nothing here runs on the node's own clock. To set
        # that from /clock would cost more than the tick itself.
        for subscription in list(self.subscriptions):
            if subscription.msg_type is message_class(CLOCK.ros_type):
                self.destroy_subscription(subscription)

        def on_tick(message: tuple[str, Tick]) -> None:
            self._carry_on(client.tick(message[1]))

        def on_heard(data: bytes) -> None:
            self._carry_on(client.hear(data))

        def on_go(message: tuple[str, Go]) -> None:
            self.publish(client.go(message[1]))

        self.listen(WORLD_TICK, body_decoder(Tick), on_tick)
        for topic in (RADIO_RX, *listens):
            self.listen(topic, text_from_cdr, on_heard)
        # The order matters: the subscription to go and the publisher of hello come last.
        self.listen(WORLD_GO, body_decoder(Go), on_go)
        for topic in (WORLD_DONE, WORLD_READY, WORLD_HELLO):
            self._topic_publishers[topic.name] = self.raw_publisher(topic)
        self.publish([client.hello()])


def _steady_s() -> float:
    return steady_us() / _MICROSECONDS


def _open_store(params: AgentParams) -> Store:
    if not params.store:
        return MemoryStore()
    return SqliteStore(Path(params.store), identity=params.name)


class _Ports:
    """The topics of a vehicle's autopilot, for its driver."""

    def __init__(self, node: AgentNode) -> None:
        self._node = node
        self._publishers: dict[str, Publisher] = {}

    def publish(self, topic: Topic, message: RosMessage) -> None:
        """Publish on a topic; its publisher is made for the first message."""
        if topic.name not in self._publishers:
            self._publishers[topic.name] = self._node.raw_publisher(topic)
        self._publishers[topic.name].publish(to_cdr(message))

    def subscribe_odometry(self, topic: Topic, callback: Callable[[Odometry], None]) -> None:
        """Call back with every odometry message of a topic that is sound."""
        self._node.listen(topic, odometry_from_cdr, callback)
