"""
What an agent is: a sans-I/O object that is told the time and what it hears.

An agent knows no ROS, clock, file or socket. It returns what it wants to send, publish and log as
values; `agent_shell.AgentShell` turns these into bytes, and the node host (one process per agent)
or the in-process kernel carries them. Its vehicle, if it has one, is behind a driver.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

import msgspec

if TYPE_CHECKING:
    from msgs_json.codec import Refusal
    from msgs_json.messages import Event, Message
    from msgs_json.ros_messages import RosMessage
    from msgs_json.topics import Topic


class Transmit(msgspec.Struct, frozen=True):
    """Say something by radio; whether it is heard is up to the channel."""

    dst: str
    body: Message


class Publish(msgspec.Struct, frozen=True):
    """Show something to people and tools; no agent listens to it."""

    topic: Topic
    message: RosMessage | Message


class Log(msgspec.Struct, frozen=True):
    """Note in the mission's log that something happened."""

    event: Event
    stamp_s: float
    """When it happened; may lie one tick before the time of logging."""


class Refuse(msgspec.Struct, frozen=True):
    """Turn down what somebody said; counted always, logged now and then."""

    sender: str
    refusal: Refusal
    detail: str


Output = Transmit | Publish | Log | Refuse


class Agent(Protocol):
    """
    The behaviour of one vehicle or station.

    Within a tick ``tick`` comes first, then ``receive`` for every message heard at that time.
    Decisions that depend on what was *not* heard are taken at the next ``tick``, when the radio of
    the tick before is known to be over.
    """

    name: str
    peers: frozenset[str]
    """Agents it listens to; messages from others are refused."""
    finished: bool
    """Whether its part of the mission is over."""

    def tick(self, now_s: float) -> list[Output]:
        """Move the vehicle to ``now_s`` and act on what was known until then."""
        ...

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Act on a message heard at ``now_s``."""
        ...


@runtime_checkable
class Worker(Protocol):
    """
    What an agent has, too, if something that it is told may make many seconds of work.

    The work is done in slices, one after another within the tick, and between them the agent is
    asked nothing else. So time stands still for it, but whoever waits can see that it goes on.
    """

    is_busy: bool
    """Whether there is work left to do."""

    def work(self, now_s: float) -> list[Output]:
        """Do one slice, of at most a second or so of wall time."""
        ...
