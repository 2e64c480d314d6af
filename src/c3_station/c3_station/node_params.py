"""A scenario cut into the parameters of its nodes: the one way from scenario to mission."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import msgspec

from auv_sim.auv_params import AuvParams
from auv_sim.radio_model import RadioOutage
from auv_sim.surfacing import Silent, surfacing_model
from auv_sim.world_params import WorldParams
from c3_station.c3_params import C3Params
from c3_station.radio_timing import copies, hearing_s, response_s
from c3_station.scenario import C3 as C3
from c3_station.scenario import UAV as UAV
from c3_station.scenario import Scenario
from msgs_json.geometry import Cell
from uav_planner.uav_params import UavParams


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
            radio_queue_frames=scenario.radio.queue_frames,
            radio_link=_json(scenario.radio.link),
            radio_links=_json(scenario.radio.links),
            radio_outages=_json(tuple(_radio_outages(scenario))),
            seed=scenario.seed,
            tick_s=scenario.tick_s,
            max_mission_s=scenario.max_mission_s,
        ),
        c3=C3Params(
            name=C3,
            uav=UAV,
            max_message_bytes=scenario.radio.max_message_bytes,
            copies=copies(scenario, C3),
            scenario=_json(scenario),
        ),
        uav=UavParams(
            name=UAV,
            c3=C3,
            max_message_bytes=scenario.radio.max_message_bytes,
            copies=copies(scenario, UAV),
            response_s=response_s(scenario, UAV, C3),
            home_east_m=scenario.c3.east_m,
            home_north_m=scenario.c3.north_m,
            speed_mps=scenario.uav.speed_mps,
            altitude_m=scenario.uav.altitude_m,
            arrival_radius_m=scenario.uav.arrival_radius_m,
            hearing_s=hearing_s(scenario),
            tick_s=scenario.tick_s,
            wind_east_mps=scenario.uav.wind_east_mps,
            wind_north_mps=scenario.uav.wind_north_mps,
            planner=scenario.planner.name,
            planner_options=_json(scenario.planner.options),
            driver=scenario.uav.driver,
        ),
        auvs=tuple(
            AuvParams(
                name=auv.name,
                uav=UAV,
                max_message_bytes=scenario.radio.max_message_bytes,
                copies=copies(scenario, auv.name),
                response_s=response_s(scenario, auv.name, UAV),
                speed_mps=auv.speed_mps,
                depth_m=auv.depth_m,
                cols=region.cols,
                rows=region.rows,
                cell_m=region.cell_m,
                masked=_flat(region.masked),
                initial_path=_flat(auv.initial_path),
                surface_margin_s=scenario.sortie.surface_margin_s,
                tick_s=scenario.tick_s,
                seed=scenario.seed,
                driver=auv.driver,
                surfacing=_json(auv.surfacing),
                field=_json(scenario.field),
            )
            for auv in scenario.auvs
        ),
    )


def _radio_outages(scenario: Scenario) -> Iterator[RadioOutage]:
    """Yield the times in which AUVs are silent: their radio is the world's affair, not theirs."""
    for auv in scenario.auvs:
        model = surfacing_model(_json(auv.surfacing))
        if isinstance(model, Silent):
            until_s = model.from_s + model.sorties * scenario.sortie.limit_s
            yield RadioOutage(station=auv.name, from_s=model.from_s, until_s=until_s)


def _flat(cells: Iterable[Cell]) -> tuple[int, ...]:
    """Return cells as a list parameter holds them: col, row, col, row, ..."""
    return tuple(index for cell in cells for index in cell)


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()
