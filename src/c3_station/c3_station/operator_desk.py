"""
What the operator wants, command by command, as one directive that the UAV is to fly by.

C3 repeats the directive until the UAV has taken it, which may be a sortie later. By a time limit
or a region the UAV may be unable to fly; it takes all else then, and these stay as they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
from msgspec.structs import replace

from c3_station.sortie_reach import problem_with_reach
from msgs_json.geometry import mask_problems
from msgs_json.messages import (
    Abort,
    ChangeLimit,
    ChangeRegion,
    Directive,
    EndMission,
    OperatorCommand,
    Pause,
    Recall,
    Reset,
    Resume,
)

if TYPE_CHECKING:
    from collections.abc import Set

    from c3_station.scenario import Scenario
    from msgs_json.geometry import Cell
    from msgs_json.messages import DirectiveRefused

OPERATOR = 'operator'
"""Who signs commands; no agent can be called so."""

_ABORTED = 'the mission is aborted, and stays so until a reset'
"""Why an aborted mission neither goes on nor ends."""


class DeskMemory(msgspec.Struct, frozen=True, kw_only=True):
    """All that an `OperatorDesk` knows."""

    wanted: Directive
    taken: Directive


class OperatorDesk:
    """
    Keeps what the operator wants, and what of it the UAV has taken.

    Parameters
    ----------
    scenario
        The mission as it was ordered.
    memory
        What a desk before this one knew; None for one whose operator wants what was ordered.

    """

    def __init__(self, scenario: Scenario, memory: DeskMemory | None = None) -> None:
        self._scenario = scenario
        self._auvs = tuple(auv.name for auv in scenario.auvs)
        self._region = scenario.region
        ordered = Directive(
            revision=0,
            paused=False,
            aborted=False,
            recalled=(),
            sortie_limit_s=scenario.sortie.limit_s,
            masked=self._region.masked,
        )
        self.wanted = memory.wanted if memory else ordered
        self.taken = memory.taken if memory else ordered
        """The one by which the UAV flies, as far as it has said so."""

    def memory(self) -> DeskMemory:
        """Return what to make another one from."""
        return DeskMemory(wanted=self.wanted, taken=self.taken)

    @property
    def is_settled(self) -> bool:
        """Return whether the UAV flies as the operator wants."""
        return self.wanted.revision == self.taken.revision

    @property
    def is_all_recalled(self) -> bool:
        """Return whether every AUV is to come back."""
        return len(self.wanted.recalled) == len(self._auvs)

    @property
    def taken_out(self) -> frozenset[Cell]:
        """Return the cells that the operator has taken out of the region."""
        return frozenset(self.wanted.masked) - frozenset(self._region.masked)

    def take(self, command: OperatorCommand, surveyed: Set[Cell] = frozenset()) -> str | None:
        """Take a command, with these cells being surveyed; return why not, or None."""
        wanted, auvs = self.wanted, self._auvs
        match command:
            case Recall(auvs=named):
                unknown = {*named} - {*auvs}
                if unknown:
                    return f'{", ".join(sorted(unknown))}: no such AUV; allowed: {", ".join(auvs)}'
                recalled = {*wanted.recalled, *(named or auvs)}
                wanted = replace(wanted, recalled=tuple(sorted(recalled)))
            case EndMission():
                if wanted.aborted:
                    return _ABORTED
                wanted = replace(wanted, recalled=tuple(sorted(auvs)), paused=False)
            case Pause():
                wanted = replace(wanted, paused=True)
            case Resume():
                if wanted.aborted:
                    return _ABORTED
                wanted = replace(wanted, paused=False)
            case Abort():
                wanted = replace(wanted, aborted=True)
            case Reset():
                wanted = replace(wanted, aborted=False)
            case ChangeLimit(sortie_limit_s=limit_s):
                wanted = replace(wanted, sortie_limit_s=limit_s)
            case ChangeRegion(masked=masked):
                for index, problem in mask_problems(replace(self._region, masked=masked)):
                    return f'masked[{index}] {problem}'
                wanted = replace(wanted, masked=self._with_those_ordered(masked))
        before = self.wanted
        if (wanted.sortie_limit_s, wanted.masked) != (before.sortie_limit_s, before.masked):
            beyond_reach = self._problem_with_reach(wanted, surveyed)
            if beyond_reach:
                return beyond_reach
        if wanted != self.wanted:
            self.wanted = replace(wanted, revision=wanted.revision + 1)
        return None

    def _problem_with_reach(self, wanted: Directive, surveyed: Set[Cell]) -> str | None:
        cells = replace(self._region, masked=wanted.masked).cells
        left = [cell for cell in cells if cell not in surveyed]
        problem = problem_with_reach(self._scenario, wanted.sortie_limit_s, left)
        return (
            f'sortie_limit_s {problem}; or take them out of the region first' if problem else None
        )

    def _with_those_ordered(self, masked: tuple[Cell, ...]) -> tuple[Cell, ...]:
        """Return masked cells in the order of the scenario: the same ones are always equal."""
        ordered = self._region.masked
        return (*ordered, *sorted({*masked} - {*ordered}))

    def acknowledged(self, revision: int) -> None:
        """Note that the UAV flies by a directive; of one that is out of date it says nothing."""
        if revision == self.wanted.revision:
            self.taken = self.wanted

    def refused(self, refusal: DirectiveRefused) -> bool:
        """Note by what the UAV flies instead of what was wanted; return whether it still was."""
        if refusal.revision != self.wanted.revision or self.is_settled:
            return False
        self.wanted = self.taken = replace(
            self.wanted, sortie_limit_s=refusal.sortie_limit_s, masked=refusal.masked
        )
        return True
