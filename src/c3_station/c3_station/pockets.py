"""
Parts of a region with one way in: who goes in comes out again, or stays.

A *pocket* lies behind a cell, its *gate*: without it the pocket is cut off from where the AUVs
begin. A bay behind a strait is one, and so is the rest of a dead end, seen from each of its cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Set

    from msgs_json.geometry import Cell, GridSpec


@dataclass(slots=True, kw_only=True)
class _Visit:
    """A cell in a depth-first search of the region."""

    cell: Cell
    came_from: _Visit | None
    index: int
    ways: Iterator[Cell]
    """The neighbours that are not looked at yet."""
    back_to: int
    """The first visit that is next to this cell or to one behind it, by its index."""
    has_start: bool
    """Whether an AUV may begin here or behind."""
    is_to_enter: bool
    """Whether this cell or one behind it is to be entered."""
    is_gate: bool = False
    depth: int = 0
    """How many pockets behind this cell lie within one another at most."""


def least_repeats(
    region: GridSpec, starts: Collection[Cell], to_enter: Set[Cell], auvs: int
) -> int:
    """
    Return how many moves to or from pockets lead at least to cells that were entered before.

    Parameters
    ----------
    region
        Only what can be reached from the starts matters; they can all reach each other.
    starts
        Where AUVs may begin.
    to_enter
        The cells that they have to enter; all others were entered before.
    auvs
        How many there are: each may end in a pocket, and so in all that this one lies in.

    """
    repeats = 0
    chains: list[int] = []
    """Numbers of pockets within one another, each pocket in one of them."""
    for visit in _depth_first(region, starts, to_enter):
        if visit.is_gate and visit.cell not in to_enter and visit.cell not in starts:
            repeats += 1  # on the way in
        gate = visit.came_from
        if gate is None:
            chains.append(visit.depth)
            continue
        if visit.back_to >= gate.index and visit.is_to_enter and not visit.has_start:
            gate.is_gate = True
            visit.depth += 1
        chains.append(min(gate.depth, visit.depth))
        gate.depth = max(gate.depth, visit.depth)
    # On the way out, but for AUVs that end where most pockets lie within one another.
    return repeats + sum(sorted(chains)[: max(0, len(chains) - auvs)])


def _depth_first(
    region: GridSpec, starts: Collection[Cell], to_enter: Set[Cell]
) -> Iterator[_Visit]:
    """Yield the cells, each after all behind it; the last one is where the search began."""
    begun: dict[Cell, _Visit] = {}

    def begin(cell: Cell, came_from: _Visit | None) -> _Visit:
        begun[cell] = _Visit(
            cell=cell,
            came_from=came_from,
            index=len(begun),
            ways=iter(region.neighbours(cell)),
            back_to=len(begun),
            has_start=cell in starts,
            is_to_enter=cell in to_enter,
        )
        return begun[cell]

    visit: _Visit | None = begin(next(iter(starts)), None)
    while visit is not None:
        way = next(visit.ways, None)
        if way is not None:
            if way in begun:
                visit.back_to = min(visit.back_to, begun[way].index)
            else:
                visit = begin(way, visit)
            continue
        yield visit
        before = visit.came_from
        if before is not None:
            before.back_to = min(before.back_to, visit.back_to)
            before.has_start |= visit.has_start
            before.is_to_enter |= visit.is_to_enter
        visit = before
