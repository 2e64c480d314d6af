"""A scenario flown in one process, without ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from auv_sim.auv_params import make_auv
from auv_sim.kernel import Sink, run_mission
from auv_sim.world_params import make_world
from c3_station.c3_params import make_c3
from c3_station.faults_in_process import FaultTally, fly_with_faults
from c3_station.node_params import MissionParams, mission_params
from c3_station.scenario import C3, Faults, Scenario
from msgs_json.agent_shell import AgentSetting, AgentShell
from msgs_json.authentication import Authenticator
from msgs_json.drivers import NoPorts
from msgs_json.key_file import new_key
from msgs_json.store import MemoryStore
from uav_planner.planning import Planner
from uav_planner.uav_params import make_uav

MakeSetting = Callable[[str], AgentSetting]
"""Returns the store and the key of an agent, by its name."""


def in_memory(key: bytes | None = None) -> MakeSetting:
    """Return settings of agents that keep what they know in memory; by default with a new key."""
    authenticator = Authenticator(key or new_key())
    return lambda name: AgentSetting(store=MemoryStore(), authenticator=authenticator)


def fly(
    scenario: Scenario,
    sink: Sink,
    planner: Planner | None = None,
    make_setting: MakeSetting | None = None,
) -> FaultTally:
    """
    Fly a mission to its end, passing on every message; see `auv_sim.kernel`.

    Agents that a fault strikes keep what they know in stores in memory, whatever ``make_setting``
    returns.

    Parameters
    ----------
    scenario
        The mission, with its faults.
    sink
        Takes the messages.
    planner
        Flies instead of the one that the scenario names.
    make_setting
        Gives each agent its store and key; by default stores in memory and a new key.

    Returns
    -------
    FaultTally
        What became of the scenario's hostile messages.

    """
    params = mission_params(scenario)
    makers = _makers(params, planner)
    make_setting = make_setting or in_memory()
    settings = {name: make_setting(name) for name in makers}
    authenticator = settings[C3].authenticator
    world = make_world(params.world, authenticator)
    if scenario.faults != Faults():
        return fly_with_faults(scenario, world, makers, authenticator, sink)
    run_mission(world, {name: make(settings[name]) for name, make in makers.items()}, sink)
    return FaultTally()


def make_agents(
    params: MissionParams, make_setting: MakeSetting, planner: Planner | None = None
) -> dict[str, AgentShell]:
    """Return the agents of a mission by name; simulated vehicles need no topics."""
    makers = _makers(params, planner)
    return {name: make(make_setting(name)) for name, make in makers.items()}


def _makers(
    params: MissionParams, planner: Planner | None
) -> Mapping[str, Callable[[AgentSetting], AgentShell]]:
    """Return by name what makes an agent from its store and key."""
    ports = NoPorts()
    return {
        params.c3.name: partial(make_c3, params.c3),
        params.uav.name: partial(make_uav, params.uav, ports, planner=planner),
    } | {auv.name: partial(make_auv, auv, ports) for auv in params.auvs}
