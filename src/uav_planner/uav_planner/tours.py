"""Tours: the cells that each AUV is still to enter, in order, as whole-mission plans know them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from msgs_json.geometry import GridSpec, Point, whole_ticks
from uav_planner.mission_rollout import (
    CellTours,
    CoolingSchedule,
    Legs,
    MissionConstants,
    Outcome,
    Position,
    Weights,
    anneal,
    cost_of,
    foresee,
    walk_on,
)
from uav_planner.planners.lanes import deal_strips
from uav_planner.planning import MissionSpec, Prospect, SurveyLeg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from msgs_json.geometry import Cell
    from uav_planner.planning import Tours


MASKED_CELLS_MAX = 6400
"""With 80 x 80 cells the ways between all of them take 0.16 GB, and 0.5 GB to be found."""

NO_WAY = 2 * MASKED_CELLS_MAX
"""Moves between cells where no way leads from one to the other: more than any way has."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TourProblem:
    """
    Which tours should the AUVs make from now on.

    Parameters
    ----------
    mission
        What stays the same.
    legs
        The AUVs for which tours are sought, in visiting order.
    values
        Exploration map, shape (rows, cols), `[row, col]`; what is 1 is still to be entered.
    now_s
        Time of planning.
    position
        Where the UAV is.
    met
        The AUV that is being met; None at C3.
    cell, behind
        Where that AUV is, as in `PlanRequest`.
    moves_least
        Moves that it is to make at least, also where nothing is left of its tour.

    """

    mission: MissionSpec
    legs: tuple[SurveyLeg, ...]
    values: NDArray[np.float64]
    now_s: float
    position: Point
    met: str | None = None
    cell: Cell | None = None
    behind: Cell | None = None
    moves_least: int = 0

    @property
    def first(self) -> int:
        """Return the index of the AUV that is being met, -1 if none."""
        return next((at for at, leg in enumerate(self.legs) if leg.auv == self.met), -1)

    @property
    def starts(self) -> list[int]:
        """Return the cell from which the tour of each AUV goes on."""
        return [self.number(self._track(leg)[0]) for leg in self.legs]

    def constants(self) -> MissionConstants:
        """Return the mission as compiled code takes it."""
        mission = self.mission
        next_cell, moves_between = ways(mission.grid)
        row, col = np.divmod(np.arange(self.values.size), mission.grid.cols)
        centre_m = (col + 0.5 + 1j * (row + 0.5)).astype(np.complex128) * mission.grid.cell_m
        c3_m = complex(mission.c3.east_m, mission.c3.north_m)
        to_c3_m = np.where(mission.grid.mask.ravel(), np.inf, abs(centre_m - c3_m))
        return MissionConstants(
            col=col,
            row=row,
            centre_m=centre_m,
            range_m=mission.radio_range_m,
            step_m=mission.step_m,
            c3_m=c3_m,
            home=int(to_c3_m.argmin()),
            limit_ticks=mission.limit_ticks,
            handover_ticks=mission.handover_ticks,
            margin_ticks=whole_ticks(mission.surface_margin_s / mission.tick_s),
            moves_max=mission.path_cells,
            moves_min=mission.min_path_cells,
            next_cell=next_cell,
            moves_between=moves_between,
        )

    def state(self) -> Legs:
        """Return the AUVs as compiled code takes them."""
        mission, auvs = self.mission, len(self.legs)
        each_track = [self._track(leg) for leg in self.legs]
        cells = max(mission.path_cells + 2, *map(len, each_track))
        waypoints = max(cells, *(len(leg.search) for leg in self.legs))
        tracks = np.zeros((auvs, cells), np.int64)
        searches = np.zeros((auvs, waypoints), np.complex128)
        sizes, lengths = np.zeros(auvs, np.int64), np.zeros(auvs, np.int64)
        for at, (leg, track) in enumerate(zip(self.legs, each_track, strict=True)):
            if not leg.search or len(track) < 2:
                raise ValueError(f'{leg.auv} has a leg without a search, or of no move')
            sizes[at], lengths[at] = len(track), len(leg.search)
            tracks[at, : len(track)] = [self.number(cell) for cell in track]
            searches[at, : len(leg.search)] = [
                complex(point.east_m, point.north_m) for point in leg.search
            ]
        return Legs(
            tracks=tracks,
            sizes=sizes,
            deadline_ticks=np.array(
                [
                    0 if leg.auv == self.met else self._ticks(leg.surface_deadline_s)
                    for leg in self.legs
                ]
            ),
            searches=searches,
            lengths=lengths,
            to_meet=np.array([leg.prospect is Prospect.ENDS for leg in self.legs]),
            begun=np.zeros(auvs, np.int64),
            ticks_per_cell=np.array(
                [mission.grid.cell_m / leg.speed_mps / mission.tick_s for leg in self.legs]
            ),
            entered=(self.values < 1.0).ravel(),
        )

    def uav(self) -> Position:
        """Return where the UAV is as compiled code takes it."""
        return Position(
            at_m=complex(self.position.east_m, self.position.north_m),
            met=self.first,
            behind=-1 if self.behind is None else self.number(self.behind),
            moves_least=max(self.moves_least, self.mission.min_path_cells),
        )

    def path_along(self, tours: CellTours) -> tuple[Cell, ...]:
        """Return the path of at most q moves along the tour of the AUV that is being met."""
        constants, state, uav = self.constants(), self.state(), self.uav()
        path = np.empty(state.tracks.shape[1], np.int64)
        tour = tour_of(tours, self.first)
        moves = walk_on(constants, state, self.first, tour, uav.moves_least, path)
        return tuple(self.cell_of(number) for number in path[: moves + 1].tolist())

    def foreseen(self, tours: CellTours) -> Outcome:
        """Return what the rest of the mission comes to with some tours."""
        return foresee(self.constants(), self.state(), self.uav(), tours)

    def moves_until_explored(self, tours: CellTours) -> int:
        """Return how many moves the AUV that is being met can make until all is explored."""
        ticks_per_cell = float(self.state().ticks_per_cell[self.first])
        return math.ceil(self.foreseen(tours).explored_ticks / ticks_per_cell)

    def cost(self, tours: CellTours) -> float:
        """Return what tours cost when they are flown to the end, ticks."""
        return cost_of(self.foreseen(tours), WEIGHTS)

    def named(self, tours: CellTours) -> Tours:
        """Return tours as planners hand them on."""
        return {
            leg.auv: tuple(self.cell_of(number) for number in tour_of(tours, at).tolist())
            for at, leg in enumerate(self.legs)
        }

    def moves_to(self, cells: NDArray[np.int64], other: NDArray[np.int64] | int) -> NDArray[Any]:
        """Return how many moves it is from cells to others, `NO_WAY` where none leads there."""
        _, moves_between = ways(self.mission.grid)
        if moves_between.size > 0:
            moves: NDArray[Any] = moves_between[cells, other]
            return moves
        cols = self.mission.grid.cols
        return abs(cells % cols - other % cols) + abs(cells // cols - other // cols)

    def is_way(self, cell: int, other: int) -> bool:
        """Return whether an AUV can come from one cell to another."""
        return bool(self.moves_to(np.array([cell]), other)[0] < NO_WAY)

    def cell_of(self, number: int) -> Cell:
        """Return the cell of a number."""
        row, col = divmod(number, self.mission.grid.cols)
        return (col, row)

    def _track(self, leg: SurveyLeg) -> tuple[Cell, ...]:
        """Return the track of a leg; of the AUV that is being met, where it is and beside what."""
        if leg.auv != self.met or self.cell is None:
            return leg.track
        beside = leg.beside(self.cell) if self.behind is None else (self.behind,)
        return tuple(each for other in beside for each in (self.cell, other))

    def number(self, cell: Cell) -> int:
        """Return the number of a cell, row by row."""
        return cell[1] * self.mission.grid.cols + cell[0]

    def _ticks(self, time_s: float) -> int:
        return whole_ticks((time_s - self.now_s) / self.mission.tick_s)


def joined(tours: Sequence[Sequence[int]]) -> CellTours:
    """Return some tours as compiled code takes them."""
    cells = [cell for tour in tours for cell in tour]
    ends = np.cumsum([len(tour) for tour in tours])
    return CellTours(cells=np.array(cells, np.int64), ends=ends)


def tour_of(tours: CellTours, auv: int) -> NDArray[np.int64]:
    """Return the tour of one AUV."""
    return tours.cells[tours.ends[auv - 1] if auv > 0 else 0 : tours.ends[auv]]


class Improved(NamedTuple):
    """What came of improving tours."""

    last: CellTours
    """Those last looked at, from which to go on."""
    best: CellTours
    cost: float
    """Of the best ones, ticks."""


def improved(
    problem: TourProblem,
    tours: CellTours,
    is_flown: bool,
    schedule: CoolingSchedule,
    rng: np.random.Generator,
) -> Improved:
    """
    Return better tours, found by simulated annealing.

    Better are those with which the mission, flown to its end, is done sooner; if none is flown,
    those that are shorter and end together.
    """
    return Improved(
        *anneal(
            problem.constants(),
            problem.state(),
            problem.uav(),
            tours,
            is_flown,
            WEIGHTS,
            schedule,
            rng,
        )
    )


WEIGHTS = Weights(late=10.0, revisit=5.0, neglect=1.0, idle=0.1)
"""
Ticks of the mission that a tick over L, a revisit, a tick of neglect or of idleness count.

Revisits and idleness make a mission longer only when something else goes wrong, but tell tours
apart of which neither is done sooner yet.
"""


def strips(problem: TourProblem) -> CellTours:
    """Return tours through strips side by side: with them the round is short for long."""
    starts = {leg.auv: leg.path[-1] for leg in problem.legs}
    dealt = deal_strips(problem.mission.grid, starts)
    return _begun_near(problem, [[problem.number(cell) for cell in dealt[auv]] for auv in starts])


def lanes(problem: TourProblem) -> CellTours:
    """Return tours along the lanes of the whole region, cut into as many parts as AUVs."""
    numbers = np.arange(problem.values.size).reshape(problem.values.shape)
    auvs = len(problem.legs)
    starts = problem.starts
    candidates = []
    for lines in (numbers, numbers.T):
        order = np.concatenate([line[::-1] if at % 2 else line for at, line in enumerate(lines)])
        is_open = (problem.values == 1.0).ravel()[order]
        parts = [part.tolist() for part in np.array_split(order[is_open], auvs)]
        moves = np.array([[_moves_to(problem, part, start) for start in starts] for part in parts])
        which, whose = linear_sum_assignment(moves)
        dealt = [parts[part] for _, part in sorted(zip(whose, which, strict=True))]
        candidates.append((moves[which, whose].sum(), _begun_near(problem, dealt)))
    return min(candidates, key=lambda each: each[0])[1]


def _begun_near(problem: TourProblem, tours: list[list[int]]) -> CellTours:
    """
    Return what is still to be entered of tours, each from the end that its AUV is nearer to.

    Cells to which no way leads from an AUV are put into tours of others.
    """
    is_open = (problem.values == 1.0).ravel()
    starts = problem.starts
    begun, orphans = [], []
    for tour, start in zip(tours, starts, strict=True):
        is_reached = problem.moves_to(np.array(tour, np.int64), start) < NO_WAY
        left = [cell for cell, reached in zip(tour, is_reached, strict=True) if reached]
        orphans += [cell for cell, reached in zip(tour, is_reached, strict=True) if not reached]
        left = [cell for cell in left if is_open[cell]]
        if left and _moves_to(problem, left[-1:], start) < _moves_to(problem, left[:1], start):
            left.reverse()
        begun.append(left)
    for cell in orphans:
        if is_open[cell]:
            _insert(problem, cell, starts, begun)
    return joined(begun)


def _moves_to(problem: TourProblem, tour: list[int], start: int) -> int:
    """Return how many moves it is to the nearer end of a tour; many for an empty one."""
    ends = np.array([*tour[:1], *tour[-1:]], np.int64)
    return int(problem.moves_to(ends, start).min(initial=NO_WAY))


def carried_on(problem: TourProblem, tours: Tours) -> CellTours:
    """
    Return the tours that were planned before, as they are to go on.

    What was entered since is left out. What nobody is to enter any more (an AUV surfaced early,
    or is lost) is put where it makes tours the least longer; what the AUV that is being met did
    not reach of its leg, at the head of its tour.
    """
    starts = problem.starts
    seen = (problem.values < 1.0).ravel()
    carried: list[list[int]] = []
    for at, leg in enumerate(problem.legs):
        missed = leg.path if at == problem.first else ()
        tour = []
        for cell in (*missed, *tours.get(leg.auv, ())):
            number = problem.number(cell)
            if not seen[number] and problem.is_way(starts[at], number):
                seen[number] = True
                tour.append(number)
        carried.append(tour)
    for orphan in np.flatnonzero(~seen).tolist():
        _insert(problem, orphan, starts, carried)
    return joined(carried)


def _insert(problem: TourProblem, cell: int, starts: list[int], tours: list[list[int]]) -> None:
    """Put a cell where it makes a tour the least longer; nowhere if no AUV can come to it."""
    best, best_place = math.inf, (-1, 0)
    for auv, (start, tour) in enumerate(zip(starts, tours, strict=True)):
        if not problem.is_way(start, cell):
            continue
        way = np.array([start, *tour])
        away = problem.moves_to(way, cell)
        more = away.astype(np.float64)
        more[:-1] += away[1:] - problem.moves_to(way[:-1], way[1:])
        place = int(more.argmin())
        if more[place] < best:
            best, best_place = more[place], (auv, place)
    auv, place = best_place
    if auv >= 0:
        tours[auv].insert(place, cell)


def check_region(grid: GridSpec) -> None:
    """
    Refuse a region for which `ways` would take too much memory.

    Raises
    ------
    ValueError
        It has a mask, and more than `MASKED_CELLS_MAX` cells.

    """
    if grid.masked and grid.cols * grid.rows > MASKED_CELLS_MAX:
        raise ValueError(
            f'a region with masked cells may have up to {MASKED_CELLS_MAX} cells, masked ones'
            f' included, with planner adaptive; it has {grid.cols * grid.rows}'
        )


@functools.lru_cache(maxsize=4)
def ways(grid: GridSpec) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
    """
    Return the way from every cell to every other around what is masked.

    The next cell on it and its moves, both of shape (cells, cells); (0, 0) where nothing is
    masked, since every way is straight then.
    """
    if not grid.masked:
        nothing = np.zeros((0, 0), np.int16)
        return nothing, nothing
    size = grid.cols * grid.rows
    pairs = [
        (row * grid.cols + col, beside[1] * grid.cols + beside[0])
        for col, row in grid.cells
        for beside in grid.neighbours((col, row))
    ]
    here, there = np.array(pairs).T
    graph = csr_array((np.ones(len(pairs)), (here, there)), shape=(size, size))
    moves, before = dijkstra(graph, unweighted=True, return_predecessors=True)
    moves[np.isinf(moves)] = NO_WAY
    # What comes last on the way back is the next on the way there. Row by row as everything else:
    # for arrays in another order all would have to be compiled once more.
    return before.T.astype(np.int16, order='C'), moves.astype(np.int16)


@functools.cache
def warm_up() -> None:
    """Have everything compiled, or loaded from where it was compiled before."""
    mission = MissionSpec(
        grid=GridSpec(cols=2, rows=2, cell_m=1.0),
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
    values = np.array([[0.5, 0.5], [1.0, 1.0]])
    problem = TourProblem(
        mission=mission,
        legs=(leg,),
        values=values,
        now_s=0.0,
        position=mission.c3,
        met='auv_1',
        cell=(1, 0),
    )
    tours = lanes(problem)
    improved(problem, tours, True, CoolingSchedule(2, 1.0, 1.0), np.random.default_rng(0))
    problem.cost(tours)
    problem.path_along(tours)
