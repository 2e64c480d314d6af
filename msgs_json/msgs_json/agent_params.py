"""The parameters that the nodes of all agents have in common."""

from __future__ import annotations

from typing import Annotated

from msgs_json.params import Params, param


class AgentParams(Params, frozen=True):
    """Base of the parameters of AUV, UAV and C3."""

    name: Annotated[str, param('agent name; empty: the last part of the node namespace')] = ''
    store: Annotated[
        str,
        param('file in which the agent keeps what it must know after a crash; empty: in memory'),
    ] = ''
    key_file: Annotated[
        str,
        param("file with the mission's key, readable by its owner only; empty: nothing is signed"),
    ] = ''
    max_message_bytes: Annotated[
        int, param('the longest message that the radio carries', unit='bytes', ge=720, le=2**30)
    ] = 1_048_576
    copies: Annotated[
        int,
        param('how often a message is said at a time; more for a radio that loses', ge=1, le=8),
    ] = 1
    response_s: Annotated[
        float, param('how long an answer by radio takes at most', unit='s', ge=0, le=1e6)
    ] = 0.0
