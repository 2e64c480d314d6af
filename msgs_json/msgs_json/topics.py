"""
Every topic of the graph: name, type, quality of service, and who publishes it.

Relative names are placed by the node's namespace (``/auv_1``, ``/uav``, ``/c3``); absolute ones
are shared by all nodes. Both can be remapped as usual.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class QosSpec:
    """A quality-of-service profile, free of ROS; the node host and the bag writer convert it."""

    reliable: bool
    transient_local: bool
    depth: int
    why: str


class Qos(enum.Enum):
    """The named profiles; nothing in the graph uses another."""

    STREAM = QosSpec(True, False, 1000, 'nothing may be missing from a bag or a barrier')
    LATCHED = QosSpec(True, True, 1, 'a late viewer gets the latest (REP-2003: maps)')
    SENSOR = QosSpec(False, False, 10, 'autopilots publish best effort (MAVROS)')
    HANDSHAKE = QosSpec(True, True, 100, 'nodes may start in any order')


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic."""

    name: str
    ros_type: str
    qos: Qos
    publishers: str
    """Who publishes it, in words."""
    content: str

    @property
    def is_json(self) -> bool:
        """Return whether it carries JSON envelopes."""
        return self.ros_type == STRING

    def resolve(self, namespace: str) -> str:
        """Return the absolute name for a node in a namespace (``/auv_1``)."""
        return self.name if self.name.startswith('/') else f'{namespace.rstrip("/")}/{self.name}'


STRING = 'std_msgs/msg/String'

ODOM = Topic(
    'odom', 'nav_msgs/msg/Odometry', Qos.STREAM, 'auv, uav', 'true pose in map, once per tick'
)
PATH = Topic('path', 'nav_msgs/msg/Path', Qos.LATCHED, 'auv', 'path of the present leg')
ROUTE = Topic(
    'route', 'nav_msgs/msg/Path', Qos.LATCHED, 'uav', 'worst-case route of the present sortie'
)
RADIO_TX = Topic('radio/tx', STRING, Qos.STREAM, 'auv, uav, c3', 'what the agent says by radio')
RADIO_RX = Topic(
    'radio/rx',
    STRING,
    Qos.STREAM,
    'world; at sea a radio driver',
    'what reaches the agent by radio',
)
EXPLORATION_MAP = Topic(
    'exploration_map',
    'nav_msgs/msg/OccupancyGrid',
    Qos.LATCHED,
    'c3',
    'delivered cells 0, masked ones 100 (occupied), all others -1 (unknown)',
)
MARKERS = Topic(
    'markers',
    'visualization_msgs/msg/MarkerArray',
    Qos.LATCHED,
    'c3',
    'survey samples as coloured cells, the station, masked cells',
)
MISSION_STATUS = Topic('mission_status', STRING, Qos.LATCHED, 'c3', 'MissionStatus')
COMMAND = Topic(
    'command', STRING, Qos.STREAM, 'operator', 'OperatorCommand, signed like what goes by radio'
)
DIAGNOSTICS = Topic(
    '/diagnostics',
    'diagnostic_msgs/msg/DiagnosticArray',
    Qos.STREAM,
    'c3',
    'mission and AUV states (REP-107)',
)
MISSION_EVENTS = Topic(
    '/mission_events', STRING, Qos.STREAM, 'every node', 'MissionEvent; no agent listens to it'
)
RADIO_STATUS = Topic('radio_status', STRING, Qos.LATCHED, 'world', 'RadioStatus')
CLOCK = Topic('/clock', 'rosgraph_msgs/msg/Clock', Qos.STREAM, 'world', 'simulated time')

WORLD_TICK = Topic('/world/tick', STRING, Qos.STREAM, 'world', 'Tick')
WORLD_DONE = Topic('/world/done', STRING, Qos.STREAM, 'every agent, recorder', 'Done')
WORLD_HELLO = Topic('/world/hello', STRING, Qos.HANDSHAKE, 'every agent, recorder', 'Hello')
WORLD_GO = Topic('/world/go', STRING, Qos.HANDSHAKE, 'world', 'Go')
WORLD_READY = Topic('/world/ready', STRING, Qos.HANDSHAKE, 'every agent, recorder', 'Ready')
WORLD_WAITING = Topic('/world/waiting', STRING, Qos.STREAM, 'world', 'Waiting: who is silent')

SETPOINT = Topic(
    'setpoint_position/local',
    'geometry_msgs/msg/PoseStamped',
    Qos.STREAM,
    'auv, uav with driver "topics"',
    'position setpoint in map',
)
VEHICLE_ODOM = Topic(
    'local_position/odom',
    'nav_msgs/msg/Odometry',
    Qos.SENSOR,
    'the autopilot of a real vehicle',
    'measured pose in map, for driver "topics"',
)

TOPICS: tuple[Topic, ...] = (
    ODOM,
    PATH,
    ROUTE,
    RADIO_TX,
    RADIO_RX,
    EXPLORATION_MAP,
    MARKERS,
    MISSION_STATUS,
    COMMAND,
    DIAGNOSTICS,
    MISSION_EVENTS,
    RADIO_STATUS,
    CLOCK,
    WORLD_TICK,
    WORLD_DONE,
    WORLD_HELLO,
    WORLD_GO,
    WORLD_READY,
    WORLD_WAITING,
    SETPOINT,
    VEHICLE_ODOM,
)
