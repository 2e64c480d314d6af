"""The mission as compiled code flies it: step by step the same as the plain code it stands for."""

from __future__ import annotations

import inspect
import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numba
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from msgs_json.geometry import Cell, GridSpec, Point, whole_ticks, within_range
from uav_planner import mission_rollout as rollout
from uav_planner import tours as planned_tours
from uav_planner.guarantee import GuaranteedPaths, Offer, guaranteed_sortie, least_limit_s
from uav_planner.guarantee_oracle import legs_after, meeting_request, next_sortie, places_of
from uav_planner.mission_rollout import CellTours, CoolingSchedule
from uav_planner.oracle_boards import legs_of
from uav_planner.planning import MissionSpec, PlanRequest, SortieRequest, SurveyLeg, track_of
from uav_planner.sortie import Route, hop_ticks, lay_search, search_ticks, worst_case_s
from uav_planner.tours import NO_WAY, TourProblem, improved, joined, tour_of

if TYPE_CHECKING:
    from collections.abc import Callable

Path = tuple[Cell, ...]


ROW = MissionSpec(
    grid=GridSpec(cols=6, rows=1, cell_m=10.0),
    c3=Point(east_m=5.0, north_m=5.0),
    radio_range_m=10.0,
    uav_speed_mps=10.0,
    tick_s=1.0,
    sortie_limit_s=4.0,
    path_cells=2,
    min_path_cells=1,
)
"""C3 at the first of six cells in a row."""


# --- missions ------------------------------------------------------------------------------------


@st.composite
def regions(draw: st.DrawFn) -> GridSpec:
    """Draw a region, half of them with land; two cells at least lie together."""
    cols, rows = draw(st.integers(2, 7)), draw(st.integers(1, 7))
    cells = list(itertools.product(range(cols), range(rows)))
    land = draw(st.just(set()) | st.sets(st.sampled_from(cells), max_size=len(cells) // 3))
    return GridSpec(cols=cols, rows=rows, cell_m=10.0, masked=tuple(land - {(0, 0), (1, 0)}))


POINTS = st.builds(Point, east_m=st.floats(-50, 120), north_m=st.floats(-50, 120))


@st.composite
def specs(draw: st.DrawFn) -> MissionSpec:
    """Draw what stays the same; nothing comes near the limit."""
    path_cells = draw(st.integers(1, 5))
    tick_s = draw(st.sampled_from([0.25, 1.0, 3.0]))
    return MissionSpec(
        grid=draw(regions()),
        c3=draw(st.just(Point(east_m=0.0, north_m=5.0)) | POINTS),
        radio_range_m=draw(st.sampled_from([10.0, 14.0, 20.0, 33.3])),
        uav_speed_mps=draw(st.sampled_from([3.0, 4.0, 5.0, 11.1])),
        tick_s=tick_s,
        sortie_limit_s=1e6,
        path_cells=path_cells,
        min_path_cells=draw(st.integers(1, path_cells)),
        handover_s=draw(st.sampled_from([0.0, 0.0, 2.5])),
        surface_margin_s=draw(st.sampled_from([0.0, 2.0])) * tick_s,
    )


@st.composite
def walks(draw: st.DrawFn, grid: GridSpec, start: Cell, moves: int) -> Path:
    """Draw a path; it may turn back."""
    path = [start]
    for _ in range(moves):
        path.append(draw(st.sampled_from(grid.neighbours(path[-1]))))
    return tuple(path)


@st.composite
def fleets(draw: st.DrawFn, mission: MissionSpec) -> tuple[SurveyLeg, ...]:
    """Draw the initial legs of one to four AUVs."""
    grid = mission.grid
    starts = st.sampled_from([cell for cell in grid.cells if grid.neighbours(cell)])
    moves = st.integers(1, mission.path_cells)
    paths = [
        draw(walks(grid, start, draw(moves)))
        for start in draw(st.lists(starts, min_size=1, max_size=4))
    ]
    return tuple(
        replace(
            leg,
            surface_deadline_s=draw(st.integers(-5, 60)) * mission.tick_s,
            speed_mps=draw(st.sampled_from([0.7, 1.0, 2.5])),
        )
        for leg in legs_of(paths)
    )


@dataclass
class Sortie:
    """A sortie in which some AUVs have been met and given paths."""

    mission: MissionSpec
    legs: tuple[SurveyLeg, ...]
    to_meet: list[str]


@st.composite
def sorties(draw: st.DrawFn, met: st.SearchStrategy[str]) -> Sortie:
    """Draw a sortie in which none, some or all were met; it keeps its limit, tight or wide."""
    mission = draw(specs())
    legs = draw(fleets(mission))
    spare_ticks = draw(st.sampled_from([0, 1, 2, 5, 12, 40]))
    least_s = max(least_limit_s(mission, legs), mission.tick_s)
    mission = replace(mission, sortie_limit_s=least_s + spare_ticks * mission.tick_s)
    legs = next_sortie(mission, legs)
    to_meet = draw(st.permutations([leg.auv for leg in legs]))
    stages = {'none': 0, 'some': draw(st.integers(0, len(legs) - 1)), 'all': len(legs)}
    for _ in range(stages[draw(met)]):
        request = draw(surfacings(mission, legs, to_meet.pop()))
        path = draw(walks(mission.grid, request.cell, mission.path_cells))
        legs = legs_after(request, longest_allowed(GuaranteedPaths(request), path))
    return Sortie(mission, legs, to_meet)


@st.composite
def surfacings(
    draw: st.DrawFn, mission: MissionSpec, legs: tuple[SurveyLeg, ...], auv: str
) -> PlanRequest:
    """Draw where on its leg an AUV is met."""
    leg = next(leg for leg in legs if leg.auv == auv)
    place = draw(st.sampled_from(places_of((leg.path, leg.behind))))
    return meeting_request(mission, legs, auv, place)


def longest_allowed(guaranteed: GuaranteedPaths, path: Path) -> Offer:
    """Return as much of a path as may be handed over, else to stay in place."""
    least = len(guaranteed.stay.path) - 1  # Delta
    for moves in range(len(path) - 1, least - 1, -1):
        if guaranteed.allows(path[: moves + 1]):
            return guaranteed.offer(path[: moves + 1])
    return guaranteed.stay


def problem_at_c3(mission: MissionSpec, legs: tuple[SurveyLeg, ...], now_s: float) -> TourProblem:
    values = np.where(mission.grid.mask, 0.0, 1.0)
    for leg in legs:
        for cell in leg.path:
            values[mission.grid.index(cell)] = 0.5
    return TourProblem(mission=mission, legs=legs, values=values, now_s=now_s, position=mission.c3)


def complex_m(point: Point) -> complex:
    return complex(point.east_m, point.north_m)


def points_m(points: tuple[Point, ...]) -> list[complex]:
    return [pytest.approx(complex_m(point), abs=1e-6) for point in points]


# --- cells, hops and searches --------------------------------------------------------------------


@given(st.floats(-1e6, 1e6) | st.integers(-1000, 1000).map(lambda ticks: ticks + 3e-10))
def test_ticks_are_whole_as_everywhere(ticks: float) -> None:
    assert rollout.whole(ticks) == whole_ticks(ticks)


@settings(max_examples=50)
@given(specs(), POINTS, POINTS)
def test_hops_take_as_long_as_everywhere(mission: MissionSpec, start: Point, end: Point) -> None:
    constants = problem_at_c3(mission, (), 0.0).constants()
    ticks = rollout.hop(constants, complex_m(start), complex_m(end))
    assert ticks == hop_ticks(mission, start, end)


@settings(max_examples=50)
@given(specs(), st.data())
def test_searches_are_laid_as_for_a_sortie(mission: MissionSpec, data: st.DataObject) -> None:
    problem = problem_at_c3(mission, (), 0.0)
    cells = st.sampled_from(mission.grid.cells)  # next to each other or not
    track = tuple(data.draw(st.lists(cells, min_size=1, max_size=8)))
    centres = [mission.grid.centre(cell) for cell in track]
    # A little more than whole ticks away: hardly less than a tick would count for a hop.
    way_m = mission.radio_range_m + data.draw(st.integers(1, 9)) * mission.step_m * (1.0 + 5e-10)
    beyond = Point(east_m=centres[0].east_m + way_m, north_m=centres[0].north_m)
    origin = data.draw(POINTS | st.sampled_from([*centres, beyond]))
    numbers = np.array([problem.number(cell) for cell in track])
    for order, is_reversed in [(track, False), (track[::-1], True)]:
        laid = np.empty(len(track) + 1, np.complex128)
        length, ticks = rollout.lay(
            problem.constants(), complex_m(origin), numbers, len(track), is_reversed, laid
        )
        expected = lay_search(mission, origin, order)
        assert laid[:length].tolist() == points_m(expected)
        assert ticks == search_ticks(mission, expected)
        assert rollout.search_ticks(problem.constants(), laid, length) == ticks


@settings(max_examples=50)
@given(regions())
def test_ways_are_the_shortest_around_land(grid: GridSpec) -> None:
    mission = replace(ROW, grid=grid)
    problem = problem_at_c3(mission, (), 0.0)
    constants = problem.constants()
    for target in grid.cells:
        moves = grid.moves_from([target])
        for cell in grid.cells:
            here, there = problem.number(cell), problem.number(target)
            assert rollout.distance(constants, here, there) == moves.get(cell, NO_WAY)
            if cell not in moves:
                assert rollout.toward(constants, here, there) < 0
            elif cell != target:
                following = problem.cell_of(rollout.toward(constants, here, there))
                assert following in grid.neighbours(cell)
                assert moves[following] == moves[cell] - 1


# --- sorties -------------------------------------------------------------------------------------


@settings(max_examples=50)
@given(sorties(st.sampled_from(['none', 'all'])), st.integers(-20, 40))
def test_a_sortie_departs_as_that_of_the_uav(sortie: Sortie, now_ticks: int) -> None:
    check_departure(sortie, now_ticks)


@pytest.mark.slow
@settings(max_examples=300)
@given(sorties(st.sampled_from(['none', 'all'])), st.integers(-20, 40))
def test_many_sorties_depart_as_those_of_the_uav(sortie: Sortie, now_ticks: int) -> None:
    check_departure(sortie, now_ticks)


def check_departure(sortie: Sortie, now_ticks: int) -> None:
    mission = sortie.mission
    now_s = now_ticks * mission.tick_s
    request = SortieRequest(mission=mission, legs=sortie.legs, now_s=now_s)
    route = guaranteed_sortie(request).route
    problem = problem_at_c3(mission, sortie.legs, 0.0)
    state = problem.state()
    room = rollout.make_workspace(state)
    leaves, late = rollout.depart(problem.constants(), state, now_ticks, room)
    assert leaves * mission.tick_s == pytest.approx(departure_s(request))
    assert late == 0
    assert state.to_meet.all()
    for at, leg in enumerate(sortie.legs):
        search = tuple(each.point for each in route if each.auv == leg.auv)
        assert state.searches[at, : state.lengths[at]].tolist() == points_m(search)


def departure_s(request: SortieRequest) -> float:
    """Return when a sortie begins: as planned, or when one is heard at C3 that may be met."""
    mission = request.mission
    plan = guaranteed_sortie(request)
    time_s = request.now_s
    while time_s < plan.depart_s - 1e-6:
        for leg in request.legs:
            rest = tuple(each for each in plan.route if each.auv != leg.auv)
            if is_heard_at_c3(mission, leg, time_s) and may_meet(mission, rest, time_s):
                return time_s
        time_s += mission.tick_s
    return plan.depart_s


def is_heard_at_c3(mission: MissionSpec, leg: SurveyLeg, time_s: float) -> bool:
    """Return whether an AUV that surfaces where and when its path ends is in range of C3."""
    way_m = mission.grid.centre(leg.path[-1]).distance_m(mission.c3)
    is_up = leg.surface_deadline_s <= time_s + 1e-6
    return is_up and within_range(way_m, mission.radio_range_m)


def may_meet(mission: MissionSpec, rest: Route, time_s: float) -> bool:
    """Return whether a sortie that begins with one meeting at C3 keeps L."""
    handover_s = mission.handover_ticks * mission.tick_s
    rest_s = worst_case_s(mission, rest, time_s + handover_s)
    return handover_s + rest_s <= mission.sortie_limit_s + 1e-6


# --- meetings ------------------------------------------------------------------------------------


@dataclass
class Meeting:
    """A meeting, now or foreseen at the end of a leg, with the tour of the AUV that is met."""

    problem: TourProblem
    request: PlanRequest
    tour: Path

    @property
    def index(self) -> int:
        return [leg.auv for leg in self.problem.legs].index(self.request.auv)

    @property
    def walk(self) -> Path:
        """Return the next moves along the tour, nearer to C3 where it has too few."""
        mission, start = self.problem.mission, self.request.cell
        walk: Path = (start,)
        for target in self.tour:
            if self.problem.values[mission.grid.index(target)] == 1.0:
                walk += self.way(walk[-1], target)
        walk = walk[: mission.path_cells + 1]
        moves_least = max(self.problem.moves_least, mission.min_path_cells)
        if len(walk) <= moves_least:
            home = min(
                mission.grid.cells, key=lambda c: mission.grid.centre(c).distance_m(mission.c3)
            )
            walk = (*walk, *self.way(walk[-1], home))[: moves_least + 1]
        beside = self.request.behind or self.problem.legs[self.index].beside(walk[0])[0]
        while len(walk) <= moves_least:
            walk += (walk[-2] if len(walk) > 1 else beside,)
        return walk

    def way(self, start: Cell, end: Cell) -> Path:
        """Return the way between two cells that compiled code takes; none where there is none."""
        way: Path = ()
        cell = start
        while cell != end:
            number, target = self.problem.number(cell), self.problem.number(end)
            following = rollout.toward(self.problem.constants(), number, target)
            if following < 0:
                return ()
            cell = self.problem.cell_of(following)
            way += (cell,)
        return way


@st.composite
def meetings(draw: st.DrawFn) -> Meeting:
    """Draw a meeting of a sortie under way, on some map, with some tour."""
    sortie = draw(sorties(st.just('some')))
    mission, cells = sortie.mission, st.sampled_from(sortie.mission.grid.cells)
    request = draw(surfacings(mission, sortie.legs, draw(st.sampled_from(sortie.to_meet))))
    is_foreseen = draw(st.booleans())
    if is_foreseen:
        leg = next(leg for leg in sortie.legs if leg.auv == request.auv)
        request = replace(request, cell=leg.path[-1], behind=None)
    values = problem_at_c3(mission, sortie.legs, 0.0).values
    for cell in draw(st.sets(cells, max_size=20)):
        values[mission.grid.index(cell)] *= 0.5
    problem = TourProblem(
        mission=mission,
        legs=request.round_legs,
        values=values,
        now_s=request.now_s,
        position=draw(POINTS),
        met=None if is_foreseen else request.auv,
        cell=request.cell,
        behind=request.behind,
        moves_least=draw(st.integers(0, mission.path_cells)),
    )
    tour = draw(st.just([]) | st.lists(cells, unique=True, max_size=12))
    return Meeting(problem, request, tuple(tour))


@settings(max_examples=50)
@given(meetings())
def test_what_is_handed_over_is_the_longest_allowed_part_of_the_tour(meeting: Meeting) -> None:
    check_hand_over(meeting)


@pytest.mark.slow
@settings(max_examples=300)
@given(meetings())
def test_what_is_handed_over_is_it_at_many_meetings(meeting: Meeting) -> None:
    check_hand_over(meeting)


def check_hand_over(meeting: Meeting) -> None:
    problem, request = meeting.problem, meeting.request
    mission, index = problem.mission, meeting.index
    guaranteed = GuaranteedPaths(request)
    offer = longest_allowed(guaranteed, meeting.walk)
    constants, state, uav = problem.constants(), problem.state(), problem.uav()
    entered = state.entered.copy()
    tour = np.array([problem.number(cell) for cell in meeting.tour], np.int64)
    room = rollout.make_workspace(state)
    new, new_until, late = rollout.hand_over(
        constants, state, index, tour, uav.behind, uav.moves_least, 7, room
    )
    track = [problem.number(cell) for cell in track_of(offer.path, request.behind)]
    assert state.tracks[index, : state.sizes[index]].tolist() == track
    laid = state.searches[index, : state.lengths[index]].tolist()
    assert laid == points_m(offer.search)
    begin, end = (Point(east_m=at_m.real, north_m=at_m.imag) for at_m in (laid[0], laid[-1]))
    ticks = rollout.search_ticks(constants, state.searches[index], len(laid))
    ticks += guaranteed.before.ticks_to_point(begin) + guaranteed.after.ticks_to_point(end)
    assert ticks + guaranteed.handover_ticks == offer.round_ticks <= mission.limit_ticks
    assert late == 0
    assert not state.to_meet[index]
    speed_mps = problem.legs[index].speed_mps
    way_s = (len(offer.path) - 1) * mission.grid.cell_m / speed_mps + mission.surface_margin_s
    assert state.deadline_ticks[index] == 7 + whole_ticks(way_s / mission.tick_s)
    numbers = [problem.number(cell) for cell in offer.path]
    fresh = [
        at for at, cell in enumerate(numbers) if not entered[cell] and cell not in numbers[:at]
    ]
    assert (new, new_until) == (len(fresh), max(fresh, default=0))
    assert set(np.flatnonzero(state.entered != entered)) == {numbers[at] for at in fresh}
    rest = [at for at, cell in enumerate(tour) if not state.entered[cell]]
    assert state.begun[index] == min(rest, default=len(tour))


@pytest.mark.parametrize(
    ('path', 'search'),
    [
        # Toward (3, 0) or, which takes less, toward (1, 0), from which it came at first.
        (
            ((1, 0), (2, 0), (3, 0), (2, 0)),
            (Point(east_m=30, north_m=5), Point(east_m=20, north_m=5)),
        ),
        # Once round; with the cell to which it moved at first.
        (
            ((2, 0), (1, 0), (1, 1), (2, 1), (2, 0)),
            (Point(east_m=30, north_m=10), Point(east_m=20, north_m=5)),
        ),
    ],
)
@pytest.mark.parametrize('met', ['auv_1', None])
def test_an_auv_stays_in_place_with_the_cell_that_takes_the_least(
    path: Path, search: tuple[Point, ...], met: str | None
) -> None:
    grid = GridSpec(cols=6, rows=2, cell_m=10.0)
    mission = replace(ROW, grid=grid, min_path_cells=2)  # two moves to the east take too long
    leg = SurveyLeg(auv='auv_1', path=path, surface_deadline_s=0.0, search=search)
    problem = replace(problem_at_c3(mission, (leg,), 0.0), met=met, cell=path[-1])
    request = meeting_request(mission, (leg,), 'auv_1', (path[-1], None))
    check_hand_over(Meeting(problem, request, ((3, 0), (4, 0), (5, 0))))
    assert GuaranteedPaths(request).stay.path == ((2, 0), (1, 0), (2, 0))


def test_an_auv_at_the_end_of_its_tour_moves_to_and_fro_at_home() -> None:
    mission = replace(ROW, c3=ROW.grid.centre((2, 0)))
    leg = SurveyLeg(
        auv='auv_1', path=((3, 0), (2, 0)), surface_deadline_s=0.0, search=(mission.c3,)
    )
    problem = replace(problem_at_c3(mission, (leg,), 0.0), moves_least=2)
    meeting = Meeting(problem, meeting_request(mission, (leg,), 'auv_1', ((2, 0), None)), ())
    assert meeting.walk == ((2, 0), (3, 0), (2, 0))
    check_hand_over(meeting)


@pytest.mark.parametrize(
    ('search', 'late_ticks'),
    [
        (ROW.grid.centre((4, 0)), 3),
        (ROW.c3, 5),  # nothing of its leg can be heard from there: as late as can be
    ],
)
def test_where_nothing_keeps_the_limit_an_auv_stays_in_place_and_is_late(
    search: Point, late_ticks: int
) -> None:
    leg = SurveyLeg(auv='auv_1', path=((4, 0), (5, 0)), surface_deadline_s=0.0, search=(search,))
    problem = problem_at_c3(replace(ROW, sortie_limit_s=5.0), (leg,), 0.0)
    problem = replace(problem, met='auv_1', cell=(5, 0))
    state = problem.state()
    tour, room = np.array([4, 3]), rollout.make_workspace(state)
    assert rollout.hand_over(problem.constants(), state, 0, tour, -1, 1, 0, room) == (
        0,
        0,
        late_ticks,
    )
    assert state.tracks[0, : state.sizes[0]].tolist() == [4, 5]
    assert state.searches[0, : state.lengths[0]].tolist() == [complex_m(search)]


def test_an_auv_that_is_never_heard_does_not_keep_a_mission_for_ever() -> None:
    leg = SurveyLeg(auv='auv_1', path=((4, 0), (5, 0)), surface_deadline_s=0.0, search=(ROW.c3,))
    problem = problem_at_c3(ROW, (leg,), 0.0)
    outcome = problem.foreseen(joined([[3, 2, 1, 0]]))
    assert outcome.left == 4
    assert outcome.late_ticks > 0


# --- better tours --------------------------------------------------------------------------------


@st.composite
def dealt(draw: st.DrawFn, cells: list[int], auvs: int) -> CellTours:
    """Draw tours that share some cells; some may be empty."""
    order = draw(st.permutations(cells))
    cuts = sorted(draw(st.lists(st.integers(0, len(cells)), min_size=auvs - 1, max_size=auvs - 1)))
    return joined([order[begin:end] for begin, end in itertools.pairwise([0, *cuts, len(cells)])])


def tours_of(tours: CellTours) -> list[list[int]]:
    return [tour_of(tours, auv).tolist() for auv in range(tours.ends.size)]


def emptied(tours: CellTours) -> CellTours:
    """Return room for other tours of the same cells."""
    return CellTours(np.full_like(tours.cells, -1), np.full_like(tours.ends, -1))


SOME_TOURS = st.integers(1, 4).flatmap(lambda auvs: dealt(list(range(12)), auvs))


@settings(max_examples=50)
@given(SOME_TOURS, st.data())
def test_a_part_of_a_tour_is_turned_round(tours: CellTours, data: st.DataObject) -> None:
    cells = tours.cells.tolist()
    first, last = data.draw(st.integers(0, 12)), data.draw(st.integers(-1, 11))
    rollout.reverse(tours.cells, first, last)
    if first < last:
        cells[first : last + 1] = cells[first : last + 1][::-1]
    assert tours.cells.tolist() == cells


@settings(max_examples=50)
@given(SOME_TOURS.filter(lambda tours: tours.ends.size > 1), st.data())
def test_two_tours_end_as_the_other_one_did(tours: CellTours, data: st.DataObject) -> None:
    expected = tours_of(tours)
    auv, other, *_ = data.draw(st.permutations(range(len(expected))))
    place = data.draw(st.integers(0, len(expected[auv])))
    other_place = data.draw(st.integers(0, len(expected[other])))
    expected[auv], expected[other] = (
        expected[auv][:place] + expected[other][other_place:],
        expected[other][:other_place] + expected[auv][place:],
    )
    begins = [0, *tours.ends.tolist()]
    new = emptied(tours)
    rollout.exchange_tails(
        tours, auv, begins[auv] + place, other, begins[other] + other_place, new
    )
    assert tours_of(new) == expected


@settings(max_examples=50)
@given(SOME_TOURS, st.booleans(), st.booleans(), st.data())
def test_a_part_of_a_tour_is_put_beside_another_cell(
    tours: CellTours, is_reversed: bool, is_behind: bool, data: st.DataObject
) -> None:
    expected = tours_of(tours)
    tour = data.draw(st.sampled_from([each for each in expected if each]))
    first = data.draw(st.integers(0, len(tour) - 1))
    stop = data.draw(st.integers(first + 1, len(tour)))
    part = tour[first:stop]
    others = sorted(set(range(12)) - set(part))
    assume(others)
    beside = data.draw(st.sampled_from(others))
    begin = tours.cells.tolist().index(tour[0])
    new = emptied(tours)
    rollout.move_part(
        tours,
        begin + first,
        begin + stop,
        is_reversed,
        tours.cells.tolist().index(beside),
        is_behind,
        new,
    )
    del tour[first:stop]
    host = next(each for each in expected if beside in each)
    place = host.index(beside) + is_behind
    host[place:place] = part[::-1] if is_reversed else part
    assert tours_of(new) == expected


@st.composite
def problems(draw: st.DrawFn) -> tuple[TourProblem, CellTours]:
    """Draw a mission at C3 or at a meeting, and how what is left is dealt to the AUVs."""
    problem = draw(meetings()).problem
    if draw(st.booleans()):
        sortie = draw(sorties(st.sampled_from(['none', 'all'])))
        problem = problem_at_c3(sortie.mission, sortie.legs, 0.0)
    left = [
        cell
        for cell in np.flatnonzero(problem.values == 1.0).tolist()
        if any(problem.is_way(start, cell) for start in problem.starts)
    ]
    return problem, draw(dealt(left, len(problem.legs)))


@settings(max_examples=40)
@given(problems(), st.integers(0, 2**32))
def test_what_is_proposed_are_tours_in_which_two_neighbours_follow_each_other(
    drawn: tuple[TourProblem, CellTours], seed: int
) -> None:
    problem, tours = drawn
    constants, size = problem.constants(), problem.values.size
    owners, places = np.empty(size, np.int64), np.empty(size, np.int64)
    new = emptied(tours)
    for each_seed in range(seed, seed + 20):
        rollout.find_places(tours, owners, places)
        rng = np.random.default_rng(each_seed)
        if not rollout.propose(constants, tours, owners, places, rng, new):
            continue
        assert sorted(new.cells.tolist()) == sorted(tours.cells.tolist())
        assert new.ends.tolist() == sorted(new.ends.tolist())
        assert new.ends[-1] == new.cells.size
        cell, neighbour, other = drawn_first(problem, tours, each_seed)
        proposed = tours_of(new)
        if any(neighbour in tour for tour in proposed):
            pairs = [pair for tour in proposed for pair in itertools.pairwise(tour)]
            assert (cell, neighbour) in pairs or (neighbour, cell) in pairs
        else:
            assert cell == proposed[other][0]
        tours, new = new, emptied(tours)


def drawn_first(problem: TourProblem, tours: CellTours, seed: int) -> tuple[int, int, int]:
    """Return what a proposal is about: a cell, its neighbour, the AUV if that is in no tour."""
    rng = np.random.default_rng(seed)
    cell = int(tours.cells[int(rng.random() * tours.cells.size)])
    col, row = problem.cell_of(cell)
    east, north = [(1, 0), (0, 1), (-1, 0), (0, -1)][int(rng.random() * 4)]
    neighbour = problem.number((col + east, row + north))
    return cell, neighbour, int(rng.random() * tours.ends.size)


@settings(max_examples=40)
@given(problems(), st.booleans(), st.integers(1, 30), st.integers(0, 2**32))
def test_improved_tours_cost_no_more_and_are_the_same_each_time(
    drawn: tuple[TourProblem, CellTours], is_flown: bool, tries: int, seed: int
) -> None:
    check_improved(*drawn, is_flown, tries, seed)


@pytest.mark.slow
@settings(max_examples=100)
@given(problems(), st.booleans(), st.integers(1, 200), st.integers(0, 2**32))
def test_much_improved_tours_cost_no_more_and_are_the_same_each_time(
    drawn: tuple[TourProblem, CellTours], is_flown: bool, tries: int, seed: int
) -> None:
    check_improved(*drawn, is_flown, tries, seed)


def check_improved(
    problem: TourProblem, tours: CellTours, is_flown: bool, tries: int, seed: int
) -> None:
    constants, state, uav = problem.constants(), problem.state(), problem.uav()
    foreseen = [rollout.foresee(constants, state, uav, tours) for _ in range(2)]
    assert foreseen[0] == foreseen[1], 'the AUVs given were changed'
    schedule = CoolingSchedule(tries, 5.0, 0.3)
    before = tours_of(tours)
    once, again = (
        improved(problem, tours, is_flown, schedule, np.random.default_rng(seed)) for _ in range(2)
    )
    assert once.cost == again.cost
    assert tours_of(once.best) == tours_of(again.best)
    assert tours_of(once.last) == tours_of(again.last)
    assert tours_of(tours) == before, 'the tours given were changed'
    assert sorted(once.best.cells.tolist()) == sorted(tours.cells.tolist())
    assert once.cost <= cost_of(problem, tours, is_flown)
    spoilt = improved(
        problem,
        once.best,
        is_flown,
        CoolingSchedule(tries, 99.0, 99.0),
        np.random.default_rng(seed),
    )
    assert spoilt.cost <= cost_of(problem, once.best, is_flown)
    if not is_flown or problem.foreseen(once.best).left == 0:
        assert once.cost == cost_of(problem, once.best, is_flown)


def cost_of(problem: TourProblem, tours: CellTours, is_flown: bool) -> float:
    if is_flown:
        return problem.cost(tours)
    _, cost = rollout.lengths_of(problem.constants(), problem.state(), tours)
    return cost


# --- compiled once -------------------------------------------------------------------------------


@pytest.mark.parametrize('masked', [(), ((3, 1),)])
def test_nothing_is_left_to_be_compiled_after_the_warm_up(
    masked: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: set[tuple[str, ...]] = set()

    def noting(function: Callable[..., object]) -> Callable[..., object]:
        def noted(*values: object) -> object:
            calls.add((function.__name__, *(str(numba.typeof(value)) for value in values)))
            return function(*values)

        return noted

    for name, function in list(vars(planned_tours).items()):
        is_code = callable(function) and not inspect.isclass(function)
        if is_code and inspect.getmodule(function) is rollout:
            monkeypatch.setattr(planned_tours, name, noting(function))
    planned_tours.warm_up.__wrapped__()
    warm = calls.copy()
    assert {'anneal', 'foresee', 'walk_on'} <= {name for name, *_ in warm}
    grid = GridSpec(cols=6, rows=2, cell_m=10.0, masked=masked)
    leg = SurveyLeg(auv='auv_1', path=((4, 0), (5, 0)), surface_deadline_s=0.0, search=(ROW.c3,))
    problem = problem_at_c3(replace(ROW, grid=grid), (leg,), 0.0)
    for each in (problem, replace(problem, met='auv_1', cell=(5, 0), behind=(4, 0))):
        found = improved(
            each,
            planned_tours.lanes(each),
            True,
            CoolingSchedule(9, 5.0, 1.0),
            np.random.default_rng(1),
        )
        each.cost(found.best)
        each.path_along(found.best)
    assert calls == warm
