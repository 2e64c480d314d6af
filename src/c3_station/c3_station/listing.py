"""What is installed: scenarios, planners, drivers."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from auv_sim.auv_params import DRIVERS as AUV_DRIVERS
from c3_station.scenario_files import load_scenario, shipped_scenarios
from msgs_json.drivers import registered_drivers
from uav_planner.planners import PLANNERS
from uav_planner.uav_params import DRIVERS as UAV_DRIVERS


def print_listing(console: Console) -> None:
    """Print what a scenario file can name."""
    scenarios = _table('scenario', 'cells', 'AUVs', 'planner', 'what it is')
    for name in shipped_scenarios():
        scenario = load_scenario(name)
        scenarios.add_row(
            name,
            f'{scenario.region.cols} x {scenario.region.rows}',
            str(len(scenario.auvs)),
            scenario.planner.name,
            scenario.description.strip(),
        )
    planners = _table('planner', 'what it is')
    for name, factory in PLANNERS.items():
        planners.add_row(name, _summary(factory))
    drivers = _table('driver', 'for', 'module')
    for vehicle, group in (('AUV', AUV_DRIVERS), ('UAV', UAV_DRIVERS)):
        for name, entry in registered_drivers(group).items():
            drivers.add_row(name, vehicle, entry.module)
    for table in (scenarios, planners, drivers):
        console.print(table)


def _table(*columns: str) -> Table:
    table = Table(box=None, header_style='bold', padding=(0, 3, 0, 0))
    for column in columns:
        table.add_column(column)
    return table


def _summary(thing: object) -> str:
    return (thing.__doc__ or '').strip().partition('\n')[0]
