"""
What a campaign flies: scenarios, their variations and planners, all on the same seeds.

Every scenario in every variation with every planner is a case. Each case is flown once per seed,
so planners and variations are compared on equal draws. Missions are numbered from 1: seed by seed,
and within a seed case by case, so that a campaign that is broken off has flown all cases alike.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Annotated

import msgspec

from c3_station.scenario_changes import Change, read_change
from c3_station.scenario_files import (
    load_scenario,
    scenario_from_json,
    scenario_json,
    with_choices,
)
from c3_station.software import this_software

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from c3_station.scenario import Scenario

_CHOSEN_ELSEWHERE = {'seed': '--seed', 'planner.name': '--planner', 'planner': '--planner'}
"""Keys that every case sets itself."""


class Case(msgspec.Struct, frozen=True, kw_only=True):
    """A scenario in one variation with one planner."""

    scenario: str
    """As named on the command line: a shipped one or a file."""
    changes: tuple[str, ...]
    """``KEY=VALUE`` each; empty for the scenario as it is."""
    planner: str
    scenario_json: str
    """The scenario that comes of it, with the first seed."""

    @property
    def variation(self) -> str:
        """Return the changes in a line."""
        return _in_a_line(self.changes)


class Campaign(msgspec.Struct, frozen=True, kw_only=True):
    """All missions to be flown."""

    software: str
    """Which code flies them: results of two are not mixed."""
    first_seed: Annotated[int, msgspec.Meta(ge=0)]
    seeds: Annotated[int, msgspec.Meta(ge=1)]
    """How many missions each case has: seeds ``first_seed`` and up."""
    cases: tuple[Case, ...]

    @property
    def missions_total(self) -> int:
        """Return the number of missions; it is the last one's number, too."""
        return self.seeds * len(self.cases)

    def place(self, number: int) -> tuple[int, int]:
        """Return which case (its index) a mission flies and with which seed."""
        seed_index, case_index = divmod(number - 1, len(self.cases))
        return case_index, self.first_seed + seed_index

    def job(self, number: int) -> MissionJob:
        """Return all that is needed to fly a mission."""
        case, seed = self.place(number)
        return MissionJob(
            number=number,
            software=self.software,
            scenario_json=self.cases[case].scenario_json,
            seed=seed,
        )


class MissionJob(msgspec.Struct, frozen=True, kw_only=True):
    """A mission to fly, as it is sent to a worker."""

    number: int
    software: str
    """Which code is to fly it."""
    scenario_json: str
    seed: int

    @property
    def scenario(self) -> Scenario:
        """Return the mission's scenario, with its seed."""
        scenario = scenario_from_json(self.scenario_json.encode())
        return msgspec.structs.replace(scenario, seed=self.seed)


def plan_campaign(
    *,
    scenarios: Sequence[str],
    planners: Sequence[str],
    variations: Sequence[Sequence[Change]],
    first_seed: int,
    seeds: int,
) -> Campaign:
    """
    Return the campaign over all combinations of scenarios, variations and planners.

    Parameters
    ----------
    planners
        Planners by name; empty for the one that each scenario names.
    variations
        For each key that is varied, its changes; all are combined with all others.

    Raises
    ------
    ValueError
        Something is given twice, cannot be varied, or makes no mission; the text says what.

    """
    if not scenarios:
        raise ValueError('campaign: no scenario is named; see campaign --help')
    _refuse_twice('scenario', scenarios)
    _refuse_twice('--planner', planners)
    _refuse_twice('--vary', [changes[0].key for changes in variations])
    for changes in variations:
        option = _CHOSEN_ELSEWHERE.get(changes[0].key)
        if option:
            raise ValueError(f'--vary {changes[0].key}: is not varied so; use {option}')
    cases: list[Case] = []
    for name in scenarios:
        scenario = with_choices(load_scenario(name), seed=first_seed)
        cases += [
            case(name, scenario, changes, planner)
            for changes in product(*variations)
            for planner in planners or (scenario.planner.name,)
        ]
    with_choices(scenario, seed=first_seed + seeds - 1)  # refuses one that is too large
    return Campaign(
        software=this_software(),
        first_seed=first_seed,
        seeds=seeds,
        cases=tuple(cases),
    )


def differences(stored: Campaign, asked: Campaign) -> list[str]:
    """Return what makes two campaigns different ones, a sentence each; empty if nothing does."""
    found = []
    if stored.software != asked.software:
        found.append(f'it is flown by {stored.software}; this is {asked.software}')
    if (stored.first_seed, stored.seeds) != (asked.first_seed, asked.seeds):
        found.append(f'its seeds are {_seeds(stored)}; asked for are {_seeds(asked)}')
    before = {(case.scenario, case.variation, case.planner): case for case in stored.cases}
    now = {(case.scenario, case.variation, case.planner): case for case in asked.cases}
    for names, only in (('it has no', now.keys() - before), ('it has also', before.keys() - now)):
        found += [f'{names} {", ".join(key)}' for key in sorted(only)]
    found += [
        f'the scenario of {", ".join(key)} has changed'
        for key in sorted(now.keys() & before)
        if now[key].scenario_json != before[key].scenario_json
    ]
    if not found and stored != asked:
        found.append('its cases are in another order')
    return found


def run_arguments(case: Case, seed: int) -> list[str]:
    """Return the arguments of ``orchestrate.py`` that fly one mission of a case by itself."""
    changes = [word for change in case.changes for word in ('--set', change)]
    return ['run', case.scenario, '--planner', case.planner, '--seed', str(seed), *changes]


def scenario_of(campaign: Campaign, case: Case) -> Scenario:
    """
    Return what a case's scenario, variation and planner come to as the files are now.

    Raises
    ------
    ValueError
        The file is gone, or the scenario cannot be flown any more.

    """
    changes = [read_change(text) for text in case.changes]
    return with_choices(
        load_scenario(case.scenario),
        planner=case.planner,
        seed=campaign.first_seed,
        changes=changes,
    )


def case(name: str, scenario: Scenario, changes: Sequence[Change], planner: str) -> Case:
    """
    Return a scenario in one variation with one planner.

    Raises
    ------
    ValueError
        That is no mission; the text names scenario, variation and planner.

    """
    try:
        varied = with_choices(scenario, planner=planner, changes=changes)
    except ValueError as error:
        raise ValueError(f'{name}, {_in_a_line(changes)}, {planner}: {error}') from None
    return Case(
        scenario=name,
        changes=tuple(map(str, changes)),
        planner=planner,
        scenario_json=scenario_json(varied).decode(),
    )


def _in_a_line(changes: Iterable[Change | str]) -> str:
    """Return the name of a variation."""
    return ' '.join(map(str, changes)) or 'as it is'


def _refuse_twice(option: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f'{option} {name}: is given twice; once is enough')


def _seeds(campaign: Campaign) -> str:
    return f'{campaign.first_seed} to {campaign.first_seed + campaign.seeds - 1}'
