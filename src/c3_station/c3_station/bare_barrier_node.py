"""
The yardstick of a lockstep tick: what ROS alone costs, with nothing simulated.

A conductor publishes ``/world/tick`` and ``/clock``; each of n vehicles answers with ``odom`` and
``/world/done``, a station with ``/world/done`` only; a recorder takes ``/clock`` and every
``odom``, and answers every few ticks. One process each, with the executor, the qualities of
service and the raw CDR bytes of the real nodes, and ready-made payloads. ``bench`` divides the
cost of a mission's tick by the cost of one of these.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from domain_coordinator import domain_id

from c3_station.processes import NodeProcess, stop_all
from c3_station.ros_environment import graph_environment
from msgs_json.geometry import Point
from msgs_json.host_node import STEADY_CLOCK, HostedNode, run
from msgs_json.node_exit import NodeExit
from msgs_json.ros_messages import (
    NANOSECONDS,
    ClockTime,
    Odometry,
    Text,
    text_from_cdr,
    to_cdr,
)
from msgs_json.topics import CLOCK, ODOM, WORLD_DONE, WORLD_HELLO, WORLD_TICK

RECORDER_TICKS = 40
"""The recorder answers this often, as in a mission with three AUVs."""

_WARM_UP_TICKS = 50
_RESEND_S = 0.5
_TIMEOUT_S = 120.0
_CONDUCTOR = 'conductor'
_STATION = 'station'
_RECORDER = 'recorder'


class Conductor(HostedNode):
    """Holds each tick until everybody has answered, and prints how many there are a second."""

    def __init__(self, vehicles: int, ticks: int) -> None:
        super().__init__(_CONDUCTOR, f'/{_CONDUCTOR}')
        self._missing = {*_vehicles(vehicles), _STATION, _RECORDER}
        self._answers = 2 * vehicles + 1
        self._open = 0
        self._tick = -1
        self._ticks = ticks
        self._began_ns = 0
        self._tick_publisher = self.raw_publisher(WORLD_TICK)
        self._clock_publisher = self.raw_publisher(CLOCK)
        for name in _vehicles(vehicles):
            self.listen(ODOM, bytes, self._odom, f'/{name}')
        self.listen(WORLD_DONE, text_from_cdr, self._done)
        self.listen(WORLD_HELLO, text_from_cdr, self._hello)
        self.every(_RESEND_S, self._resend)

    def _hello(self, name: bytes) -> None:
        self._missing.discard(name.decode())
        if not self._missing and self._tick < 0:
            self._next()

    def _next(self) -> None:
        self._tick += 1
        if self._tick == _WARM_UP_TICKS:
            self._began_ns = STEADY_CLOCK.now().nanoseconds
        if self._tick == _WARM_UP_TICKS + self._ticks:
            elapsed_ns = STEADY_CLOCK.now().nanoseconds - self._began_ns
            sys.stdout.write(f'{self._ticks / elapsed_ns * NANOSECONDS}\n')
            self.on_end(NodeExit.OK)
            return
        self._open = self._answers + (self._tick % RECORDER_TICKS == 0)
        self._clock_publisher.publish(to_cdr(ClockTime(time_s=float(self._tick))))
        self._tick_publisher.publish(to_cdr(Text(b'%d' % self._tick)))

    def _resend(self) -> None:
        """Send the first tick again: a hello does not prove that its sender can be reached."""
        if self._tick == 0:
            self._tick_publisher.publish(to_cdr(Text(b'0')))

    def _odom(self, cdr: bytes) -> None:
        self._settle()

    def _done(self, tick: bytes) -> None:
        if int(tick) == self._tick:
            self._settle()

    def _settle(self) -> None:
        self._open -= 1
        if self._open == 0:
            self._next()


class Answerer(HostedNode):
    """A vehicle, the station or the recorder: answers a tick once."""

    def __init__(self, name: str) -> None:
        super().__init__(name, f'/{name}')
        self._answered = -1
        self._odom = None if name in (_STATION, _RECORDER) else self.raw_publisher(ODOM)
        self._odometry = to_cdr(
            Odometry(
                stamp_s=0.0,
                child_frame_id=f'{name}/base_link',
                position=Point(east_m=0.0, north_m=0.0),
                z_m=0.0,
                heading_rad=0.0,
                speed_mps=0.0,
            )
        )
        self._every = RECORDER_TICKS if name == _RECORDER else 1
        self._done = self.raw_publisher(WORLD_DONE)
        self.listen(WORLD_TICK, text_from_cdr, self._tick)
        self.raw_publisher(WORLD_HELLO).publish(to_cdr(Text(name.encode())))

    def _tick(self, tick: bytes) -> None:
        number = int(tick)
        if number <= self._answered or number % self._every:
            return
        self._answered = number
        if self._odom is not None:
            self._odom.publish(self._odometry)
        self._done.publish(to_cdr(Text(tick)))


class Recorder(Answerer):
    """Takes the clock and every pose, and keeps nothing."""

    def __init__(self, vehicles: int) -> None:
        super().__init__(_RECORDER)
        self.listen(CLOCK, bytes, self._take)
        for name in _vehicles(vehicles):
            self.listen(ODOM, bytes, self._take, f'/{name}')

    def _take(self, cdr: bytes) -> None:
        pass


def bare_ticks_per_s(vehicles: int, ticks: int) -> float:
    """
    Return the ticks per second of a bare barrier, on a graph of its own.

    Raises
    ------
    RuntimeError
        It did not come to its end.

    """
    names = (*_vehicles(vehicles), _STATION, _RECORDER, _CONDUCTOR)
    with TemporaryDirectory() as logs, domain_id() as domain:
        environment = os.environ | graph_environment(domain, Path(logs))
        processes = []
        try:
            for name in names:
                words = [sys.executable, '-m', 'c3_station.bare_barrier_node', name]
                log = Path(logs) / f'{name}.log'
                command = [*words, str(vehicles), str(ticks)]
                processes.append(NodeProcess(name, command, environment, log))
            conductor = processes[-1]
            if conductor.wait(_TIMEOUT_S) != 0:
                raise RuntimeError(f'the bare barrier ended with {conductor.last_lines(3)}')
            return float(conductor.last_lines(1)[0])
        finally:
            stop_all(processes)


def _vehicles(count: int) -> list[str]:
    return [f'vehicle_{number}' for number in range(1, count + 1)]


def _node(name: str, vehicles: int, ticks: int) -> HostedNode:
    match name:
        case 'conductor':
            return Conductor(vehicles, ticks)
        case 'recorder':
            return Recorder(vehicles)
        case _:
            return Answerer(name)


def main(arguments: list[str]) -> int:
    """Run one node: its name, the number of vehicles, the number of ticks."""
    name, vehicles, ticks = arguments
    return run(lambda: [_node(name, int(vehicles), int(ticks))])


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
