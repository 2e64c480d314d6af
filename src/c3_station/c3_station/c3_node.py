"""The station as a node."""

from __future__ import annotations

from c3_station.c3_params import C3Params, make_c3
from c3_station.scenario_files import parse_scenario
from msgs_json.agent_node import AgentKind, AgentNode
from msgs_json.host_node import run
from msgs_json.topics import (
    COMMAND,
    DIAGNOSTICS,
    EXPLORATION_MAP,
    MARKERS,
    MISSION_EVENTS,
    MISSION_STATUS,
    RADIO_TX,
)

C3 = AgentKind(
    node='c3',
    namespace='/c3',
    params_type=C3Params,
    make_agent=lambda params, ports, setting: make_c3(params, setting),
    tick_s=lambda params: parse_scenario(params.scenario).tick_s,
    listens=(COMMAND,),
    publishes=(EXPLORATION_MAP, MARKERS, MISSION_STATUS, DIAGNOSTICS, RADIO_TX, MISSION_EVENTS),
)


def main() -> int:
    """Run the station."""
    return run(lambda: [AgentNode(C3)])
