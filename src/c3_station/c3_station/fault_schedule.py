"""
What goes wrong in a mission beside the sea and the radio, drawn before it begins.

Same scenario, same seed: same faults. In one process they strike at the very input that is named
here (`faults_in_process`); between real processes at the same mission time (`faults_on_ros`).
"""

from __future__ import annotations

import enum
from collections import defaultdict
from dataclasses import dataclass, field, replace
from itertools import cycle, islice
from typing import TYPE_CHECKING

from c3_station.lower_bound import lower_bound_s
from c3_station.scenario import C3, UAV
from msgs_json.geometry import is_before
from msgs_json.randomness import agent_rng

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np

    from c3_station.scenario import Scenario


class Moment(enum.Enum):
    """Where in its work a process dies."""

    BEFORE_INPUT = 'before_input'
    """It has not taken notice of a tick or a message."""
    BEFORE_COMMIT = 'before_commit'
    """It has acted on it, and nothing of that is stored."""
    AFTER_COMMIT = 'after_commit'
    """All of it is stored, and nothing is said."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Kill:
    """A process dies, or hangs until somebody kills it."""

    at_s: float
    """The first input from this time on that allows it."""
    moment: Moment
    when_it_hears: bool
    """Whether a message of the radio is waited for; otherwise any tick will do."""
    hangs: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FullDisk:
    """A time in which nothing can be stored."""

    from_s: float
    until_s: float

    def holds_at(self, now_s: float) -> bool:
        """Return whether the disk is full at a time."""
        return not is_before(now_s, self.from_s) and is_before(now_s, self.until_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockJump:
    """The ROS clock is set."""

    at_s: float
    by_s: float


@dataclass(slots=True, kw_only=True)
class NodeFaults:
    """What befalls one agent."""

    kills: list[Kill] = field(default_factory=list)
    """By time."""
    full_disk: FullDisk | None = None
    clock_jump: ClockJump | None = None
    forged_s: Sequence[float] = ()
    """When it hears a forged message, in order."""
    off_by_one_s: float | None = None
    """From when on it reports a neighbour of the cell that it is in."""


def fault_schedule(scenario: Scenario) -> Mapping[str, NodeFaults]:
    """
    Return the faults of a mission by agent.

    Each kind of fault is drawn from a stream of its own: more of one does not change the others.
    """
    faults = scenario.faults
    agents = (*(auv.name for auv in scenario.auvs), UAV, C3)
    struck = [name for name in agents if not faults.nodes or name in faults.nodes]
    until_s = lower_bound_s(scenario) if faults.until_s is None else faults.until_s
    schedule: dict[str, NodeFaults] = defaultdict(NodeFaults)
    if faults.disk_full_s:
        rng = _rng(scenario, 'disk_full')
        for name in struck:
            from_s = rng.uniform(0.0, until_s)
            schedule[name].full_disk = FullDisk(from_s=from_s, until_s=from_s + faults.disk_full_s)
    if faults.clock_jump_s:
        rng = _rng(scenario, 'clock_jump')
        for name in struck:
            schedule[name].clock_jump = ClockJump(
                at_s=rng.uniform(0.0, until_s),
                by_s=rng.uniform(-faults.clock_jump_s, faults.clock_jump_s),
            )
    for kind, count in (('kills', faults.kills), ('hangs', faults.hangs)):
        rng = _rng(scenario, kind)
        for name in islice(cycle(struck), count):
            kill = _kill(rng, until_s, hangs=kind == 'hangs')
            disk = schedule[name].full_disk
            if disk is not None and disk.holds_at(kill.at_s):
                # What a process could not store dies with it: nobody promises anything for both
                # at once. A tick later it is stored.
                kill = replace(kill, at_s=disk.until_s + scenario.tick_s)
            schedule[name].kills.append(kill)
    for each in schedule.values():
        each.kills.sort(key=lambda kill: kill.at_s)
    if faults.forged:
        rng = _rng(scenario, 'forged')
        times_s = rng.uniform(0.0, until_s, faults.forged)
        victims = rng.integers(len(struck), size=faults.forged)
        for index, name in enumerate(struck):
            schedule[name].forged_s = tuple(sorted(times_s[victims == index].tolist()))
    if faults.off_by_one is not None:
        rng = _rng(scenario, 'off_by_one')
        schedule[faults.off_by_one].off_by_one_s = rng.uniform(0.0, until_s)
    return schedule


def _kill(rng: np.random.Generator, until_s: float, *, hangs: bool) -> Kill:
    at_s = rng.uniform(0.0, until_s)
    moment = list(Moment)[rng.integers(len(Moment))]
    # Contacts are short and rare, and there is most to lose in them.
    when_it_hears = bool(rng.integers(2))
    if hangs:  # who hangs is killed between two inputs
        return Kill(at_s=at_s, moment=Moment.BEFORE_INPUT, when_it_hears=False, hangs=True)
    return Kill(at_s=at_s, moment=moment, when_it_hears=when_it_hears, hangs=False)


def _rng(scenario: Scenario, kind: str) -> np.random.Generator:
    return agent_rng(scenario.seed, f'faults.{kind}')
