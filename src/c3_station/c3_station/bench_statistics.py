"""What the missions of a planner in a family of scenarios came to."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from c3_station.campaign_mission import MissionExit

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from c3_station.bench_families import Family
    from c3_station.bench_mission import TimedMission


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """A mission of a family with one planner: flown, or refused before it began."""

    family: Family
    planner: str
    seed: int
    stop_s: float
    """The hard stop."""
    refusal: str | None = None
    """Why the mission cannot be flown with this planner."""
    flown: TimedMission | None = None

    @property
    def is_explored(self) -> bool:
        """Return whether all of the region was explored."""
        return self.flown is not None and self.flown.result.explored_s is not None

    @property
    def problem(self) -> str | None:
        """Return why the region was not explored, None if it was."""
        if self.flown is None:
            return f'refused: {self.refusal}'
        result = self.flown.result
        if result.exit is MissionExit.STOPPED:
            return f'not explored by the hard stop, {self.stop_s:,.0f} s'
        return None if self.is_explored else result.reason or 'ended without all explored'

    @property
    def explored_ratio(self) -> float:
        """
        Return the time to explore the region over its lower bound.

        Where the hard stop came first it is more than this; infinite where the planner refused or
        failed.
        """
        if self.flown is None:
            return math.inf
        result = self.flown.result
        explored_s = result.explored_s
        if explored_s is None:
            explored_s = self.stop_s if result.exit is MissionExit.STOPPED else math.inf
        return explored_s / result.lower_bound_s if result.lower_bound_s else math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line of the table: the missions of one planner in one family."""

    attempts: tuple[Attempt, ...]

    @property
    def planner(self) -> str:
        """Return the planner's name."""
        return self.attempts[0].planner

    @property
    def explored(self) -> int:
        """Return how many of the missions explored their region."""
        return sum(attempt.is_explored for attempt in self.attempts)

    @property
    def is_explored(self) -> bool:
        """Return whether all of them did."""
        return self.explored == len(self.attempts)

    @property
    def ratio_mean(self) -> float:
        """Return the mean time to explore over its lower bound; at least that if not all did."""
        return statistics.fmean(attempt.explored_ratio for attempt in self.attempts)

    @property
    def ratio_worst(self) -> float:
        """Return the largest of these."""
        return max(attempt.explored_ratio for attempt in self.attempts)

    @property
    def delivered_s(self) -> float | None:
        """Return the mean time at which all data was at C3, of the missions in which it was."""
        return _mean(each.result.delivered_s for each in self._flown)

    @property
    def neglect(self) -> float | None:
        """Return the mean neglect, of the missions that were explored."""
        return _mean(each.result.neglect_fraction for each in self._flown)

    @property
    def revisits(self) -> float | None:
        """Return the mean number of moves into cells that had been entered before."""
        return _mean(each.result.revisits for each in self._flown)

    @property
    def sorties(self) -> float | None:
        """Return the mean number of sorties."""
        return _mean(each.result.sorties_total for each in self._flown)

    @property
    def violations(self) -> int:
        """Return the number of sorties over L, of all missions together."""
        return sum(each.result.violations for each in self._flown)

    @property
    def plan_p50_s(self) -> float | None:
        """Return the median time to plan a path in flight, seconds."""
        return self._plan_quantile_s(0.50)

    @property
    def plan_p99_s(self) -> float | None:
        """Return the time that one plan of a path in a hundred is above, seconds."""
        return self._plan_quantile_s(0.99)

    @property
    def take_off_plan_s(self) -> float | None:
        """Return the longest time to plan before take-off, seconds."""
        return max((each.take_off_plan_s for each in self._flown), default=None)

    @property
    def peak_memory_bytes(self) -> int | None:
        """Return the largest resident set of a process that flew one of the missions."""
        return max((each.peak_memory_bytes for each in self._flown), default=None)

    @property
    def _flown(self) -> list[TimedMission]:
        return [attempt.flown for attempt in self.attempts if attempt.flown is not None]

    def _plan_quantile_s(self, share: float) -> float | None:
        times_s = [time_s for each in self._flown for time_s in each.path_plans_s]
        # A time that was measured: of few plans, p99 is the longest.
        return float(np.quantile(times_s, share, method='higher')) if times_s else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """The part of the table about one family, planner by planner."""

    family: Family
    lines: tuple[Line, ...]

    @property
    def best(self) -> str | None:
        """Return the planner with the least mean; None if no planner explored all."""
        explored = [line for line in self.lines if line.is_explored]
        best = min(explored, key=lambda line: line.ratio_mean, default=None)
        return best.planner if best else None

    @property
    def problems(self) -> tuple[str, ...]:
        """Return why regions were not explored: for each planner its reasons, and how often."""
        reasons = Counter(
            (line.planner, attempt.problem)
            for line in self.lines
            for attempt in line.attempts
            if not attempt.is_explored
        )
        return tuple(
            f'{planner}, {_missions(count)}: {reason}'
            for (planner, reason), count in reasons.items()
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What it comes to for a planner over all families on time, as each counts the same."""

    planner: str
    ratio_mean: float
    """Of the means; at least that if not all missions were explored."""
    explored: int
    """Missions in which the whole region was explored."""
    missions: int
    families: int
    best_of: int
    """Families, uncertain ones included, in which it is the best one."""
    families_total: int
    """Those, uncertain ones included, that it flew in."""
    violations: int
    """Sorties over L, in all families."""


def blocks_of(attempts: Iterable[Attempt]) -> tuple[Block, ...]:
    """Return the table of some missions; families and planners in the order of their first one."""
    found: dict[str, dict[str, list[Attempt]]] = {}
    families = {}
    for attempt in attempts:
        families[attempt.family.name] = attempt.family
        block = found.setdefault(attempt.family.name, {})
        block.setdefault(attempt.planner, []).append(attempt)
    return tuple(
        Block(
            family=families[name],
            lines=tuple(Line(attempts=tuple(each)) for each in block.values()),
        )
        for name, block in found.items()
    )


def verdicts_of(blocks: Sequence[Block]) -> tuple[Verdict, ...]:
    """Return the verdict on every planner, in the table's order."""
    planners = dict.fromkeys(line.planner for block in blocks for line in block.lines)
    verdicts = []
    for planner in planners:
        lines = {
            block: line for block in blocks for line in block.lines if line.planner == planner
        }
        on_time = [line for block, line in lines.items() if block.family.is_on_time]
        verdicts.append(
            Verdict(
                planner=planner,
                ratio_mean=_mean(line.ratio_mean for line in on_time) or math.inf,
                explored=sum(line.explored for line in on_time),
                missions=sum(len(line.attempts) for line in on_time),
                families=len(on_time),
                families_total=len(lines),
                best_of=sum(block.best == planner for block in lines),
                violations=sum(line.violations for line in lines.values()),
            )
        )
    return tuple(verdicts)


def _missions(count: int) -> str:
    return '1 mission' if count == 1 else f'{count} missions'


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None
