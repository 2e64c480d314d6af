"""The faults of a scenario, struck at real processes: SIGKILL, SIGSTOP, full disks, strangers."""

from __future__ import annotations

import resource
import signal
from collections import deque
from typing import TYPE_CHECKING

from c3_station.fault_schedule import fault_schedule
from c3_station.scenario import C3, UAV
from c3_station.stranger_node import StrangerNode
from msgs_json.geometry import is_before
from msgs_json.randomness import agent_rng

if TYPE_CHECKING:
    from collections.abc import Callable

    from c3_station.processes import NodeProcess
    from c3_station.scenario import Scenario

_NO_LIMIT = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
_FULL = (0, resource.RLIM_INFINITY)
"""
No file may grow beyond so many bytes: writing fails as it does on a full disk.

SIGXFSZ, which comes with that, ends no node: Python ignores it from its start.
"""

_FORGED_AT_ONCE = 50
"""A queue that overflows would refuse them for the nodes."""


class RosFaults:
    """
    Strikes at the processes of a flight, each time it is told how far the mission is.

    Which of a node's inputs a fault meets is up to the processes: what is drawn is when.

    Parameters
    ----------
    scenario
        The mission.
    domain_id
        The graph of its nodes.
    process_of
        Returns the process that an agent runs in at present.

    Raises
    ------
    ValueError
        The scenario has a fault that only agents in this process can have.

    """

    def __init__(
        self, scenario: Scenario, domain_id: int, process_of: Callable[[str], NodeProcess]
    ) -> None:
        faults = scenario.faults
        for key, is_set in (
            ('clock_jump_s', faults.clock_jump_s > 0.0),
            ('off_by_one', faults.off_by_one is not None),
        ):
            if is_set:
                raise ValueError(
                    f'faults.{key}: nodes in lockstep have no such fault; allowed: with --no-ros'
                )
        schedule = fault_schedule(scenario)
        self._process_of = process_of
        self._kills = deque(
            sorted(
                (kill.at_s, name, signal.SIGSTOP if kill.hangs else signal.SIGKILL)
                for name, each in schedule.items()
                for kill in each.kills
            )
        )
        self._disks = {
            name: each.full_disk for name, each in schedule.items() if each.full_disk is not None
        }
        self._full: dict[str, NodeProcess] = {}
        """Processes whose disk is full at present, by agent."""
        self._forged = deque(
            sorted((at_s, name) for name, each in schedule.items() for at_s in each.forged_s)
        )
        """When to forge what for whom."""
        self._stranger = None
        if self._forged:
            agents = (C3, UAV, *(auv.name for auv in scenario.auvs))
            rng = agent_rng(scenario.seed, 'faults.stranger')
            self._stranger = StrangerNode(agents, rng, domain_id)

    def strike(self, now_s: float) -> None:
        """Let everything happen that is due at a time of the mission."""
        while self._kills and not is_before(now_s, self._kills[0][0]):
            _, name, signum = self._kills.popleft()
            self._process_of(name).send(signum)
        for name, disk in self._disks.items():
            if disk.holds_at(now_s) and name not in self._full:
                self._full[name] = self._process_of(name)
                _limit(self._full[name], _FULL)
            elif name in self._full and not is_before(now_s, disk.until_s):
                _limit(self._full.pop(name), _NO_LIMIT)
        if self._stranger is not None:
            self._forge(self._stranger, now_s)

    def close(self) -> None:
        """Let everybody be."""
        if self._stranger is not None:
            self._stranger.close()

    def _forge(self, stranger: StrangerNode, now_s: float) -> None:
        stranger.listen()
        for _ in range(_FORGED_AT_ONCE):
            is_due = self._forged and not is_before(now_s, self._forged[0][0])
            if not (stranger.has_heard and is_due):
                return
            stranger.forge_for(self._forged.popleft()[1])


def _limit(process: NodeProcess, limits: tuple[int, int]) -> None:
    try:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, limits)
    except ProcessLookupError:
        return  # it has died; the next one finds room
