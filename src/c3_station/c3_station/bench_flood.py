"""
``orchestrate.py bench flood``: forged and malformed messages, as fast as they come.

They must not change a mission, and not slow it down to less than half. In one process agents get
them from memory, and what it takes to forge them is left out. On the graph a process of its own
publishes them, with a share of the machine.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import msgspec
import numpy as np
from rich.console import Console

from auv_sim.kernel import run_mission
from auv_sim.world_params import make_world
from c3_station.bench_figure import Figure, at_least
from c3_station.bench_flight import BenchFlight, fly_for_bench
from c3_station.forgeries import Stranger
from c3_station.in_process import in_memory, make_agents
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import C3, UAV, mission_params
from c3_station.processes import NodeProcess, stop_all
from c3_station.run_folder import RunFolder
from c3_station.scenario import Scenario
from c3_station.scenario_files import load_scenario, with_choices
from c3_station.summary import Summarizer, Summary, course
from msgs_json.agent_shell import AgentShell, Frame
from msgs_json.ros_messages import ClockTime, Text
from msgs_json.topics import RADIO_RX

_FORGED = 10_000
_PER_TICK = 20
_AIM = 0.5
_PAIRS = 5
_ROS_PAIRS = 3
_ROS_TICK_S = 0.1
"""So that a mission lasts as long as it takes to say so many messages."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FloodedFlight:
    """A mission in one process, and what became of the forged messages."""

    summary: Summary
    processor_s: float
    said: int
    refused: int


def bench_flood(console: Console) -> Iterator[Figure]:
    """Return the figures."""
    yield from _in_process(load_scenario('ecc2009'))
    scenario = with_choices(load_scenario('ecc2009'), planner='robust')
    yield from _on_ros(msgspec.structs.replace(scenario, tick_s=_ROS_TICK_S))


# --- in one process ------------------------------------------------------------------------------


def _in_process(scenario: Scenario) -> Iterator[Figure]:
    fly_flooded(scenario, 0)  # fills caches (walk tables, drivers)
    pairs = [(fly_flooded(scenario, 0), fly_flooded(scenario, _FORGED)) for _ in range(_PAIRS)]
    calm, flooded = pairs[0]
    yield Figure(
        what=f'in one process: obeyed, of {flooded.said:,} forged messages',
        value=f'{flooded.said - flooded.refused}',
        aim='0 of 10,000',
        met=flooded.said == flooded.refused == _FORGED,
    )
    is_same = course(calm.summary) == course(flooded.summary)
    yield Figure(
        what='the mission, beside the one without',
        value='the same' if is_same else 'another one',
        aim='the same',
        met=is_same,
    )
    yield at_least(
        f'tick rate with {_PER_TICK} of them a tick over that without',
        [calm.processor_s / flooded.processor_s for calm, flooded in pairs],
        _AIM,
    )


def fly_flooded(scenario: Scenario, forged: int) -> FloodedFlight:
    """Fly a mission in this process in which agents hear so many forged messages."""
    params = mission_params(scenario)
    agents = make_agents(params, in_memory())
    flood = _Flood(agents, forged)
    began_s = process_time()
    run_mission(make_world(params.world), agents, flood.pass_on)
    processor_s = process_time() - began_s - flood.forging_s
    summarizer = Summarizer()
    for name, frame in flood.frames:
        summarizer.frame(name, frame)
    return FloodedFlight(
        summary=summarizer.summary(),
        processor_s=processor_s,
        said=flood.said,
        refused=sum(sum(agent.refused.values()) for agent in agents.values()),
    )


class _Flood:
    """Takes what is published in a mission, and hands its agents forged messages at each tick."""

    def __init__(self, agents: Mapping[str, AgentShell], forged: int) -> None:
        self.frames: list[tuple[str, Frame]] = []
        self.forging_s = 0.0
        self.said = 0
        self._agents = agents
        self._names = tuple(agents)
        self._forged = forged
        self._rng = np.random.default_rng(_FORGED)
        self._stranger: Stranger | None = None

    def pass_on(self, name: str, frame: Frame) -> None:
        """Keep a frame; overhear it, if it came through by radio; speak when the clock ticks."""
        self.frames.append((name, frame))
        if isinstance(frame.message, ClockTime):
            self._say(frame.message.time_s)
        elif frame.topic is RADIO_RX and isinstance(frame.message, Text) and self._forged:
            self._hear(frame.message.data)

    def _hear(self, payload: bytes) -> None:
        began_s = process_time()
        self._stranger = self._stranger or Stranger(self._rng)
        self._stranger.hear(payload)
        self.forging_s += process_time() - began_s

    def _say(self, now_s: float) -> None:
        if self._stranger is None:
            return
        began_s = process_time()
        count = min(_PER_TICK, self._forged - self.said)
        forgeries = list(self._stranger.forgeries(count))
        receivers = self._rng.integers(len(self._names), size=count).tolist()
        self.forging_s += process_time() - began_s
        for forgery, receiver in zip(forgeries, receivers, strict=True):
            name = self._names[receiver]
            frames = self._agents[name].receive(forgery.payload, now_s)
            self.frames += [(name, frame) for frame in frames]
            self.said += 1


# --- over the ROS graph --------------------------------------------------------------------------


def _on_ros(scenario: Scenario) -> Iterator[Figure]:
    pairs = [(fly_for_bench(scenario), fly_beside_stranger(scenario)) for _ in range(_ROS_PAIRS)]
    said = min(said for _, (_, said) in pairs)
    yield Figure(
        what='on ROS: forged messages that were published',
        value=f'{said:,}',
        aim=f'>= {_FORGED:,}',
        met=said >= _FORGED,
    )
    summaries = [flooded.summary for _, (flooded, _) in pairs]
    lost = sum(summary.samples_lost or 0 for summary in summaries)
    over = sum(summary.sortie_limit_violations for summary in summaries)
    yield Figure(
        what='samples lost, sorties over L, missions not completed',
        value=f'{lost}, {over}, {sum(not summary.complete for summary in summaries)}',
        aim='0, 0, 0',
        met=lost == over == 0 and all(summary.complete for summary in summaries),
    )
    yield at_least(
        'tick rate while they are published over that without',
        [flooded.real_time_factor / calm.real_time_factor for calm, (flooded, _) in pairs],
        _AIM,
    )


def fly_beside_stranger(scenario: Scenario) -> tuple[BenchFlight, int]:
    """Fly a mission with a stranger on its graph; return how much that has said, too."""
    agents = (*(auv.name for auv in scenario.auvs), UAV, C3)
    strangers: list[NodeProcess] = []
    with tempfile.TemporaryDirectory() as logs:
        command = [sys.executable, '-m', 'c3_station.stranger_node', *agents]

        def look(folder: RunFolder, monitor: MissionMonitor) -> None:
            if not strangers:  # it comes up while the nodes do
                log = Path(logs) / 'stranger.log'
                strangers.append(NodeProcess('stranger', command, os.environ, log))

        try:
            flown = fly_for_bench(scenario, look)
        finally:
            stop_all(strangers)
        said = [int(stranger.last_lines(1)[0]) for stranger in strangers]
    return flown, sum(said)
