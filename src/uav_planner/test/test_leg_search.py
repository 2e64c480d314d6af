"""The single-leg search: the same as a comparison of all paths, with bounds that hold."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from msgs_json.geometry import Cell, GridSpec, Point
from uav_planner.branch_and_bound import AGAINST, ALONG, Bounds, Rules, search
from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    SEARCHED_MOVES_MAX,
    TIE_MARGIN,
    TieOrder,
    every_tie_order,
    walk_table,
)
from uav_planner.guarantee import GuaranteedPaths, least_limit_s
from uav_planner.guarantee_oracle import meeting_request, next_sortie, places_of
from uav_planner.leg_search import LegScore, best_leg, bounds_of, rounds_of, warm_up, window_of
from uav_planner.oracle_boards import legs_of
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import MissionSpec, PlanRequest, PlanStatus, Prospect, track_of
from uav_planner.sortie import lay_search

if TYPE_CHECKING:
    from numpy.typing import NDArray

Path = tuple[Cell, ...]


# --- meetings ------------------------------------------------------------------------------------


@st.composite
def meetings(draw: st.DrawFn, moves: st.SearchStrategy[int]) -> PlanRequest:
    """Draw a meeting: of how many AUVs, where, on which map; the limit is tight or wide."""
    cols, rows = draw(st.integers(2, 7)), draw(st.integers(2, 7))
    cells = list(itertools.product(range(cols), range(rows)))
    path_cells = draw(moves)
    starts = draw(st.lists(st.sampled_from(cells), min_size=1, max_size=4))
    paths = [(start, _beside(start, cols)) for start in starts]
    sailed = set(itertools.chain(*paths))
    land = draw(st.sets(st.sampled_from(cells), max_size=len(cells) // 3)) - sailed
    mission = MissionSpec(
        grid=GridSpec(cols=cols, rows=rows, cell_m=10.0, masked=tuple(sorted(land))),
        c3=Point(east_m=draw(st.floats(-50, 120)), north_m=draw(st.floats(-50, 120))),
        radio_range_m=draw(st.sampled_from([10.0, 14.0, 20.0, 33.3])),
        uav_speed_mps=draw(st.sampled_from([3.0, 4.0, 11.1])),
        tick_s=1.0,
        sortie_limit_s=1e6,
        path_cells=path_cells,
        min_path_cells=draw(st.integers(1, path_cells)),
        handover_s=draw(st.sampled_from([0.0, 0.0, 2.5])),
    )
    legs = legs_of(tuple(paths))
    spare_s = draw(st.sampled_from([0.0, 1.0, 2.0, 5.0, 12.0, 40.0]))
    least_s = max(least_limit_s(mission, legs), mission.tick_s)
    mission = replace(mission, sortie_limit_s=least_s + spare_s)
    legs = tuple(
        replace(leg, prospect=draw(st.sampled_from(Prospect)))
        for leg in next_sortie(mission, legs)
    )
    leg = draw(st.sampled_from(legs))
    place = draw(st.sampled_from(places_of((leg.path, leg.behind))))
    request = meeting_request(mission, legs, leg.auv, place)
    visits = draw(st.lists(st.integers(0, 4), min_size=len(cells), max_size=len(cells)))
    values = np.where(mission.grid.mask, 0.0, np.exp2(-np.reshape(visits, (rows, cols))))
    return replace(request, values=values)


def _beside(cell: Cell, cols: int) -> Cell:
    col, row = cell
    return (col + 1, row) if col + 1 < cols else (col - 1, row)


@st.composite
def scores(draw: st.DrawFn, request: PlanRequest) -> LegScore:
    """Draw what paths are compared by: often as the planner ``robust`` does it, or otherwise."""
    shape = request.values.shape
    kinds = draw(st.integers(1, 2))
    fifths = st.lists(
        st.integers(0, 8), min_size=request.values.size, max_size=request.values.size
    )
    ends = np.array([-0.2 * np.reshape(draw(fifths), shape) for _ in range(kinds)])
    if draw(st.booleans()):
        ends[0][ends[0] < -0.8] = -np.inf
    is_about_ends = draw(st.booleans())
    return LegScore(
        values=np.zeros(shape) if is_about_ends else request.values,
        ends=ends,
        round_cost=draw(st.sampled_from([0.0, 3.0, 10.0])),
        turn_cost=0.0 if is_about_ends else 0.05,
    )


# --- the obvious way -----------------------------------------------------------------------------


@dataclass
class Walks:
    """All paths of some moves that stay in the region, in tie order, and what they come to."""

    tracks: NDArray[np.intp]
    """Columns and rows, `P_q` first: shape (2, cells, walks)."""
    scores: NDArray[np.float64]
    """Minus infinity for those that are not allowed."""

    def path(self, walk: int) -> Path:
        return tuple(map(tuple, self.tracks[:, ::-1, walk].T.tolist()))


def every_walk(
    request: PlanRequest,
    guaranteed: GuaranteedPaths,
    score: LegScore,
    tie_order: TieOrder,
    moves: int,
) -> Walks:
    """Score all walks one cell after the other."""
    grid = request.mission.grid
    table = walk_table(moves, tie_order)
    tracks = table.tracks(np.arange(4**moves), request.cell)
    cols, rows = tracks
    is_inside = ((cols >= 0) & (cols < grid.cols) & (rows >= 0) & (rows < grid.rows)).all(axis=0)
    tracks = tracks[:, :, is_inside]
    tracks = tracks[:, :, ~grid.mask[tracks[1], tracks[0]].any(axis=0)]
    cols, rows = tracks[:, ::-1]
    worth = np.zeros(tracks.shape[2])
    kinds = np.zeros(tracks.shape[2], dtype=np.intp)
    for place in range(1, moves + 1):
        before = ((cols[:place] == cols[place]) & (rows[:place] == rows[place])).sum(axis=0)
        values = score.values[rows[place], cols[place]]
        worth += values * 0.5**before
        kinds[(values == 1.0) & (before == 0)] = len(score.ends) - 1
    steps = np.diff(cols, axis=0) + 1j * np.diff(rows, axis=0)
    worth -= score.turn_cost * (steps[1:] != steps[:-1]).sum(axis=0)
    worth += score.ends[kinds, rows[-1], cols[-1]]
    if tracks.size:
        ticks = guaranteed.round_ticks_each(tracks)
        is_allowed = ticks < np.inf
        worth[~is_allowed] = -np.inf
        worth[is_allowed] -= score.round_cost / request.mission.limit_ticks * ticks[is_allowed]
    return Walks(tracks=tracks, scores=worth)


def best_of_all(
    request: PlanRequest,
    score: LegScore,
    tie_order: TieOrder = DOCUMENTED_TIE_ORDER,
) -> tuple[Path | None, float]:
    """Compare all paths of at least Delta moves, the shortest first."""
    guaranteed = GuaranteedPaths(request)
    mission = request.mission
    best: Path | None = None
    best_score = -math.inf
    for moves in range(mission.min_path_cells, mission.path_cells + 1):
        walks = every_walk(request, guaranteed, score, tie_order, moves)
        highest = float(walks.scores.max(initial=-math.inf))
        if highest > best_score + TIE_MARGIN:
            best = walks.path(int(np.argmax(walks.scores >= highest - TIE_MARGIN)))
            best_score = highest
    return best, best_score


def check_agreement(request: PlanRequest, score: LegScore, tie_order: TieOrder) -> None:
    guaranteed = GuaranteedPaths(request)
    path, best_score = best_of_all(request, score, tie_order)
    found = best_leg(request, guaranteed, score, tie_order=tie_order, node_limit=10_000_000)
    assert found.is_proven
    assert found.path == path
    assert found.score == pytest.approx(best_score, abs=TIE_MARGIN)
    assert path is None or guaranteed.allows(path)
    # In little time: first in haste, then all paths if that is enough.
    hurried = best_leg(request, guaranteed, score, tie_order=tie_order, node_limit=400)
    assert hurried.path == path or not hurried.is_proven
    assert hurried.score <= best_score + 2.0 * TIE_MARGIN
    assert hurried.path is None or guaranteed.allows(hurried.path)


# --- exact ---------------------------------------------------------------------------------------


@given(st.data(), meetings(st.integers(1, 5)), st.sampled_from(every_tie_order()))
@settings(max_examples=100)
def test_the_path_is_the_one_that_a_comparison_of_all_paths_finds(
    data: st.DataObject, request: PlanRequest, tie_order: TieOrder
) -> None:
    check_agreement(request, data.draw(scores(request)), tie_order)


@pytest.mark.slow
@pytest.mark.parametrize('moves', [6, 7, 8])
@given(st.data(), st.sampled_from(every_tie_order()))
@settings(max_examples=60)
def test_so_it_is_with_longer_paths(moves: int, data: st.DataObject, tie_order: TieOrder) -> None:
    request = data.draw(meetings(st.just(moves)))
    check_agreement(request, data.draw(scores(request)), tie_order)


REFERENCE = MissionSpec(
    grid=GridSpec(cols=10, rows=10, cell_m=10.0),
    c3=Point(east_m=50.0, north_m=0.0),
    radio_range_m=20.0,
    uav_speed_mps=4.0,
    tick_s=1.0,
    sortie_limit_s=60.0,
    path_cells=12,
    min_path_cells=12,
)
START = legs_of([((3, 7), (4, 7)), ((2, 9), (3, 9)), ((1, 2), (1, 1))])


def met_first(**changes: object) -> PlanRequest:
    """Return the first meeting of the reference mission, with paths of twelve moves."""
    mission = replace(REFERENCE, **changes)
    return meeting_request(mission, next_sortie(mission, START), 'auv_1', ((4, 7), None))


def by_value(request: PlanRequest, round_cost: float = 3.0) -> LegScore:
    ends = np.zeros((1, *request.values.shape))
    return LegScore(values=request.values, ends=ends, round_cost=round_cost)


ISLET = tuple(
    (col, row)
    for col, row in itertools.product(range(10), range(10))
    if not (4 <= col <= 6 and 6 <= row <= 8) or (col, row) == (5, 7)
)
"""Land all around but for a ring of water about one cell: there are 2^12 ways to go."""


@pytest.mark.parametrize(
    'limit_s',
    [46.0, pytest.param(50.0, marks=pytest.mark.slow), pytest.param(60.0, marks=pytest.mark.slow)],
)
def test_twelve_moves_are_searched_exactly(limit_s: float) -> None:
    request = met_first(
        grid=GridSpec(cols=10, rows=10, cell_m=10.0, masked=ISLET), sortie_limit_s=limit_s
    )
    col, row = np.meshgrid(np.arange(10), np.arange(10))
    values = np.where(request.mission.grid.mask, 0.0, 0.5 ** ((col * col + 3 * row) % 4))
    request = replace(request, values=values)
    guaranteed = GuaranteedPaths(request)
    score = by_value(request)
    found = best_leg(request, guaranteed, score)
    assert found.is_proven
    assert found.path is not None
    paths = [[request.cell]]
    for _ in range(12):
        paths = [
            [*path, cell] for path in paths for cell in request.mission.grid.neighbours(path[-1])
        ]
    assert len(paths) == 2**12
    tracks = np.array(paths).transpose(2, 1, 0)[:, ::-1]
    ticks = guaranteed.round_ticks_each(tracks)
    best = -math.inf
    for path, round_ticks in zip(paths, ticks.tolist(), strict=True):
        if round_ticks == math.inf:
            continue
        total = -3.0 / limit_s * round_ticks
        for place, (here_col, here_row) in enumerate(path[1:], start=1):
            visits = path[:place].count((here_col, here_row))
            total += values[here_row, here_col] * 0.5**visits
        steps = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(path)]
        total -= 0.05 * sum(a != b for a, b in itertools.pairwise(steps))
        best = max(best, total)
    assert found.score == pytest.approx(best, abs=TIE_MARGIN)


NODES_OF_TWELVE_MOVES = 20_000
"""What ``docs/planners.md`` says is enough for most paths of twelve moves."""


@pytest.mark.parametrize('seed', range(8))
def test_twelve_moves_take_few_nodes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    request = met_first(sortie_limit_s=60.0 + 5.0 * seed)
    request = replace(request, values=0.5 ** rng.integers(0, 4, (10, 10)))
    guaranteed = GuaranteedPaths(request)
    found = best_leg(request, guaranteed, by_value(request), node_limit=NODES_OF_TWELVE_MOVES)
    assert found.is_proven
    assert found.path is not None
    assert guaranteed.allows(found.path)


# --- bounds --------------------------------------------------------------------------------------


@given(st.data(), meetings(st.integers(1, 4)))
@settings(max_examples=60)
def test_no_path_comes_to_more_than_the_bounds_say(
    data: st.DataObject, request: PlanRequest
) -> None:
    score = data.draw(scores(request))
    guaranteed = GuaranteedPaths(request)
    mission = request.mission
    rules = Rules(
        turn_cost=score.turn_cost,
        tick_cost=score.round_cost / mission.limit_ticks,
        margin=TIE_MARGIN,
        moves_min=mission.path_cells,
        moves_max=mission.path_cells,
        is_first_fastest=True,
    )
    window = window_of(request, score, DOCUMENTED_TIE_ORDER)
    bounds = bounds_of(window, rounds_of(request, guaranteed), rules)
    walks = every_walk(request, guaranteed, score, DOCUMENTED_TIE_ORDER, mission.path_cells)
    allowed = np.flatnonzero(walks.scores > -np.inf).tolist()
    for walk in data.draw(st.permutations(allowed))[:30]:
        path = walks.path(walk)
        cells = [
            (row - request.cell[1]) * window.side + col - request.cell[0] + window.gains.size // 2
            for col, row in path
        ]
        for way, ticks in enumerate(rounds_each_way(request, guaranteed, path)):
            assert all(bounds.rounds[way, cell] <= ticks for cell in cells)
        # Of what the hand-overs take the bounds know nothing.
        total = walks.scores[walk] + rules.tick_cost * guaranteed.handover_ticks
        for made in range(1, mission.path_cells + 1):
            assert total <= hope(window.steps, bounds, score, path, cells, made) + TIE_MARGIN


def rounds_each_way(
    request: PlanRequest, guaranteed: GuaranteedPaths, path: Path
) -> tuple[float, float]:
    """Return the shortest round along the track of a path and against it, infinite beyond L."""
    track = track_of(path, request.behind)
    ticks = [math.inf, math.inf]
    for way, order in ((ALONG, track), (AGAINST, track[::-1])):
        for origin in guaranteed.origins:
            offer = guaranteed._offer(path, lay_search(request.mission, origin, order))
            if offer.round_ticks <= guaranteed.limit_ticks:
                ticks[way] = min(ticks[way], offer.round_ticks - guaranteed.handover_ticks)
    return ticks[0], ticks[1]


def hope(
    steps: NDArray[np.int64],
    bounds: Bounds,
    score: LegScore,
    path: Path,
    cells: list[int],
    made: int,
) -> float:
    """Return what a path can come to at best after some of its moves."""
    total, kind = 0.0, 0
    for place in range(1, made + 1):
        col, row = path[place]
        visits = path[:place].count(path[place])
        total += score.values[row, col] * 0.5**visits
        if visits == 0 and score.values[row, col] == 1.0:
            kind = len(score.ends) - 1
    moves = [steps.tolist().index(b - a) for a, b in itertools.pairwise(cells[: made + 1])]
    total -= score.turn_cost * sum(a != b for a, b in itertools.pairwise(moves))
    ticks = bounds.rounds[:, cells[: made + 1]].max(axis=1).min()
    level = int((ticks - bounds.base) / bounds.width)
    left = len(path) - 1 - made
    return total + float(bounds.outlook[left, cells[made], level, kind, moves[-1]])


# --- effort --------------------------------------------------------------------------------------


def test_a_search_that_is_cut_short_says_so_and_returns_what_it_has() -> None:
    request = met_first()
    guaranteed = GuaranteedPaths(request)
    score = by_value(request)
    full = best_leg(request, guaranteed, score)
    assert full.is_proven
    assert best_leg(request, guaranteed, score) == full
    cut = best_leg(request, guaranteed, score, node_limit=full.nodes // 2)
    assert not cut.is_proven
    assert cut.nodes <= full.nodes // 2 + 6  # each pass ends with the node that it is at
    assert cut.path is not None
    assert guaranteed.allows(cut.path)
    assert cut.score <= full.score
    nothing = best_leg(request, guaranteed, score, node_limit=1)
    assert nothing.path is None
    assert nothing.score == -math.inf


def test_where_no_path_is_allowed_there_is_none() -> None:
    request = met_first()
    nowhere = replace(by_value(request), ends=np.full((1, 10, 10), -np.inf))
    found = best_leg(request, GuaranteedPaths(request), nowhere)
    assert found.path is None
    assert found.score == -math.inf
    assert found.is_proven


def test_robust_plans_paths_as_long_as_are_searched() -> None:
    plan = RobustPlanner().plan_path(met_first())
    assert plan.status is PlanStatus.OK
    assert len(plan.path) == 13
    too_long = met_first(path_cells=SEARCHED_MOVES_MAX + 1)
    with pytest.raises(ValueError, match=r'path_cells is 25; allowed .* 1 to 24'):
        RobustPlanner().plan_path(too_long)


def test_nothing_is_left_to_be_compiled_after_the_warm_up() -> None:
    warm_up()
    before = getattr(search, 'signatures')[:]  # noqa: B009  of numba's, unknown to types
    request = met_first()
    best_leg(replace(request, behind=(3, 7)), GuaranteedPaths(request), by_value(request))
    assert getattr(search, 'signatures') == before  # noqa: B009
