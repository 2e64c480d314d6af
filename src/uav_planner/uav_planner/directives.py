"""What the operator wants beside the order: what of it can be flown, and what is in force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
from msgspec import structs

from msgs_json.geometry import is_before, mask_problems, unreachable_cells
from msgs_json.messages import Acknowledged, Acknowledgement, Directive, DirectiveRefused, Message
from uav_planner.entries import Entry
from uav_planner.sortie import leg_waypoints, round_ticks

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    from msgs_json.geometry import Cell, GridSpec
    from msgs_json.store import Store
    from uav_planner.fleet import Fleet
    from uav_planner.planning import MissionSpec, SurveyLeg
    from uav_planner.sortie import Route

_DIRECTIVE = 'directive'
"""Kind of the entry of the store that says what is in force."""


class Taken(msgspec.Struct, frozen=True, kw_only=True):
    """A directive by which the UAV flies, and why it is not all that the operator wanted."""

    directive: Directive
    problem: str | None

    @property
    def answer(self) -> Message:
        """Return what C3 is told, as often as it asks."""
        if self.problem is None:
            return Acknowledgement(
                acknowledges=Acknowledged.DIRECTIVE, reference=self.directive.revision
            )
        return DirectiveRefused(
            revision=self.directive.revision,
            problem=self.problem,
            sortie_limit_s=self.directive.sortie_limit_s,
            masked=self.directive.masked,
        )


class _InForce(msgspec.Struct, frozen=True, kw_only=True):
    taken: Taken | None = None
    is_called_home: bool = False


class StandingDirective:
    """The directive by which the UAV flies, and an abort that it has heard in the air."""

    def __init__(self) -> None:
        self._in_force = Entry(_DIRECTIVE, _InForce())
        self.kept = (self._in_force,)
        """What is to be saved."""

    def load(self, store: Store) -> None:
        """Go on by what a process before this one had taken."""
        self._in_force.load(store, _InForce)

    @property
    def taken(self) -> Taken | None:
        """Return the directive that was taken; None where the order says all."""
        return self._in_force.value.taken

    @property
    def is_called_home(self) -> bool:
        """Return whether an abort was heard in the air, where no directive is taken."""
        return self._in_force.value.is_called_home

    @property
    def may_depart(self) -> bool:
        """Return whether the operator lets sorties begin."""
        if self.taken is None:
            return not self.is_called_home
        wanted = self.taken.directive
        return not (wanted.paused or wanted.aborted or self.is_called_home)

    def take(self, taken: Taken) -> None:
        """Fly by another directive from now on."""
        self._in_force.value = _InForce(taken=taken)

    def call_home(self) -> None:
        """Take an abort in the air; all else that a directive says has time until the landing."""
        self._in_force.value = structs.replace(self._in_force.value, is_called_home=True)


def flyable(
    directive: Directive,
    fleet: Fleet,
    route: Route | None,
    now_s: float,
    *,
    guarantees_limit: bool,
) -> Taken:
    """
    Return a directive with the limit and the region as they are, if they must stay so.

    Parameters
    ----------
    directive
        What the operator wants.
    fleet
        The AUVs, wherever they are.
    route
        Of the next sortie; None where there is none.
    now_s
        The time.
    guarantees_limit
        Whether the planner does.

    """
    mission, problems = fleet.mission, []
    limit_s = directive.sortie_limit_s
    if limit_s != mission.sortie_limit_s:
        problem = problem_with_limit(limit_s, mission)
        if problem is None and route is not None and guarantees_limit:
            problem = problem_with_guarantee(limit_s, mission, route, fleet.legs_out)
        if problem:
            problems.append(f'{problem}; it stays {mission.sortie_limit_s:g}')
            directive = structs.replace(directive, sortie_limit_s=mission.sortie_limit_s)
    if directive.masked != mission.grid.masked:
        surveyors = {leg.auv for leg in fleet.survey_legs()} - {*directive.recalled}
        problem = problem_with_region(
            directive.masked, fleet.ordered_region, fleet.legs_out, surveyors
        )
        if problem is None and route is not None:
            problem = fleet.planner_problem(directive.masked, now_s)
        if problem:
            problems.append(f'{problem}; the region stays as it is')
            directive = structs.replace(directive, masked=mission.grid.masked)
    return Taken(directive=directive, problem='. '.join(problems) or None)


def problem_with_limit(limit_s: float, mission: MissionSpec) -> str | None:
    """Return why no planner could fly by a sortie limit, or None."""
    if is_before(limit_s, mission.tick_s):
        return _too_short(limit_s, mission.tick_s, 'a tick')
    return None


def problem_with_guarantee(
    limit_s: float, mission: MissionSpec, route: Route, legs: Iterable[SurveyLeg]
) -> str | None:
    """
    Return why a sortie limit could not be guaranteed any more, or None.

    Parameters
    ----------
    limit_s
        The limit.
    mission
        What stays the same for all sorties, by now.
    route
        Of the next sortie; it must keep the limit whatever the AUVs do.
    legs
        Those of all AUVs that are out, or may be. The next sortie may not go to all of them, and
        yet each must be within reach of some sortie: a lost one, too, may be heard again.

    """
    routes = {'the next sortie': route}
    routes |= {
        f'a sortie to {leg.auv} alone': tuple(leg_waypoints(leg, leg.search))
        for leg in legs
        if leg.search
    }
    for sortie, each in routes.items():
        needed_s = round_ticks(mission, each) * mission.tick_s
        if is_before(limit_s, needed_s):
            return _too_short(limit_s, needed_s, f'which {sortie} takes at worst')
    return None


def _too_short(limit_s: float, needed_s: float, reason: str) -> str:
    return f'sortie_limit_s is {limit_s:g}; allowed: at least {needed_s:g}, {reason}'


def problem_with_region(
    masked: tuple[Cell, ...],
    ordered: GridSpec,
    legs: Iterable[SurveyLeg],
    surveyors: Container[str],
) -> str | None:
    """
    Return why cells cannot be masked now, or no others be masked, or None.

    Parameters
    ----------
    masked
        The cells.
    ordered
        The region of the order.
    legs
        Those of all AUVs that are out, or may be: a lost one may be heard again.
    surveyors
        The AUVs among them that are to get further paths.

    """
    region = structs.replace(ordered, masked=masked)
    for index, problem in mask_problems(region):
        return f'masked[{index}] {problem}'
    if not {*ordered.masked} <= {*masked}:
        return 'masked leaves out cells that are masked in the order; AUVs go nowhere else'
    legs = tuple(legs)
    for leg in legs:
        for cell in leg.track:
            if not region.contains(cell):
                return f'masked holds {list(cell)}, which is on the path of {leg.auv}'
    ends = [leg.path[-1] for leg in legs if leg.auv in surveyors]
    unreachable = unreachable_cells(region, ends)
    if ends and unreachable:
        return (
            f'masked leaves {len(unreachable)} cells to which no AUV could get,'
            f' {list(unreachable[0])} first'
        )
    return None
