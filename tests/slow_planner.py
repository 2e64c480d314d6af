"""A planner that plans the whole mission ahead for longer than a node may be silent."""

import os
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from uav_planner import planners
from uav_planner.planners.ecc2009 import Ecc2009Planner
from uav_planner.planning import LookAhead, SortieRequest

SLICES = 8
NAME = 'ecc2009'
"""Under this name it flies, as `ecc2009` does: every node takes the scenario for sound."""


class SlowPlanner(Ecc2009Planner):
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


_UAV_NODE = """#!{python}
import sys

sys.path.insert(0, {tests!r})
from slow_planner import planners, planners_with_it

planners.PLANNERS = planners_with_it({slice_s})
from uav_planner.uav_node import main

sys.exit(main())
"""


def let_nodes_fly_with_it(monkeypatch: pytest.MonkeyPatch, folder: Path, slice_s: float) -> None:
    """Put an executable in place of the UAV's whose planner is this one."""
    uav = folder / 'lib' / 'uav_planner' / 'uav'
    uav.parent.mkdir(parents=True)
    tests = str(Path(__file__).parent)
    uav.write_text(_UAV_NODE.format(python=sys.executable, tests=tests, slice_s=slice_s))
    uav.chmod(0o755)
    prefixes = f'{folder}{os.pathsep}{os.environ["AMENT_PREFIX_PATH"]}'
    monkeypatch.setenv('AMENT_PREFIX_PATH', prefixes)
