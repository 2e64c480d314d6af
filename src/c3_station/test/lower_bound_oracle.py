"""When tiny regions can be explored at the earliest: every path of every AUV is tried."""

from __future__ import annotations

import heapq
import math
import operator
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from c3_station.scenario import Auv, Scenario
    from msgs_json.geometry import Cell

    _State = tuple[int, int, tuple[Cell, ...], tuple[float, ...]]
    """Tick of the last new entry, cells entered (bits), and of each AUV: cell and tick."""

T = TypeVar('T')


def earliest_ticks(scenario: Scenario) -> int:
    """
    Return the first tick at which all cells can be entered.

    AUVs are on time and begin with paths of one move. There is one AUV, or all of the region is in
    range of C3: then the next leg of an AUV begins when its leg and the way home and back are
    over, and no other AUV is in the way of that.
    """
    cells = scenario.region.cells
    bit = {cell: 1 << index for index, cell in enumerate(cells)}
    entered = sum({bit[cell] for auv in scenario.auvs for cell in auv.initial_path})
    # Of a fleet: where each AUV lies, and from which tick on it can be met.
    lies = tuple(auv.initial_path[-1] for auv in scenario.auvs)
    ends = [_ticks(scenario, auv, 1) for auv in scenario.auvs]
    free = tuple(max(end, _home_ticks(scenario, at)) for end, at in zip(ends, lies, strict=True))
    pending: list[_State] = [(max(ends), entered, lies, free)]
    seen: dict[tuple[int, tuple[Cell, ...]], list[tuple[float, ...]]] = {}
    while True:
        state = heapq.heappop(pending)
        ticks, entered, lies, free = state
        if entered == sum(bit.values()):
            return ticks
        # Those seen before have entered the same by then, and some lie there no later.
        earlier = seen.setdefault((entered, lies), [])
        if any(all(map(operator.le, other, free)) for other in earlier):
            continue
        earlier.append(free)
        for following in _next(scenario, state, bit):
            heapq.heappush(pending, following)


def _next(scenario: Scenario, state: _State, bit: dict[Cell, int]) -> Iterator[_State]:
    """Yield what can come next: the AUV that is free first gets a path, or nothing more."""
    ticks, entered, lies, free = state
    begins = min(free)
    if begins == math.inf:
        return
    number = free.index(begins)
    auv = scenario.auvs[number]
    yield ticks, entered, lies, _with(free, number, math.inf)
    for path in _paths(scenario, lies[number]):
        then, entered_then = ticks, entered
        for moves, cell in enumerate(path[1:], 1):
            if not entered_then & bit[cell]:
                entered_then |= bit[cell]
                then = int(begins) + _ticks(scenario, auv, moves)
        home_ticks = _home_ticks(scenario, path[0]) + _home_ticks(scenario, path[-1])
        lasts = max(_ticks(scenario, auv, len(path) - 1), home_ticks)
        yield (
            max(ticks, then),
            entered_then,
            _with(lies, number, path[-1]),
            _with(free, number, begins + lasts),
        )


def _with(items: tuple[T, ...], place: int, item: T) -> tuple[T, ...]:
    return (*items[:place], item, *items[place + 1 :])


def _paths(scenario: Scenario, cell: Cell) -> Iterator[tuple[Cell, ...]]:
    """Yield every path of 1 ... q moves from a cell."""
    paths = [(cell,)]
    for _ in range(scenario.planner.path_cells):
        paths = [(*path, to) for path in paths for to in scenario.region.neighbours(path[-1])]
        yield from paths


def _ticks(scenario: Scenario, auv: Auv, moves: int) -> int:
    return math.ceil(moves * scenario.region.cell_m / auv.speed_mps / scenario.tick_s - 1e-6)


def _home_ticks(scenario: Scenario, cell: Cell) -> int:
    """Return the ticks between C3 and a meeting with an AUV at a cell."""
    way_m = scenario.region.centre(cell).distance_m(scenario.c3) - scenario.radio.range_m
    return max(0, math.ceil(way_m / (scenario.uav.speed_mps * scenario.tick_s) - 1e-6))
