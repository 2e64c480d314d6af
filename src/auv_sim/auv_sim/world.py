"""
The simulated world without I/O: time, true positions and the radio between the agents.

Both ways to run a mission use it: the kernel in one process, and the world node over topics.
"""

from __future__ import annotations

from dataclasses import dataclass

from auv_sim.radio_channel import Delivery, RadioChannel
from auv_sim.radio_model import ChannelModel, StationKind
from msgs_json.agent_shell import Frame, Speaker
from msgs_json.authentication import Authenticator
from msgs_json.geometry import Point, is_before, whole_ticks
from msgs_json.messages import MissionResumed, MissionStopped, NodeRestarted, RadioStatus
from msgs_json.ros_messages import ClockTime, Odometry
from msgs_json.topics import CLOCK, MISSION_EVENTS, RADIO_STATUS

WORLD = 'world'
HARD_STOP = 'hard stop: max_mission_s is reached'


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldSpec:
    """What the world is made of."""

    stations: dict[str, StationKind]
    """Agents by name, in the fixed order in which their messages are gated."""
    c3_position: Point
    channel: ChannelModel
    tick_s: float
    max_mission_s: float
    """Hard stop, seconds of simulated time."""


class World:
    """Counts ticks, knows where everybody is, and gates the radio."""

    def __init__(self, spec: WorldSpec, authenticator: Authenticator | None = None) -> None:
        self._spec = spec
        self._channel = RadioChannel(
            spec.channel, spec.stations, tick_s=spec.tick_s, authenticator=authenticator
        )
        for name, kind in spec.stations.items():
            if kind is StationKind.C3:
                self._channel.locate(name, spec.c3_position, 0.0)
        self._speaker = Speaker(WORLD)
        self._shown: RadioStatus | None = None
        self.tick = 0
        self.order = tuple(spec.stations)
        (self.c3,) = (n for n, kind in spec.stations.items() if kind is StationKind.C3)

    @property
    def now_s(self) -> float:
        """Return the simulated time."""
        return self.tick * self._spec.tick_s

    @property
    def time_is_up(self) -> bool:
        """Return whether the next tick would lie beyond the hard stop."""
        return is_before(self._spec.max_mission_s, (self.tick + 1) * self._spec.tick_s)

    def ticks_until(self, time_s: float) -> int:
        """Return the number of the first tick that is not before a time."""
        return whole_ticks(time_s / self._spec.tick_s)

    def clock(self) -> Frame:
        """Return the clock of this tick."""
        return Frame(CLOCK, ClockTime(time_s=self.now_s))

    def see(self, name: str, odometry: Odometry) -> None:
        """Note where a vehicle truly is."""
        self._channel.locate(name, odometry.position, odometry.z_m)

    def say(self, name: str, payload: bytes) -> int | None:
        """Take what came on an agent's ``radio/tx``; return its number if it is its own."""
        return self._channel.say(name, payload)

    def gate(self) -> list[Delivery]:
        """Return who hears what in the next round of the radio."""
        return self._channel.deliveries(self.now_s)

    def expect(self, name: str, next_seq: int) -> None:
        """Note that an agent came up, and how it will number what it says by radio."""
        self._channel.expect(name, next_seq)

    def radio_status(self) -> list[Frame]:
        """Return the radio counters where they have changed since they were last shown."""
        status = self._channel.status()
        if status == self._shown:
            return []
        self._shown = status
        return [self._speaker.frame(RADIO_STATUS, status, self.now_s)]

    def restarted(self, name: str, restarts: int) -> Frame:
        """Return the log entry of an agent that came up anew."""
        event = NodeRestarted(node=name, restarts=restarts)
        return self._speaker.frame(MISSION_EVENTS, event, self.now_s)

    def resumed(self) -> Frame:
        """Return the log entry of a mission that goes on after everything had ended."""
        return self._speaker.frame(MISSION_EVENTS, MissionResumed(), self.now_s)

    def stopped(self, reason: str, node: str | None = None) -> Frame:
        """Return the log entry of an end that C3 did not call."""
        event = MissionStopped(reason=reason, node=node)
        return self._speaker.frame(MISSION_EVENTS, event, self.now_s)
