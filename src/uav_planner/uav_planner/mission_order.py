"""The mission order as the UAV takes it: is it a mission, and what does it mean for planners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgs_json.geometry import mask_problems, path_problem, unreachable_cells, whole_ticks
from uav_planner.planning import MissionSpec

if TYPE_CHECKING:
    from msgs_json.messages import MissionOrder


@dataclass(frozen=True, slots=True, kw_only=True)
class UavSetup:
    """What the UAV knows before it gets its order."""

    c3: str
    """Name of the station."""
    speed_mps: float
    altitude_m: float
    tick_s: float
    arrival_radius_m: float
    """Closer than this to a waypoint counts as there; 0 for a vehicle that arrives exactly."""
    hearing_s: float = 0.0
    """How long a frame of an AUV takes at most until it is heard."""

    @property
    def short_of_range_m(self) -> float:
        """
        Return by how much shorter than the radio's range the UAV has to plan, metres.

        It may hold an arrival radius short of a waypoint, and has flown on when a frame arrives.
        """
        flown_on_m = self.speed_mps * self.tick_s * whole_ticks(self.hearing_s / self.tick_s)
        return self.arrival_radius_m + flown_on_m


def problem_with_order(order: MissionOrder, setup: UavSetup) -> str | None:
    """Return why an order is no mission, or None."""
    if order.radio_range_m <= setup.short_of_range_m:
        return (
            f'radio_range_m must be more than {setup.short_of_range_m:g} m, the arrival radius and'
            f' the way until a frame is heard, is {order.radio_range_m:g}'
        )
    if order.sortie_limit_s < setup.tick_s:
        return (
            f'sortie_limit_s must be at least a tick of {setup.tick_s:g} s,'
            f' is {order.sortie_limit_s:g}'
        )
    names = [auv.name for auv in order.auvs]
    if len(set(names)) < len(names):
        return f'AUVs must have different names, are {", ".join(names)}'
    if order.min_path_cells > order.path_cells:
        return f'min_path_cells is {order.min_path_cells}, path_cells {order.path_cells}'
    for index, mask_problem in mask_problems(order.region):
        return f'region.masked[{index}] {mask_problem}'
    for auv in order.auvs:
        problem = path_problem(auv.leg.path, order.region)
        if problem:
            return f'path of {auv.name}: {problem}'
    unreachable = unreachable_cells(order.region, (auv.leg.path[0] for auv in order.auvs))
    if unreachable:
        return (
            f'no AUV can reach {len(unreachable)} cells of the region from where it starts,'
            f' {list(unreachable[0])} first'
        )
    return None


def mission_spec(order: MissionOrder, setup: UavSetup) -> MissionSpec:
    """Return what an order means for the planners of a UAV."""
    return MissionSpec(
        grid=order.region,
        c3=order.c3,
        # All of the leg must be heard there.
        radio_range_m=order.radio_range_m - setup.short_of_range_m,
        uav_speed_mps=setup.speed_mps,
        tick_s=setup.tick_s,
        sortie_limit_s=order.sortie_limit_s,
        path_cells=order.path_cells,
        min_path_cells=order.min_path_cells,
        handover_s=order.handover_s,
        surface_margin_s=order.surface_margin_s,
    )
