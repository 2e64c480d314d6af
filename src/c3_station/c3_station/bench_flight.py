"""A mission of the benchmarks that is flown over the ROS graph, as fast as the machine can."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from c3_station.flight import Flight
from c3_station.mission_monitor import MissionMonitor
from c3_station.mission_record import read_mission
from c3_station.node_params import UAV
from c3_station.ros_flight import fly_on_ros
from c3_station.run_folder import RunFolder, new_run_folder
from c3_station.scenario import Scenario
from c3_station.summary import Summary

Look = Callable[[RunFolder, MissionMonitor], None]
"""Is called several times a second while the mission is flown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchFlight:
    """What came of a flight."""

    flight: Flight
    summary: Summary
    real_time_factor: float
    """From the first tick to the last."""


def fly_for_bench(scenario: Scenario, look: Look = lambda folder, monitor: None) -> BenchFlight:
    """
    Fly with everything on: the recorder, stores on disk, a key.

    Raises
    ------
    ValueError
        A node has failed.

    """
    with tempfile.TemporaryDirectory() as out:
        folder = new_run_folder(Path(out) / 'run', scenario, force=False)
        monitor = MissionMonitor(scenario, UAV)

        def refresh() -> None:
            look(folder, monitor)

        flight = fly_on_ros(scenario, folder, monitor, rate=0.0, bag=True, refresh=refresh)
        if flight.problem:
            raise ValueError(f'bench: {flight.problem}')
        summary = read_mission(folder.bag).summary
    return BenchFlight(
        flight=flight, summary=summary, real_time_factor=summary.real_time_factor or 0.0
    )
