"""An agent whose vehicle may fail: the failure is counted and reported, the agent goes on."""

from __future__ import annotations

from collections.abc import Callable

from msgs_json.agent_shell import AgentShell, Frame
from msgs_json.drivers import DriverError


class GuardedAgent:
    """
    An `AgentShell` that survives its driver's errors.

    ``report`` gets the first of a row of failures. An agent keeps what it had decided when its
    vehicle failed in a tick, and says it as soon as a tick goes well.
    """

    def __init__(self, shell: AgentShell, report: Callable[[str], None]) -> None:
        self.driver_failures = 0
        self.is_behind = False
        """Whether its last tick failed; the same one may be tried again."""
        self._shell = shell
        self._report = report
        self._is_failing = False

    @property
    def name(self) -> str:
        """Return the agent's name."""
        return self._shell.agent.name

    @property
    def genuine_from(self) -> str | None:
        """Return who sent what was heard last; None where that was nobody of this mission."""
        return self._shell.genuine_from

    @property
    def finished(self) -> bool:
        """Return whether the agent's part of the mission is over."""
        return self._shell.agent.finished

    @property
    def latest_s(self) -> float:
        """Return the time of the last change that a process before this one has stored."""
        return self._shell.latest_s

    @property
    def next_seq(self) -> int:
        """Return the number of what the agent says next by radio."""
        return self._shell.next_seq

    @property
    def is_busy(self) -> bool:
        """Return whether the agent has work left to do before anything else is asked of it."""
        return self._shell.is_busy

    @property
    def logged(self) -> int:
        """Return the number below which all that the agent has stored in its log is said."""
        return self._shell.logged

    def recorded(self, logged: int) -> None:
        """Note that what it has logged below a number is recorded."""
        self._shell.recorded(logged)

    def tick(self, now_s: float) -> list[Frame]:
        """Tick the agent; nothing comes of it where its vehicle fails."""
        try:
            frames = self._shell.tick(now_s)
        except DriverError as error:
            self.is_behind = True
            self._fail(error)
            return []
        self.is_behind = self._is_failing = False
        return frames

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        """Hand the agent what came by radio; nothing comes of it where its vehicle fails."""
        try:
            return self._shell.receive(data, now_s)
        except DriverError as error:
            self._fail(error)
            return []

    def work(self, now_s: float) -> list[Frame]:
        """Let the agent do a slice of its work; its vehicle has no part in it."""
        return self._shell.work(now_s)

    def _fail(self, error: DriverError) -> None:
        self.driver_failures += 1
        if not self._is_failing:
            self._report(f'driver failed ({self.driver_failures} times so far): {error}')
        self._is_failing = True
