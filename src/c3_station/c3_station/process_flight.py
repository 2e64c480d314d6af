"""A mission flown in this process, shown and recorded like one of ROS 2 nodes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from threading import Event as Pause
from time import monotonic

from c3_station.bag import BagFacts, BagWriter, LogTimes
from c3_station.flight import Flight
from c3_station.in_process import fly, in_memory
from c3_station.mission_monitor import MissionMonitor
from c3_station.recorded_topics import mission_topics
from c3_station.run_folder import RunFolder
from c3_station.scenario import Scenario
from msgs_json.agent_shell import Frame
from msgs_json.key_file import read_key
from msgs_json.ros_messages import ClockTime, to_cdr
from msgs_json.topics import MISSION_EVENTS

_LOOK_EVERY_S = 0.1


def fly_in_process(
    scenario: Scenario,
    folder: RunFolder,
    monitor: MissionMonitor,
    *,
    rate: float,
    bag: bool,
    refresh: Callable[[], None],
) -> Flight:
    """
    Fly a mission without ROS; with the same outputs as `ros_flight.fly_on_ros`.

    Raises
    ------
    BagError
        The bag cannot be written.

    """
    began_s = monotonic()
    with ExitStack() as stack:
        writer = None
        if bag:
            writer = stack.enter_context(BagWriter(folder.bag, mission_topics(scenario)))
        sink = _Sink(monitor, writer, rate, refresh)
        fly(scenario, sink, make_setting=in_memory(read_key(str(folder.key))))
        wall_s = monotonic() - began_s
        if writer is not None:
            writer.close(
                BagFacts(wall_s=wall_s, real_time_factor=monitor.now_s / wall_s, complete=True)
            )
    return Flight(first_tick_s=0.0)


class _Sink:
    """Takes every message of the mission: into the bag, to the view, at the pace asked for."""

    def __init__(
        self,
        monitor: MissionMonitor,
        writer: BagWriter | None,
        rate: float,
        refresh: Callable[[], None],
    ) -> None:
        self._monitor = monitor
        self._writer = writer
        self._log_times = LogTimes()
        self._rate = rate
        self._refresh = refresh
        self._due_s = monotonic()
        """Wall time of the tick at `_time_s`."""
        self._time_s = 0.0
        self._pause = Pause()

    def __call__(self, name: str, frame: Frame) -> None:
        """Take a message that an agent, or the world in its name, publishes."""
        message = frame.message
        topic = frame.topic.resolve(f'/{name}')
        if isinstance(message, ClockTime):
            self._keep_pace(message.time_s)
        self._monitor.message(topic, message)
        if isinstance(message, ClockTime) or frame.topic is MISSION_EVENTS:
            self._refresh()
        if self._writer is not None:
            cdr = to_cdr(message)
            time_ns = self._log_times.log_time_ns(topic, frame.topic.ros_type, cdr)
            self._writer.write(topic, cdr, time_ns)

    def _keep_pace(self, time_s: float) -> None:
        if self._rate == 0:
            return
        # What a tick took too long is not made up for, as little as between nodes: after many
        # seconds of planning ahead nobody could follow.
        self._due_s = max(self._due_s + (time_s - self._time_s) / self._rate, monotonic())
        self._time_s = time_s
        while (early_s := self._due_s - monotonic()) > 0:
            self._pause.wait(min(early_s, _LOOK_EVERY_S))
            self._refresh()
