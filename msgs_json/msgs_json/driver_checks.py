"""
The conformance suite of vehicle drivers: every rule that planners and agents rely on.

A vehicle's package runs it in its own tests::

    def test_driver_conforms() -> None:
        check_uav_driver(make_driver)

Drivers are made with the ports of a `SimulatedAutopilot`, an ideal vehicle for drivers that speak
over topics; those that simulate or reach their vehicle otherwise ignore them. Every rule is a
function here, its docstring says what must hold, and what breaks it raises `BrokenRuleError`.
"""

from __future__ import annotations

from collections.abc import Callable

from msgs_json.drivers import (
    AuvDriver,
    AuvDriverSetup,
    DriverPorts,
    UavDriver,
    UavDriverSetup,
)

MakeUavDriver = Callable[[UavDriverSetup, DriverPorts], UavDriver]
MakeAuvDriver = Callable[[AuvDriverSetup, DriverPorts], AuvDriver]

ROUNDING_M = 1e-6
"""Positions closer than this are the same; far above rounding, far below any vehicle."""
