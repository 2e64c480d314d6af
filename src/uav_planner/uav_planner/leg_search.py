"""
The best path for one AUV from the guaranteed set, exactly, without looking at all of them.

Paths are grown move by move, depth first; what no continuation can make better than the best path
found so far is cut off. Two bounds say what continuations can come to at best:

- *the round*: the UAV comes within R of every cell of a path and of the one where it begins. How
  long that takes at least is worked out for each cell; the longest so far is a bound;
- *the outlook*: the most that so many more moves can add to a score from each cell, round and end
  included, worked out backwards from the last move as if only a cell that is left again at once
  were entered twice.

A path that is complete is compared by its exact round. Why the result is exact is argued in
``docs/planners.md``. Work is counted, not timed.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from msgs_json.geometry import GridSpec, Point
from uav_planner.branch_and_bound import (
    Bounds,
    Reach,
    Rounds,
    Rules,
    Trail,
    Window,
    fill_outlook,
    least_rounds,
    search,
)
from uav_planner.candidate_paths import (
    DOCUMENTED_TIE_ORDER,
    SEARCHED_MOVES_MAX,
    TIE_MARGIN,
    TURN_COST,
    TieOrder,
    window_around,
)
from uav_planner.guarantee import GuaranteedPaths
from uav_planner.planning import MissionSpec, PlanRequest, SurveyLeg

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from msgs_json.geometry import Cell
    from uav_planner import guarantee

    Floats = NDArray[np.float64]
    Points = NDArray[np.complex128]

NODE_LIMIT = 100_000
"""
Work at which a search gives up, unless told otherwise: some 0.15 s.

Twice what any path of nine moves took, and enough for 98 of 100 of twelve (``docs/planners.md``).
"""

PASSES = ((False, 0.1), (True, 0.3), (False, 0.6))
"""
In haste or not, and with which share of the nodes a path is searched until it is proven best.

The first is mostly enough. Where L leaves hardly any room, one in haste finds a good path, with
which the last one can drop many more.
"""

LEVELS = 16
"""Rounds from the shortest to L are told apart so finely in the outlook."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LegScore:
    """
    By what paths are compared.

    The sum of the values of the cells that a path enters, each halved once more for every time it
    was there before (`P_0` is not scored, coming back to it counts half), less its turns and its
    round, plus what its end is worth.
    """

    values: Floats
    """Shape (rows, cols), `[row, col]`; 1 where nobody was yet."""
    ends: Floats
    """
    Shape (1 or 2, rows, cols): what it is worth to end in a cell, minus infinity to forbid it.

    Of two, the first is for paths that enter no cell of value 1, the second for those that do.
    """
    round_cost: float
    """What a round as long as L takes off."""
    turn_cost: float = TURN_COST


@dataclass(frozen=True, slots=True, kw_only=True)
class LegSearch:
    """What a search came to."""

    path: tuple[Cell, ...] | None
    """The best path found, `P_0` first; None if none was."""
    score: float
    """Its score; minus infinity without one."""
    nodes: int
    """The work done: paths begun and rounds laid."""
    is_proven: bool
    """Whether no path is better by more than `TIE_MARGIN`; False where the node limit was met."""


def best_leg(
    request: PlanRequest,
    guaranteed: GuaranteedPaths,
    score: LegScore,
    *,
    moves_min: int | None = None,
    tie_order: TieOrder = DOCUMENTED_TIE_ORDER,
    node_limit: int = NODE_LIMIT,
) -> LegSearch:
    """
    Return the best allowed path.

    Of paths that are alike to within `TIE_MARGIN` it is the one of the fewest moves, and of these
    the first in tie order.

    Parameters
    ----------
    request
        Where the AUV was met, and the mission; its values say which cells are masked.
    guaranteed
        The guaranteed set of this request.
    score
        By what paths are compared.
    moves_min
        Moves of the shortest path that is looked at, Delta if not given; the longest has q.
    tie_order
        Which of several equally good paths is taken.
    node_limit
        The search gives up after so much work, with the best path that it has found.

    Raises
    ------
    ValueError
        q is more than `SEARCHED_MOVES_MAX`.

    """
    mission = request.mission
    check_moves(mission)
    window = window_of(request, score, tie_order)
    rounds = rounds_of(request, guaranteed)
    rules = Rules(
        turn_cost=score.turn_cost,
        tick_cost=score.round_cost / mission.limit_ticks,
        margin=TIE_MARGIN,
        moves_min=mission.min_path_cells if moves_min is None else moves_min,
        moves_max=mission.path_cells,
        is_first_fastest=tie_order.first_move_fastest,
    )
    bounds = bounds_of(window, rounds, rules)
    places = np.zeros(mission.path_cells + 1, np.int64)
    size, best, nodes, is_proven = 0, -math.inf, 0, False
    for is_hasty, share in PASSES:
        trail = trail_of(window, rules, bounds)
        limit = int(share * node_limit)
        enough = best - 2.0 * TIE_MARGIN  # what was found comes again, in tie order
        new_size, new_best, more, is_complete = search(
            window, rounds, rules, bounds, trail, limit, enough, is_hasty, places
        )
        nodes += more
        if new_size > 0:
            size, best = new_size, new_best
        is_proven = is_complete and not is_hasty
        if is_proven:
            break
    west, south = (middle - mission.path_cells - 1 for middle in request.cell)
    path = tuple(
        (west + place % window.side, south + place // window.side)
        for place in places[:size].tolist()
    )
    return LegSearch(
        path=path or None,
        score=best - rules.tick_cost * guaranteed.handover_ticks,
        nodes=nodes,
        is_proven=is_proven,
    )


def check_moves(mission: MissionSpec) -> None:
    """
    Check that the paths of a mission can be searched.

    Raises
    ------
    ValueError
        q is more than `SEARCHED_MOVES_MAX`.

    """
    if mission.path_cells > SEARCHED_MOVES_MAX:
        raise ValueError(
            f'path_cells is {mission.path_cells}; allowed where the best path is searched:'
            f' 1 to {SEARCHED_MOVES_MAX}'
        )


@functools.cache
def warm_up() -> None:
    """Have everything compiled, or loaded from where it was compiled before."""
    mission = MissionSpec(
        grid=GridSpec(cols=2, rows=1, cell_m=1.0),
        c3=Point(east_m=0.0, north_m=0.0),
        radio_range_m=1.0,
        uav_speed_mps=1.0,
        tick_s=1.0,
        sortie_limit_s=60.0,
        path_cells=1,
        min_path_cells=1,
    )
    leg = SurveyLeg(
        auv='auv_1', path=((0, 0), (1, 0)), surface_deadline_s=1.0, search=(mission.c3,)
    )
    values = np.array([[1.0, 0.5]])
    request = PlanRequest(
        mission=mission, values=values, auv=leg.auv, cell=(1, 0), legs=(leg,), now_s=1.0
    )
    score = LegScore(values=values, ends=np.zeros((1, 1, 2)), round_cost=0.0)
    best_leg(request, GuaranteedPaths(request), score)


def window_of(request: PlanRequest, score: LegScore, tie_order: TieOrder) -> Window:
    """Return the cells that a path can reach as compiled code takes them."""
    reach = request.mission.path_cells + 1  # with a border that no path enters
    side = 2 * reach + 1
    values, is_open, *ends = (
        window_around(cells, request.cell, reach).ravel()
        for cells in (score.values, request.values, *score.ends)
    )
    values[values.size // 2] *= 0.5  # the AUV was there before
    steps = np.array([direction.value for direction in tie_order.directions])
    col, row = request.cell
    return Window(
        side=side,
        gains=values,
        ends=np.array(ends),
        is_open=is_open > 0.0,
        steps=steps[:, 0] + side * steps[:, 1],
        corner_m=complex(col - reach + 0.5, row - reach + 0.5) * request.mission.grid.cell_m,
        cell_m=request.mission.grid.cell_m,
    )


def rounds_of(request: PlanRequest, guaranteed: GuaranteedPaths) -> Rounds:
    """Return what the round of a path depends on as compiled code takes it."""
    mission = request.mission
    behind = () if request.behind is None else (mission.grid.centre(request.behind),)
    return Rounds(
        before=_reach(guaranteed.before),
        after=_reach(guaranteed.after),
        origins_m=_each_m(guaranteed.origins),
        behind_m=_each_m(behind),
        c3_m=complex(mission.c3.east_m, mission.c3.north_m),
        range_m=mission.radio_range_m,
        step_m=mission.step_m,
        limit=float(guaranteed.limit_ticks - guaranteed.handover_ticks),
        limit_alone=float(mission.limit_ticks - mission.handover_ticks),
    )


def _reach(reach: guarantee.Reach) -> Reach:
    return Reach(points_m=_each_m(reach.points), ticks=np.array(reach.ticks, np.float64))


def _each_m(points: Iterable[Point]) -> Points:
    return np.array([complex(point.east_m, point.north_m) for point in points], np.complex128)


def bounds_of(window: Window, rounds: Rounds, rules: Rules) -> Bounds:
    """Return what paths can come to at best."""
    cells = window.gains.size
    least = np.full((2, cells), np.inf)
    least_rounds(window, rounds, rules.moves_max, least)
    either = least.min(axis=0)
    base = float(either[cells // 2])  # L allows it, as it allows to stay in place
    width = float(max(1, math.ceil((rounds.limit - base + 1.0) / LEVELS)))
    levels = int((rounds.limit - base) / width) + 1
    outlook = np.empty((rules.moves_max, cells, levels, len(window.ends), 4))
    bounds = Bounds(rounds=least, either=either, base=base, width=width, outlook=outlook)
    fill_outlook(window, rules, bounds)
    return bounds


def trail_of(window: Window, rules: Rules, bounds: Bounds) -> Trail:
    """Return the path that has not left `P_0`."""
    cells, start = rules.moves_max + 1, window.gains.size // 2
    return Trail(
        cells=np.full(cells, start),
        moves=np.zeros(cells, np.int64),
        kinds=np.zeros(cells, np.int64),
        ranks=np.zeros(cells, np.int64),
        counts=np.zeros(cells, np.int64),
        tried=np.zeros(cells, np.int64),
        ticks=np.tile(bounds.rounds[:, start], (cells, 1)),
        scores=np.zeros(cells),
        gains=np.zeros(cells),
        ahead=np.zeros((cells, 4), np.int64),
        hopes=np.zeros((cells, 4)),
    )
