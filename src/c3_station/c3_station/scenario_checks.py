"""
Why a well-formed scenario is no mission: its parts against each other, and parts made elsewhere.

Every check returns all problems it finds.
"""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import TYPE_CHECKING

import msgspec

from auv_sim.auv_params import DRIVERS as AUV_DRIVERS
from auv_sim.surfacing import surfacing_model
from auv_sim.survey_field import make_field
from c3_station.c3_agent import mission_order
from c3_station.operator_desk import OperatorDesk
from c3_station.radio_checks import radio_problems
from c3_station.scenario import C3, RESERVED_NAMES, UAV, Limits, Scenario
from c3_station.scheduled_commands import operator_command
from c3_station.shape_checks import KeyPath, Problem, nearest
from c3_station.sortie_reach import problem_with_reach, uav_setup
from msgs_json.drivers import find_driver, registered_drivers
from msgs_json.geometry import mask_problems, path_problem, unreachable_cells
from msgs_json.straight_motion import Flow
from uav_planner.guarantee import initial_problem
from uav_planner.mission_order import mission_spec
from uav_planner.planners import PLANNERS, make_planner
from uav_planner.planning import SortieRequest, SurveyLeg
from uav_planner.uav_params import DRIVERS as UAV_DRIVERS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


def mission_problems(scenario: Scenario) -> list[Problem]:
    """Return why a well-formed scenario is no mission that can be flown here."""
    problems = [*_inconsistencies(scenario), *_unknown_parts(scenario)]
    return problems or [
        *_unreachable(scenario),
        *_refused(scenario),
    ]


# --- one part against another --------------------------------------------------------------------


def _inconsistencies(scenario: Scenario) -> Iterator[Problem]:
    yield from _geometry(scenario)
    yield from _mask(scenario)
    yield from _fleet(scenario)
    yield from _wind(scenario)
    yield from _faults(scenario)
    yield from radio_problems(scenario)
    planner = scenario.planner
    if planner.min_path_cells > planner.path_cells:
        yield Problem(
            ('planner', 'min_path_cells'),
            f'is {planner.min_path_cells}; allowed: at most path_cells, {planner.path_cells}',
        )
    for key, time_s in (
        (('sortie', 'limit_s'), scenario.sortie.limit_s),
        (('max_mission_s',), scenario.max_mission_s),
    ):
        if time_s < scenario.tick_s:
            yield Problem(
                key, f'is {time_s:g}; allowed: at least one tick, tick_s {scenario.tick_s:g}'
            )
    for name, limits in msgspec.structs.asdict(scenario.pass_conditions).items():
        yield from _limits(name, limits)


def _geometry(scenario: Scenario) -> Iterator[Problem]:
    # Narrower than the types of messages: what the nodes' parameters take.
    if scenario.region.cell_m < 0.1:
        yield Problem(
            ('region', 'cell_m'), f'is {scenario.region.cell_m:g}; allowed: at least 0.1'
        )
    for name in ('east_m', 'north_m'):
        value_m = getattr(scenario.c3, name)
        if abs(value_m) > 1e6:
            yield Problem(('c3', name), f'is {value_m:g}; allowed: -1,000,000 to 1,000,000')


def _mask(scenario: Scenario) -> Iterator[Problem]:
    for index, problem in mask_problems(scenario.region):
        yield Problem(('region', 'masked', index), problem)
    if not scenario.region.cells_total:
        yield Problem(('region', 'masked'), 'has every cell; allowed: to leave some to survey')


def _fleet(scenario: Scenario) -> Iterator[Problem]:
    count = Counter(auv.name for auv in scenario.auvs)
    for index, auv in enumerate(scenario.auvs):
        path: KeyPath = ('auvs', index)
        if count[auv.name] > 1:
            yield Problem(
                (*path, 'name'),
                f'is {auv.name!r}, as that of {count[auv.name] - 1} other;'
                ' allowed: a name of its own for each AUV',
            )
        if auv.name in RESERVED_NAMES:
            yield Problem(
                (*path, 'name'),
                f'is {auv.name!r}; allowed: any but {", ".join(sorted(RESERVED_NAMES))}',
            )
        problem = path_problem(auv.initial_path, scenario.region)
        if problem:
            cells = ', '.join(str(list(cell)) for cell in auv.initial_path)
            yield Problem((*path, 'initial_path'), f'is {cells}: {problem}')


def _wind(scenario: Scenario) -> Iterator[Problem]:
    uav = scenario.uav
    wind = Flow(east_mps=uav.wind_east_mps, north_mps=uav.wind_north_mps)
    if wind.speed_mps >= uav.speed_mps:
        yield Problem(
            ('uav', 'wind_east_mps'),
            f'and wind_north_mps make a wind of {wind.speed_mps:g} m/s; allowed: less than'
            f' speed_mps, {uav.speed_mps:g} (a UAV cannot come home against more)',
        )


def _faults(scenario: Scenario) -> Iterator[Problem]:
    auvs = tuple(auv.name for auv in scenario.auvs)
    for index, name in enumerate(scenario.faults.nodes):
        if name not in (C3, UAV, *auvs):
            yield Problem(
                ('faults', 'nodes', index), f'is {name!r}; allowed: {C3}, {UAV}, {", ".join(auvs)}'
            )
    off_by_one = scenario.faults.off_by_one
    if off_by_one is not None and off_by_one not in auvs:
        yield Problem(('faults', 'off_by_one'), f'is {off_by_one!r}; allowed: {", ".join(auvs)}')


def _limits(name: str, limits: Limits) -> Iterator[Problem]:
    if limits.min is not None and limits.max is not None and limits.min > limits.max:
        yield Problem(
            ('pass', name, 'min'), f'is {limits.min:g}; allowed: at most max, {limits.max:g}'
        )


# --- can every cell be surveyed? -----------------------------------------------------------------


def _unreachable(scenario: Scenario) -> Iterator[Problem]:
    cells = unreachable_cells(scenario.region, (auv.initial_path[0] for auv in scenario.auvs))
    if cells:
        listed = ', '.join(str(list(cell)) for cell in cells)
        yield Problem(
            ('region', 'masked'),
            f'leaves {len(cells)} cells that no AUV can reach from where it starts; allowed:'
            f' to start an AUV there, or to mask them as well: {listed}',
        )


# --- does the planner take the mission? ----------------------------------------------------------


def _refused(scenario: Scenario) -> Iterator[Problem]:
    """Ask what the UAV asks when it gets its order; first for L, which has a key of its own."""
    choice, order = scenario.planner, mission_order(scenario, 0.0)
    planner = make_planner(choice.name, **choice.options)
    mission = mission_spec(order, uav_setup(scenario))
    legs = tuple(
        SurveyLeg(auv=auv.name, path=auv.leg.path, surface_deadline_s=auv.leg.surface_deadline_s)
        for auv in order.auvs
    )
    problem = initial_problem(mission, legs) if planner.guarantees_limit else None
    if problem:
        text = f'is {scenario.sortie.limit_s:g}, and {choice.name} guarantees it: {problem}'
        yield Problem(('sortie', 'limit_s'), text)
        return
    problem = problem_with_reach(scenario, scenario.sortie.limit_s, scenario.region.cells)
    if problem:
        yield Problem(('sortie', 'limit_s'), problem)
        return
    try:
        planner.plan_sortie(SortieRequest(mission=mission, legs=legs, now_s=0.0))
    except ValueError as error:
        yield Problem(
            ('planner', 'name'), f'is {choice.name!r}; it cannot plan this mission: {error}'
        )


# --- names of parts that live elsewhere ----------------------------------------------------------


def _unknown_parts(scenario: Scenario) -> Iterator[Problem]:
    """Ask whoever makes the parts: planner, drivers, surfacing models, survey field."""
    planner = scenario.planner
    yield from _refusal(
        ('planner', 'name' if planner.name not in PLANNERS else 'options'),
        partial(make_planner, planner.name, **planner.options),
        nearest(planner.name, PLANNERS) if planner.name not in PLANNERS else '',
    )
    yield from _unknown_driver(('uav', 'driver'), UAV_DRIVERS, scenario.uav.driver)
    for index, auv in enumerate(scenario.auvs):
        path: KeyPath = ('auvs', index)
        yield from _unknown_driver((*path, 'driver'), AUV_DRIVERS, auv.driver)
        yield from _refusal((*path, 'surfacing'), partial(surfacing_model, _json(auv.surfacing)))
    yield from _refusal(('field',), partial(make_field, _json(scenario.field), scenario.region))
    yield from _commands(scenario)


def _commands(scenario: Scenario) -> Iterator[Problem]:
    """
    Give the operator's commands to a desk as C3 has one: it says now what it would say then.

    What is surveyed by then nobody knows; here all of it is.
    """
    desk, before_s = OperatorDesk(scenario), 0.0
    surveyed = frozenset(scenario.region.cells)
    for index, scheduled in enumerate(scenario.operator):
        if scheduled.at_s < before_s:
            yield Problem(
                ('operator', index, 'at_s'),
                f'is {scheduled.at_s:g}; allowed: at least that of the one before, {before_s:g}',
            )
        before_s = scheduled.at_s
        try:
            problem = desk.take(operator_command(scheduled.command), surveyed)
        except ValueError as error:
            problem = f'{error}'
        if problem:
            yield Problem(('operator', index, 'command'), f'cannot be taken: {problem}')


def _unknown_driver(path: KeyPath, group: str, name: str) -> Iterator[Problem]:
    hint = nearest(name, registered_drivers(group))
    yield from _refusal(path, partial(find_driver, group, name), hint)


def _refusal(path: KeyPath, make: Callable[[], object], hint: str = '') -> Iterator[Problem]:
    try:
        make()
    except (ValueError, TypeError) as error:  # TypeError: an option called like an argument
        yield Problem(path, f'cannot be used: {error}{hint}')


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()
