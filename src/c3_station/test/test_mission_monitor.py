"""The live view's figures: they agree with the summary, and no stranger can upset them."""

from __future__ import annotations

from rich.console import Console

from c3_station.in_process import fly
from c3_station.live_view import LiveView
from c3_station.mission_monitor import MissionMonitor
from c3_station.node_params import UAV
from c3_station.scenario_files import load_scenario
from msgs_json.agent_shell import Frame, Speaker
from msgs_json.messages import LegOutcome, Met, Surfaced
from msgs_json.ros_messages import Text
from msgs_json.topics import MISSION_EVENTS


def watched() -> MissionMonitor:
    scenario = load_scenario('ecc2009')
    monitor = MissionMonitor(scenario, UAV)

    def take(name: str, frame: Frame) -> None:
        monitor.message(frame.topic.resolve(f'/{name}'), frame.message)

    fly(scenario, take)
    return monitor


def test_it_ends_with_the_figures_of_the_summary() -> None:
    monitor = watched()
    summary = monitor.summarizer.summary()
    assert monitor.explored_s == summary.explored_s
    assert monitor.now_s == summary.mission_s
    assert monitor.sorties_flown == len(summary.sorties)
    assert monitor.longest_sortie_s == max(s.duration_s or 0.0 for s in summary.sorties)
    assert {
        name: monitor.auv_neglect_s(auv) for name, auv in monitor.auvs.items()
    } == summary.neglect_s
    assert len(monitor.entered) == summary.cells_explored
    assert monitor.ended == 'completed'


def test_events_of_strangers_are_passed_over() -> None:
    scenario = load_scenario('ecc2009')
    monitor = MissionMonitor(scenario, UAV)
    surfaced = Surfaced(leg_id=0, outcome=LegOutcome.COMPLETED, cell=(0, 0))
    met = Met(
        sortie=1,
        auv='auv_99',
        cell=(0, 0),
        leg_id=0,
        path=(),
        slack_s=None,
        sortie_time_s=None,
        plan_status=None,
    )
    for frame in (
        Speaker('stranger').frame(MISSION_EVENTS, surfaced, 1.0),
        Speaker('uav').frame(MISSION_EVENTS, met, 1.0),
        Frame(MISSION_EVENTS, Text(b'{"schema":"MissionEvent"')),
    ):
        monitor.message(MISSION_EVENTS.name, frame.message)
    assert not monitor.log
    assert monitor.now_s == 0.0


def test_the_view_fits_narrow_and_wide_terminals() -> None:
    monitor = watched()
    for width in (60, 80, 120):
        console = Console(width=width)
        with console.capture() as capture:
            console.print(LiveView(monitor, 'ecc2009'))
        lines = capture.get().splitlines()
        assert any('100 of 100 cells' in line for line in lines)
        assert any('recovered' in line for line in lines)
