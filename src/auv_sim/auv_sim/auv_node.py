"""An AUV as a node."""

from __future__ import annotations

from auv_sim.auv_params import AuvParams, make_auv
from msgs_json.agent_node import AgentKind, AgentNode
from msgs_json.host_node import run
from msgs_json.topics import MISSION_EVENTS, ODOM, PATH, RADIO_TX

AUV = AgentKind(
    node='auv',
    namespace='/auv_1',
    params_type=AuvParams,
    make_agent=make_auv,
    tick_s=lambda params: params.tick_s,
    publishes=(ODOM, PATH, RADIO_TX, MISSION_EVENTS),
)


def main() -> int:
    """Run one AUV."""
    return run(lambda: [AgentNode(AUV)])
