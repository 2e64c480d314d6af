"""The AUV's settings, as node parameters, and the agent made from them."""

from __future__ import annotations

from typing import Annotated

from auv_sim.auv_agent import AuvAgent, AuvMission
from auv_sim.survey_field import make_field
from msgs_json.agent_params import AgentParams
from msgs_json.agent_shell import AgentSetting, AgentShell, recalled
from msgs_json.custody import SampleCustody
from msgs_json.drivers import AuvDriverSetup, DriverPorts, find_driver
from msgs_json.geometry import Cell, GridSpec, mask_problems, path_problem
from msgs_json.params import param
from msgs_json.randomness import agent_rng

DRIVERS = 'auv_sim.drivers'


class AuvParams(AgentParams, frozen=True):
    """Parameters of ``auv_sim auv``."""

    uav: Annotated[str, param('name of the UAV that relays for this AUV')] = 'uav'
    speed_mps: Annotated[float, param('speed through the path', unit='m/s', ge=0.01, le=100)] = 1.0
    depth_m: Annotated[float, param('survey depth, positive down', unit='m', ge=1, le=11_000)] = (
        5.0
    )
    cols: Annotated[int, param('cells of the region from west to east', ge=1, le=1000)] = 10
    rows: Annotated[int, param('cells of the region from south to north', ge=1, le=1000)] = 10
    cell_m: Annotated[float, param('cell width', unit='m', ge=0.1, le=1e5)] = 10.0
    masked: Annotated[
        tuple[int, ...],
        param('cells that are not part of the region (land, no-go): col, row, col, row, ...'),
    ] = ()
    initial_path: Annotated[
        tuple[int, ...], param('cells swum on deployment: col, row, col, row, ...')
    ] = (3, 7, 4, 7)
    surface_margin_s: Annotated[
        float, param('added to the surface deadline of the initial path', unit='s', ge=0, le=1e6)
    ] = 0.0
    tick_s: Annotated[float, param('length of a tick', unit='s', ge=0.001, le=3600)] = 1.0
    seed: Annotated[int, param('seed of the mission', ge=0, le=2**53)] = 0
    driver: Annotated[str, param(f'vehicle driver, an entry point of {DRIVERS}')] = 'kinematic'
    surfacing: Annotated[str, param('surfacing model of the simulated vehicle, JSON')] = (
        '{"model": "on_time"}'
    )
    field: Annotated[str, param('survey field, JSON')] = '{"kind": "synthetic"}'


def make_auv(params: AuvParams, ports: DriverPorts, setting: AgentSetting) -> AgentShell:
    """
    Return the AUV's agent with its driver and its sensor.

    Raises
    ------
    ValueError
        A parameter is not usable; the text names it.
    StoreError
        The store of the setting is not usable.

    """
    region = _region(params)
    path = _initial_path(params, region)
    setup = AuvDriverSetup(
        name=params.name,
        start=region.centre(path[0]),
        speed_mps=params.speed_mps,
        depth_m=params.depth_m,
        surfacing=params.surfacing,
        rng=agent_rng(params.seed, params.name),
    )
    mission = AuvMission(
        region=region,
        uav=params.uav,
        speed_mps=params.speed_mps,
        depth_m=params.depth_m,
        initial_path=path,
        surface_margin_s=params.surface_margin_s,
        tick_s=params.tick_s,
    )
    driver = recalled(find_driver(DRIVERS, params.driver)(setup, ports), setting.store)
    field = make_field(params.field, region)
    custody = SampleCustody(setting.store, params.max_message_bytes, params.response_s)
    agent = AuvAgent(params.name, mission, driver, field, setting.store, custody)
    return AgentShell(
        agent, setting, driver, frame_bytes=params.max_message_bytes, copies=params.copies
    )


def _region(params: AuvParams) -> GridSpec:
    masked = _cells(params.masked)
    if masked is None:
        raise ValueError(
            f'parameter masked is {params.masked}; it must hold col, row of each cell'
        )
    region = GridSpec(cols=params.cols, rows=params.rows, cell_m=params.cell_m, masked=masked)
    for index, problem in mask_problems(region):
        raise ValueError(f'parameter masked, cell {index}, {problem}')
    return region


def _initial_path(params: AuvParams, region: GridSpec) -> tuple[Cell, ...]:
    flat, path = params.initial_path, _cells(params.initial_path)
    if path is None or len(path) < 2:
        raise ValueError(
            f'parameter initial_path is {flat}; it must hold col, row of at least 2 cells'
        )
    problem = path_problem(path, region)
    if problem:
        raise ValueError(f'parameter initial_path is {flat}: {problem}')
    return path


def _cells(flat: tuple[int, ...]) -> tuple[Cell, ...] | None:
    """Return the cells of a list of col, row, col, row, ...; None if the last has no row."""
    return None if len(flat) % 2 else tuple(zip(flat[::2], flat[1::2], strict=True))
