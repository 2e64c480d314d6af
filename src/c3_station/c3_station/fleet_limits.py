"""
What no vehicle of a mission exceeds: how fast it is, and where and when its first leg may end.

This is all of a scenario that `lower_bound` knows. Times are in ticks, since everything that
counts happens at one: an AUV is heard, the UAV is back, an entered cell is noted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from auv_sim.surfacing import Early, Slow, surfacing_model
from msgs_json.geometry import TIME_TOLERANCE_S, Cell, GridSpec, Point, whole_ticks
from msgs_json.straight_motion import Flow

if TYPE_CHECKING:
    from auv_sim.surfacing import SurfacingModel
    from c3_station.scenario import Auv, Scenario

_SIMULATED = 'kinematic'
"""The driver to which surfacing models apply; other vehicles come up where they please."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AuvLimits:
    """What an AUV does not exceed."""

    initial_path: tuple[Cell, ...]
    cell_ticks: float
    """From one cell centre to the next at its fastest, in ticks, not rounded."""
    forgiven_ticks: float
    """An entry that is earlier by this than a tick is noted at that tick."""
    first_tick: int
    """Its initial leg does not end before this tick."""
    first_cells: tuple[Cell, ...]
    """Where it may then be: at these cells or, if there are several, between them."""

    def ticks(self, moves: int) -> int:
        """Return the ticks until so many moves from the beginning of a leg are noted."""
        return whole_ticks(moves * self.cell_ticks - self.forgiven_ticks)


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetLimits:
    """What the vehicles of a mission do not exceed."""

    region: GridSpec
    c3: Point
    range_m: float
    """How far the UAV hears an AUV."""
    home_m: float
    """How far from C3 counts as home for the UAV, metres."""
    astray_m: float
    """How far beside a cell's centre an AUV may lie when it is met, metres."""
    step_m: float
    """How far the UAV flies in a tick at most, metres."""
    path_cells: int
    auvs: tuple[AuvLimits, ...]


def fleet_limits(scenario: Scenario) -> FleetLimits:
    """Return what the vehicles of a scenario do not exceed, whatever its seed and planner."""
    uav, cell_m = scenario.uav, scenario.region.cell_m
    wind = Flow(east_mps=uav.wind_east_mps, north_mps=uav.wind_north_mps)
    models = [_surfacing(auv) for auv in scenario.auvs]
    stops_between = any(model is None or isinstance(model, Slow) for model in models)
    return FleetLimits(
        region=scenario.region,
        c3=scenario.c3,
        range_m=scenario.radio.range_m,
        home_m=uav.arrival_radius_m,
        astray_m=cell_m if stops_between else 0.0,
        step_m=(uav.speed_mps + wind.speed_mps) * scenario.tick_s,
        path_cells=scenario.planner.path_cells,
        auvs=tuple(
            _auv_limits(auv, model, cell_m, scenario.tick_s)
            for auv, model in zip(scenario.auvs, models, strict=True)
        ),
    )


def _surfacing(auv: Auv) -> SurfacingModel | None:
    if auv.driver != _SIMULATED:
        return None
    return surfacing_model(msgspec.json.encode(auv.surfacing).decode())


def _auv_limits(auv: Auv, model: SurfacingModel | None, cell_m: float, tick_s: float) -> AuvLimits:
    path = auv.initial_path
    current_mps = 0.0
    if isinstance(model, Slow):
        # Along a row or a column no more of it than this can help.
        current_mps = max(abs(model.current_east_mps), abs(model.current_north_mps))
    cell_ticks = cell_m / ((auv.speed_mps + current_mps) * tick_s)
    forgiven_ticks = TIME_TOLERANCE_S / tick_s
    # One in distress comes up early as well, but gets no further path.
    is_early = model is None or (isinstance(model, Early) and model.probability > 0.0)
    is_anywhere = is_early or isinstance(model, Slow)
    whole_leg = whole_ticks((len(path) - 1) * cell_ticks - forgiven_ticks)
    return AuvLimits(
        initial_path=path,
        cell_ticks=cell_ticks,
        forgiven_ticks=forgiven_ticks,
        first_tick=1 if is_early else whole_leg,
        first_cells=tuple(dict.fromkeys(path)) if is_anywhere else path[-1:],
    )
