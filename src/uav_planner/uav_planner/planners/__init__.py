"""The planners by name. A new one is a module here and a line in `PLANNERS`."""

from __future__ import annotations

import inspect
from types import MappingProxyType
from typing import TYPE_CHECKING

from uav_planner.candidate_paths import DOCUMENTED_TIE_ORDER
from uav_planner.planners.ecc2009 import make_ecc2009
from uav_planner.planners.lanes import make_lanes
from uav_planner.planners.random_paths import make_random

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from uav_planner.planning import Planner


def _make_adaptive(*, effort: str = 'normal', visiting_order: str = 'fixed') -> Planner:
    """Plan whole missions ahead, and keep L whatever the AUVs do: the fastest."""
    # Not at the top, and so with `robust`: nodes that plan nothing need no compiler.
    from uav_planner.planners.adaptive import make_adaptive

    return make_adaptive(effort=effort, visiting_order=visiting_order)


def _make_robust(*, tie_order: str = DOCUMENTED_TIE_ORDER.name) -> Planner:
    """Plan by the paper's value and straightness, and keep L whatever the AUVs do."""
    from uav_planner.planners.robust import make_robust

    return make_robust(tie_order=tie_order)


PLANNERS: Mapping[str, Callable[..., Planner]] = MappingProxyType(
    {
        'adaptive': _make_adaptive,
        'ecc2009': make_ecc2009,
        'robust': _make_robust,
        'lanes': make_lanes,
        'random': make_random,
    }
)
"""
Planner name, as in scenario files, to its factory.

The factory's keyword arguments are the planner's options: plain JSON values, all with a default.
"""


def make_planner(name: str, /, **options: object) -> Planner:
    """
    Return a new planner.

    Raises
    ------
    ValueError
        There is no planner of that name, it has no such option, or not with that value.

    """
    if name not in PLANNERS:
        raise ValueError(f"unknown planner '{name}'; allowed: {', '.join(sorted(PLANNERS))}")
    factory = PLANNERS[name]
    allowed = sorted(inspect.signature(factory).parameters)
    for option in options:
        if option not in allowed:
            raise ValueError(
                f"planner '{name}' has no option '{option}'; "
                f'allowed: {", ".join(allowed) or "none"}'
            )
    return factory(**options)
