"""The agents of a mission in one process, for tests that come between them."""

from __future__ import annotations

from auv_sim.auv_params import make_auv
from c3_station.c3_params import make_c3
from c3_station.node_params import MissionParams
from msgs_json.agent_shell import AgentShell
from msgs_json.drivers import NoPorts
from uav_planner.uav_params import make_uav


def make_agents(params: MissionParams) -> dict[str, AgentShell]:
    """Return all agents by name, as `c3_station.in_process.fly` makes them."""
    agents = {
        params.c3.name: make_c3(params.c3),
        params.uav.name: make_uav(params.uav, NoPorts()),
    }
    return agents | {auv.name: make_auv(auv, NoPorts()) for auv in params.auvs}
