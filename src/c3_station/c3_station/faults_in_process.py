"""A mission flown in one process, in which agents are killed, starved and lied to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from auv_sim.kernel import run_mission
from auv_sim.world import WORLD
from c3_station.fault_schedule import Moment, NodeFaults, fault_schedule
from c3_station.faulty_store import FaultyStore, ProcessDied
from c3_station.forgeries import Stranger
from c3_station.misreporting_auv import MisreportingAuv
from msgs_json.agent_shell import AgentSetting
from msgs_json.codec import MessageError
from msgs_json.geometry import is_before
from msgs_json.mission_clock import MissionClock
from msgs_json.randomness import agent_rng
from msgs_json.ros_messages import Text
from msgs_json.store import MemoryStore
from msgs_json.topics import RADIO_RX

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from auv_sim.kernel import Sink
    from auv_sim.world import World
    from c3_station.fault_schedule import Kill
    from c3_station.scenario import Scenario
    from msgs_json.agent import Agent
    from msgs_json.agent_shell import AgentShell, Frame
    from msgs_json.authentication import Authenticator

    MakeAgent = Callable[[AgentSetting], AgentShell]

_BOOT_ID = 'simulated'
_STEADY_OFFSET_S = 4096.0
"""A steady clock counts from anywhere; from a power of two, no digit of the time is lost."""


@dataclass(slots=True, kw_only=True)
class FaultTally:
    """What became of hostile messages."""

    forged: int = 0
    obeyed: int = 0
    """Of the forged ones, those that were not refused."""
    refused: int = 0
    """All messages that agents refused, the radio's late copies included."""


def fly_with_faults(
    scenario: Scenario,
    world: World,
    makers: Mapping[str, MakeAgent],
    authenticator: Authenticator | None,
    sink: Sink,
) -> FaultTally:
    """Fly a mission to its end, with the faults of its scenario; see `auv_sim.kernel`."""
    flight = _Flight(scenario, world, sink)
    schedule = fault_schedule(scenario)
    agents = {
        name: FaultyAgent(name, make, authenticator, schedule.get(name, NodeFaults()), flight)
        for name, make in makers.items()
    }
    run_mission(world, agents, flight.show)
    for agent in agents.values():
        agent.count_refused()
    return flight.tally


class _Flight:
    """What the faulty agents of a mission share."""

    def __init__(self, scenario: Scenario, world: World, sink: Sink) -> None:
        self.scenario = scenario
        self.world = world
        self.tally = FaultTally()
        self._sink = sink
        self._stranger = Stranger(agent_rng(scenario.seed, 'faults.stranger'))
        self._has_stranger = scenario.faults.forged > 0
        self._has_heard = False

    def show(self, name: str, frame: Frame) -> None:
        """Pass a frame on; the stranger hears what comes through by radio."""
        self._sink(name, frame)
        # Only what comes through: what nobody could hear yet, it could carry to where it is news.
        if self._has_stranger and frame.topic is RADIO_RX and isinstance(frame.message, Text):
            try:
                self._stranger.hear(frame.message.data)
            except MessageError:
                return  # damaged on its way
            self._has_heard = True

    def forged(self, count: int) -> list[bytes]:
        """Return so many hostile payloads, as soon as there is something to forge."""
        if not self._has_heard:
            return []
        return [forgery.payload for forgery in self._stranger.forgeries(count)]

    def restarted(self, name: str, shell: AgentShell, restarts: int) -> None:
        """Tell that an agent is back."""
        self.world.expect(name, shell.next_seq)
        self._sink(WORLD, self.world.restarted(name, restarts))


class FaultyAgent:
    """
    Stands in an `AgentShell`'s place, and makes the shell anew from its store after each death.

    As in lockstep no time passes meanwhile. A new process is told the open tick, and then the
    message that the dead one had not worked off.
    """

    def __init__(
        self,
        name: str,
        make: MakeAgent,
        authenticator: Authenticator | None,
        faults: NodeFaults,
        flight: _Flight,
    ) -> None:
        self._name = name
        self._make = make
        self._faults = faults
        self._flight = flight
        self._store = FaultyStore(MemoryStore())
        self._setting = AgentSetting(store=self._store, authenticator=authenticator)
        self._clock: MissionClock | None = None
        self._kills = list(faults.kills)
        self._forged_next = 0
        self._restarts = 0
        self._shell = self._made(0.0)

    @property
    def agent(self) -> Agent:
        """Return the agent as it is now."""
        return self._shell.agent

    @property
    def is_busy(self) -> bool:
        """Return whether the agent has work left to do before anything else is asked of it."""
        return self._shell.is_busy

    def tick(self, now_s: float) -> list[Frame]:
        """Tick the agent."""
        frames = self._survive(lambda: self._shell.tick(self._clocked(now_s)), now_s, hears=False)
        return frames + self._fooled(now_s)

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        """Hand the agent what came by radio."""
        frames = self._survive(
            lambda: self._shell.receive(data, self._clocked(now_s)), now_s, hears=True
        )
        return frames + self._fooled(now_s)

    def work(self, now_s: float) -> list[Frame]:
        """Let the agent do a slice of its work."""
        return self._survive(lambda: self._shell.work(self._clocked(now_s)), now_s, hears=False)

    def count_refused(self) -> None:
        """Add to the tally what the present process has refused."""
        self._flight.tally.refused += sum(self._shell.refused.values())

    # --- death -----------------------------------------------------------------------------------

    def _survive(
        self, act: Callable[[], list[Frame]], now_s: float, *, hears: bool
    ) -> list[Frame]:
        """Have an input worked off, by this process or by the next one."""
        disk = self._faults.full_disk
        self._store.is_full = disk is not None and disk.holds_at(now_s)
        kill = self._due(now_s, hears=hears)
        if kill is None:
            return act()
        if kill.moment is not Moment.BEFORE_INPUT:
            self._store.dies = kill.moment
            try:
                return act()  # it lives on if there is nothing to commit
            except ProcessDied:
                pass
            finally:
                self._store.dies = None
        self._kills.remove(kill)
        self._restart(now_s)
        caught_up = self._shell.tick(self._clocked(now_s)) if hears else []
        return [*caught_up, *act()]

    def _due(self, now_s: float, *, hears: bool) -> Kill | None:
        for kill in self._kills:
            if is_before(now_s, kill.at_s):
                return None
            if hears or not kill.when_it_hears:
                return kill
        return None

    def _restart(self, now_s: float) -> None:
        self.count_refused()
        self._store.reopen()
        self._shell = self._made(now_s)
        self._restarts += 1
        self._flight.restarted(self._name, self._shell, self._restarts)

    def _made(self, now_s: float) -> AgentShell:
        if self._faults.clock_jump is not None:
            self._clock = MissionClock(
                self._store,
                ros_s=self._ros_s(now_s),
                steady_s=now_s + _STEADY_OFFSET_S,
                boot_id=_BOOT_ID,
            )
        shell = self._make(self._setting)
        if self._faults.off_by_one_s is not None:
            region = self._flight.scenario.region
            shell.agent = MisreportingAuv(shell.agent, region, self._faults.off_by_one_s)
        return shell

    # --- time ------------------------------------------------------------------------------------

    def _clocked(self, now_s: float) -> float:
        """Return what the agent's process takes for the time, as it does in real time."""
        return self._clock.now_s(now_s + _STEADY_OFFSET_S) if self._clock is not None else now_s

    def _ros_s(self, now_s: float) -> float:
        jump = self._faults.clock_jump
        is_set = jump is not None and not is_before(now_s, jump.at_s)
        return now_s + jump.by_s if jump is not None and is_set else now_s

    # --- strangers -------------------------------------------------------------------------------

    def _fooled(self, now_s: float) -> list[Frame]:
        """Hand the agent the forged messages that are due; return what comes of them."""
        times_s, first = self._faults.forged_s, self._forged_next
        until = first
        while until < len(times_s) and not is_before(now_s, times_s[until]):
            until += 1
        if until == first or self.is_busy:
            return []
        frames: list[Frame] = []
        tally = self._flight.tally
        for payload in self._flight.forged(until - first):
            self._forged_next += 1
            refused = sum(self._shell.refused.values())
            frames += self._shell.receive(payload, self._clocked(now_s))
            tally.forged += 1
            tally.obeyed += sum(self._shell.refused.values()) == refused
        return frames
