"""The simulated world's settings, as node parameters."""

from __future__ import annotations

from typing import Annotated, TypeVar

import msgspec

from auv_sim.radio_model import (
    ChannelModel,
    Link,
    LinkModel,
    RadioOutage,
    StationKind,
    link_problems,
)
from auv_sim.world import World, WorldSpec
from msgs_json.authentication import Authenticator
from msgs_json.geometry import Point
from msgs_json.params import Params, param

T = TypeVar('T')


class WorldParams(Params, frozen=True):
    """Parameters of ``auv_sim world``."""

    auvs: Annotated[tuple[str, ...], param('AUV names, in visiting order')] = (
        'auv_1',
        'auv_2',
        'auv_3',
    )
    uav: Annotated[str, param('name of the UAV')] = 'uav'
    c3: Annotated[str, param('name of the station')] = 'c3'
    namespaces: Annotated[
        tuple[str, ...], param('agents that are not in /<name>, as "auv_1=/north/auv_1"')
    ] = ()
    c3_east_m: Annotated[float, param('position of the station', unit='m', ge=-1e6, le=1e6)] = 50.0
    c3_north_m: Annotated[float, param('position of the station', unit='m', ge=-1e6, le=1e6)] = 0.0
    range_m: Annotated[float, param('radio range, R', unit='m', ge=0.001, le=1e6)] = 20.0
    max_message_bytes: Annotated[
        int, param('longer radio messages are blocked', unit='bytes', ge=720, le=2**30)
    ] = 1_048_576
    radio_queue_frames: Annotated[
        int, param('so many frames wait while a radio is sending', unit='frames', ge=1, le=2**30)
    ] = 16
    radio_link: Annotated[
        str, param('what every link does to frames, JSON, see docs/radio.md; {}: nothing')
    ] = '{}'
    radio_links: Annotated[
        str,
        param('links that differ, JSON: a list of {"from": name, "to": name, "loss": 0.5, ...}'),
    ] = '[]'
    radio_outages: Annotated[
        str,
        param('dead radios, JSON: a list of {"station": name, "from_s": ..., "until_s": ...}'),
    ] = '[]'
    seed: Annotated[int, param('of what happens to frames', ge=0, le=2**53)] = 0
    key_file: Annotated[
        str,
        param(
            "file with the mission's key, readable by its owner only; empty: signatures are not"
            ' checked'
        ),
    ] = ''
    tick_s: Annotated[float, param('length of a tick', unit='s', ge=0.001, le=3600)] = 1.0
    max_mission_s: Annotated[
        float, param('hard stop in simulated time', unit='s', ge=1, le=1e7)
    ] = 3600.0
    rate: Annotated[
        float, param('pace as a multiple of real time; 0: as fast as possible', ge=0, le=1e6)
    ] = 0.0
    recorder: Annotated[bool, param('wait for a recorder, and never let it fall behind')] = False
    start_timeout_s: Annotated[
        float, param('wall time to wait for all nodes; 0: for ever', unit='s', ge=0, le=1e6)
    ] = 0.0
    reply_timeout_s: Annotated[
        float,
        param('wall time after which a silent node is reported as dead', unit='s', ge=1, le=1e6),
    ] = 10.0
    restarted: Annotated[
        tuple[str, ...], param('agents that somebody starts again when they die')
    ] = ()
    rejoin_timeout_s: Annotated[
        float,
        param('wall time after which one of these is reported as dead', unit='s', ge=1, le=1e6),
    ] = 60.0


def make_world(params: WorldParams, authenticator: Authenticator | None = None) -> World:
    """
    Return the world; with an authenticator its radio carries only what that can verify.

    Raises
    ------
    ValueError
        Two agents have the same name, or what is said of the radio is none of this mission.

    """
    names = [params.c3, params.uav, *params.auvs]
    if len(set(names)) < len(names):
        raise ValueError(f'parameters c3, uav, auvs: names must differ, are {", ".join(names)}')
    stations = {params.c3: StationKind.C3, params.uav: StationKind.UAV} | dict.fromkeys(
        params.auvs, StationKind.AUV
    )
    links = _parsed('radio_links', params.radio_links, tuple[Link, ...])
    for index, key, problem in link_problems(links, stations):
        raise ValueError(f'parameter radio_links: [{index}].{key} {problem}')
    outages = _parsed('radio_outages', params.radio_outages, tuple[RadioOutage, ...])
    for outage in outages:
        if outage.station not in names:
            raise ValueError(
                f'parameter radio_outages: station is {outage.station!r};'
                f' allowed: {", ".join(names)}'
            )
    return World(
        WorldSpec(
            stations=stations,
            c3_position=Point(east_m=params.c3_east_m, north_m=params.c3_north_m),
            channel=ChannelModel(
                range_m=params.range_m,
                max_message_bytes=params.max_message_bytes,
                queue_frames=params.radio_queue_frames,
                link=_parsed('radio_link', params.radio_link, LinkModel),
                links=links,
                outages=outages,
                seed=params.seed,
            ),
            tick_s=params.tick_s,
            max_mission_s=params.max_mission_s,
        ),
        authenticator,
    )


def _parsed(name: str, text: str, value_type: type[T]) -> T:
    try:
        return msgspec.json.decode(text, type=value_type)
    except msgspec.MsgspecError as error:
        raise ValueError(f'parameter {name} is {text!r}: {error}') from None
