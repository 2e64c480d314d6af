"""
``orchestrate.py bench week``: whether anything grows while a mission goes on and on.

Gliders survey a shelf for a week of simulated time on a radio that loses, on the ROS graph. By
the second day everything is loaded and has been used; from then on memory is to stay flat.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
from rich.console import Console

from c3_station.bench_figure import Figure, at_most
from c3_station.bench_flight import fly_for_bench
from c3_station.mission_monitor import MissionMonitor
from c3_station.run_folder import RunFolder
from c3_station.scenario import Auv, Radio, Scenario, Sortie, Uav
from c3_station.scenario_files import load_scenario
from msgs_json.geometry import GridSpec, Point

DAY_S = 86_400.0
_DAYS = 7
_FROM_DAY = 2
_AIM = 1.1

_NAMESPACE = re.compile(rb'__ns:=/(\w+)')


@dataclass(slots=True, kw_only=True)
class Growth:
    """What a mission's nodes hold at the beginning of each simulated day, counted from 0."""

    memory_bytes: list[Mapping[str, int]] = field(default_factory=list)
    """Resident set by node."""
    stored_bytes: list[Mapping[str, int]] = field(default_factory=list)
    """By file of an agent's store."""

    def of(self, days: list[Mapping[str, int]], name: str) -> float:
        """Return what a node holds at the end, over what it held when all was in use."""
        return days[-1][name] / days[_FROM_DAY][name]


def bench_week(console: Console) -> Iterator[Figure]:
    """Return the figures."""
    growth = watch_growth(week_scenario(), DAY_S)
    memory, stored = growth.memory_bytes, growth.stored_bytes
    by_node = {name: growth.of(memory, name) for name in memory[-1]}
    most = max(by_node, key=lambda name: by_node[name])
    what = f'memory on day {len(memory) - 1} over day {_FROM_DAY}, most: {most}'
    yield at_most(what, [by_node[most]], _AIM)
    for name, ratio in by_node.items():
        yield Figure(what=f'memory, {name}', value=f'{ratio:.3f}, {memory[-1][name] >> 20} MiB')
    for name in stored[-1]:
        sizes = ', '.join(f'{day.get(name, 0) / 1024:.0f}' for day in stored)
        yield Figure(what=f'{name}, KiB by day', value=sizes)


def week_scenario() -> Scenario:
    """Return a mission that lasts longer than a week, with a hard stop at its end."""

    def glider(name: str, col: int, **surfacing: object) -> Auv:
        return Auv(
            name=name, speed_mps=0.25, initial_path=((col, 5), (col + 1, 5)), surfacing=surfacing
        )

    return msgspec.structs.replace(
        load_scenario('ecc2009'),
        name='week',
        description='Three gliders on 15 km x 15 km, for a week',
        region=GridSpec(cols=30, rows=30, cell_m=500.0),
        c3=Point(east_m=7500.0, north_m=0.0),
        uav=Uav(speed_mps=5.0),
        auvs=(
            glider('auv_1', 5, model='early', probability=0.05),
            glider('auv_2', 15, model='slow', least_factor=0.7),
            glider('auv_3', 24, model='early', probability=0.05),
        ),
        radio=Radio(range_m=1000.0, loss=0.2, duplicates=0.05, corruption=0.02),
        sortie=Sortie(limit_s=28_800.0, surface_margin_s=3600.0, handover_s=300.0),
        planner=msgspec.structs.replace(load_scenario('ecc2009').planner, name='robust'),
        tick_s=60.0,
        max_mission_s=_DAYS * DAY_S + 3600.0,
    )


def watch_growth(scenario: Scenario, day_s: float) -> Growth:
    """Fly a mission over the ROS graph and look at its nodes once a day."""
    growth = Growth()

    def look(folder: RunFolder, monitor: MissionMonitor) -> None:
        if monitor.ticking and monitor.now_s >= len(growth.memory_bytes) * day_s:
            growth.memory_bytes.append(_resident_bytes())
            growth.stored_bytes.append(
                {path.name: path.stat().st_size for path in sorted(folder.stores.iterdir())}
            )

    fly_for_bench(scenario, look)
    return growth


def _resident_bytes() -> Mapping[str, int]:
    """Return the resident set of every node that this process has started (Linux)."""
    resident = {}
    for task in Path('/proc/self/task').iterdir():
        for pid in (task / 'children').read_text().split():
            process = Path('/proc') / pid
            node = _NAMESPACE.search((process / 'cmdline').read_bytes())
            lines = (process / 'status').read_text().splitlines()
            sizes = [int(line.split()[1]) for line in lines if line.startswith('VmRSS:')]
            if node is not None and sizes:  # a process that has just ended has none
                resident[node[1].decode()] = 1024 * sizes[0]
    return resident
