"""A scenario flown in one process, without ROS."""

from __future__ import annotations

from collections.abc import Callable

from auv_sim.auv_params import make_auv
from auv_sim.kernel import Sink, run_mission
from auv_sim.world_params import make_world
from c3_station.c3_params import make_c3
from c3_station.node_params import MissionParams, mission_params
from c3_station.scenario import Scenario
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
) -> None:
    """
    Fly a mission to its end, passing on every message; see `auv_sim.kernel`.

    A planner that is given flies instead of the one that the scenario names.
    """
    params = mission_params(scenario)
    agents = make_agents(params, make_setting or in_memory(), planner)
    run_mission(make_world(params.world), agents, sink)


def make_agents(
    params: MissionParams, make_setting: MakeSetting, planner: Planner | None = None
) -> dict[str, AgentShell]:
    """Return the agents of a mission by name; simulated vehicles need no topics."""
    c3, uav = params.c3, params.uav
    agents = {
        c3.name: make_c3(c3, make_setting(c3.name)),
        uav.name: make_uav(uav, NoPorts(), make_setting(uav.name), planner),
    }
    return agents | {
        auv.name: make_auv(auv, NoPorts(), make_setting(auv.name)) for auv in params.auvs
    }
