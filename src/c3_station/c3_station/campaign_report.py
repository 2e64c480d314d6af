"""A campaign's ``report.html``: everything it shows is in it."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from typing import TYPE_CHECKING

import matplotlib as mpl

from c3_station.campaign_figures import (
    draw_differences,
    draw_spread,
    draw_tightness,
    draw_violations,
    draw_worst_cases,
)
from c3_station.campaign_groups import Comparison, Section, compare, sections_of, totals_of
from c3_station.campaign_mission import MissionExit
from c3_station.campaign_plan import run_arguments
from c3_station.figure_style import STYLE, png_of
from c3_station.program import command_line
from c3_station.report_page import page_template

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from c3_station.campaign_mission import MissionResult
    from c3_station.campaign_plan import Campaign, Case

_SPREAD_CAPTION = (
    'Thin line: four of five missions. Thick: half of them. Mark: median, between the ticks with'
    ' 95 % confidence.'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldMission:
    """A mission that a person should have a look at, and how to fly it again."""

    number: int
    seed: int
    case: Case
    what: str
    line: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure on the page."""

    title: str
    caption: str
    data: str
    """PNG, base 64."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedRow:
    """How a planner does beside the first one in one variation, figure by figure."""

    variation: str
    planner: str
    comparisons: tuple[Comparison | None, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """A section with its pictures and comparisons."""

    section: Section
    pictures: tuple[Picture, ...]
    base: str
    """The planner with which the others are compared."""
    paired: tuple[PairedRow, ...]


def write_campaign_report(
    folder: Path, campaign: Campaign, results: Sequence[MissionResult]
) -> Path:
    """
    Write the report of what is flown so far, over an older one, and return where it is.

    Raises
    ------
    ValueError
        It cannot be written there.

    """
    page = render_campaign_report(folder, campaign, results)
    path = folder / 'report.html'
    try:
        path.write_text(page, encoding='utf-8')
    except OSError as error:
        raise ValueError(f'{path}: cannot be written: {error.strerror}') from None
    return path


def render_campaign_report(
    folder: Path, campaign: Campaign, results: Sequence[MissionResult]
) -> str:
    """Return the page; everything it shows is in it."""
    with mpl.rc_context(STYLE):
        chapters = [_chapter(section) for section in sections_of(campaign, results)]
    return page_template('campaign.html.j2').render(
        campaign=campaign,
        scenarios=tuple(dict.fromkeys(case.scenario for case in campaign.cases)),
        flown=len(results),
        flown_s=sum(result.mission_s or 0.0 for result in results),
        totals=totals_of(campaign, results),
        chapters=chapters,
        told=_told(campaign, results),
        resume_command=command_line('campaign', '--resume', str(folder)),
        report_command=command_line('campaign', '--report', str(folder)),
        mission_command=command_line('campaign', '--mission', str(folder), 'NUMBER'),
    )


def _chapter(section: Section) -> Chapter:
    return Chapter(
        section=section,
        pictures=tuple(_pictures(section)),
        base=section.planners[0],
        paired=tuple(_paired(section)),
    )


def _pictures(section: Section) -> Iterator[Picture]:
    drawn: list[tuple[str, str, Figure | None]] = [
        (
            'Missions that broke the limit',
            'With the interval of the true share.',
            draw_violations(section),
        )
    ]
    drawn += [
        (metric.title, _SPREAD_CAPTION, draw_spread(section, metric)) for metric in section.metrics
    ]
    drawn += [
        (
            f'Sorties of {planner}: worst case against realised',
            'Each sortie over its limit L. Above the diagonal it took longer than its worst case,'
            ' above the dashed line longer than it may.',
            draw_worst_cases(section, planner),
        )
        for planner in section.planners
    ]
    drawn.append(
        (
            'How tight the worst case is',
            'At 1 the worst case came true. A bound that is never reached wastes sortie time; one'
            ' that is exceeded is none.',
            draw_tightness(section),
        )
    )
    drawn += [
        (
            f'{metric.title}: planners on the same seeds',
            f'Left of 0 is less than with {section.planners[0]}. {_SPREAD_CAPTION}',
            draw_differences(section, metric),
        )
        for metric in section.metrics[:1]
    ]
    for title, caption, figure in drawn:
        if figure is not None:
            yield Picture(title=title, caption=caption, data=b64encode(png_of(figure)).decode())


def _paired(section: Section) -> Iterator[PairedRow]:
    """Yield how every planner but the first does beside it."""
    for group, base in section.beside_first():
        yield PairedRow(
            variation=group.variation,
            planner=group.planner,
            comparisons=tuple(compare(group, base, metric) for metric in section.metrics),
        )


def _told(campaign: Campaign, results: Sequence[MissionResult]) -> dict[str, list[ToldMission]]:
    """Return the missions that stand out, by planner."""
    told: dict[str, list[ToldMission]] = {}
    for result in results:
        if result.stands_out:
            case_index, seed = campaign.place(result.number)
            case = campaign.cases[case_index]
            told.setdefault(case.planner, []).append(
                ToldMission(
                    number=result.number,
                    seed=seed,
                    case=case,
                    what=', '.join(_what(result)),
                    line=command_line(*run_arguments(case, seed)),
                )
            )
    return told


def _what(result: MissionResult) -> Iterator[str]:
    """Yield why a mission stands out."""
    if result.exit is not MissionExit.COMPLETE:
        yield f'{result.exit.value}: {result.reason or "no reason was given"}'
    if result.violations:
        yield f'{result.violations} of {result.sorties_total} sorties over L'
        if result.longest_sortie_s is not None:
            yield f'the longest {result.longest_sortie_s:g} s'
    if result.missed:
        yield f'{result.missed} missed'
    if result.samples_lost:
        yield f'{result.samples_lost} samples lost'
