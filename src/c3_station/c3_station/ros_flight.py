"""A mission flown by ROS 2 nodes: starts them, watches over them, ends them."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic

from domain_coordinator import domain_id

from auv_sim.world import WORLD
from c3_station.faults_on_ros import RosFaults
from c3_station.flight import Flight
from c3_station.graph import RECORDER, NodeSpec, mission_nodes, write_params
from c3_station.mission_monitor import MissionMonitor
from c3_station.observer_node import Observer
from c3_station.processes import NodeProcess, executable, how_it_ended, stop_all
from c3_station.ros_environment import graph_environment
from c3_station.run_folder import RunFolder
from c3_station.scenario import Faults, OnDeath, Scenario
from msgs_json.messages import Waiting
from msgs_json.node_exit import NodeExit

_POLL_S = 0.05
_LOOK_EVERY_S = 0.5
_REPLY_TIMEOUT_S = 5.0
"""A node on this machine answers within milliseconds; a loaded machine may take a second."""
_LOG_LINES = 5

DEATHS_MAX = 5
DEATHS_WITHIN_S = 60.0
"""A node that dies more often than so many times within this wall time is not started again."""


def fly_on_ros(
    scenario: Scenario,
    folder: RunFolder,
    monitor: MissionMonitor,
    *,
    rate: float,
    bag: bool,
    refresh: Callable[[], None],
    before: Path | None = None,
) -> Flight:
    """
    Fly a mission on a ROS graph of its own and return when all its processes have ended.

    The graph has a domain id that no other run on this machine uses, and stays on loopback.
    ``refresh`` is called several times a second, after the monitor was brought up to date. Where
    the folder has stores of the mission's agents it goes on from there; ``before`` is what was
    recorded until then.
    """
    with domain_id() as domain:
        os.environ.update(graph_environment(domain, folder.logs))
        monitor.domain_id = domain
        nodes = mission_nodes(scenario, bag=bag)
        write_params(
            scenario,
            folder.params,
            rate=rate,
            bag=folder.bag if bag else None,
            reply_timeout_s=_REPLY_TIMEOUT_S,
            stores=folder.stores,
            key=folder.key,
            before=before,
            restarted=tuple(
                agent
                for node in nodes
                if node.on_death is OnDeath.RESTART
                for agent in node.agents
            ),
        )
        watch = _Watch(folder, monitor, refresh)
        faults = RosFaults(scenario, domain, watch.process_of)
        has_faults = scenario.faults != Faults()
        folder.domain.write_text(f'{domain}\n')
        try:
            for node in nodes:
                watch.start(node)
            observer = Observer(
                domain, monitor, every_tick=rate > 0 or has_faults, heed=watch.heed
            )
            try:
                watch.until_the_world_ends(observer, faults)
            finally:
                observer.close()
        finally:
            folder.domain.unlink(missing_ok=True)  # commands find no mission from now on
            faults.close()
            watch.stop()
        return watch.flight


@dataclass(slots=True)
class _Node:
    """One node of the graph, in its present process."""

    spec: NodeSpec
    process: NodeProcess
    deaths_s: deque[float] = field(default_factory=lambda: deque(maxlen=DEATHS_MAX))
    """The latest."""
    is_given_up: bool = False
    """It is dead, and is not started again."""


class _Watch:
    """Looks after the processes of a flight."""

    def __init__(
        self, folder: RunFolder, monitor: MissionMonitor, refresh: Callable[[], None]
    ) -> None:
        self.flight = Flight()
        self._folder = folder
        self._nodes: dict[str, _Node] = {}
        self._monitor = monitor
        self._refresh = refresh
        self._began_s = monotonic()
        self._looked_s = self._began_s
        self._is_hopeless = False
        """The world waits for somebody who does not come back."""

    def start(self, spec: NodeSpec) -> None:
        """Start a node."""
        self._nodes[spec.name] = _Node(spec, _start(spec, self._folder))

    def process_of(self, agent: str) -> NodeProcess:
        """Return the present process of an agent."""
        return next(n.process for n in self._nodes.values() if agent in n.spec.agents)

    def until_the_world_ends(self, observer: Observer, faults: RosFaults) -> None:
        """Listen and watch until the world node ends, or the mission cannot begin or go on."""
        world = self._nodes[WORLD].process
        while world.exit_code() is None:
            observer.spin(_POLL_S)
            self._note_first_tick()
            self._look_for_the_dead()
            faults.strike(self._monitor.now_s)
            self._note_memory()
            self._refresh()
            if self._is_hopeless or (self.flight.problem and self.flight.first_tick_s is None):
                return
        observer.spin(_POLL_S)
        self._look_for_the_dead()
        self._refresh()

    def heed(self, waiting: Waiting) -> None:
        """Kill nodes that hang, so that they are started again; the world waits for them."""
        for node in self._nodes.values():
            lives = [waiting.lives[name] for name in node.spec.agents if name in waiting.lives]
            if lives and node.is_given_up:
                self._is_hopeless = True
            # Where the world waits for the process before, this one is just coming up.
            elif (
                lives
                and node.spec.on_death is OnDeath.RESTART
                and max(lives) >= node.process.started_us
                and node.process.exit_code() is None
            ):
                self._monitor.note(f'{node.spec.name} hangs: {waiting.problem}')
                node.process.send(signal.SIGKILL)

    def stop(self) -> None:
        """End the processes: the world first, which says why, and the recorder last."""
        last = (WORLD, RECORDER)
        others = [node.process for name, node in self._nodes.items() if name not in last]
        world, recorder = (
            [self._nodes[name].process] if name in self._nodes else [] for name in last
        )
        with _undisturbed():
            for group in (world, others, recorder):
                stop_all(group)

    def _note_first_tick(self) -> None:
        if self.flight.first_tick_s is None and self._monitor.ticking:
            self.flight.first_tick_s = monotonic() - self._began_s

    def _look_for_the_dead(self) -> None:
        """Start nodes again that ended without being asked, or note why that is no use."""
        is_over = self._nodes[WORLD].process.exit_code() is not None
        for name, node in self._nodes.items():
            code = node.process.exit_code()
            if code is None or (name == WORLD and code == 0) or node.is_given_up:
                continue
            if node.spec.on_death is OnDeath.RESTART and not is_over:
                self._restart(node, code)
            else:
                self._give_up(node, how_it_ended(code))

    def _restart(self, node: _Node, code: int) -> None:
        name, now_s = node.spec.name, monotonic()
        if code == NodeExit.BAD_PARAMETERS:
            self._give_up(node, how_it_ended(code))
            return
        if len(node.deaths_s) == DEATHS_MAX and now_s - node.deaths_s[0] < DEATHS_WITHIN_S:
            often = f'for the {DEATHS_MAX + 1}th time within {DEATHS_WITHIN_S:g} s'
            self._give_up(node, f'{how_it_ended(code)} {often}')
            return
        node.deaths_s.append(now_s)
        restarts = self.flight.restarts.get(name, 0) + 1
        self.flight.restarts[name] = restarts
        self._monitor.note(f'{name} {how_it_ended(code)}, restarted ({restarts})')
        node.process = _start(node.spec, self._folder)

    def _give_up(self, node: _Node, how: str) -> None:
        """Note who is to blame; the world names it and ends, too."""
        node.is_given_up = True
        process = node.process
        told = ''.join(f'\n    {line}' for line in process.last_lines(_LOG_LINES))
        problem = f'{node.spec.name} {how}; the end of {process.log}:{told}'
        self.flight.problem = self.flight.problem or problem

    def _note_memory(self) -> None:
        if monotonic() - self._looked_s < _LOOK_EVERY_S:
            return
        self._looked_s = monotonic()
        peaks = self.flight.peak_memory_bytes
        for name, node in self._nodes.items():
            peaks[name] = max(peaks.get(name, 0), node.process.peak_memory_bytes() or 0)


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
    log = folder.logs / f'{node.name}.log'
    return NodeProcess(node.name, command, os.environ, log, keeps=folder.lock_files)
