"""The UAV's settings, as node parameters, and the agent made from them."""

from __future__ import annotations

from typing import Annotated

import msgspec

from msgs_json.agent_params import AgentParams
from msgs_json.agent_shell import AgentSetting, AgentShell, recalled
from msgs_json.custody import SampleCustody
from msgs_json.drivers import DriverPorts, UavDriverSetup, find_driver
from msgs_json.geometry import Point
from msgs_json.params import param
from msgs_json.straight_motion import Flow
from uav_planner.mission_order import UavSetup
from uav_planner.planners import make_planner
from uav_planner.planning import Planner
from uav_planner.uav_agent import UavAgent

DRIVERS = 'uav_planner.drivers'


class UavParams(AgentParams, frozen=True):
    """Parameters of ``uav_planner uav``."""

    c3: Annotated[str, param('name of the station')] = 'c3'
    home_east_m: Annotated[
        float, param('where the UAV starts: the position of C3', unit='m', ge=-1e6, le=1e6)
    ] = 50.0
    home_north_m: Annotated[
        float, param('where the UAV starts: the position of C3', unit='m', ge=-1e6, le=1e6)
    ] = 0.0
    speed_mps: Annotated[float, param('air speed', unit='m/s', ge=0.01, le=1000)] = 4.0
    altitude_m: Annotated[float, param('height of flight', unit='m', ge=0, le=20_000)] = 30.0
    tick_s: Annotated[float, param('length of a tick', unit='s', ge=0.001, le=3600)] = 1.0
    arrival_radius_m: Annotated[
        float,
        param('closer than this to a waypoint counts as there', unit='m', ge=0, le=1000),
    ] = 0.0
    hearing_s: Annotated[
        float, param('how long a frame of an AUV takes until it is heard', unit='s', ge=0, le=1e6)
    ] = 0.0
    wind_east_mps: Annotated[
        float, param('steady wind over the simulated UAV', unit='m/s', ge=-100, le=100)
    ] = 0.0
    wind_north_mps: Annotated[
        float, param('steady wind over the simulated UAV', unit='m/s', ge=-100, le=100)
    ] = 0.0
    planner: Annotated[str, param('chooses the paths of the AUVs')] = 'robust'
    planner_options: Annotated[str, param('settings of that planner, JSON object')] = '{}'
    driver: Annotated[str, param(f'vehicle driver, an entry point of {DRIVERS}')] = 'kinematic'


def make_uav(
    params: UavParams, ports: DriverPorts, setting: AgentSetting, planner: Planner | None = None
) -> AgentShell:
    """
    Return the UAV's agent with its driver and its planner, or another one that is given.

    Raises
    ------
    ValueError
        A parameter is not usable; the text names it.
    StoreError
        The store of the setting is not usable.

    """
    try:
        options = msgspec.json.decode(params.planner_options, type=dict[str, object])
    except msgspec.DecodeError as error:
        raise ValueError(
            f'parameter planner_options is {params.planner_options!r}: {error}'
        ) from None
    setup = UavDriverSetup(
        name=params.name,
        home=Point(east_m=params.home_east_m, north_m=params.home_north_m),
        speed_mps=params.speed_mps,
        altitude_m=params.altitude_m,
        wind=Flow(east_mps=params.wind_east_mps, north_mps=params.wind_north_mps),
    )
    driver = recalled(find_driver(DRIVERS, params.driver)(setup, ports), setting.store)
    agent = UavAgent(
        params.name,
        UavSetup(
            c3=params.c3,
            speed_mps=params.speed_mps,
            altitude_m=params.altitude_m,
            tick_s=params.tick_s,
            arrival_radius_m=params.arrival_radius_m,
            hearing_s=params.hearing_s,
        ),
        planner or make_planner(params.planner, **options),
        driver,
        setting.store,
        SampleCustody(setting.store, params.max_message_bytes, params.response_s),
    )
    return AgentShell(
        agent, setting, driver, frame_bytes=params.max_message_bytes, copies=params.copies
    )
