"""Why the radio of a scenario does not fit its vehicles or its sorties, and what it costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from auv_sim.radio_model import StationKind, link_problems
from c3_station.radio_timing import copies, least_handover_s
from c3_station.scenario import C3, UAV, Scenario
from c3_station.shape_checks import Problem

if TYPE_CHECKING:
    from collections.abc import Iterator


def radio_problems(scenario: Scenario) -> Iterator[Problem]:
    """Yield what is wrong with the links, and with the time that hand-overs get."""
    stations = {C3: StationKind.C3, UAV: StationKind.UAV} | {
        auv.name: StationKind.AUV for auv in scenario.auvs
    }
    for index, key, problem in link_problems(scenario.radio.links, stations):
        yield Problem(('radio', 'links', index, key), problem)
    needed_s, given_s = least_handover_s(scenario), scenario.sortie.handover_s
    if given_s < needed_s:
        yield Problem(
            ('sortie', 'handover_s'),
            f'is {given_s:g}; allowed: at least {needed_s:g}, in which this radio carries report,'
            ' receipt, path and acknowledgement one after another, each'
            f' {scenario.radio.max_message_bytes:,} bytes long (radio.max_message_bytes)',
        )


def copies_said(scenario: Scenario) -> str | None:
    """Return who says each message how often at a time; None where nobody repeats himself."""
    names = (C3, UAV, *(auv.name for auv in scenario.auvs))
    said = {name: number for name in names if (number := copies(scenario, name)) > 1}
    if not said:
        return None
    listed = ', '.join(f'{name} {number}' for name, number in said.items())
    return f'the radio loses so much that each message is said several times at once: {listed}'
