"""
What a planner is: the values it is given, the values it returns, the protocol it implements.

Planners are pure: same request, same answer. They read no clock, draw no random numbers and
mutate nothing they are given.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from msgs_json.geometry import Cell, GridSpec, Point

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from uav_planner.sortie import Route


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

    @property
    def step_m(self) -> float:
        """Return how far the UAV flies in one tick, metres."""
        return self.uav_speed_mps * self.tick_s


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyLeg:
    """What the UAV knows of one AUV: its name, its path and when it is surfaced at the latest."""

    auv: str
    path: tuple[Cell, ...]
    """`P_0` ... `P_q`; the AUV is at one of these cells, or between two of them."""
    surface_deadline_s: float
    """Time at which the AUV is surfaced at the latest, seconds [S_i]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRequest:
    """The question to a planner: one AUV has been met, which path does it get."""

    mission: MissionSpec
    values: NDArray[np.float64]
    """Exploration map, shape (rows, cols), `[row, col]`, in (0, 1], read-only [V(C), M]."""
    auv: str
    """The AUV that was met."""
    cell: Cell
    """Where it was met; the new path starts there [P_i0]."""
    legs: tuple[SurveyLeg, ...]
    """
    Every AUV still surveying, in visiting order, `auv` included (with the leg it just ended).

    Those in `met` have their new leg here already, the others their present one.
    """
    met: frozenset[str]
    """AUVs met earlier in this sortie, `auv` not included."""
    now_s: float


class PlanStatus(enum.Enum):
    """How a plan came about."""

    OK = 'ok'
    """A full path of q moves."""
    SHORTENED = 'shortened'
    """No feasible path has q moves; the longest length that has one was used."""
    INFEASIBLE = 'infeasible'
    """No path of Delta moves or more keeps the limit; the path given is a last resort."""


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


class Planner(Protocol):
    """A way to choose paths and sorties. Implementations are registered in `planners`."""

    meets_out_of_turn: bool
    """Whether an AUV heard before its turn is met at once (ECC 2009 waits for its turn)."""

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """Choose the next path of the AUV that was just met."""
        ...

    def plan_sortie(
        self, mission: MissionSpec, legs: tuple[SurveyLeg, ...], now_s: float
    ) -> SortiePlan:
        """
        Lay the route of the next sortie and choose its departure, at or after ``now_s``.

        Raises
        ------
        ValueError
            The planner cannot plan this mission; it then says so for its first sortie.

        """
        ...
