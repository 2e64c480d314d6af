"""A planner that plans the whole mission ahead for longer than a node may be silent."""

import time
from collections.abc import Iterator, Mapping

import pytest

from uav_planner import planners
from uav_planner.planners.robust import RobustPlanner
from uav_planner.planning import LookAhead, SortieRequest

SLICES = 8
NAME = 'robust'
"""Under this name it flies, as `robust` does: every node takes the scenario for sound."""


class SlowPlanner(RobustPlanner):
    """Thinks before take-off, and comes to nothing new."""

    def __init__(self, slice_s: float) -> None:
        super().__init__()
        self._slice_s = slice_s

    def look_ahead(self, request: SortieRequest) -> Iterator[LookAhead]:
        for number in range(1, SLICES + 1):
            time.sleep(self._slice_s)
            yield LookAhead(share=number / SLICES, tours={})


def planners_with_it(slice_s: float) -> Mapping[str, object]:
    return {**planners.PLANNERS, NAME: lambda: SlowPlanner(slice_s)}


def fly_with_it(monkeypatch: pytest.MonkeyPatch, slice_s: float) -> None:
    """Let it fly the missions of this process."""
    monkeypatch.setattr(planners, 'PLANNERS', planners_with_it(slice_s))


UAV_NODE = """#!{python}
import sys

sys.path.insert(0, {tests!r})
from slow_planner import planners, planners_with_it

planners.PLANNERS = planners_with_it({slice_s})
from uav_planner.uav_node import main

sys.exit(main())
"""
"""An executable that is a UAV node with this planner."""
