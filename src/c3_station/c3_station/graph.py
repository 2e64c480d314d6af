"""The nodes of a mission: which executables, in which namespaces, with which parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec

from auv_sim.fleet_params import FleetParams
from auv_sim.world import WORLD
from auv_sim.world_params import WorldParams
from c3_station.node_params import C3, UAV, mission_params
from c3_station.recorder_params import RecorderParams
from c3_station.scenario import OnDeath, Scenario
from c3_station.scenario_files import scenario_json
from msgs_json.params import Params
from msgs_json.params_file import params_yaml

RECORDER = 'recorder'

_FLEET_FROM = 12
"""From this many AUVs on they share processes: start-up and memory grow with processes."""
_FLEET_SIZE = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSpec:
    """One process of the graph, ``ros2 run package executable``, in namespace ``/name``."""

    name: str
    package: str
    executable: str
    agents: tuple[str, ...] = ()
    """Those that live in it."""
    on_death: OnDeath = OnDeath.END


def mission_nodes(scenario: Scenario, *, bag: bool) -> tuple[NodeSpec, ...]:
    """Return the processes of a mission."""
    recorder = NodeSpec(name=RECORDER, package='c3_station', executable='recorder')
    on_death = scenario.on_death_of()
    fleets = _fleets(scenario)
    return (
        *((recorder,) if bag else ()),
        NodeSpec(name=WORLD, package='auv_sim', executable='world'),
        NodeSpec(
            name=C3,
            package='c3_station',
            executable='c3',
            agents=(C3,),
            on_death=on_death.c3,
        ),
        NodeSpec(
            name=UAV,
            package='uav_planner',
            executable='uav',
            agents=(UAV,),
            on_death=on_death.uav,
        ),
        *(
            NodeSpec(
                name=name,
                package='auv_sim',
                executable='fleet' if fleets else 'auv',
                agents=agents,
                on_death=on_death.auvs,
            )
            for name, agents in (fleets or {a.name: (a.name,) for a in scenario.auvs}).items()
        ),
    )


def write_params(
    scenario: Scenario,
    path: Path,
    *,
    rate: float,
    bag: Path | None,
    reply_timeout_s: float = WorldParams().reply_timeout_s,
    stores: Path | None = None,
    key: Path | None = None,
    restarted: tuple[str, ...] = (),
    before: Path | None = None,
) -> None:
    """
    Write the parameters of every node of a mission, for ``--params-file``.

    Parameters
    ----------
    scenario
        The mission.
    path
        File to write.
    rate
        Times real time; 0 as fast as possible.
    bag
        Where the recorder writes; None for a mission without one.
    reply_timeout_s
        Wall time after which the world reports a silent node as dead.
    stores
        Folder in which each agent keeps what it must know after a crash; None: in memory.
    key
        File with the key of the mission; None: nothing is signed.
    restarted
        Agents that somebody starts again when they die.
    before
        What is recorded of the mission already; the new bag begins with it.

    Raises
    ------
    ValueError
        The file cannot be written.

    """
    params = mission_params(scenario)
    nodes: dict[str, Params] = {
        f'/{WORLD}/world': msgspec.structs.replace(
            params.world,
            rate=rate,
            recorder=bag is not None,
            reply_timeout_s=reply_timeout_s,
            restarted=restarted,
            key_file=str(key) if key is not None else '',
        ),
    }
    for kind, agent in (
        ('c3', params.c3),
        ('uav', params.uav),
        *(('auv', a) for a in params.auvs),
    ):
        nodes[f'/{agent.name}/{kind}'] = msgspec.structs.replace(
            agent,
            store=str(stores / f'{agent.name}.sqlite') if stores is not None else '',
            key_file=str(key) if key is not None else '',
        )
    nodes |= {
        f'/{fleet}/fleet': FleetParams(auvs=names) for fleet, names in _fleets(scenario).items()
    }
    if bag is not None:
        nodes[f'/{RECORDER}/recorder'] = RecorderParams(
            out=str(bag),
            scenario=scenario_json(scenario).decode(),
            before=str(before) if before is not None else '',
        )
    try:
        path.write_text(params_yaml(nodes, use_sim_time=True), encoding='utf-8')
    except OSError as error:
        raise ValueError(f'{path}: cannot be written, {error.strerror}') from None


def _fleets(scenario: Scenario) -> dict[str, tuple[str, ...]]:
    """Return the AUVs of each fleet process; none for a small mission."""
    names = [auv.name for auv in scenario.auvs]
    if len(names) < _FLEET_FROM:
        return {}
    return {
        f'fleet_{1 + start // _FLEET_SIZE}': tuple(names[start : start + _FLEET_SIZE])
        for start in range(0, len(names), _FLEET_SIZE)
    }
