from __future__ import annotations

from dataclasses import replace

import hypothesis.strategies as st
import msgspec
import numpy as np
import pytest
from hypothesis import given

from msgs_json.geometry import Cell, GridSpec, Point
from uav_planner.candidate_paths import LISTED_MOVES_MAX, TieOrder, every_tie_order
from uav_planner.exploration_map import ExplorationMap
from uav_planner.planners import make_planner
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planners.ecc2009_oracle import plan_path_by_enumeration
from uav_planner.planning import (
    MissionSpec,
    PlanRequest,
    PlanResult,
    PlanStatus,
    Prospect,
    SortieRequest,
    SurveyLeg,
)
from uav_planner.sortie import flight_time_s, lay_route

REFERENCE = MissionSpec(
    grid=GridSpec(cols=10, rows=10, cell_m=10.0),
    c3=Point(east_m=50.0, north_m=0.0),
    radio_range_m=20.0,
    uav_speed_mps=4.0,
    tick_s=1.0,
    sortie_limit_s=60.0,
    path_cells=6,
    min_path_cells=1,
)
STEPS = {'e': (1, 0), 'n': (0, 1), 'w': (-1, 0), 's': (0, -1)}
AUVS = ('auv_1', 'auv_2', 'auv_3')

# The reference mission: initial paths, then every path handed over, in the order of the meetings
# (three a sortie). The moves are those of an independent prototype of the same decisions. Of the
# paper the first three are known: straight, straight, one turn (ECC 2009, Figures 4-6).
INITIAL_PATHS = (((3, 7), (4, 7)), ((2, 9), (3, 9)), ((1, 2), (1, 1)))
HANDED_OVER = (
    ('ssssss', 'eeeeee', 'eennnn'),
    ('seeeee', 'ssssww', 'neeeee'),
    ('nnnnww', 'wwssss', 'nnwwws'),
    ('wsssee', 'swwwww', 'wwwsse'),
    ('nnnwss', 'nnnnee', 'wwnnne'),
    ('wwwwwn', 'wwnnnn', 'nwseee'),
    ('wsseee', 'neeeee', 'eeesww'),
    ('eeeeen', 'eeesss'),
)


def path_of(start: Cell, moves: str) -> tuple[Cell, ...]:
    path = [start]
    for move in moves:
        path.append((path[-1][0] + STEPS[move][0], path[-1][1] + STEPS[move][1]))
    return tuple(path)


def hand_overs() -> list[tuple[PlanRequest, tuple[Cell, ...]]]:
    """Return each meeting of the reference mission as a request, with the path it gave."""
    exploration = ExplorationMap(REFERENCE.grid, [path[0] for path in INITIAL_PATHS])
    paths = dict(zip(AUVS, INITIAL_PATHS, strict=True))
    for path in INITIAL_PATHS:
        exploration.assign(path)
    meetings = []
    for sortie in HANDED_OVER:
        for turn, (auv, moves) in enumerate(zip(AUVS, sortie, strict=False)):
            path = path_of(paths[auv][-1], moves)
            request = PlanRequest(
                mission=REFERENCE,
                values=exploration.values.copy(),
                auv=auv,
                cell=path[0],
                legs=tuple(
                    SurveyLeg(
                        auv=name,
                        path=paths[name],
                        surface_deadline_s=0.0,
                        prospect=Prospect.STAYS if name in AUVS[:turn] else Prospect.ENDS,
                    )
                    for name in AUVS
                ),
                now_s=0.0,
            )
            meetings.append((request, path))
            exploration.assign(path)
            paths[auv] = path
    return meetings


def test_the_reference_mission_hands_over_the_known_paths() -> None:
    planner = Ecc2009Planner()
    for request, path in hand_overs():
        plan = planner.plan_path(request)
        assert plan.status is PlanStatus.OK
        assert plan.path == path
        assert plan.sortie_time_s <= 60.0


def test_slack_and_foreseen_time_of_the_first_sortie() -> None:
    """Our figures: the paper's 24.2, 27.4 and 32.14 s belong to start cells it does not give."""
    plans = [Ecc2009Planner().plan_path(request) for request, _ in hand_overs()[:3]]
    assert [plan.slack_s for plan in plans] == [17.0, 29.0, 5.0]
    assert [plan.sortie_time_s for plan in plans] == [44.0, 58.0, 59.0]


def test_when_all_others_are_met_the_foreseen_time_is_that_of_the_next_route() -> None:
    request, path = hand_overs()[2]
    plan = Ecc2009Planner().plan_path(request)
    legs = (*request.legs[:2], replace(request.legs[2], path=path))
    route = lay_route(REFERENCE, legs)
    assert plan.sortie_time_s == flight_time_s(REFERENCE, route)
    others = lay_route(REFERENCE, legs[:2])
    assert plan.slack_s == 60.0 - flight_time_s(REFERENCE, others)


def test_next_sortie_of_the_reference_mission() -> None:
    legs = tuple(
        SurveyLeg(auv=auv, path=path, surface_deadline_s=deadline_s)
        for auv, (_, path), deadline_s in zip(
            AUVS, hand_overs()[:3], (74.0, 80.0, 93.0), strict=True
        )
    )
    request = SortieRequest(mission=REFERENCE, legs=legs, now_s=44.0)
    sortie = Ecc2009Planner().plan_sortie(request)
    assert sortie.route == lay_route(REFERENCE, legs)
    assert sortie.depart_s == 74.0  # the first AUV surfaces within range of C3
    assert sortie.predicted_s == sortie.worst_case_s == 59.0  # and nothing is waited for


@st.composite
def requests(draw: st.DrawFn, path_cells: int = 4) -> PlanRequest:
    """Any state in the middle of a sortie; the limit is such that it binds more or less."""
    cols, rows = draw(st.integers(2, 7)), draw(st.integers(1, 7))
    grid = GridSpec(cols=cols, rows=rows, cell_m=draw(st.sampled_from([7.5, 10.0, 20.0])))
    used: set[Cell] = set()
    cells = st.tuples(st.integers(0, cols - 1), st.integers(0, rows - 1))
    moves = st.text('enws', max_size=6)
    auvs = [f'auv_{number}' for number in range(1, draw(st.integers(1, 4)) + 1)]
    legs = []
    for auv in auvs:
        path = path_of(draw(cells), draw(moves))
        inside = tuple(cell for cell in path if grid.contains(cell))
        prospect = draw(st.sampled_from(Prospect))
        legs.append(SurveyLeg(auv=auv, path=inside, surface_deadline_s=0.0, prospect=prospect))
        used.update(inside)
    cell = draw(cells)
    used.add(cell)
    # Land is where no AUV is; it leaves each of them a way out.
    used |= {(col + 1 if col + 1 < cols else col - 1, row) for col, row in used}
    masked = draw(st.lists(cells.filter(lambda each: each not in used), max_size=8))
    grid = msgspec.structs.replace(grid, masked=tuple(masked))
    turn = draw(st.integers(0, len(auvs) - 1))
    halvings = draw(st.lists(st.integers(0, 5), min_size=cols * rows, max_size=cols * rows))
    longest = draw(st.integers(1, path_cells))
    return PlanRequest(
        mission=MissionSpec(
            grid=grid,
            c3=Point(east_m=draw(st.floats(-20, 90)), north_m=draw(st.floats(-20, 90))),
            radio_range_m=draw(st.sampled_from([5.0, 15.0, 20.0])),
            uav_speed_mps=draw(st.sampled_from([3.0, 4.0, 7.3])),
            tick_s=draw(st.sampled_from([0.5, 0.7, 1.0])),
            sortie_limit_s=float(draw(st.integers(1, 90))),
            path_cells=longest,
            min_path_cells=draw(st.integers(1, longest)),
        ),
        values=np.where(grid.mask, 0.0, 0.5 ** np.array(halvings).reshape(rows, cols)),
        auv=auvs[turn],
        cell=cell,
        legs=tuple(legs),
        now_s=0.0,
    )


@given(request=requests(), tie_order=st.sampled_from(every_tie_order()))
def test_plans_are_those_of_the_loop_over_all_paths(
    request: PlanRequest, tie_order: TieOrder
) -> None:
    values = request.values.copy()
    plan = Ecc2009Planner(tie_order=tie_order).plan_path(request)
    assert plan == plan_path_by_enumeration(request, tie_order)
    np.testing.assert_array_equal(request.values, values)


@given(
    request=requests(path_cells=3),
    tie_order=st.sampled_from(every_tie_order()),
    data=st.data(),
)
def test_near_ties_are_broken_as_by_the_loop_over_all_paths(
    request: PlanRequest, tie_order: TieOrder, data: st.DataObject
) -> None:
    """Values that differ by a fraction of the margin: chains of paths, each tied with the next."""
    cells = request.values.size
    parts = data.draw(st.lists(st.integers(0, 8), min_size=cells, max_size=cells))
    values = 1.0 - 0.4e-9 * np.array(parts).reshape(request.values.shape)
    near = replace(request, values=np.where(request.mission.grid.mask, 0.0, values))
    plan = Ecc2009Planner(tie_order=tie_order).plan_path(near)
    assert plan == plan_path_by_enumeration(near, tie_order)


@pytest.mark.parametrize(
    ('meeting', 'limit_s'),
    [
        (5, 60.0),  # the 111th best path is the best feasible one
        (10, 36.0),
        (2, 52.0),  # none of six moves is feasible, nor any shorter one
    ],
)
def test_plans_of_six_moves_are_those_of_the_loop_over_all_paths(
    meeting: int, limit_s: float
) -> None:
    request, _ = hand_overs()[meeting]
    request = replace(request, mission=replace(REFERENCE, sortie_limit_s=limit_s))
    assert Ecc2009Planner().plan_path(request) == plan_path_by_enumeration(request)


def single_auv(mission: MissionSpec, cell: Cell) -> PlanResult:
    leg = SurveyLeg(auv='auv_1', path=(cell,), surface_deadline_s=0.0)
    values = np.ones((mission.grid.rows, mission.grid.cols))
    return Ecc2009Planner().plan_path(
        PlanRequest(
            mission=mission,
            values=values,
            auv='auv_1',
            cell=cell,
            legs=(leg,),
            now_s=0.0,
        )
    )


def test_alone_the_whole_limit_is_slack() -> None:
    plan = single_auv(REFERENCE, (0, 0))
    assert plan.status is PlanStatus.OK
    assert plan.slack_s == 60.0
    assert plan.path == path_of((0, 0), 'eeeeee')


def test_the_only_feasible_paths_may_be_the_worst_ones() -> None:
    """East is unexplored but too far; west is explored and on the way home."""
    mission = replace(
        REFERENCE,
        grid=GridSpec(cols=12, rows=1, cell_m=10.0),
        c3=Point(east_m=5.0, north_m=5.0),
        radio_range_m=5.0,
        path_cells=4,
    )
    values = np.ones((1, 12))
    values[0, :7] = 2.0**-6
    leg = SurveyLeg(auv='auv_1', path=((6, 0),), surface_deadline_s=0.0)
    only_home = replace(mission, sortie_limit_s=flight_time_s(mission, lay_route(mission, (leg,))))
    request = PlanRequest(
        mission=only_home,
        values=values,
        auv='auv_1',
        cell=(6, 0),
        legs=(leg,),
        now_s=0.0,
    )
    plan = Ecc2009Planner().plan_path(request)
    assert (plan.status, plan.path) == (PlanStatus.OK, path_of((6, 0), 'wwww'))
    assert plan == plan_path_by_enumeration(request)


def test_where_no_full_path_is_feasible_a_shorter_one_is_given() -> None:
    """
    One row with C3 at its west end: there and back again takes 4 s, any three moves 6 s or more.

    (0, 0) is in range from C3; 2 ticks to clear (1, 0), 1 tick back to clear (0, 0), 1 tick home.
    """
    mission = replace(
        REFERENCE,
        grid=GridSpec(cols=5, rows=1, cell_m=10.0),
        c3=Point(east_m=5.0, north_m=5.0),
        radio_range_m=4.0,
        sortie_limit_s=5.9,  # five whole ticks
        path_cells=3,
    )
    plan = single_auv(mission, (0, 0))
    assert plan.status is PlanStatus.SHORTENED
    assert plan.path == ((0, 0), (1, 0), (0, 0))
    assert plan.sortie_time_s == 4.0
    longer = single_auv(replace(mission, sortie_limit_s=6.0), (0, 0))
    assert (longer.status, len(longer.path), longer.sortie_time_s) == (PlanStatus.OK, 4, 6.0)


def test_the_last_resort_is_the_greedy_cell() -> None:
    mission = replace(REFERENCE, sortie_limit_s=5.0)
    plan = single_auv(mission, (5, 9))
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.path == ((5, 9), (6, 9))
    assert plan.sortie_time_s > 5.0


def test_the_last_resort_has_delta_moves() -> None:
    plan = single_auv(replace(REFERENCE, sortie_limit_s=5.0, min_path_cells=3), (5, 9))
    assert plan.status is PlanStatus.INFEASIBLE
    assert plan.path == path_of((5, 9), 'eee')


def test_a_request_that_does_not_fit_together_is_refused() -> None:
    request, _ = hand_overs()[0]
    planner = Ecc2009Planner()
    with pytest.raises(ValueError, match=r"auv_7 has no leg among those of \['auv_1'"):
        planner.plan_path(replace(request, auv='auv_7'))
    with pytest.raises(ValueError, match=r'auv_1: cell \[10, 0\] lies outside'):
        planner.plan_path(replace(request, cell=(10, 0)))
    one_cell = replace(REFERENCE, grid=GridSpec(cols=1, rows=1, cell_m=10.0))
    with pytest.raises(ValueError, match=r'no path of 1 moves from cell \[0, 0\]'):
        single_auv(one_cell, (0, 0))


@pytest.mark.parametrize('path_cells', [LISTED_MOVES_MAX + 1, 24])
def test_more_moves_than_can_be_listed_are_refused(path_cells: int) -> None:
    request, _ = hand_overs()[0]
    mission = replace(request.mission, path_cells=path_cells)
    told = f'path_cells is {path_cells}; allowed with planner ecc2009: 1 to 9 '
    with pytest.raises(ValueError, match=told):
        Ecc2009Planner().plan_sortie(SortieRequest(mission=mission, legs=request.legs, now_s=0.0))
    with pytest.raises(ValueError, match=told):
        plan_path_by_enumeration(replace(request, mission=mission))


def test_planners_are_made_by_name_with_options() -> None:
    request, path = hand_overs()[2]
    assert make_planner('ecc2009').plan_path(request).path == path
    other = make_planner('ecc2009', tie_order='wsne-last').plan_path(request)
    assert other == Ecc2009Planner(tie_order=TieOrder.named('wsne-last')).plan_path(request)
    assert other.path != path


def test_unknown_planners_and_options_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"unknown planner 'dijkstra'; allowed: .*ecc2009, "):
        make_planner('dijkstra')
    with pytest.raises(ValueError, match="no option 'speed'; allowed: tie_order"):
        make_planner('ecc2009', speed=3)
    with pytest.raises(ValueError, match="as in 'enws-first', not 'north'"):
        make_planner('ecc2009', tie_order='north')
