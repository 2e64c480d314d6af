"""A scenario cut into the parameters of its nodes: the one way from scenario to mission."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from auv_sim.auv_params import AuvParams
from auv_sim.world_params import WorldParams
from c3_station.c3_params import C3Params
from c3_station.scenario import Scenario
from uav_planner.uav_params import UavParams

C3 = 'c3'
UAV = 'uav'


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionParams:
    """The parameters of every node of a mission."""

    world: WorldParams
    c3: C3Params
    uav: UavParams
    auvs: tuple[AuvParams, ...]


def mission_params(scenario: Scenario) -> MissionParams:
    """Return what every node of a scenario must know, and no more."""
    region = scenario.region
    return MissionParams(
        world=WorldParams(
            auvs=tuple(auv.name for auv in scenario.auvs),
            uav=UAV,
            c3=C3,
            c3_east_m=scenario.c3.east_m,
            c3_north_m=scenario.c3.north_m,
            range_m=scenario.radio.range_m,
            max_message_bytes=scenario.radio.max_message_bytes,
            tick_s=scenario.tick_s,
            max_mission_s=scenario.max_mission_s,
        ),
        c3=C3Params(name=C3, uav=UAV, scenario=msgspec.json.encode(scenario).decode()),
        uav=UavParams(
            name=UAV,
            c3=C3,
            home_east_m=scenario.c3.east_m,
            home_north_m=scenario.c3.north_m,
            speed_mps=scenario.uav.speed_mps,
            altitude_m=scenario.uav.altitude_m,
            arrival_radius_m=scenario.uav.arrival_radius_m,
            tick_s=scenario.tick_s,
            planner=scenario.planner.name,
            planner_options=msgspec.json.encode(scenario.planner.options).decode(),
            driver=scenario.uav.driver,
        ),
        auvs=tuple(
            AuvParams(
                name=auv.name,
                uav=UAV,
                speed_mps=auv.speed_mps,
                depth_m=auv.depth_m,
                cols=region.cols,
                rows=region.rows,
                cell_m=region.cell_m,
                initial_path=tuple(index for cell in auv.initial_path for index in cell),
                surface_margin_s=scenario.sortie.surface_margin_s,
                tick_s=scenario.tick_s,
                seed=scenario.seed,
                driver=auv.driver,
                surfacing=msgspec.json.encode(auv.surfacing).decode(),
                field=msgspec.json.encode(scenario.field).decode(),
            )
            for auv in scenario.auvs
        ),
    )
