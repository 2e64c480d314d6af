"""A mission flown by ROS 2 nodes: starts them, watches over them, ends them."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from domain_coordinator import domain_id

from auv_sim.world import WORLD
from c3_station.flight import Flight
from c3_station.graph import RECORDER, NodeSpec, mission_nodes, write_params
from c3_station.mission_monitor import MissionMonitor
from c3_station.observer_node import Observer
from c3_station.processes import NodeProcess, executable, how_it_ended, stop_all
from c3_station.ros_environment import graph_environment
from c3_station.run_folder import RunFolder
from c3_station.scenario import Scenario

_POLL_S = 0.05
_LOOK_EVERY_S = 0.5
_REPLY_TIMEOUT_S = 5.0
"""A node on this machine answers within milliseconds; a loaded machine may take a second."""
_LOG_LINES = 5


def fly_on_ros(
    scenario: Scenario,
    folder: RunFolder,
    monitor: MissionMonitor,
    *,
    rate: float,
    bag: bool,
    refresh: Callable[[], None],
) -> Flight:
    """
    Fly a mission on a ROS graph of its own and return when all its processes have ended.

    The graph has a domain id that no other run on this machine uses, and stays on loopback.
    ``refresh`` is called several times a second, after the monitor was brought up to date.
    """
    with domain_id() as domain:
        os.environ.update(graph_environment(domain, folder.logs))
        monitor.domain_id = domain
        folder.domain.write_text(f'{domain}\n')
        nodes = mission_nodes(scenario, bag=bag)
        write_params(
            scenario,
            folder.params,
            rate=rate,
            bag=folder.bag if bag else None,
            reply_timeout_s=_REPLY_TIMEOUT_S,
            stores=folder.stores,
            key=folder.key,
        )
        watch = _Watch(monitor, refresh)
        try:
            for node in nodes:
                watch.processes[node.name] = _start(node, folder)
            observer = Observer(domain, monitor, every_tick=rate > 0)
            try:
                watch.until_the_world_ends(observer)
            finally:
                observer.close()
        finally:
            watch.stop()
        return watch.flight


class _Watch:
    """Looks after the processes of a flight."""

    def __init__(self, monitor: MissionMonitor, refresh: Callable[[], None]) -> None:
        self.flight = Flight()
        self.processes: dict[str, NodeProcess] = {}
        self._monitor = monitor
        self._refresh = refresh
        self._began_s = monotonic()
        self._looked_s = self._began_s
        self._dead: set[str] = set()

    def until_the_world_ends(self, observer: Observer) -> None:
        """Listen and watch until the world node ends, or the mission cannot begin."""
        world = self.processes[WORLD]
        while world.exit_code() is None:
            observer.spin(_POLL_S)
            self._note_first_tick()
            self._look_for_the_dead()
            self._note_memory()
            self._refresh()
            if self.flight.problem and self.flight.first_tick_s is None:
                return
        observer.spin(_POLL_S)
        self._look_for_the_dead()
        self._refresh()

    def stop(self) -> None:
        """End the processes: the world first, which says why, and the recorder last."""
        first = [p for name, p in self.processes.items() if name == WORLD]
        last = [p for name, p in self.processes.items() if name == RECORDER]
        others = [p for p in self.processes.values() if p not in first + last]
        with _undisturbed():
            for group in (first, others, last):
                stop_all(group)

    def _note_first_tick(self) -> None:
        if self.flight.first_tick_s is None and self._monitor.ticking:
            self.flight.first_tick_s = monotonic() - self._began_s

    def _look_for_the_dead(self) -> None:
        """Note a process that ended without being asked; the world names it and ends, too."""
        for name, process in self.processes.items():
            code = process.exit_code()
            if code is None or (name == WORLD and code == 0) or name in self._dead:
                continue
            self._dead.add(name)
            told = ''.join(f'\n    {line}' for line in process.last_lines(_LOG_LINES))
            problem = f'{name} {how_it_ended(code)}; the end of {process.log}:{told}'
            self.flight.problem = self.flight.problem or problem

    def _note_memory(self) -> None:
        if monotonic() - self._looked_s < _LOOK_EVERY_S:
            return
        self._looked_s = monotonic()
        for name, process in self.processes.items():
            peak_bytes = process.peak_memory_bytes()
            if peak_bytes is not None:
                self.flight.peak_memory_bytes[name] = peak_bytes


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Ignore a second Ctrl-C while the nodes end, which takes some seconds at most."""
    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(signum, signal.SIG_IGN) for signum in signals]
    try:
        yield
    finally:
        for signum, handler in zip(signals, before, strict=True):
            signal.signal(signum, handler)


def _start(node: NodeSpec, folder: RunFolder) -> NodeProcess:
    command = [
        str(executable(node.package, node.executable)),
        '--ros-args',
        '-r',
        f'__ns:=/{node.name}',
        '--params-file',
        str(folder.params),
    ]
    return NodeProcess(node.name, command, os.environ, folder.logs / f'{node.name}.log')
