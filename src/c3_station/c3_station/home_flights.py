"""How long the UAV is on its way between two meetings of one AUV: it flies by way of C3."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from msgs_json.geometry import TOLERANCE
from uav_planner.sortie import whole_ticks_of_each

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from c3_station.fleet_limits import FleetLimits
    from msgs_json.geometry import Cell


def round_ticks(limits: FleetLimits, cells: Sequence[Cell]) -> NDArray[np.float64]:
    """
    Return how long a leg keeps the UAV away from its AUV, by its moves and by a cell on it.

    Parameters
    ----------
    limits
        What the vehicles do not exceed.
    cells
        A connected part of the region.

    Returns
    -------
    NDArray[np.float64]
        Shape (q, cells): from the meeting where a leg of 1, 2, ... q moves begins, which enters
        that cell, home to C3 and to the meeting where it ends, in ticks. Both meetings are where
        they keep the UAV away least.

    """
    cols, rows = np.array(cells).T
    home = np.full((limits.region.rows, limits.region.cols), math.inf)
    home[rows, cols] = _home_ticks(limits, cols, rows)
    outside = np.isinf(home)
    # From a cell at most 0, 1, ... q moves away.
    nearest = [home]
    for _ in range(limits.path_cells):
        nearest.append(np.where(outside, math.inf, _least_beside(nearest[-1])))
    return np.array(
        [
            np.min([nearest[begun] + nearest[moves - begun] for begun in range(moves + 1)], axis=0)
            for moves in range(1, limits.path_cells + 1)
        ]
    )[:, rows, cols]


def _home_ticks(
    limits: FleetLimits, cols: NDArray[np.intp], rows: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the ticks from a meeting with an AUV at each cell to C3, or from there to it."""
    cell_m = limits.region.cell_m
    east_m = (cols + 0.5) * cell_m - limits.c3.east_m
    north_m = (rows + 0.5) * cell_m - limits.c3.north_m
    near_m = (limits.range_m + limits.home_m + limits.astray_m) * (1.0 + TOLERANCE)
    away_m = np.maximum(np.hypot(east_m, north_m) - near_m, 0.0)
    return np.maximum(whole_ticks_of_each(away_m / limits.step_m), 0.0)


def _least_beside(field: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each cell the least value at it and its four neighbours."""
    framed = np.pad(field, 1, constant_values=math.inf)
    least = field.copy()
    for beside in (framed[1:-1, 2:], framed[2:, 1:-1], framed[1:-1, :-2], framed[:-2, 1:-1]):
        np.minimum(least, beside, out=least)
    return least
