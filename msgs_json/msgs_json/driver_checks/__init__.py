"""
The conformance suite of vehicle drivers: the rules that planners and agents rely on.

A vehicle's package runs it in its own tests::

    def test_driver_conforms() -> None:
        check_uav_driver(make_driver)

A driver is made with the ports of a `SimulatedAutopilot`, an ideal vehicle for drivers that speak
over topics; a driver that reaches its vehicle otherwise brings a simulated one and ignores them.
Every rule is a function: its docstring tells a driver what to do, and it yields what it did not.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from msgs_json.driver_checks.auv_rules import AUV_PACES, AUV_RULES, auv_bench
from msgs_json.driver_checks.bench import BrokenRuleError, enforce
from msgs_json.driver_checks.memory_rules import MEMORY_RULES
from msgs_json.driver_checks.shared_rules import SHARED_RULES
from msgs_json.driver_checks.uav_rules import UAV_PACES, UAV_RULES, uav_bench

if TYPE_CHECKING:
    from msgs_json.driver_checks.auv_rules import MakeAuvDriver
    from msgs_json.driver_checks.uav_rules import MakeUavDriver

__all__ = ['BrokenRuleError', 'check_auv_driver', 'check_uav_driver']


def check_uav_driver(make_driver: MakeUavDriver, *, arrival_radius_m: float = 0.0) -> None:
    """
    Check a UAV driver against every rule.

    Parameters
    ----------
    make_driver
        The factory that is registered as an entry point.
    arrival_radius_m
        How far from where it is sent the UAV may come to rest; at 0 it must be exactly there.

    Raises
    ------
    BrokenRuleError
        Names the rule and what happened.

    """
    for pace in UAV_PACES:
        bench = uav_bench(make_driver, pace, arrival_radius_m)
        enforce((*SHARED_RULES, *UAV_RULES, *MEMORY_RULES), bench)


def check_auv_driver(
    make_driver: MakeAuvDriver, *, capture_radius_m: float = 0.0, vertical_mps: float = math.inf
) -> None:
    """
    Check an AUV driver against every rule.

    Parameters
    ----------
    make_driver
        The factory that is registered as an entry point.
    capture_radius_m
        How far from a waypoint the AUV may count it as reached; at 0 it must be exactly there.
    vertical_mps
        How fast the vehicle dives and comes up, at least; infinite where it does so at once.

    Raises
    ------
    BrokenRuleError
        Names the rule and what happened.

    """
    for pace in AUV_PACES:
        bench = auv_bench(make_driver, pace, capture_radius_m, vertical_mps)
        enforce((*SHARED_RULES, *AUV_RULES, *MEMORY_RULES), bench)
