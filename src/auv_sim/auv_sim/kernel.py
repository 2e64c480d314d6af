"""
Runs a mission in one process: the same agents as the nodes, in the same order, without ROS.

The order within a tick is that of lockstep: all agents tick; then the radio in rounds, each round
gated in agent order, until nobody says anything more. An agent that is busy with what it was told
gets all of it done before anything else happens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Protocol

from auv_sim.world import HARD_STOP, WORLD, World
from msgs_json.agent import Agent
from msgs_json.agent_shell import Frame
from msgs_json.ros_messages import Odometry, Text
from msgs_json.topics import ODOM, RADIO_RX, RADIO_TX

Sink = Callable[[str, Frame], None]
"""Takes every frame with the name of the agent in whose namespace it is published."""


class Shell(Protocol):
    """What is asked of an `AgentShell` here."""

    @property
    def agent(self) -> Agent:
        """Return the agent."""

    @property
    def is_busy(self) -> bool:
        """Return whether the agent has work left to do before anything else is asked of it."""

    def tick(self, now_s: float) -> list[Frame]:
        """Tick the agent."""

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        """Hand the agent what came by radio."""

    def work(self, now_s: float) -> list[Frame]:
        """Let the agent do a slice of its work."""


def run_mission(world: World, agents: Mapping[str, Shell], sink: Sink) -> None:
    """Run a mission until C3 calls it complete, or to the hard stop."""
    while True:
        _run_tick(world, agents, sink)
        if agents[world.c3].agent.finished:
            break
        if world.time_is_up:
            sink(WORLD, world.stopped(HARD_STOP))
            break
        world.tick += 1
    for frame in world.radio_status():
        sink(WORLD, frame)


def _run_tick(world: World, agents: Mapping[str, Shell], sink: Sink) -> None:
    now_s = world.now_s
    sink(WORLD, world.clock())
    for name in world.order:
        agent = agents[name]
        _carry(name, agent.tick(now_s), world, sink)
        if agent.is_busy:
            _carry(name, _worked_off(agent, now_s), world, sink)
    while heard := world.gate():
        for name, payload, _ in heard:
            sink(name, Frame(RADIO_RX, Text(payload)))
            agent = agents[name]
            _carry(name, agent.receive(payload, now_s), world, sink)
            if agent.is_busy:
                _carry(name, _worked_off(agent, now_s), world, sink)


def _worked_off(agent: Shell, now_s: float) -> Iterator[Frame]:
    """Yield what comes of the work that a tick or a message has begun, as it is done."""
    while agent.is_busy:
        yield from agent.work(now_s)


def _carry(name: str, frames: Iterable[Frame], world: World, sink: Sink) -> None:
    """Pass an agent's frames on; tell the world where it is and what it says by radio."""
    for frame in frames:
        sink(name, frame)
        match frame.message:
            case Odometry() as odometry if frame.topic is ODOM:
                world.see(name, odometry)
            case Text(data) if frame.topic is RADIO_TX:
                world.say(name, data)
