"""The UAV as a node."""

from __future__ import annotations

from msgs_json.agent_node import AgentKind, AgentNode
from msgs_json.host_node import run
from msgs_json.topics import MISSION_EVENTS, ODOM, RADIO_TX, ROUTE
from uav_planner.uav_params import UavParams, make_uav

UAV = AgentKind(
    node='uav',
    namespace='/uav',
    params_type=UavParams,
    make_agent=make_uav,
    tick_s=lambda params: params.tick_s,
    publishes=(ODOM, ROUTE, RADIO_TX, MISSION_EVENTS),
)


def main() -> int:
    """Run the UAV."""
    return run(lambda: [AgentNode(UAV)])
