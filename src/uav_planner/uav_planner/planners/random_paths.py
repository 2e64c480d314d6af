"""Any allowed path is as good as any other: what a survey comes to without a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from msgs_json.randomness import agent_rng
from uav_planner.candidate_paths import Direction
from uav_planner.guarantee import GuaranteedPaths, guaranteed_sortie
from uav_planner.planning import Planner

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from msgs_json.geometry import Cell, GridSpec
    from uav_planner.planning import PlanRequest, PlanResult, SortiePlan, SortieRequest

BLOCK = 64
"""So many walks are drawn and looked at together."""
DRAWS_MAX = 32 * BLOCK
"""Where none of so many may be handed over, hardly any may: the AUV stays in place."""

_STEPS = np.array([direction.value for direction in Direction], dtype=np.intp)


class RandomPlanner(Planner):
    """
    Draws a path from all those of q moves that may be handed over, each with the same chance.

    Parameters
    ----------
    seed
        Of the draws. Each has a generator of its own, made from the seed, the AUV and the time, so
        that the same request gets the same answer.

    """

    guarantees_limit = True

    def __init__(self, *, seed: int = 0) -> None:
        self._seed = seed

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """
        Draw a path of q moves; where none that is allowed turned up, stay in place.

        Raises
        ------
        ValueError
            The AUV has no leg among those of the request, or is not on it.

        """
        guaranteed = GuaranteedPaths(request)
        rng = agent_rng(self._seed, f'{request.auv} {request.now_s!r}')
        for _ in range(DRAWS_MAX // BLOCK):
            walks = _draw_walks(
                rng, request.mission.grid, request.cell, request.mission.path_cells
            )
            # Those that may not be handed over are drawn again: the others stay equally likely.
            allowed = np.isfinite(guaranteed.round_ticks_each(walks[:, ::-1]))
            if allowed.any():
                cols, rows = walks[:, :, allowed.argmax()].tolist()
                return guaranteed.plan(tuple(zip(cols, rows, strict=True)))
        return guaranteed.plan(None)

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route of the next sortie; leave so that its worst case is at most L.

        Raises
        ------
        ValueError
            L cannot be kept from the beginning.

        """
        return guaranteed_sortie(request)


def make_random(*, seed: int = 0) -> RandomPlanner:
    """
    Draw each path from those with which L is kept whatever the AUVs do: the least one can do.

    Options are as in scenario files: ``seed`` of the draws, a whole number, 0 or more.
    """
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise ValueError(f'seed must be a whole number, 0 or more, not {seed!r}')
    return RandomPlanner(seed=seed)


def _draw_walks(
    rng: np.random.Generator, grid: GridSpec, start: Cell, moves: int
) -> NDArray[np.intp]:
    """Return the walks in the region among `BLOCK` random ones: shape (2, moves + 1, walks)."""
    walks = np.zeros((2, moves + 1, BLOCK), dtype=np.intp)
    walks[:, 1:] = _STEPS[rng.integers(len(_STEPS), size=(moves, BLOCK))].transpose(2, 0, 1)
    walks[:, 0] = np.array(start).reshape(2, 1)
    cols, rows = walks.cumsum(axis=1, out=walks)
    inside = (cols >= 0) & (cols < grid.cols) & (rows >= 0) & (rows < grid.rows)
    # Outside of the grid the index is anything: it is out already.
    inside &= ~grid.mask[rows % grid.rows, cols % grid.cols]
    return walks[:, :, inside.all(axis=0)]
