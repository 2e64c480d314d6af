"""
Before when no planner can have a region explored; claims and proofs are in ``docs/bounds.md``.

The bound knows what vehicles do not exceed (`fleet_limits`) and how soon they can have been met
(`first_meetings`). From that follows how much each AUV can do up to a time. Several demands say
how much has to be done: cells to enter, of either colour of the chequerboard, far from where the
AUVs begin, far from C3. The bound is the first tick at which none of them rules it out.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from c3_station.first_meetings import FirstMeetings
from c3_station.fleet_limits import fleet_limits
from c3_station.home_flights import round_ticks
from c3_station.pockets import least_repeats
from msgs_json.geometry import TOLERANCE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from numpy.typing import NDArray

    from c3_station.fleet_limits import AuvLimits, FleetLimits
    from c3_station.scenario import Scenario
    from msgs_json.geometry import Cell

    Done = Callable[[NDArray[np.float64]], NDArray[np.float64]]
    """How much an AUV can have done so many ticks after its first meeting."""

_DISTANCES = 12
"""
So many distances from where the AUVs begin make demands of their own, for the cells beyond.

Those between them hardly ever demand more.
"""


def lower_bound_s(scenario: Scenario) -> float:
    """
    Return a time before which no planner can have all cells entered, seconds.

    A whole number of ticks, whatever the seed. Cells to which no AUV can get are left out.
    """
    return _least_ticks(fleet_limits(scenario)) * scenario.tick_s


@functools.lru_cache(maxsize=1024)
def _least_ticks(limits: FleetLimits) -> int:
    meetings = FirstMeetings(limits)
    least_ticks = _initial_ticks(limits, meetings)
    for part in _parts(limits):
        for demand in (*_entry_demands(limits, part), *_flight_demands(limits, part)):
            least_ticks = demand.first_met(meetings, least_ticks)
    return least_ticks


def _initial_ticks(limits: FleetLimits, meetings: FirstMeetings) -> int:
    """Return when the initial paths can be entered: by then, or again after a first meeting."""
    entered: dict[Cell, int] = {}
    for auv in limits.auvs:
        for moves, cell in enumerate(auv.initial_path):
            ticks = auv.ticks(moves)
            entered[cell] = min(ticks, entered.get(cell, ticks))
    again = meetings.least_ticks.min(axis=0) + [auv.ticks(1) for auv in limits.auvs]
    return int(min(max(entered.values()), again.min()))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Demand:
    """Something of which so much has to be done before the region is explored."""

    amount: float
    done: Mapping[int, Done]
    """By the AUVs that can do it."""

    def is_met(self, meetings: FirstMeetings, ticks: int) -> bool:
        """Return whether the fleet can have done as much at a tick."""
        left = np.maximum(ticks - meetings.least_ticks, 0.0)
        done = np.zeros_like(left)
        for auv, done_by in self.done.items():
            done[:, auv] = done_by(left[:, auv])
        return meetings.most(done) >= self.amount * (1.0 - TOLERANCE)

    def first_met(self, meetings: FirstMeetings, ticks: int) -> int:
        """Return the first tick at which it can be met, the given one or later."""
        if self.is_met(meetings, ticks):
            return ticks
        step = 1
        while not self.is_met(meetings, ticks + step):
            ticks += step
            step *= 2
        while step > 1:
            step //= 2
            if not self.is_met(meetings, ticks + step):
                ticks += step
        return ticks + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pace:
    """How fast an AUV gets on after its first meeting, leg after leg."""

    move_ticks: float
    """For each move of the legs before the last one, on average at least."""
    last_leg: tuple[int, ...]
    """Ticks until 0, 1, ... q moves of the last one."""
    colour: int | None
    """Of the cell where it is first met; None where that is not known."""

    def entries(
        self, ticks: NDArray[np.float64], beyond: int, colour: int | None
    ) -> NDArray[np.float64]:
        """
        Return how many cells of a colour, or of both, an AUV can have entered at most.

        That many ticks after it is first met, and not counting its first ``beyond`` moves.
        """
        moves = self._moves(ticks)
        if colour is None:
            entries = moves - beyond
        elif self.colour is None:
            entries = (moves - beyond + 1) // 2
        else:
            # Colours alternate, and the first move leads to the other one.
            odd = int(self.colour != colour)
            entries = (moves + odd) // 2 - (beyond + odd) // 2
        return np.maximum(entries, 0.0)

    def _moves(self, ticks: NDArray[np.float64]) -> NDArray[np.float64]:
        most = np.zeros_like(ticks)
        for moves, last_ticks in enumerate(self.last_leg):
            before = np.floor((ticks - last_ticks) / self.move_ticks + TOLERANCE)
            most = np.maximum(most, np.where(before >= 0.0, before + moves, 0.0))
        return most


# --- what has to be done after the first meetings ------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """A connected part of the region with cells to enter."""

    auvs: Mapping[int, AuvLimits]
    """Those in it, by their place in the fleet."""
    to_enter: tuple[Cell, ...]
    """Its cells that are on no initial path."""
    least_rounds: NDArray[np.float64]
    """Shape (q,): how long a leg of 1, 2, ... q moves keeps the UAV away, in ticks."""
    rounds: NDArray[np.float64]
    """Shape (q, cells to enter): how long one that enters that cell does."""

    starts: frozenset[Cell]
    """Where AUVs may be at their first meetings."""
    repeats: int
    """How many moves at least lead to cells that were entered before."""


def _parts(limits: FleetLimits) -> Iterator[_Part]:
    entered = {cell for auv in limits.auvs for cell in auv.initial_path}
    auvs = dict(enumerate(limits.auvs))
    while auvs:
        first = next(iter(auvs.values()))
        cells = sorted(limits.region.moves_from(first.first_cells))
        connected = frozenset(cells)
        there = {auv: each for auv, each in auvs.items() if each.first_cells[0] in connected}
        auvs = {auv: each for auv, each in auvs.items() if auv not in there}
        is_to_enter = np.array([cell not in entered for cell in cells])
        if is_to_enter.any():
            to_enter = tuple(cell for cell in cells if cell not in entered)
            starts = frozenset(cell for auv in there.values() for cell in auv.first_cells)
            rounds = round_ticks(limits, cells)
            yield _Part(
                auvs=there,
                starts=starts,
                to_enter=to_enter,
                repeats=least_repeats(limits.region, starts, frozenset(to_enter), len(there)),
                least_rounds=rounds.min(axis=1),
                rounds=rounds[:, is_to_enter],
            )


def _entry_demands(limits: FleetLimits, part: _Part) -> Iterator[_Demand]:
    """Yield demands to enter all cells, and all of a colour, beyond a distance from the starts."""
    paces = {auv: _pace(limits, part, each) for auv, each in part.auvs.items()}
    moves_to = limits.region.moves_from(part.starts)
    distances = np.array([moves_to[cell] for cell in part.to_enter])
    colours = np.array([_colour(cell) for cell in part.to_enter])

    def demand(amount: int, beyond: int, colour: int | None) -> _Demand:
        entries = {
            auv: functools.partial(pace.entries, beyond=beyond, colour=colour)
            for auv, pace in paces.items()
        }
        return _Demand(amount=amount, done=entries)

    # The AUVs' first moves, up to the nearest cell to enter, are of no use.
    beyond_all = np.linspace(distances.min() - 1, distances.max() - 1, _DISTANCES).astype(int)
    if part.repeats:
        yield demand(len(part.to_enter) + part.repeats, 0, None)
    for beyond, colour in itertools.product(np.unique(beyond_all).tolist(), (None, 0, 1)):
        is_counted = (distances > beyond) & ((colour is None) | (colours == colour))
        yield demand(int(np.count_nonzero(is_counted)), beyond, colour)


def _pace(limits: FleetLimits, part: _Part, auv: AuvLimits) -> _Pace:
    last_leg = _leg_ticks(limits, auv)
    moves = np.arange(1, len(last_leg))
    return _Pace(
        move_ticks=float((np.maximum(last_leg[1:], part.least_rounds) / moves).min()),
        last_leg=tuple(last_leg.tolist()),
        colour=_colour(auv.first_cells[0]) if len(auv.first_cells) == 1 else None,
    )


def _flight_demands(limits: FleetLimits, part: _Part) -> Iterator[_Demand]:
    """Yield demands for the time that AUVs are under way or wait for the UAV's next round."""
    moves = np.arange(1, limits.path_cells + 1)
    own = {auv: _leg_ticks(limits, each)[1:] for auv, each in part.auvs.items()}
    # Nothing is known of the cells that are entered again: they cost the least there is.
    again = np.repeat(part.least_rounds[:, None], part.repeats, axis=1)
    rounds = np.hstack([part.rounds, again])
    legs = {auv: np.maximum(ticks[:, None], rounds) for auv, ticks in own.items()}
    in_last_legs = range(len(part.auvs) * limits.path_cells + 1)
    by_ticks = dict.fromkeys(part.auvs, 1.0)
    by_moves = {auv: 1.0 / each.cell_ticks for auv, each in part.auvs.items()}
    for weight in (by_ticks, by_moves):
        spent = {auv: functools.partial(np.multiply, weight[auv]) for auv in part.auvs}
        in_last = min(float((weight[auv] * own[auv] / moves).min()) for auv in part.auvs)
        shares = _dearest_first(
            weight[auv] * (leg / moves[:, None]).min(axis=0) for auv, leg in legs.items()
        )
        yield _Demand(
            amount=min(count * in_last + shares[count:].sum() for count in in_last_legs),
            done=spent,
        )
        wholes = _dearest_first(weight[auv] * leg.min(axis=0) for auv, leg in legs.items())
        yield _Demand(
            amount=min(
                count * in_last + wholes[count :: limits.path_cells].sum()
                for count in in_last_legs
            ),
            done=spent,
        )


def _dearest_first(costs: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return what each cell costs the AUV that it costs least, the dearest cell first."""
    return np.sort(np.min(list(costs), axis=0))[::-1]


def _leg_ticks(limits: FleetLimits, auv: AuvLimits) -> NDArray[np.int64]:
    """Return the ticks until 0, 1, ... q moves of a leg are made."""
    return np.array([auv.ticks(moves) for moves in range(limits.path_cells + 1)])


def _colour(cell: Cell) -> int:
    return (cell[0] + cell[1]) % 2
