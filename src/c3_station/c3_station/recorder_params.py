"""The recorder's settings, as node parameters."""

from __future__ import annotations

from typing import Annotated

from msgs_json.params import Params, param


class RecorderParams(Params, frozen=True):
    """Parameters of ``c3_station recorder``."""

    out: Annotated[str, param('folder of the bag; it must not exist')] = 'bag'
    scenario: Annotated[
        str, param('the mission: a shipped scenario, a scenario file, or its JSON')
    ] = 'ecc2009'
    before: Annotated[
        str, param('folder of a bag, whole or not, with which this one begins; empty: none')
    ] = ''
    namespaces: Annotated[
        tuple[str, ...],
        param('agents that are not in /<name>, as "auv_1=/north/auv_1"; the bag says /auv_1'),
    ] = ()
