"""
What a planner is: the values it is given, the values it returns, the protocol it implements.

Planners are pure: same request, same answer. They read no clock and mutate nothing they are given;
those that draw random numbers make their generators anew for every request, from fixed seeds.
"""

from __future__ import annotations

import enum
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from msgs_json.geometry import Cell, GridSpec, Point, whole_ticks
from uav_planner.sortie import Route

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionSpec:
    """What stays the same for a whole mission (symbols of ECC 2009 in brackets)."""

    grid: GridSpec
    c3: Point
    """Base station, where sorties begin and end."""
    radio_range_m: float
    """Radius of the UAV's radio disc, metres [R]."""
    uav_speed_mps: float
    tick_s: float
    """Length of a tick, seconds; vehicles move in whole ticks."""
    sortie_limit_s: float
    """From leaving C3 to being back at C3, seconds [L]."""
    path_cells: int
    """Moves of a full path [q]."""
    min_path_cells: int
    """Moves of the shortest path that may be handed over [Delta], >= 1."""
    handover_s: float = 0.0
    """Kept free in a sortie for each AUV met, seconds."""
    surface_margin_s: float = 0.0
    """How much later than at nominal speed an AUV may surface, seconds; part of `S_i`."""

    @property
    def step_m(self) -> float:
        """Return how far the UAV flies in one tick, metres."""
        return self.uav_speed_mps * self.tick_s

    @property
    def limit_ticks(self) -> int:
        """Return L in whole ticks, rounded down."""
        return -whole_ticks(-self.sortie_limit_s / self.tick_s)

    @property
    def handover_ticks(self) -> int:
        """Return the time kept free for each AUV met in whole ticks, rounded up."""
        return whole_ticks(self.handover_s / self.tick_s)


Tours = Mapping[str, tuple[Cell, ...]]
"""
By AUV, the cells that it is still to enter, in order.

What a planner that looks beyond one leg has in mind, empty otherwise. It gets back what it
returned last.
"""


class Prospect(enum.Enum):
    """What the next sortie has to do with a leg, seen from within the present one."""

    ENDS = 'ends'
    """The AUV is to be met in this sortie, somewhere on the leg, and will get another one."""
    STAYS = 'stays'
    """The whole leg is to be searched: it is new, or this sortie does not go there."""
    ASTRAY = 'astray'
    """The AUV was searched and not found; it is looked for where that leaves room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyLeg:
    """What the UAV knows of one AUV: its path, when it is surfaced, how it will be searched."""

    auv: str
    path: tuple[Cell, ...]
    """`P_0` ... `P_q`; the AUV is at one of these cells, or between two of them."""
    surface_deadline_s: float
    """Time at which the AUV is surfaced at the latest, seconds [S_i]."""
    behind: Cell | None = None
    """The neighbour of `P_0` toward which the leg began; None where it began at `P_0` itself."""
    search: tuple[Point, ...] = ()
    """The waypoints from which the leg is cleared, in order; empty where none are laid yet."""
    prospect: Prospect = Prospect.ENDS
    speed_mps: float = 1.0
    """Of the AUV under water."""

    @property
    def track(self) -> tuple[Cell, ...]:
        """Return the cells between which the AUV can be, in searching order: `P_q` first."""
        return track_of(self.path, self.behind)

    def beside(self, cell: Cell) -> tuple[Cell, ...]:
        """Return the cells that follow a cell on the track or that it follows, each once."""
        beside = [
            other
            for pair in itertools.pairwise(self.track)
            for here, other in (pair, pair[::-1])
            if here == cell
        ]
        return tuple(dict.fromkeys(beside))


def track_of(path: tuple[Cell, ...], behind: Cell | None) -> tuple[Cell, ...]:
    """Return the cells of a leg in searching order, from `P_q` back to where it began."""
    return path[::-1] if behind is None else (*path[::-1], behind)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRequest:
    """The question to a planner: one AUV has been met, which path does it get."""

    mission: MissionSpec
    values: NDArray[np.float64]
    """Exploration map, shape (rows, cols), `[row, col]`, (0, 1], 0 if masked, read-only [V(C)]."""
    auv: str
    """The AUV that was met."""
    cell: Cell
    """The last cell it entered; the new path starts there [P_i0]."""
    behind: Cell | None = None
    """The neighbour of `cell` toward which it lies; None at the centre of `cell`."""
    legs: tuple[SurveyLeg, ...]
    """
    Every AUV still surveying, in visiting order, `auv` included (with the leg it just ended).

    Those met earlier in this sortie have their new leg here already, the others their present one.
    """
    now_s: float
    position: Point | None = None
    """Where the UAV is, if that is known."""
    tours: Tours = field(default_factory=dict)
    """What the planner had in mind when it planned last."""

    @property
    def round_legs(self) -> tuple[SurveyLeg, ...]:
        """Return the legs that the next round goes to: those of all but who was sought in vain."""
        return tuple(
            leg for leg in self.legs if leg.auv == self.auv or leg.prospect is not Prospect.ASTRAY
        )


class PlanStatus(enum.Enum):
    """How a plan came about."""

    OK = 'ok'
    """A full path of q moves."""
    SHORTENED = 'shortened'
    """No path of q moves was found that is feasible; it has fewer."""
    INFEASIBLE = 'infeasible'
    """No path of Delta moves or more keeps the limit for a sortie to all; a last resort."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanResult:
    """The path to hand over and what the planner foresees with it."""

    status: PlanStatus
    path: tuple[Cell, ...]
    """`P_0` ... `P_n`, n >= Delta; `P_0` is the requested cell."""
    slack_s: float
    """Time left for this AUV before its path is chosen, seconds [lambda = L - L-]."""
    sortie_time_s: float
    """The planner's own figure for the next sortie with this path, seconds [T_j]."""
    search: tuple[Point, ...] = ()
    """The waypoints with which the limit is guaranteed; empty from a planner without one."""
    tours: Tours = field(default_factory=dict)
    """They still hold the cells of `path`: what the AUV does not reach then has its place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortieRequest:
    """The question to a planner: where does the next sortie go, and when does it leave."""

    mission: MissionSpec
    legs: tuple[SurveyLeg, ...]
    """Every AUV still surveying, in visiting order."""
    overlooked: frozenset[str] = frozenset()
    """AUVs that the sortie before did not reach: they are to come first."""
    now_s: float
    values: NDArray[np.float64] | None = None
    """Exploration map as in `PlanRequest`, for a planner that looks ahead."""
    tours: Tours = field(default_factory=dict)
    """What the planner had in mind when it planned last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortiePlan:
    """The next sortie: a fixed list of waypoints and when to leave."""

    route: Route
    depart_s: float
    """When the UAV leaves C3 (on the tick grid, not before the time of planning)."""
    predicted_s: float
    """The planner's own figure for the duration of the sortie, seconds [T_j]."""
    worst_case_s: float
    """The whole list flown from `depart_s`, waits for every surface deadline included, seconds."""
    tours: Tours = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class LookAhead:
    """How far a planner has come with the whole mission, before take-off."""

    share: float
    """Of the work that is done, 0 to 1."""
    tours: Tours
    """The best so far."""
    visiting_order: tuple[str, ...] = ()
    """That goes with them; empty where the AUVs are visited in the order in which they come."""


class Planner(Protocol):
    """
    A way to choose paths and sorties. Implementations are registered in `planners`.

    Those that do not look ahead inherit from it, and with that the default of `look_ahead`.
    """

    guarantees_limit: bool
    """
    Whether its sorties keep L whatever the AUVs do.

    Then an AUV heard before its turn is met at once, and the UAV turns home when to go on could
    break L (it is late for a reason outside the plan). ECC 2009 does neither.
    """

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """Choose the next path of the AUV that was just met."""
        ...

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route of the next sortie and choose its departure, at or after ``now_s``.

        Raises
        ------
        ValueError
            The planner cannot plan this mission; it then says so for its first sortie.

        """
        ...

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        """
        Plan the whole mission on the ground, after its first sortie was planned.

        It does that slice by slice, each at most a second or so long, and yields after each. There
        is nothing to yield where a planner goes from leg to leg.
        """
        return iter(())
