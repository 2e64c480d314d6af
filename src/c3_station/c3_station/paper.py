"""
What ECC 2009 reports of the reference mission, and where, beside what a mission showed.

P. B. Sujit, J. Sousa, F. L. Pereira, "Coordination strategies between UAV and AUVs for ocean
exploration", European Control Conference 2009, pp. 115-120; all figures are from Section IV.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from c3_station.scenario_files import load_scenario

if TYPE_CHECKING:
    from collections.abc import Callable

    from c3_station.scenario import Scenario
    from c3_station.summary import MeetingSummary, Summary
    from msgs_json.geometry import Cell

EXPLORED_S = 456.0
"""Section IV, p. 120: "the agents achieve this task in 456 seconds"."""

_FLOWN = ('region', 'c3', 'uav', 'auvs', 'radio', 'sortie', 'tick_s')


def is_reference_mission(scenario: Scenario) -> bool:
    """Return whether it is the paper's mission, whoever plans it and whatever is sampled."""
    reference = load_scenario('ecc2009')
    planner, published = scenario.planner, reference.planner
    return (
        planner.path_cells == published.path_cells
        and planner.min_path_cells == published.min_path_cells
        and all(getattr(scenario, part) == getattr(reference, part) for part in _FLOWN)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperFigure:
    """One figure of the paper, and how to find it in a mission's summary."""

    what: str
    value: float
    unit: str
    place: str
    """Where in the paper."""
    measure: Callable[[Summary], float | None]
    note: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A figure of the paper beside that of a mission."""

    figure: PaperFigure
    measured: float | None

    @property
    def difference(self) -> float | None:
        """Return measured minus published."""
        return None if self.measured is None else self.measured - self.figure.value


def comparisons(summary: Summary) -> tuple[Comparison, ...]:
    """Return every figure of the paper beside the mission's."""
    return tuple(
        Comparison(figure=figure, measured=figure.measure(summary)) for figure in PAPER_FIGURES
    )


def _first_meeting(summary: Summary, auv: str) -> MeetingSummary | None:
    if not summary.sorties:
        return None
    return next((each for each in summary.sorties[0].meetings if each.auv == auv), None)


def _first_met_s(auv: str) -> Callable[[Summary], float | None]:
    def measure(summary: Summary) -> float | None:
        meeting = _first_meeting(summary, auv)
        return meeting.time_s if meeting else None

    return measure


def _first_slack_s(auv: str) -> Callable[[Summary], float | None]:
    def measure(summary: Summary) -> float | None:
        meeting = _first_meeting(summary, auv)
        return meeting.slack_s if meeting else None

    return measure


def _turns_of_first_path(auv: str) -> Callable[[Summary], float | None]:
    def measure(summary: Summary) -> float | None:
        meeting = _first_meeting(summary, auv)
        return _turns(meeting.path) if meeting else None

    return measure


def _turns(path: tuple[Cell, ...]) -> int:
    moves = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(path)]
    return sum(a != b for a, b in pairwise(moves))


def _neglect_percent(auv: str) -> Callable[[Summary], float | None]:
    def measure(summary: Summary) -> float | None:
        if not summary.explored_s or auv not in summary.neglect_s:
            return None
        return 100.0 * summary.neglect_s[auv] / summary.explored_s

    return measure


def _total_neglect_percent(summary: Summary) -> float | None:
    return None if summary.neglect_fraction is None else 100.0 * summary.neglect_fraction


def _first_return_s(summary: Summary) -> float | None:
    return summary.sorties[0].returned_s if summary.sorties else None


_SLACK_NOTE = 'depends on start cells that are only drawn in the paper'
_NEGLECT_NOTE = 'the paper divides by 460 s'

PAPER_FIGURES: tuple[PaperFigure, ...] = (
    PaperFigure(
        what='A1 met for the first time',
        value=14.0,
        unit='s',
        place='p. 119, Fig. 4(b)',
        measure=_first_met_s('auv_1'),
    ),
    PaperFigure(
        what='A2 met for the first time',
        value=20.0,
        unit='s',
        place='Fig. 5(a)',
        measure=_first_met_s('auv_2'),
    ),
    PaperFigure(
        what='A3 met for the first time',
        value=33.0,
        unit='s',
        place='p. 120, Fig. 5(b)',
        measure=_first_met_s('auv_3'),
    ),
    PaperFigure(
        what='first sortie back at C3',
        value=44.0,
        unit='s',
        place='p. 120, Fig. 7(a)',
        measure=_first_return_s,
    ),
    PaperFigure(
        what='turns in the first path of A1',
        value=0,
        unit='',
        place='p. 120, Fig. 6(a)',
        measure=_turns_of_first_path('auv_1'),
    ),
    PaperFigure(
        what='turns in the first path of A2',
        value=0,
        unit='',
        place='p. 120, Fig. 6(b)',
        measure=_turns_of_first_path('auv_2'),
    ),
    PaperFigure(
        what='turns in the first path of A3',
        value=1,
        unit='',
        place='p. 120, Fig. 6(c)',
        measure=_turns_of_first_path('auv_3'),
    ),
    PaperFigure(
        what='whole region explored',
        value=EXPLORED_S,
        unit='s',
        place='p. 120, Fig. 7(b)',
        measure=lambda summary: summary.explored_s,
    ),
    PaperFigure(
        what='sorties over the limit',
        value=0,
        unit='',
        place='p. 120',
        measure=lambda summary: summary.sortie_limit_violations,
    ),
    PaperFigure(
        what='neglect of all AUVs',
        value=20.0,
        unit='%',
        place='p. 120',
        measure=_total_neglect_percent,
        note=_NEGLECT_NOTE,
    ),
    PaperFigure(
        what='neglect of A1',
        value=4.35,
        unit='%',
        place='p. 120',
        measure=_neglect_percent('auv_1'),
        note=_NEGLECT_NOTE,
    ),
    PaperFigure(
        what='neglect of A2',
        value=8.48,
        unit='%',
        place='p. 120',
        measure=_neglect_percent('auv_2'),
        note=_NEGLECT_NOTE,
    ),
    PaperFigure(
        what='neglect of A3',
        value=7.17,
        unit='%',
        place='p. 120',
        measure=_neglect_percent('auv_3'),
        note=_NEGLECT_NOTE,
    ),
    PaperFigure(
        what='\N{GREEK SMALL LETTER LAMDA} at the first meeting with A1',
        value=24.2,
        unit='s',
        place='p. 120',
        measure=_first_slack_s('auv_1'),
        note=_SLACK_NOTE,
    ),
    PaperFigure(
        what='\N{GREEK SMALL LETTER LAMDA} at the first meeting with A2',
        value=27.4,
        unit='s',
        place='p. 120',
        measure=_first_slack_s('auv_2'),
        note=_SLACK_NOTE,
    ),
    PaperFigure(
        what='\N{GREEK SMALL LETTER LAMDA} at the first meeting with A3',
        value=32.14,
        unit='s',
        place='p. 120',
        measure=_first_slack_s('auv_3'),
        note=_SLACK_NOTE,
    ),
)
