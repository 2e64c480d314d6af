"""The station's settings, as node parameters, and the agent made from them."""

from __future__ import annotations

from typing import Annotated

from c3_station.c3_agent import C3Agent
from c3_station.scenario_files import parse_scenario
from msgs_json.agent_params import AgentParams
from msgs_json.agent_shell import AgentSetting, AgentShell
from msgs_json.params import param


class C3Params(AgentParams, frozen=True):
    """Parameters of ``c3_station c3``."""

    uav: Annotated[str, param('name of the UAV')] = 'uav'
    scenario: Annotated[
        str, param('the mission: a shipped scenario, a scenario file, or its JSON')
    ] = 'ecc2009'
    status_period_s: Annotated[
        float, param('mission status at least this often', unit='s', ge=0.1, le=3600)
    ] = 10.0


def make_c3(params: C3Params, setting: AgentSetting) -> AgentShell:
    """
    Return the station's agent.

    Raises
    ------
    ValueError
        The scenario is not usable; the text says where.
    StoreError
        The store of the setting is not usable.

    """
    scenario = parse_scenario(params.scenario)
    agent = C3Agent(params.name, scenario, params.uav, params.status_period_s, setting.store)
    return AgentShell(agent, setting, frame_bytes=params.max_message_bytes, copies=params.copies)
