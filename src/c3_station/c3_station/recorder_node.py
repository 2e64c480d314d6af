"""The recorder: writes every message of a mission's topics into a bag."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path

from c3_station.bag import BagError, BagFacts, BagWriter, LogTimes, salvage_bag, source_of
from c3_station.node_params import C3, UAV
from c3_station.recorded_topics import RecordedTopic, mission_topics
from c3_station.recorder_params import RecorderParams
from c3_station.scenario_files import parse_scenario
from msgs_json.agent_shell import Frame
from msgs_json.host_node import STEADY_CLOCK, HostedNode, run, steady_us
from msgs_json.lockstep_client import RecorderClient
from msgs_json.messages import Go, Hello, Tick
from msgs_json.namespaces import agent_namespaces
from msgs_json.node_exit import NodeExit
from msgs_json.refusals import body_decoder
from msgs_json.ros_messages import NANOSECONDS, to_cdr
from msgs_json.topics import (
    CLOCK,
    MISSION_EVENTS,
    SETPOINT,
    VEHICLE_ODOM,
    WORLD_DONE,
    WORLD_GO,
    WORLD_HELLO,
    WORLD_READY,
    WORLD_TICK,
)

_FLUSH_S = 0.5
"""Wall time that a bag lacks at most of what was not asked for, when its machine goes down."""
_UNCOUNTED = (SETPOINT, VEHICLE_ODOM)
"""Between a driver and its autopilot: agents do not count these as published."""


class RecorderNode(HostedNode):
    """Stores bytes as they come, and tells the world once it has them all."""

    def __init__(self) -> None:
        # Messages bring their own stamps; it needs no simulated time.
        super().__init__('recorder', '/recorder', use_sim_time=False)
        with self.setup():
            params = self.params(RecorderParams)
            scenario = parse_scenario(params.scenario)
            agents = (C3, UAV, *(auv.name for auv in scenario.auvs))
            namespaces = agent_namespaces(agents, params.namespaces)
            topics = mission_topics(scenario)
            self._bag = BagWriter(Path(params.out), topics)
            latest_ns = self._copy(params.before) if params.before else 0
        self._client = RecorderClient(life=steady_us(), latest_s=latest_ns / NANOSECONDS)
        self._arrived: list[tuple[RecordedTopic, bytes]] = []
        self._has_failed = False
        """Nothing more can be written; the first failure is the cause of any other."""
        self._log_times = LogTimes()
        self._first_tick: tuple[int, Tick] | None = None
        self._last_tick: tuple[int, Tick] | None = None
        """With the steady time at which it came."""
        for recorded in topics:
            owner = recorded.name.split('/')[1]
            namespace = namespaces.get(owner, f'/{owner}')
            take = self._store if recorded.topic in _UNCOUNTED else self._store_counted
            self.listen(recorded.topic, bytes, partial(take, recorded), namespace)
        self.listen(WORLD_TICK, body_decoder(Tick), self._tick)
        self._topic_publishers = {
            topic.name: self.raw_publisher(topic) for topic in (WORLD_DONE, WORLD_READY)
        }
        # The order matters: these subscriptions, and the publisher of hello, come last.
        self.listen(WORLD_HELLO, body_decoder(Hello), self._hear_hello)
        self.listen(WORLD_GO, body_decoder(Go), self._go)
        self._topic_publishers[WORLD_HELLO.name] = self.raw_publisher(WORLD_HELLO)
        self._publish([self._client.hello()])
        self.every(_FLUSH_S, self._flush)

    def close(self) -> None:
        """Close the bag."""
        self._write()
        facts = BagFacts(complete=self._client.has_all)
        if self._first_tick and self._last_tick and self._last_tick[0] > self._first_tick[0]:
            wall_s = (self._last_tick[0] - self._first_tick[0]) / NANOSECONDS
            simulated_s = self._last_tick[1].time_s - self._first_tick[1].time_s
            facts = BagFacts(
                wall_s=wall_s, real_time_factor=simulated_s / wall_s, complete=facts.complete
            )
        try:
            self._bag.close(facts)
        except BagError as error:
            self._fail(error)

    def _copy(self, before: str) -> int:
        """Write what there is of a bag of the same mission; return when its clock stopped."""
        latest_ns = 0
        for topic, log_time_ns, cdr in salvage_bag(Path(before)).messages:
            self._bag.write(topic, cdr, log_time_ns)
            if topic == CLOCK.name:
                latest_ns = max(latest_ns, log_time_ns)
        self._bag.flush()
        return latest_ns

    def _store(self, recorded: RecordedTopic, cdr: bytes) -> None:
        self._arrived.append((recorded, cdr))

    def _store_counted(self, recorded: RecordedTopic, cdr: bytes) -> None:
        self._arrived.append((recorded, cdr))
        src = source_of(cdr) if recorded.topic is MISSION_EVENTS else recorded.publisher
        self._answer(self._client.store(src))

    def _answer(self, frames: list[Frame]) -> None:
        if frames:
            self._flush()  # what it says it holds must not go down with the machine
            if not self._has_failed:  # else it would claim to hold what it does not
                self._publish(frames)

    def _write(self) -> None:
        """Write what has arrived: many at a time, which costs a third of one by one."""
        arrived, self._arrived = self._arrived, []
        if self._has_failed:
            return
        try:
            for recorded, cdr in arrived:
                ros_type = recorded.topic.ros_type
                time_ns = self._log_times.log_time_ns(recorded.name, ros_type, cdr)
                self._bag.write(recorded.name, cdr, time_ns)
        except BagError as error:
            self._fail(error)

    def _flush(self) -> None:
        self._write()
        if self._has_failed:
            return
        try:
            self._bag.flush()
        except BagError as error:
            self._fail(error)

    def _fail(self, error: BagError) -> None:
        self._has_failed = True
        self.log.fatal(str(error))
        self.on_end(NodeExit.NOT_RECORDING)

    def _tick(self, message: tuple[str, Tick]) -> None:
        _, tick = message
        self._last_tick = (STEADY_CLOCK.now().nanoseconds, tick)
        self._first_tick = self._first_tick or self._last_tick
        self._answer(self._client.tick(tick))

    def _hear_hello(self, message: tuple[str, Hello]) -> None:
        self._publish(self._client.hear_hello(*message))

    def _go(self, message: tuple[str, Go]) -> None:
        self._publish(self._client.go(message[1]))

    def _publish(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            self._topic_publishers[frame.topic.name].publish(to_cdr(frame.message))


def main() -> int:
    """Run the recorder."""
    return run(lambda: [RecorderNode()])
