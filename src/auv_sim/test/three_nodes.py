"""Three nodes and their world in lockstep, without ROS: what tests of the conductor begin with."""

from __future__ import annotations

from auv_sim.conductor import Addressed, Conductor
from auv_sim.radio_model import IDEAL, ChannelModel, LinkModel, StationKind
from auv_sim.world import World, WorldSpec
from msgs_json import codec
from msgs_json.agent import Agent
from msgs_json.agent_shell import AgentSetting, AgentShell, Frame
from msgs_json.geometry import Point
from msgs_json.lockstep_client import AgentClient
from msgs_json.messages import Acknowledged, Acknowledgement, Done, Go, Hello, Message, Ready, Tick
from msgs_json.ros_messages import Odometry, Text
from msgs_json.store import MemoryStore
from msgs_json.topics import RADIO_TX

ORIGIN = Point(east_m=0.0, north_m=0.0)
KINDS = {'c3': StationKind.C3, 'uav': StationKind.UAV, 'auv_1': StationKind.AUV}
REPLY_NUDGES = 4
"""After so many a node that is silent is named, or given up."""


def world(link: LinkModel = IDEAL, *, max_mission_s: float = 500.0) -> World:
    """Return a world of ticks of a second, in which all are in touch at the surface."""
    return World(
        WorldSpec(
            stations=KINDS,
            c3_position=ORIGIN,
            channel=ChannelModel(range_m=20.0, max_message_bytes=4096, link=link),
            tick_s=1.0,
            max_mission_s=max_mission_s,
        )
    )


def word(number: int) -> Acknowledgement:
    """Return something to say."""
    return Acknowledgement(acknowledges=Acknowledged.MISSION_ORDER, reference=number)


def odometry(name: str, time_s: float, z_m: float = 0.0) -> Odometry:
    """Return where a station is seen: where all are, or below."""
    return Odometry(
        stamp_s=time_s,
        child_frame_id=name,
        position=ORIGIN,
        z_m=z_m,
        heading_rad=0.0,
        speed_mps=0.0,
    )


def shell(agent: Agent, store: MemoryStore | None = None) -> AgentShell:
    """Return an agent's shell, with an empty store by default."""
    store = MemoryStore() if store is None else store
    return AgentShell(agent, AgentSetting(store=store, authenticator=None))


def body_of(frame: Frame) -> Message:
    """Return what a frame says."""
    assert isinstance(frame.message, Text)
    return codec.decode(frame.message.data)[1]


def told(client: AgentClient, frame: Frame) -> list[Frame]:
    """Return what a node answers to a go or a tick."""
    body = body_of(frame)
    assert isinstance(body, (Go, Tick))
    return client.go(body) if isinstance(body, Go) else client.tick(body)


def heard_by_conductor(conductor: Conductor, name: str, frame: Frame) -> list[Addressed]:
    """Hand the conductor what a node publishes; return what it says to that."""
    match frame.message:
        case Odometry() as seen:
            return conductor.saw(name, seen)
        case Text(data) if frame.topic is RADIO_TX:
            return conductor.said(name, data)
    match body_of(frame):
        case Hello() as hello:
            return conductor.hello(name, hello)
        case Ready() as ready:
            return conductor.ready(name, ready)
        case Done() as done:
            return conductor.done(name, done)
    return []
