"""The figures of a report, drawn from a mission's record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib as mpl

from c3_station.figure_style import STYLE, png_of
from c3_station.map_figures import draw_first_sortie, draw_routes, draw_survey
from c3_station.time_figures import draw_contacts, draw_coverage, draw_neglect, draw_sorties

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from c3_station.mission_record import MissionRecord
    from c3_station.scenario import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnFigure:
    """A figure, ready to be written and shown."""

    name: str
    title: str
    caption: str
    png: bytes


def draw_figures(record: MissionRecord) -> tuple[DrawnFigure, ...]:
    """Return all figures of a mission; those for which the record holds nothing are left out."""
    if record.scenario is None:
        return ()
    drawn = []
    with mpl.rc_context(STYLE):
        for name, title, caption, draw in FIGURES:
            figure = draw(record, record.scenario)
            if figure is not None:
                drawn.append(
                    DrawnFigure(name=name, title=title, caption=caption, png=png_of(figure))
                )
    return tuple(drawn)


FIGURES: tuple[tuple[str, str, str, Callable[[MissionRecord, Scenario], Figure | None]], ...] = (
    (
        'routes',
        'Routes of the AUVs',
        'Until the region is explored; lines are set side by side where routes meet. Hatched cells'
        ' were not entered.',
        draw_routes,
    ),
    (
        'first_sortie',
        'The first sortie',
        'The UAV meets each AUV the moment it hears it, hands over the next path, and flies on to'
        ' the first waypoint of the next AUV.',
        draw_first_sortie,
    ),
    (
        'coverage',
        'Coverage over time',
        'What is entered is known to C3 only once the UAV is back with the data. Shares are of the'
        ' region as the operator wanted it at the time.',
        draw_coverage,
    ),
    (
        'contacts',
        'Contact with the AUVs',
        'What C3 makes of an AUV that is not heard, knowing what the UAV told it when it was last'
        ' home. Silent, as expected: under water until its surface deadline. Due: it must be up'
        ' by now. Overdue: it was searched in vain. Lost: it was given up.',
        draw_contacts,
    ),
    (
        'neglect',
        'Neglect, and waits at C3',
        'An AUV that has surfaced waits for the UAV and does not survey; counted until the region'
        ' is explored. A UAV that waits at C3 keeps its limit the easier, at the price of neglect'
        ' and of old data.',
        draw_neglect,
    ),
    (
        'sorties',
        'Sorties against their limit',
        'The worst case is that of the whole route at departure: every AUV where the search ends,'
        " every wait included. What is planned is the planner's own figure.",
        draw_sorties,
    ),
    (
        'survey',
        'The survey at C3',
        'Latest sample of each cell among those delivered; hatched cells have none.',
        draw_survey,
    ),
)
