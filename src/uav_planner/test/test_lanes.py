"""Planner `lanes`: strips for ever, lanes to and fro, room for whoever comes first."""

from __future__ import annotations

import itertools
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from msgs_json.geometry import Cell, GridSpec, Point, path_problem
from uav_planner.guarantee import GuaranteedPaths, least_limit_s
from uav_planner.guarantee_oracle import meeting_request, next_sortie
from uav_planner.oracle_boards import legs_of
from uav_planner.planners.lanes import LanesPlanner, cut_strips, deal_strips
from uav_planner.planning import MissionSpec, PlanRequest, PlanStatus, Prospect, SortieRequest

# Two AUVs on 6 x 4 cells: the strips are three columns wide, their lanes go across them.
MISSION = MissionSpec(
    grid=GridSpec(cols=4, rows=6, cell_m=10.0),
    c3=Point(east_m=20.0, north_m=0.0),
    radio_range_m=20.0,
    uav_speed_mps=10.0,
    tick_s=1.0,
    sortie_limit_s=100.0,
    path_cells=4,
    min_path_cells=1,
)
LEGS = next_sortie(MISSION, legs_of([((0, 1), (0, 0)), ((2, 1), (2, 0))]))
STRIPS = deal_strips(MISSION.grid, {'auv_1': (0, 1), 'auv_2': (2, 1)})


def met(auv: str, cell: Cell, **changes: object) -> PlanRequest:
    """Return a meeting with an AUV at a cell of its leg; its strip is as dealt."""
    legs = tuple(
        replace(leg, path=(cell, MISSION.grid.neighbours(cell)[0])) if leg.auv == auv else leg
        for leg in LEGS
    )
    mission = changes.pop('mission', MISSION)
    assert isinstance(mission, MissionSpec)
    request = meeting_request(mission, next_sortie(mission, legs), auv, (cell, None))
    return replace(request, tours=STRIPS, **changes)


def unexplored(*cells: Cell) -> np.ndarray:
    """Return a map on which only some cells are unexplored."""
    values = np.full((6, 4), 0.25)
    for col, row in cells:
        values[row, col] = 1.0
    return values


# --- strips --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'grid',
    [
        GridSpec(cols=7, rows=9, cell_m=1.0),
        GridSpec(cols=9, rows=7, cell_m=1.0, masked=((0, 0), (4, 3), (4, 4), (8, 6))),
    ],
)
@pytest.mark.parametrize('count', [1, 2, 3, 5])
def test_strips_lie_side_by_side_and_have_as_many_cells_each(grid: GridSpec, count: int) -> None:
    strips = cut_strips(grid, count)
    assert sorted(itertools.chain(*strips)) == sorted(grid.cells)
    sizes = [len(strip) for strip in strips]
    assert max(sizes) - min(sizes) <= 1
    across = 1 if grid.cols > grid.rows else 0
    for strip, beside in itertools.pairwise(strips):
        assert max(cell[across] for cell in strip) <= min(cell[across] for cell in beside)


def test_lanes_go_to_and_fro_across_the_strip() -> None:
    strip, _ = cut_strips(MISSION.grid, 2)
    assert strip[:6] == ((0, 0), (1, 0), (1, 1), (0, 1), (0, 2), (1, 2))
    assert path_problem(strip, MISSION.grid) is None


def test_strips_begin_at_the_side_to_which_the_auvs_have_less_way() -> None:
    west, east = cut_strips(MISSION.grid, 2)
    assert deal_strips(MISSION.grid, {'auv_1': (0, 0), 'auv_2': (3, 0)})['auv_1'] == west
    assert deal_strips(MISSION.grid, {'auv_1': (3, 0), 'auv_2': (0, 0)})['auv_1'] == east
    assert deal_strips(MISSION.grid, {'auv_1': (3, 0), 'auv_2': (2, 0)})['auv_1'] == east


def test_strips_are_dealt_before_the_first_sortie_and_kept_in_mind() -> None:
    planner = LanesPlanner()
    first = planner.plan_sortie(SortieRequest(mission=MISSION, legs=LEGS, now_s=0.0)).tours
    assert first == STRIPS
    elsewhere = legs_of([((3, 5), (2, 5))])  # one was given up, the other one is far off
    later = SortieRequest(mission=MISSION, legs=elsewhere, now_s=50.0, tours=first)
    assert planner.plan_sortie(later).tours == first
    assert planner.plan_path(met('auv_2', (0, 5))).tours == first


# --- along the lanes -----------------------------------------------------------------------------


def test_an_auv_goes_along_its_lanes() -> None:
    plan = LanesPlanner().plan_path(met('auv_1', (0, 0)))
    assert plan.path == ((0, 0), (1, 0), (1, 1), (0, 1), (0, 2))
    assert plan.status is PlanStatus.OK


def test_it_goes_on_at_the_nearer_end_of_what_is_left_there() -> None:
    left = unexplored((1, 0), (1, 3), (0, 3), (0, 4))
    assert LanesPlanner().plan_path(met('auv_1', (0, 5), values=left)).path == (
        *((0, 5), (0, 4), (0, 3), (1, 3)),
        (1, 2),  # on its way to (1, 0)
    )


def test_it_goes_around_land() -> None:
    grid = msgspec.structs.replace(MISSION.grid, masked=((0, 1), (1, 2)))
    plan = LanesPlanner().plan_path(
        met('auv_1', (0, 0), mission=replace(MISSION, grid=grid), values=unexplored((0, 2)))
    )
    assert path_problem(plan.path, grid) is None
    assert plan.path[:3] == ((0, 0), (1, 0), (1, 1))


def test_the_strip_of_one_that_is_given_up_is_taken_over_after_its_own() -> None:
    left = unexplored((1, 5), (2, 5), (3, 5))
    lost = replace(met('auv_1', (0, 5), values=left), legs=())
    lost = replace(lost, legs=met('auv_1', (0, 5)).legs[:1])
    assert LanesPlanner().plan_path(lost).path == ((0, 5), (1, 5), (2, 5), (3, 5))
    both = met('auv_1', (0, 5), values=left)
    assert LanesPlanner().plan_path(both).path == ((0, 5), (1, 5))


def test_who_is_done_comes_to_c3() -> None:
    plan = LanesPlanner().plan_path(met('auv_1', (1, 3), values=unexplored((3, 5))))
    assert plan.path == ((1, 3), (1, 2), (1, 1), (1, 0))


def test_an_auv_between_two_cells_gets_all_moves_so_that_it_comes_to_the_next_one() -> None:
    alone = legs_of([((0, 0), (1, 0))])
    request = meeting_request(MISSION, next_sortie(MISSION, alone), 'auv_1', ((0, 0), (1, 0)))
    request = replace(request, tours=STRIPS, values=unexplored((1, 0)))
    plan = LanesPlanner().plan_path(request)
    assert plan.path == ((0, 0), (1, 0), (0, 0), (1, 0), (0, 0))


# --- where L is tight ----------------------------------------------------------------------------


def test_of_its_lanes_as_much_is_handed_over_as_is_allowed() -> None:
    cut = 0
    for limit_s in (7.0, 8.0, 9.0, 10.0, 11.0):
        request = met('auv_1', (0, 1), mission=replace(MISSION, sortie_limit_s=limit_s))
        values = unexplored(*((0, row) for row in range(2, 6)))
        plan = LanesPlanner().plan_path(replace(request, values=values))
        guaranteed = GuaranteedPaths(request)
        lanes = tuple((0, row) for row in range(1, 6))
        allowed = [n for n in range(1, 5) if guaranteed.allows(lanes[: n + 1])]
        assert plan.path == (lanes[: allowed[-1] + 1] if allowed else guaranteed.stay.path)
        cut += bool(allowed) and len(plan.path) < len(lanes)
    assert cut > 0


def standstill(auv: str) -> PlanRequest:
    """Return a meeting where AUVs in different corners have been where they are often."""
    grid = GridSpec(cols=12, rows=12, cell_m=10.0)
    legs = legs_of([((0, 9), (0, 10)), ((11, 9), (11, 10))])
    mission = replace(MISSION, grid=grid, c3=Point(east_m=60.0, north_m=0.0), radio_range_m=10.0)
    mission = replace(mission, uav_speed_mps=1.0)
    mission = replace(mission, sortie_limit_s=least_limit_s(mission, legs))
    values = np.full((12, 12), 0.25)
    values[11, 0] = values[11, 11] = 1.0
    values[9:11, 0] = values[9:11, 11] = 0.5**6
    cell = next(leg.path[-1] for leg in legs if leg.auv == auv)
    legs = tuple(
        leg if leg.auv == auv else replace(leg, prospect=Prospect.STAYS)
        for leg in next_sortie(mission, legs)
    )
    request = meeting_request(mission, legs, auv, (cell, None))
    assert not GuaranteedPaths(request).allows((cell, (cell[0], 11)))
    strips = deal_strips(grid, {'auv_1': (0, 0), 'auv_2': (11, 0)})
    return replace(request, values=values, tours=strips)


def test_where_nobody_gets_on_all_but_the_first_come_nearer_to_c3() -> None:
    first = LanesPlanner().plan_path(standstill('auv_1'))
    assert first.path == GuaranteedPaths(standstill('auv_1')).stay.path
    second = LanesPlanner().plan_path(standstill('auv_2'))
    assert second.path == ((11, 10), (11, 9), (11, 8))


def test_one_that_is_astray_does_not_keep_others_waiting() -> None:
    request = standstill('auv_2')
    astray = replace(request.legs[0], prospect=Prospect.ASTRAY)
    alone = replace(request, legs=(astray, request.legs[1]))
    assert LanesPlanner().plan_path(alone).path[-1] == (11, 11)
