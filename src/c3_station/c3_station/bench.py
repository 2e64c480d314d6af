"""
``orchestrate.py bench``: what this machine makes of it, as ratios taken in one run.

Absolute times say little on a shared machine, so each figure is a quotient of two things that
ran one after the other, or simulated over wall time. The aim beside it is the design's.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter

import msgspec
from rich.console import Console
from rich.table import Table

from c3_station.bare_barrier_node import bare_ticks_per_s
from c3_station.bench_campaign import missions_per_s
from c3_station.bench_custody import bench_custody
from c3_station.bench_figure import Figure, at_least, at_most, number
from c3_station.bench_flight import fly_for_bench
from c3_station.bench_flood import bench_flood
from c3_station.bench_guarantee import print_refusals
from c3_station.bench_planners import PlannersOptions, bench_planners
from c3_station.bench_ties import print_ties
from c3_station.bench_week import bench_week
from c3_station.exit_codes import ExitCode
from c3_station.in_process import fly
from c3_station.scenario import Scenario
from c3_station.scenario_files import load_scenario, with_choices
from msgs_json.agent_shell import Frame
from msgs_json.topics import CLOCK
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planners.ecc2009_oracle import plan_path_by_enumeration
from uav_planner.planning import PlanRequest, PlanResult

_REPEATS = 5
_FLEET_AUVS = 50
_FLEET_MISSION_S = 600.0
_FLEET_LIMIT_S = 300.0
_BARE_TICKS = 2000


def run_benchmarks(
    names: Sequence[str], console: Console, planners: PlannersOptions | None = None
) -> ExitCode:
    """
    Run benchmarks by name (all but those on request if none is named) and print a table.

    ``planners`` are the options of the benchmark of that name.

    Raises
    ------
    ValueError
        There is no benchmark of that name, or it cannot be run with these options.

    """
    for name in names:
        if name not in BENCHMARKS:
            raise ValueError(f'bench: no benchmark {name!r}; there are {", ".join(BENCHMARKS)}')
    chosen = names or [name for name in BENCHMARKS if name not in ON_REQUEST]
    benchmarks = dict(BENCHMARKS)
    if planners is not None:
        if 'planners' not in chosen:
            raise ValueError('bench: these options are for the benchmark planners; name it, too')
        benchmarks['planners'] = partial(_planners, planners)
    missed = False
    for name in chosen:
        table = Table(title=name, title_justify='left', box=None, padding=(0, 3, 0, 0))
        for column in ('figure', 'measured', 'aim', ''):
            table.add_column(column, justify='left')
        with console.status(f'bench {name} ...'):
            figures = list(benchmarks[name](console))
        for figure in figures:
            verdict = {None: '', True: 'met', False: '[bold red]missed[/]'}[figure.met]
            table.add_row(figure.what, figure.value, figure.aim, verdict)
            missed = missed or figure.met is False
        if figures:
            console.print(table)
            console.print()
    return ExitCode.FAILED if missed else ExitCode.OK


# --- (a) in process ------------------------------------------------------------------------------


def _mission_speed(console: Console) -> Iterator[Figure]:
    scenario = load_scenario('ecc2009')
    ratios = []
    for _ in range(_REPEATS + 1):
        mission_s = 0.0

        def note_time(name: str, frame: Frame) -> None:
            nonlocal mission_s
            if frame.topic is CLOCK:
                mission_s += scenario.tick_s

        began_s = perf_counter()
        fly(scenario, note_time)
        ratios.append(mission_s / (perf_counter() - began_s))
    # The first run also fills caches (walk tables, drivers).
    yield at_least('ecc2009 in one process, x real time', ratios[1:], 3000)


# --- (b), (d), (e) over the ROS graph ------------------------------------------------------------


def _lockstep(console: Console) -> Iterator[Figure]:
    scenario = load_scenario('ecc2009')
    yield from _lockstep_figures(scenario, 'ecc2009, 3 AUV processes', aim=300, against_bare=True)
    yield from _lockstep_figures(
        _fleet_scenario(), f'{_FLEET_AUVS} AUVs in fleet processes', aim=30, against_bare=False
    )


def _lockstep_figures(
    scenario: Scenario, what: str, *, aim: float, against_bare: bool
) -> Iterator[Figure]:
    factors, costs = [], []
    for _ in range(_REPEATS if against_bare else 1):
        flown = fly_for_bench(scenario)
        factors.append(flown.real_time_factor)
        if against_bare:  # right after it, so that both meet the same machine
            bare_per_s = bare_ticks_per_s(len(scenario.auvs) + 1, _BARE_TICKS)
            costs.append(bare_per_s * scenario.tick_s / factors[-1])
    yield at_least(f'{what}, x real time', factors, aim)
    if costs:
        yield at_most('cost of a tick over a bare rclpy barrier', costs, 2)
    yield Figure(
        what='start of the first process to first tick',
        value=f'{flown.flight.first_tick_s or 0.0:.1f} s',
    )
    groups: dict[str, list[int]] = {}
    for name, peak_bytes in flown.flight.peak_memory_bytes.items():
        groups.setdefault(re.sub(r'_\d+$', '', name), []).append(peak_bytes)
    for name, peaks in groups.items():
        yield Figure(what=f'peak memory, {name}', value=f'{max(peaks) / 2**20:.0f} MiB')


def _fleet_scenario() -> Scenario:
    """Return fleet_8 with many more AUVs, each on a short path of its own."""
    base = load_scenario('fleet_8')
    template = base.auvs[0]
    region = base.region
    starts = [
        (col, row) for row in range(0, region.rows, 3) for col in range(0, region.cols - 1, 5)
    ]
    auvs = tuple(
        msgspec.structs.replace(
            template, name=f'auv_{number}', initial_path=((col, row), (col + 1, row))
        )
        for number, (col, row) in enumerate(starts[:_FLEET_AUVS], start=1)
    )
    # The hard stop bounds the run. The limit is such that one sortie can go to so many.
    sortie = msgspec.structs.replace(base.sortie, limit_s=_FLEET_LIMIT_S)
    return msgspec.structs.replace(base, auvs=auvs, sortie=sortie, max_mission_s=_FLEET_MISSION_S)


# --- (c) planning --------------------------------------------------------------------------------


class _Notebook(Ecc2009Planner):
    """Plans as ecc2009 does and keeps every request."""

    def __init__(self) -> None:
        super().__init__()
        self.requests: list[PlanRequest] = []

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """Keep the request, with a copy of the map, which goes on changing."""
        self.requests.append(replace(request, values=request.values.copy()))
        return super().plan_path(request)


def _planning(console: Console) -> Iterator[Figure]:
    notebook = _Notebook()
    fly(load_scenario('ecc2009'), lambda name, frame: None, notebook)
    ratios = []
    for request in notebook.requests[:_REPEATS]:
        fast, fast_s = _best_of(3, Ecc2009Planner().plan_path, request)
        plain, plain_s = _best_of(3, plan_path_by_enumeration, request)
        if fast != plain:
            raise ValueError(f'bench: {fast} is not what enumeration finds, {plain}')
        ratios.append(plain_s / fast_s)
    yield at_least(
        'ecc2009 planning at q = 6 over a plain loop over all 4^6 paths, x faster', ratios, 100
    )


def _best_of(
    repeats: int, plan: Callable[[PlanRequest], PlanResult], request: PlanRequest
) -> tuple[PlanResult, float]:
    """Return the plan and the shortest of a few planning times: the one least disturbed."""
    times_s = []
    for _ in range(repeats):
        began_s = perf_counter()
        result = plan(request)
        times_s.append(perf_counter() - began_s)
    return result, min(times_s)


def _campaign(console: Console) -> Iterator[Figure]:
    one, two = missions_per_s(jobs=1), missions_per_s(jobs=2)
    yield Figure(what='missions per second, one process', value=number(one))
    yield Figure(
        what='missions per second, two processes',
        value=number(two),
        aim='>= 8.3 (10,000 in 20 minutes)',
        met=two >= 10_000 / 1200,
    )
    yield Figure(what='two processes over one', value=number(two / one))


def _ties(console: Console) -> Iterator[Figure]:
    for planner in ('ecc2009', 'robust'):
        print_ties(with_choices(load_scenario('ecc2009'), planner=planner), console)
    yield from ()


def _guarantee(console: Console) -> Iterator[Figure]:
    print_refusals(console)
    yield from ()


def _planners(options: PlannersOptions, console: Console) -> Iterator[Figure]:
    bench_planners(options, console)
    yield from ()


BENCHMARKS: Mapping[str, Callable[[Console], Iterator[Figure]]] = {
    'mission': _mission_speed,
    'lockstep': _lockstep,
    'planning': _planning,
    'campaign': _campaign,
    'custody': bench_custody,
    'flood': bench_flood,
    'week': bench_week,
    'ties': _ties,
    'guarantee': _guarantee,
    'planners': partial(_planners, PlannersOptions()),
}
ON_REQUEST = ('week', 'ties', 'guarantee', 'planners')
"""Those that are run only if they are named: they take minutes."""
