"""The planners by name. A new one is a module here and a line in `PLANNERS`."""

from __future__ import annotations

import inspect
from types import MappingProxyType
from typing import TYPE_CHECKING

from uav_planner.planners.ecc2009 import Ecc2009Planner

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from uav_planner.planning import Planner

PLANNERS: Mapping[str, Callable[..., Planner]] = MappingProxyType({'ecc2009': Ecc2009Planner})
"""Planner name, as in scenario files, to its factory; options are keyword arguments of it."""


def make_planner(name: str, **options: object) -> Planner:
    """
    Return a new planner.

    Raises
    ------
    ValueError
        There is no planner of that name, or it has no such option.

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
