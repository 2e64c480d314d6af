"""The fleet's settings, as node parameters."""

from __future__ import annotations

from typing import Annotated

from msgs_json.params import Params, param


class FleetParams(Params, frozen=True):
    """
    Parameters of ``auv_sim fleet``: many AUV nodes in one process.

    Each AUV is a node of its own, ``/auv_1/auv``, and has its parameters in a section of that
    name in the parameter file, just as in a process of its own.
    """

    auvs: Annotated[
        tuple[str, ...], param('namespaces of the AUVs; "auv_1" stands for /auv_1')
    ] = (
        'auv_1',
        'auv_2',
        'auv_3',
    )
