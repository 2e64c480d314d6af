"""A scenario flown in one process, without ROS."""

from __future__ import annotations

from auv_sim.auv_params import make_auv
from auv_sim.kernel import Sink, run_mission
from auv_sim.world_params import make_world
from c3_station.c3_params import make_c3
from c3_station.node_params import MissionParams, mission_params
from c3_station.scenario import Scenario
from msgs_json.agent_shell import AgentSetting, AgentShell
from msgs_json.authentication import Authenticator
from msgs_json.drivers import NoPorts
from msgs_json.store import MemoryStore
from uav_planner.planning import Planner
from uav_planner.uav_params import make_uav


def fly(
    scenario: Scenario,
    sink: Sink,
    planner: Planner | None = None,
    key: bytes | None = None,
) -> None:
    """
    Fly a mission to its end, passing on every message; see `auv_sim.kernel`.

    A planner that is given flies instead of the one that the scenario names. With a key, radio
    messages are signed and checked.
    """
    params = mission_params(scenario)
    authenticator = Authenticator(key) if key is not None else None
    agents = make_agents(params, authenticator, planner)
    run_mission(make_world(params.world), agents, sink)


def make_agents(
    params: MissionParams,
    authenticator: Authenticator | None = None,
    planner: Planner | None = None,
) -> dict[str, AgentShell]:
    """Return the agents of a mission by name; simulated vehicles need no topics."""

    def setting() -> AgentSetting:
        return AgentSetting(store=MemoryStore(), authenticator=authenticator)

    agents = {
        params.c3.name: make_c3(params.c3, setting()),
        params.uav.name: make_uav(params.uav, NoPorts(), setting(), planner),
    }
    return agents | {auv.name: make_auv(auv, NoPorts(), setting()) for auv in params.auvs}
