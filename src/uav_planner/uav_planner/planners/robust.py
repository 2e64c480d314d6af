"""The paper's values and straightness, chosen from the paths with which L can always be kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uav_planner.candidate_paths import DOCUMENTED_TIE_ORDER, TieOrder, walk_table
from uav_planner.guarantee import GuaranteedPaths, guaranteed_sortie
from uav_planner.path_choice import best_path
from uav_planner.planning import PlanResult, PlanStatus

if TYPE_CHECKING:
    from uav_planner.planning import PlanRequest, SortiePlan, SortieRequest


class RobustPlanner:
    """
    Algorithm 1 of ECC 2009 with the guaranteed set in the place of the paper's prediction.

    Parameters
    ----------
    tie_order
        Which of several equally good paths is taken.

    """

    guarantees_limit = True

    def __init__(self, *, tie_order: TieOrder = DOCUMENTED_TIE_ORDER) -> None:
        self._tie_order = tie_order

    def plan_path(self, request: PlanRequest) -> PlanResult:
        """
        Choose the best guaranteed path of q moves, else of fewer, down to Delta.

        Raises
        ------
        ValueError
            The AUV has no leg among those of the request, or the region has no path of Delta
            moves, or they are more than `WalkTable` can hold.

        """
        mission = request.mission
        guaranteed = GuaranteedPaths(request)
        offer = guaranteed.stay
        for moves in range(mission.path_cells, mission.min_path_cells - 1, -1):
            table = walk_table(moves, self._tie_order)
            path = best_path(table, request.values, request.cell, guaranteed)
            if path is not None:
                offer = guaranteed.offer(path)
                break
        if offer.round_ticks > mission.limit_ticks:
            status = PlanStatus.INFEASIBLE
        elif len(offer.path) - 1 < mission.path_cells:
            status = PlanStatus.SHORTENED
        else:
            status = PlanStatus.OK
        return PlanResult(
            status=status,
            path=offer.path,
            slack_s=(mission.limit_ticks - guaranteed.others_ticks) * mission.tick_s,
            sortie_time_s=offer.round_ticks * mission.tick_s,
            search=offer.search,
        )

    def plan_sortie(self, request: SortieRequest) -> SortiePlan:
        """
        Lay the route of the next sortie; leave so that its worst case is at most L.

        Raises
        ------
        ValueError
            L cannot be kept from the beginning, or paths are longer than `WalkTable` can hold.

        """
        walk_table(request.mission.path_cells, self._tie_order)  # made on the ground
        return guaranteed_sortie(request)


def make_robust(*, tie_order: str = DOCUMENTED_TIE_ORDER.name) -> RobustPlanner:
    """
    Plan by the paper's value and straightness, and keep L whatever the AUVs do.

    Options are as in scenario files: ``tie_order``, see `TieOrder.named`.
    """
    return RobustPlanner(tie_order=TieOrder.named(tie_order))
