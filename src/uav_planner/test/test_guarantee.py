"""The guaranteed set: sound by brute force, the same one path at a time or many at once."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from msgs_json.geometry import Cell, GridSpec, Point, within_range
from uav_planner.candidate_paths import every_tie_order, walk_table
from uav_planner.guarantee import (
    GuaranteedPaths,
    guaranteed_sortie,
    initial_problem,
    least_limit_s,
)
from uav_planner.guarantee_oracle import (
    legs_after,
    meeting_request,
    next_sortie,
    paths_from,
    places_of,
    reachable_meetings,
)
from uav_planner.oracle_boards import BLOCK, STRIP, Board, legs_of
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import (
    MissionSpec,
    PlanRequest,
    PlanStatus,
    Prospect,
    SortieRequest,
    SurveyLeg,
    track_of,
)
from uav_planner.sortie import worst_case_s

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Path = tuple[Cell, ...]


BOARDS = {
    'strip': STRIP,
    'strip_with_hand_over_time': replace(STRIP, handover_s=2.0, limit_s=14.0),
}
LARGE_BOARDS = {
    'strip_of_longer_paths': replace(
        STRIP, moves=2, min_moves=2, paths=(((1, 0), (0, 0), (1, 0)), ((2, 0), (3, 0), (2, 0)))
    ),
    'block': BLOCK,
}


# --- the induction step, by brute force ----------------------------------------------------------


EVERY_BOARD = [
    *(pytest.param(board, id=name) for name, board in BOARDS.items()),
    *(
        pytest.param(board, id=name, marks=pytest.mark.slow)
        for name, board in LARGE_BOARDS.items()
    ),
]


@pytest.mark.parametrize('board', [*BOARDS.values(), BLOCK], ids=[*BOARDS, 'block'])
def test_the_limits_of_the_boards_are_the_tightest_that_can_be_kept(board: Board) -> None:
    tighter = replace(board, limit_s=board.limit_s - 1.0)
    assert initial_problem(board.mission, board.legs) is None
    assert initial_problem(tighter.mission, tighter.legs) is not None


@pytest.mark.parametrize('board', EVERY_BOARD)
def test_at_every_meeting_that_can_follow_some_path_keeps_the_limit(board: Board) -> None:
    mission = board.mission
    meetings = 0
    for meeting in reachable_meetings(mission, board.legs):
        meetings += 1
        stay = meeting.guaranteed.stay
        assert stay.round_ticks <= mission.limit_ticks, meeting
        assert len(stay.path) - 1 >= mission.min_path_cells
        for path in paths_from(mission, meeting.request.cell):
            if meeting.guaranteed.allows(path):
                offer = meeting.guaranteed.offer(path)
                assert offer.round_ticks <= mission.limit_ticks
                assert_clears(mission, track_of(path, meeting.request.behind), offer.search)
    assert meetings > 100


def assert_clears(mission: MissionSpec, track: Path, search: tuple[Point, ...]) -> None:
    """Check that everything between two cells of a track is heard from some one waypoint."""
    centres = [mission.grid.centre(cell) for cell in track]
    for start, end in itertools.pairwise(centres):
        assert any(
            all(
                within_range(point.distance_m(place), mission.radio_range_m)
                for place in (start, end)
            )
            for point in search
        )


# --- the same on larger grids, by chance ---------------------------------------------------------


@st.composite
def missions(draw: st.DrawFn) -> tuple[MissionSpec, tuple[SurveyLeg, ...]]:
    """Draw a mission whose limit is as tight as its initial paths allow, or a little wider."""
    grid = GridSpec(cols=draw(st.integers(2, 8)), rows=draw(st.integers(2, 8)), cell_m=10.0)
    shortest = draw(st.integers(1, 3))
    mission = MissionSpec(
        grid=grid,
        c3=Point(east_m=draw(st.floats(-50, 130)), north_m=draw(st.floats(-50, 130))),
        radio_range_m=draw(st.floats(10, 35)),
        uav_speed_mps=draw(st.floats(2, 20)),
        tick_s=draw(st.sampled_from([0.25, 1.0, 3.0])),
        sortie_limit_s=1e6,
        path_cells=draw(st.integers(shortest, 4)),
        min_path_cells=shortest,
        handover_s=draw(st.sampled_from([0.0, 0.0, 2.5])),
    )
    cells = st.tuples(st.integers(0, grid.cols - 1), st.integers(0, grid.rows - 1))
    starts = draw(st.lists(cells, min_size=1, max_size=4))
    paths = [draw(st.sampled_from(paths_from(mission, start))) for start in starts]
    legs = legs_of(tuple(paths))
    spare_s = draw(st.integers(0, 3)) * mission.tick_s
    return replace(mission, sortie_limit_s=least_limit_s(mission, legs) + spare_s), legs


@given(missions(), st.data())
def test_whatever_is_chosen_and_wherever_auvs_surface_the_limit_is_kept(
    start: tuple[MissionSpec, tuple[SurveyLeg, ...]], data: st.DataObject
) -> None:
    mission, legs = start
    for _ in range(3):
        sortie = guaranteed_sortie(SortieRequest(mission=mission, legs=legs, now_s=0.0))
        assert sortie.worst_case_s <= mission.sortie_limit_s
        assert {each.auv for each in sortie.route} == {leg.auv for leg in legs}, 'all are visited'
        legs = next_sortie(mission, legs)
        for index in data.draw(st.permutations(range(len(legs)))):  # out of turn as well
            leg = legs[index]
            place = data.draw(st.sampled_from(places_of((leg.path, leg.behind))))
            request = meeting_request(mission, legs, leg.auv, place)
            guaranteed = GuaranteedPaths(request)
            assert guaranteed.stay.round_ticks <= mission.limit_ticks
            choices = [
                path for path in paths_from(mission, request.cell) if guaranteed.allows(path)
            ]
            offer = guaranteed.stay
            if choices:  # the longest ones are the riskiest
                offer = guaranteed.offer(data.draw(st.sampled_from(choices[-5:])))
            legs = legs_after(request, offer)


@given(missions(), st.data())
def test_many_paths_at_once_are_judged_as_one_at_a_time(
    start: tuple[MissionSpec, tuple[SurveyLeg, ...]], data: st.DataObject
) -> None:
    mission, legs = start
    legs = tuple(
        replace(leg, prospect=data.draw(st.sampled_from(Prospect)))
        for leg in next_sortie(mission, legs)
    )
    leg = data.draw(st.sampled_from(legs))
    place = data.draw(st.sampled_from(places_of((leg.path, leg.behind))))
    request = meeting_request(mission, legs, leg.auv, place)
    guaranteed = GuaranteedPaths(request)
    for _, paths in itertools.groupby(paths_from(mission, request.cell), key=len):
        same_length = list(paths)
        tracks = np.array([path[::-1] for path in same_length]).transpose(2, 1, 0)
        assert guaranteed.round_ticks_each(tracks).tolist() == [
            guaranteed.offer(path).round_ticks if guaranteed.allows(path) else math.inf
            for path in same_length
        ]


# --- the next sortie -----------------------------------------------------------------------------


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
INITIAL_LEGS = legs_of([((3, 7), (4, 7)), ((2, 9), (3, 9)), ((1, 2), (1, 1))])
FIRST_SORTIE = next_sortie(REFERENCE, INITIAL_LEGS)


@given(missions(), st.data())
def test_a_sortie_leaves_as_early_as_the_limit_and_the_first_deadline_allow(
    start: tuple[MissionSpec, tuple[SurveyLeg, ...]], data: st.DataObject
) -> None:
    mission, legs = start
    now_s = 100.0 * mission.tick_s
    deadlines = data.draw(st.lists(st.integers(0, 300), min_size=len(legs), max_size=len(legs)))
    legs = tuple(
        replace(leg, surface_deadline_s=ticks * mission.tick_s)
        for leg, ticks in zip(legs, deadlines, strict=True)
    )
    sortie = guaranteed_sortie(SortieRequest(mission=mission, legs=legs, now_s=now_s))
    limit_s = mission.limit_ticks * mission.tick_s + 1e-9
    assert sortie.worst_case_s == worst_case_s(mission, sortie.route, sortie.depart_s)
    assert sortie.worst_case_s <= limit_s
    assert sortie.depart_s >= now_s
    if sortie.depart_s > now_s:
        earlier_s = sortie.depart_s - mission.tick_s
        first = sortie.route[0]
        reached_s = earlier_s + mission.c3.distance_m(first.point) / mission.uav_speed_mps
        too_long = worst_case_s(mission, sortie.route, earlier_s) > limit_s
        assert too_long or reached_s < first.surface_deadline_s - mission.tick_s * 1e-6


def test_an_initial_state_that_cannot_keep_the_limit_is_named() -> None:
    legs = INITIAL_LEGS
    assert initial_problem(REFERENCE, legs) is None
    assert initial_problem(replace(REFERENCE, sortie_limit_s=40.0), legs) == (
        'to search the initial paths of all AUVs takes up to 45 s;'
        ' allowed: a sortie limit of at least that'
    )
    wide = replace(REFERENCE, radio_range_m=9.0)
    assert 'cells are 10 m wide' in (initial_problem(wide, legs) or '')
    with pytest.raises(ValueError, match='takes up to 45 s; allowed'):
        guaranteed_sortie(
            SortieRequest(mission=replace(REFERENCE, sortie_limit_s=40.0), legs=legs, now_s=0.0)
        )


def order_of(request: SortieRequest) -> list[str]:
    route = guaranteed_sortie(request).route
    return list(dict.fromkeys(waypoint.auv for waypoint in route))


def test_a_sortie_goes_to_all_in_visiting_order_and_first_to_those_not_reached() -> None:
    request = SortieRequest(mission=REFERENCE, legs=FIRST_SORTIE, now_s=0.0)
    assert order_of(request) == ['auv_1', 'auv_2', 'auv_3']
    assert order_of(replace(request, overlooked=frozenset({'auv_3'})))[0] == 'auv_3'


def test_where_not_all_can_be_visited_those_not_reached_come_before_those_astray() -> None:
    tight = replace(REFERENCE, sortie_limit_s=30.0)  # a round to all takes 45 s
    request = SortieRequest(mission=tight, legs=FIRST_SORTIE, now_s=0.0)
    assert order_of(request) == ['auv_1']
    first, *others = FIRST_SORTIE
    astray = replace(request, legs=(replace(first, prospect=Prospect.ASTRAY), *others))
    assert order_of(astray) == ['auv_3']
    assert order_of(replace(request, overlooked=frozenset({'auv_3'}))) == ['auv_3']


# --- the planner that chooses from it ------------------------------------------------------------


def met_first(**changes: object) -> PlanRequest:
    """Return the first meeting of the reference mission."""
    request = meeting_request(REFERENCE, FIRST_SORTIE, 'auv_1', ((4, 7), None))
    return replace(request, **changes)


def test_robust_hands_over_a_full_path_with_its_search() -> None:
    plan = RobustPlanner().plan_path(met_first())
    assert plan.status is PlanStatus.OK
    assert len(plan.path) == 7
    assert plan.sortie_time_s <= 60.0
    assert_clears(REFERENCE, plan.path[::-1], plan.search)


def test_robust_keeps_the_tightest_limit_with_the_searches_that_were_promised() -> None:
    plan = RobustPlanner().plan_path(met_first(mission=replace(REFERENCE, sortie_limit_s=45.0)))
    assert plan.status is not PlanStatus.INFEASIBLE
    assert plan.sortie_time_s <= 45.0


def met_in_a_row() -> PlanRequest:
    """Return a meeting on a row of six cells, where every cell farther costs a round a lot."""
    mission = replace(
        REFERENCE,
        grid=GridSpec(cols=6, rows=1, cell_m=10.0),
        c3=Point(east_m=5.0, north_m=5.0),
        radio_range_m=10.0,
        uav_speed_mps=10.0,
        sortie_limit_s=4.0,
        path_cells=2,
    )
    legs = next_sortie(mission, legs_of([((0, 0), (1, 0))]))
    return meeting_request(mission, legs, 'auv_1', ((1, 0), None))


def met_early() -> PlanRequest:
    """Return the first meeting of the reference mission, with paths of three moves."""
    return met_first(mission=replace(REFERENCE, path_cells=3))


@pytest.mark.parametrize(
    ('meeting', 'limits_s'), [(met_early(), [45.0, 50.0, 60.0]), (met_in_a_row(), [4.0, 6.0, 9.0])]
)
@given(data=st.data())
def test_robust_chooses_as_a_comparison_of_all_paths_would(
    meeting: PlanRequest, limits_s: list[float], data: st.DataObject
) -> None:
    grid, moves = meeting.mission.grid, meeting.mission.path_cells
    sailed = {cell for leg in meeting.legs for cell in leg.track}
    land = data.draw(
        st.lists(st.sampled_from([cell for cell in grid.cells if cell not in sailed]), max_size=20)
        if data.draw(st.booleans())
        else st.just([])
    )
    grid = msgspec.structs.replace(grid, masked=tuple(land))
    visits = arrays(np.float64, (grid.rows, grid.cols), elements=st.integers(0, 3))
    values = np.where(grid.mask, 0.0, np.exp2(-data.draw(visits)))
    # It was entered, but not so often that the AUV might have to make room.
    values[grid.index(meeting.cell)] = min(values[grid.index(meeting.cell)], 0.5)
    limit_s = data.draw(st.sampled_from(limits_s))
    tie_order = data.draw(st.sampled_from(every_tie_order()))
    request = replace(
        meeting, mission=replace(meeting.mission, grid=grid, sortie_limit_s=limit_s), values=values
    )
    guaranteed = GuaranteedPaths(request)
    new_cells = [(col, row) for row, col in np.argwhere(values == 1.0).tolist()]

    def score(path: Path) -> float:
        total = 0.0
        for index, cell in enumerate(path[1:], start=1):
            total += values[cell[1], cell[0]] * 0.5 ** path[:index].count(cell)
        steps = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(path)]
        total -= 0.05 * sum(a != b for a, b in itertools.pairwise(steps))
        total -= 3.0 * guaranteed.offer(path).round_ticks / limit_s
        return total - (0.2 * moves_left(path[-1]) if moves_left(path[-1]) < math.inf else 0.0)

    def moves_left(cell: Cell) -> float:
        if not land:
            ways = [abs(cell[0] - new[0]) + abs(cell[1] - new[1]) for new in new_cells]
        else:
            moves_from_here = grid.moves_from([cell])
            ways = [moves_from_here[new] for new in new_cells if new in moves_from_here]
        return min(ways, default=math.inf)

    def gets_on(path: Path) -> bool:
        finds_new = any(cell in new_cells for cell in path[1:])
        return finds_new or moves_left(path[-1]) < moves_left(path[0])

    table = walk_table(moves, tie_order)
    walks = [table.path(walk, request.cell) for walk in range(4**moves)]
    allowed = [
        path
        for path in walks
        if all(grid.contains(cell) for cell in path) and guaranteed.allows(path)
    ]
    plan = RobustPlanner(tie_order=tie_order).plan_path(request)
    best = first_best(allowed, score)
    if best is not None and not gets_on(best):
        best = first_best([path for path in allowed if gets_on(path)], score) or best
    assert plan.path == (best or guaranteed.stay.path)


def first_best(paths: Sequence[Path], score: Callable[[Path], float]) -> Path | None:
    """Return the first of the paths with the highest score, to within what a tie may differ."""
    best = max(map(score, paths), default=None)
    return next((path for path in paths if best is not None and score(path) >= best - 1e-7), None)


@pytest.mark.parametrize(('new_col', 'end_col'), [(2, 1), (3, 3), (4, 3), (5, 3)])
def test_what_is_new_is_gone_for_though_the_round_costs_more_than_it_is_worth(
    new_col: int, end_col: int
) -> None:
    values = np.full((1, 6), 0.5)
    values[0, new_col] = 1.0
    plan = RobustPlanner().plan_path(replace(met_in_a_row(), values=values))
    assert plan.path[-1] == (end_col, 0)


@pytest.mark.parametrize(
    ('visits', 'other_path', 'newly_entered', 'end_col'),
    [
        (4, ((3, 0), (4, 0)), None, 0),  # auv_2 is nearer to the new cell: make room
        (3, ((3, 0), (4, 0)), None, 4),  # nobody was here for long
        (4, ((3, 0), (4, 0)), 4, 4),  # auv_2 finds something new: it needs no room
        (4, ((2, 0), (1, 0)), None, 4),  # it is nobody's turn but ours
        (4, ((3, 0), (2, 0)), None, 4),  # as near as the other, and before it
    ],
)
def test_where_nobody_finds_anything_new_all_make_room_for_the_nearest(
    visits: int, other_path: Path, newly_entered: int | None, end_col: int
) -> None:
    mission = replace(met_in_a_row().mission, sortie_limit_s=20.0)
    legs = next_sortie(mission, legs_of([((1, 0), (2, 0)), other_path]))
    values = np.full((1, 6), 0.5**visits)
    values[0, 5] = 1.0
    if newly_entered is not None:
        values[0, newly_entered] = 0.5
    request = replace(meeting_request(mission, legs, 'auv_1', ((2, 0), None)), values=values)
    assert RobustPlanner().plan_path(request).path[-1] == (end_col, 0)


def test_with_the_fleet_out_of_reach_an_auv_stays_near_and_is_said_to() -> None:
    beyond = replace(REFERENCE, sortie_limit_s=35.0)
    plan = RobustPlanner().plan_path(met_first(mission=beyond))
    stay = GuaranteedPaths(met_first(mission=beyond)).stay
    assert plan.status is PlanStatus.INFEASIBLE
    assert 35.0 < plan.sortie_time_s <= stay.round_ticks


def test_an_auv_astray_takes_no_room_from_the_others() -> None:
    request = met_first()
    first, *others = request.legs
    legs = (first, *(replace(leg, prospect=Prospect.ASTRAY) for leg in others))
    alone = GuaranteedPaths(replace(request, legs=legs))
    assert alone.others_ticks == 0
    assert alone.stay.round_ticks < GuaranteedPaths(request).stay.round_ticks


def test_an_auv_without_a_leg_is_refused() -> None:
    with pytest.raises(ValueError, match='auv_9 has no leg'):
        GuaranteedPaths(met_first(auv='auv_9'))


def test_an_auv_that_is_not_on_its_leg_is_refused() -> None:
    with pytest.raises(ValueError, match=r'auv_1 is at \[0, 0\], which is not on its leg'):
        GuaranteedPaths(met_first(cell=(0, 0)))
