"""Many AUVs in one process, each a node of its own."""

from __future__ import annotations

from auv_sim.auv_node import AUV
from auv_sim.fleet_params import FleetParams
from msgs_json.agent_node import AgentNode
from msgs_json.host_node import HostedNode, run


class FleetNode(HostedNode):
    """Says which AUVs this process hosts."""

    def __init__(self) -> None:
        super().__init__('fleet', '/fleet')
        with self.setup():
            auvs = self.params(FleetParams).auvs
            if len(set(auvs)) < len(auvs):
                raise ValueError(f'parameter auvs: names must differ, are {", ".join(auvs)}')
        self.namespaces = [f'/{auv.lstrip("/")}' for auv in auvs]


def main() -> int:
    """Run a fleet."""
    return run(_fleet)


def _fleet() -> list[HostedNode]:
    fleet = FleetNode()
    return [fleet, *(AgentNode(AUV, namespace) for namespace in fleet.namespaces)]
