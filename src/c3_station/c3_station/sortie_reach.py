"""Which cells no sortie could reach: by a planner that guarantees L, nobody is sent there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from c3_station.radio_timing import hearing_s
from c3_station.scenario import C3
from msgs_json.geometry import TOLERANCE, whole_ticks
from uav_planner.mission_order import UavSetup
from uav_planner.planners import make_planner

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from c3_station.scenario import Scenario
    from msgs_json.geometry import Cell

_NAMED = 12
"""So many cells are named in a message."""


def uav_setup(scenario: Scenario) -> UavSetup:
    """Return what the UAV of a scenario knows before it gets its order."""
    return UavSetup(
        c3=C3,
        speed_mps=scenario.uav.speed_mps,
        altitude_m=scenario.uav.altitude_m,
        tick_s=scenario.tick_s,
        arrival_radius_m=scenario.uav.arrival_radius_m,
        hearing_s=hearing_s(scenario),
    )


def beyond_reach(scenario: Scenario, limit_s: float, cells: Collection[Cell]) -> tuple[Cell, ...]:
    """
    Return the cells to which no sortie could go, from the south-west.

    An AUV may surface in each cell that it is sent to, and then the UAV must be able to meet it
    there and to be back in time, if it meets nobody else. With others to be met, more cells may be
    out of reach. A planner that guarantees no limit sends AUVs everywhere.

    Parameters
    ----------
    scenario
        The mission.
    limit_s
        Sortie time limit, L.
    cells
        Those that are to be surveyed.

    """
    choice = scenario.planner
    if not cells or not make_planner(choice.name, **choice.options).guarantees_limit:
        return ()
    tick_s = scenario.tick_s
    flight_ticks = -whole_ticks(-limit_s / tick_s) - whole_ticks(
        scenario.sortie.handover_s / tick_s
    )
    reach_m = flight_ticks // 2 * scenario.uav.speed_mps * tick_s + _range_m(scenario)
    away_m = _away_m(scenario, cells)
    return tuple(sorted(cell for cell in cells if away_m[cell] > reach_m * (1.0 + TOLERANCE)))


def problem_with_reach(scenario: Scenario, limit_s: float, cells: Collection[Cell]) -> str | None:
    """Return why a sortie limit is too short for cells that are to be surveyed, or None."""
    beyond = beyond_reach(scenario, limit_s, cells)
    if not beyond:
        return None
    tick_s = scenario.tick_s
    way_m = max(_away_m(scenario, beyond).values()) - _range_m(scenario)
    least_ticks = 2 * whole_ticks(way_m / (scenario.uav.speed_mps * tick_s))
    least_ticks += whole_ticks(scenario.sortie.handover_s / tick_s)
    return (
        f'is {limit_s:g}; allowed: at least {least_ticks * tick_s:g}, or no sortie could go to'
        f' {len(beyond)} of the cells and be back in time: {listed(beyond)}'
    )


def _range_m(scenario: Scenario) -> float:
    """Return how far from a waypoint of a plan an AUV is heard."""
    return scenario.radio.range_m - uav_setup(scenario).short_of_range_m


def _away_m(scenario: Scenario, cells: Iterable[Cell]) -> dict[Cell, float]:
    """Return how far from C3 the centres of cells are."""
    return {cell: scenario.c3.distance_m(scenario.region.centre(cell)) for cell in cells}


def listed(cells: Sequence[Cell]) -> str:
    """Return cells as people read them."""
    first = ', '.join(str(list(cell)) for cell in cells[:_NAMED])
    return first if len(cells) <= _NAMED else f'{first} and {len(cells) - _NAMED} more'
