"""What the operator wants beside the order: which sortie limits and regions can be flown by."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import structs

from msgs_json.geometry import is_before, mask_problems, unreachable_cells
from uav_planner.sortie import leg_waypoints, round_ticks

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from msgs_json.geometry import Cell, GridSpec
    from uav_planner.planning import MissionSpec, SurveyLeg
    from uav_planner.sortie import Route


def problem_with_limit(limit_s: float, mission: MissionSpec) -> str | None:
    """Return why no planner could fly by a sortie limit, or None."""
    if is_before(limit_s, mission.tick_s):
        return _too_short(limit_s, mission.tick_s, 'a tick')
    return None


def problem_with_guarantee(
    limit_s: float, mission: MissionSpec, route: Route, legs: Iterable[SurveyLeg]
) -> str | None:
    """
    Return why a sortie limit could not be guaranteed any more, or None.

    Parameters
    ----------
    limit_s
        The limit.
    mission
        What stays the same for all sorties, by now.
    route
        Of the next sortie; it must keep the limit whatever the AUVs do.
    legs
        Those of all AUVs that are out, or may be. The next sortie may not go to all of them, and
        yet each must be within reach of some sortie: a lost one, too, may be heard again.

    """
    routes = {'the next sortie': route}
    routes |= {
        f'a sortie to {leg.auv} alone': tuple(leg_waypoints(leg, leg.search))
        for leg in legs
        if leg.search
    }
    for sortie, each in routes.items():
        needed_s = round_ticks(mission, each) * mission.tick_s
        if is_before(limit_s, needed_s):
            return _too_short(limit_s, needed_s, f'which {sortie} takes at worst')
    return None


def _too_short(limit_s: float, needed_s: float, reason: str) -> str:
    return f'sortie_limit_s is {limit_s:g}; allowed: at least {needed_s:g}, {reason}'


def problem_with_region(
    masked: tuple[Cell, ...],
    ordered: GridSpec,
    legs: Iterable[SurveyLeg],
    surveyors: Container[str],
) -> str | None:
    """
    Return why cells cannot be masked now, or no others be masked, or None.

    Parameters
    ----------
    masked
        The cells.
    ordered
        The region of the order.
    legs
        Those of all AUVs that are out, or may be: a lost one may be heard again.
    surveyors
        The AUVs among them that are to get further paths.

    """
    region = structs.replace(ordered, masked=masked)
    for index, problem in mask_problems(region):
        return f'masked[{index}] {problem}'
    if not {*ordered.masked} <= {*masked}:
        return 'masked leaves out cells that are masked in the order; AUVs go nowhere else'
    legs = tuple(legs)
    for leg in legs:
        for cell in leg.track:
            if not region.contains(cell):
                return f'masked holds {list(cell)}, which is on the path of {leg.auv}'
    ends = [leg.path[-1] for leg in legs if leg.auv in surveyors]
    unreachable = unreachable_cells(region, ends)
    if ends and unreachable:
        return (
            f'masked leaves {len(unreachable)} cells to which no AUV could get,'
            f' {list(unreachable[0])} first'
        )
    return None
