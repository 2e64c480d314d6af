"""
``orchestrate.py bench planners``: all planners over all families of scenarios.

Every planner flies the same missions. That a region is not explored by the hard stop, that a
planner refuses a mission, that its process dies: all of that is a result.
"""

from __future__ import annotations

import itertools
import math
import os
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
)

from c3_station.bench_families import FAMILIES, family_scenario
from c3_station.bench_mission import fly_each
from c3_station.bench_planners_report import write_planners_report
from c3_station.bench_planners_table import print_blocks, print_verdicts
from c3_station.bench_statistics import Attempt, blocks_of, verdicts_of
from c3_station.campaign_plan import MissionJob
from c3_station.interrupts import interruptible
from c3_station.scenario_files import scenario_json
from c3_station.shape_checks import nearest
from c3_station.software import this_software
from uav_planner.planners import PLANNERS

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from rich.console import Console

    from c3_station.bench_families import Family
    from c3_station.bench_mission import TimedMission

_RUNS = Path('runs')
_SEEDS = 3
"""Enough to see what hangs on where AUVs are put in; a campaign tells about thousands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannersOptions:
    """What to fly, and where to; None for the usual."""

    families: tuple[str, ...] | None = None
    """All."""
    planners: tuple[str, ...] | None = None
    """All, the baselines first."""
    seeds: int | None = None
    """Missions of each family, seeds 0 and up; one of those that are all the same, or long."""
    out: Path | None = None
    """A new folder in ``runs``."""
    processes: int | None = None
    """One per core."""


def bench_planners(
    options: PlannersOptions, console: Console, families: Sequence[Family] = FAMILIES
) -> None:
    """
    Fly all missions, print the table, and write it with its figures to a folder.

    Raises
    ------
    ValueError
        There is no such family or planner, or the folder cannot be written.

    """
    by_name = {family.name: family for family in families}
    chosen = [by_name[name] for name in _named('--families', options.families, by_name)]
    # The one that is to beat the others comes last.
    planners = _named('--planners', options.planners, sorted(PLANNERS, key='adaptive'.__eq__))
    folder = _made(options.out)
    cores = len(os.sched_getaffinity(0))
    attempts = fly_attempts(
        chosen, planners, options.seeds or _SEEDS, options.processes or cores, console
    )
    blocks = blocks_of(attempts)
    print_blocks(blocks, console)
    print_verdicts(verdicts_of(blocks), console)
    report = write_planners_report(folder, blocks)
    console.print(f'report: {report}', highlight=False, soft_wrap=True)


def fly_attempts(
    families: Sequence[Family],
    planners: Sequence[str],
    seeds: int,
    processes: int,
    console: Console,
) -> list[Attempt]:
    """Return all missions, flown, family by family and planner by planner."""
    software = this_software()
    missions = [
        (family, planner, seed)
        for family in families
        for planner in planners
        for seed in range(family.missions(seeds))
    ]
    stops_s: dict[int, float] = {}
    refusals: dict[int, str] = {}
    jobs: list[MissionJob] = []
    for number, (family, planner, seed) in enumerate(missions):
        try:
            scenario = family_scenario(family, seed, planner)
        except ValueError as error:
            refusals[number] = ' '.join(str(error).split())
            continue
        stops_s[number] = scenario.max_mission_s
        job_json = scenario_json(scenario).decode()
        jobs.append(
            MissionJob(number=number, software=software, scenario_json=job_json, seed=seed)
        )
    flown: dict[int, TimedMission] = {}
    with interruptible() as look, _progress_bar(console, len(jobs)) as show:

        def take(mission: TimedMission) -> None:
            flown[mission.result.number] = mission
            show()

        # The long ones first, so that no process is left with one of them at the end.
        fly_each(jobs[::-1], processes, take, look)
    return [
        Attempt(
            family=family,
            planner=planner,
            seed=seed,
            stop_s=stops_s.get(number, math.inf),
            refusal=refusals.get(number),
            flown=flown.get(number),
        )
        for number, (family, planner, seed) in enumerate(missions)
    ]


@contextmanager
def _progress_bar(console: Console, total: int) -> Iterator[Callable[[], None]]:
    """Show a bar, or a line for every tenth mission in a log; yields what to call for each."""
    if not console.is_terminal:
        numbers = itertools.count(1)

        def count() -> None:
            number = next(numbers)
            if number % 10 == 0 or number == total:
                console.print(f'{number} of {total} missions', highlight=False)

        yield count
        return
    with Progress(
        TextColumn('missions'),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    ) as progress:
        task = progress.add_task('', total=total)
        yield lambda: progress.advance(task)


def _named(option: str, asked: Sequence[str] | None, known: Collection[str]) -> tuple[str, ...]:
    """Return the names that were asked for, all that are known if none were."""
    for name in asked or ():
        if name not in known:
            raise ValueError(
                f'{option}: there is no {name!r}{nearest(name, known)};'
                f' allowed: {", ".join(known)}'
            )
    return tuple(dict.fromkeys(asked or known))


def _made(out: Path | None) -> Path:
    """Return the folder to write to, which is there then."""
    # Local time: a person looks for "the table of this morning".
    now = datetime.now(UTC).astimezone()
    folder = out or _RUNS / f'planners-{now:%Y%m%d-%H%M%S-%f}'
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f'--out {folder}: cannot be made, {error.strerror}') from None
    return folder
