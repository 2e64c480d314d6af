"""Which of all paths from a cell is the best one that is allowed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from uav_planner.candidate_paths import TIE_MARGIN, TURN_COST

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from msgs_json.geometry import Cell
    from uav_planner.candidate_paths import WalkTable

SINGLE_CHECKS = 8
"""So many of the best candidates are checked one by one: it takes as long as 100 at once."""
SCORE_DROPS = (2 * TURN_COST, 1.5, math.inf)
"""Candidates are ranked in parts that reach so far below the best score: a few first, then all."""


class AllowedPaths(Protocol):
    """The set of paths that may be handed over at a meeting."""

    def allows(self, path: tuple[Cell, ...]) -> bool:
        """Return whether one path may be handed over."""
        ...

    def allows_each(self, tracks: NDArray[np.intp]) -> NDArray[np.bool_]:
        """
        Return the same for many paths at once, shape (paths,).

        ``tracks`` are their cells in searching order, `P_q` first: shape (2, cells, paths).
        """
        ...


def best_path(
    table: WalkTable, values: NDArray[np.float64], start: Cell, allowed: AllowedPaths
) -> tuple[Cell, ...] | None:
    """
    Return the path that a comparison of all allowed walks in tie order ends with, or None.

    Parameters
    ----------
    table
        The walks to choose from.
    values
        Exploration map, shape (rows, cols), `[row, col]`.
    start
        `P_0`.
    allowed
        Which of them may be handed over.

    """
    walk = _Choice(table, start, table.scores(values, start), allowed).best()
    return None if walk is None else table.path(walk, start)


@dataclass(frozen=True, slots=True)
class _Choice:
    """Which of the walks of a table from a cell is the best allowed one."""

    table: WalkTable
    start: Cell
    scores: NDArray[np.float64]
    allowed: AllowedPaths

    def best(self) -> int | None:
        """
        Return the walk that a comparison of all allowed walks in tie order ends with.

        Best first, so that only a few need to be checked.
        """
        best = self._first_allowed()
        if best is None:
            return None
        # Scores that differ by rounding only tie, and the one that comes first wins: follow them
        # down to the first gap and compare as the full comparison would.
        scores = self.scores
        floor = scores[best]
        while (lower := scores[(scores < floor) & (scores >= floor - TIE_MARGIN)]).size > 0:
            floor = lower.min()
        if floor == scores[best]:
            return best
        rivals = np.flatnonzero((scores >= floor) & (scores <= scores[best]))
        chosen, *later = rivals[self._are_allowed(rivals)].tolist()
        for walk in later:
            if scores[walk] > scores[chosen] + TIE_MARGIN:
                chosen = walk
        return int(chosen)

    def _first_allowed(self) -> int | None:
        """Return the first allowed walk in order of falling score, equal scores in tie order."""
        single_checks = SINGLE_CHECKS
        for walks in self._best_first():
            single, many = walks[:single_checks], walks[single_checks:]
            single_checks -= single.size
            for walk in single.tolist():
                if self.allowed.allows(self.table.path(walk, self.start)):
                    return int(walk)
            if many.size > 0:
                allowed = self._are_allowed(many)
                if allowed.any():
                    return int(many[allowed.argmax()])
        return None

    def _best_first(self) -> Iterator[NDArray[np.intp]]:
        """Yield all walks within the region in that order, in parts: sorting all is slow."""
        scores = self.scores
        ceiling = np.inf
        for floor in (scores.max() - drop for drop in SCORE_DROPS):
            walks = np.flatnonzero((scores >= floor) & (scores < ceiling) & (scores > -np.inf))
            yield walks[np.argsort(-scores[walks], kind='stable')]
            ceiling = floor

    def _are_allowed(self, walks: NDArray[np.intp]) -> NDArray[np.bool_]:
        return self.allowed.allows_each(self.table.tracks(walks, self.start))
