"""
The fault suite: a table of faults, each flown over the same seeds, and what was promised for all.

A row is a case of a campaign, so that workers, store and resuming are those of campaigns.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING

from c3_station.campaign_mission import MissionExit
from c3_station.campaign_plan import Campaign, run_arguments
from c3_station.campaign_plan import case as campaign_case
from c3_station.program import command_line
from c3_station.scenario import C3, UAV
from c3_station.scenario_changes import read_change
from c3_station.scenario_files import load_scenario, with_choices
from c3_station.software import this_software

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from c3_station.campaign_mission import MissionResult
    from c3_station.scenario import Scenario

_SLOW_HANDOVER_S = 4.0
"""What a hand-over takes where each of its four frames is on its way for a tick of a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A line of the table."""

    name: str
    changes: tuple[str, ...] = ()
    """What is changed in the scenario, ``KEY=VALUE`` each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What the missions of a row came to."""

    row: Row
    results: Sequence[MissionResult]
    explored_s: float | None
    """Median over the missions that explored their region."""
    explored_ratio: float | None
    """Median of explored time over that of the same seed without faults."""
    worst: str
    """The line that flies the mission to look at first: a broken promise, or the longest."""

    @property
    def broken(self) -> Sequence[MissionResult]:
        """Return the missions that did not keep what is promised."""
        return [result for result in self.results if not keeps_promises(result)]


def rows_of(scenario: Scenario) -> tuple[Row, ...]:
    """Return the table for a scenario; its first row has no fault."""
    auvs = ', '.join(auv.name for auv in scenario.auvs)
    first = scenario.auvs[0].name
    limit_s = scenario.sortie.limit_s + _SLOW_HANDOVER_S * len(scenario.auvs)
    slow = (f'sortie.limit_s={limit_s:g}', f'sortie.handover_s={_SLOW_HANDOVER_S:g}')
    return (
        Row(name='no fault'),
        Row(name='AUVs killed', changes=('faults.kills=20', f'faults.nodes=[{auvs}]')),
        Row(name='UAV killed', changes=('faults.kills=20', f'faults.nodes=[{UAV}]')),
        Row(name='C3 killed', changes=('faults.kills=20', f'faults.nodes=[{C3}]')),
        Row(name='all killed', changes=('faults.kills=50',)),
        Row(name='nodes hang', changes=('faults.hangs=10',)),
        Row(name='loss 10 %', changes=('radio.loss=0.1',)),
        Row(name='loss 30 %', changes=('radio.loss=0.3',)),
        Row(name='loss 60 %', changes=('radio.loss=0.6',)),
        Row(name='loss in bursts', changes=('radio.bursts={good_s: 30, bad_s: 10}',)),
        Row(
            name='bandwidth starved',
            changes=(*slow, 'radio.max_message_bytes=1000', 'radio.bytes_per_s=1000'),
        ),
        Row(
            name='latency and jitter',
            changes=(*slow, 'radio.latency_s=0.3', 'radio.jitter_s=0.7'),
        ),
        Row(
            name='duplicates, reordered',
            changes=(*slow, 'radio.duplicates=0.3', 'radio.jitter_s=1'),
        ),
        Row(name='corruption 20 %', changes=('radio.corruption=0.2',)),
        Row(
            name='one-way link',
            changes=(
                f'radio.links=[{{from: {UAV}, to: {first}, bursts: {{good_s: 120, bad_s: 60}}}}]',
            ),
        ),
        Row(name='10,000 forged', changes=('faults.forged=10000',)),
        Row(name='disk full', changes=('faults.disk_full_s=60',)),
        Row(name='clock jumps', changes=('faults.clock_jump_s=300', 'faults.kills=10')),
        Row(name='cell off by one', changes=(f'faults.off_by_one={first}',)),
        Row(
            name='all of it',
            changes=(
                'faults.kills=20',
                'faults.hangs=5',
                'faults.forged=1000',
                'faults.disk_full_s=20',
                'faults.clock_jump_s=60',
                'radio.loss=0.1',
                'radio.duplicates=0.1',
                'radio.corruption=0.05',
            ),
        ),
    )


def rows_for_nodes(scenario: Scenario) -> tuple[Row, ...]:
    """
    Return the rows that nodes fly: faults that strike processes and topics.

    Nobody is killed more than five times: a node that dies more often within a minute is given up.
    """
    names = [auv.name for auv in scenario.auvs]
    auvs = ', '.join(names)
    return (
        Row(name='no fault'),
        Row(
            name='AUVs killed',
            changes=(f'faults.kills={2 * len(names)}', f'faults.nodes=[{auvs}]'),
        ),
        Row(name='UAV killed', changes=('faults.kills=4', f'faults.nodes=[{UAV}]')),
        Row(name='C3 killed', changes=('faults.kills=4', f'faults.nodes=[{C3}]')),
        Row(name='all killed', changes=(f'faults.kills={2 * len(names) + 4}',)),
        Row(name='nodes hang', changes=('faults.hangs=2',)),
        Row(name='1,000 forged', changes=('faults.forged=1000',)),
        Row(name='disk full', changes=('faults.disk_full_s=60',)),
    )


def plan_table(name: str, planner: str, rows: Sequence[Row], missions: int) -> Campaign:
    """
    Return the campaign that flies so many missions for each row, seed by seed.

    Raises
    ------
    ValueError
        There is no such scenario or planner, or a row is no mission.

    """
    scenario = with_choices(load_scenario(name), seed=0)
    return Campaign(
        software=this_software(),
        first_seed=0,
        seeds=missions,
        cases=tuple(
            campaign_case(name, scenario, [read_change(text) for text in row.changes], planner)
            for row in rows
        ),
    )


def keeps_promises(result: MissionResult) -> bool:
    """Return whether a mission ended by name, in time, with every sample, obeying nobody else."""
    return (
        result.exit is not MissionExit.ERROR
        and (result.exit is MissionExit.COMPLETE or result.reason is not None)
        and not (result.violations or result.samples_lost or result.samples_doubled)
        and not result.obeyed
    )


def outcomes(
    campaign: Campaign, rows: Sequence[Row], results: Iterable[MissionResult], *how: str
) -> tuple[Outcome, ...]:
    """Return what each row came to, as far as it is flown; ``how`` are options of ``run``."""
    by_row: list[dict[int, MissionResult]] = [{} for _ in rows]
    for result in results:
        index, seed = campaign.place(result.number)
        by_row[index][seed] = result
    calm = by_row[0]
    return tuple(
        Outcome(
            row=row,
            results=tuple(flown.values()),
            explored_s=_median(result.explored_s for result in flown.values()),
            explored_ratio=_median(
                _ratio(result, calm[seed]) for seed, result in flown.items() if seed in calm
            ),
            worst=_line(campaign, max(flown.values(), key=_badness), how or ('--no-ros',)),
        )
        for row, flown in zip(rows, by_row, strict=True)
        if flown
    )


def _ratio(result: MissionResult, calm: MissionResult) -> float | None:
    if result.explored_s is None or calm.explored_s is None:
        return None
    return result.explored_s / calm.explored_s


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None


def _badness(result: MissionResult) -> tuple[bool, bool, float]:
    return not keeps_promises(result), result.explored_s is None, result.explored_s or 0.0


def _line(campaign: Campaign, result: MissionResult, how: Sequence[str]) -> str:
    index, seed = campaign.place(result.number)
    return command_line(*run_arguments(campaign.cases[index], seed), *how)
