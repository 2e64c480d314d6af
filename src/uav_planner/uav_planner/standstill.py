"""Whether nobody gets on any more: each AUV would make the round too long for the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from uav_planner.planning import PlanRequest

STUCK_VALUE = 0.5**4
"""An AUV in a cell of this value or less may be one that moves to and fro for ever."""


def is_at_a_standstill(request: PlanRequest) -> bool:
    """Return whether an AUV has been where it is often, and no other one finds anything new."""
    index_of = request.mission.grid.index
    if request.values[index_of(request.cell)] > STUCK_VALUE:
        return False
    entered = (
        cell for leg in request.round_legs if leg.auv != request.auv for cell in leg.path[1:]
    )
    # A cell entered once is new.
    return not any(request.values[index_of(cell)] == 0.5 for cell in entered)
