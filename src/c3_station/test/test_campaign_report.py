"""The report of a campaign: what is on the page, and whether its figures can be read."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pytest
from campaign_samples import LIMIT_S, sample_campaign, sample_result, sample_results
from page_checks import Page, check_texts, words
from rich.console import Console

from c3_station.campaign_figures import (
    draw_differences,
    draw_spread,
    draw_tightness,
    draw_violations,
    draw_worst_cases,
)
from c3_station.campaign_groups import EXPLORED, sections_of
from c3_station.campaign_mission import MissionExit, SortieTimes
from c3_station.campaign_report import render_campaign_report, write_campaign_report
from c3_station.campaign_table import print_sections
from c3_station.figure_style import STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONG = 'auvs.surfacing={model: early, probability: 0.1},{model: slow, least_factor: 0.5}'
CAMPAIGN = sample_campaign('surfacing=early_10,slow,mixed', scenarios=('ecc2009',), seeds=60)
RESULTS = sample_results(CAMPAIGN)
FOLDER = Path('runs/c')


# --- the page ------------------------------------------------------------------------------------


def test_page_is_well_formed_and_needs_nothing_else() -> None:
    text = render_campaign_report(FOLDER, CAMPAIGN, RESULTS)
    page = Page(text)
    assert page.open == []
    assert page.loads == []
    assert page.images == 1 + 4 + 2 + 1 + 1
    assert 'url(' not in text


def test_page_tells_what_was_flown_and_how_to_make_it_again() -> None:
    text = words(render_campaign_report(FOLDER, CAMPAIGN, RESULTS))
    assert 'Shearwater campaign report ecc2009 360 missions · seeds 0 to 59' in text
    assert 'Not all is flown yet' not in text
    assert 'python3 orchestrate.py campaign --report runs/c' in text
    assert 'python3 orchestrate.py campaign --mission runs/c NUMBER' in text
    ratios = [
        result.bound_ratio_max or 0.0
        for result in RESULTS
        if CAMPAIGN.cases[CAMPAIGN.place(result.number)[0]].planner == 'robust'
    ]
    assert len(ratios) == 180
    assert f'robust 0 of 180 (0 % to 2.1 %) 0 of 1,800 {max(ratios):.4f} 0 0 0 0 0' in text


def test_each_violation_has_its_seed_and_its_line() -> None:
    page = render_campaign_report(FOLDER, CAMPAIGN, RESULTS)
    late = [result for result in RESULTS if result.violations]
    assert len(late) > 50
    lines = re.findall(r'<code>(python3 orchestrate.py run [^<]*)</code>', page)
    assert len(lines) == len(late)
    for result, line in zip(late, lines, strict=True):
        case, seed = CAMPAIGN.place(result.number)
        assert line == (
            f'python3 orchestrate.py run ecc2009 --planner ecc2009 --seed {seed}'
            f' --set {CAMPAIGN.cases[case].variation}'
        )
    first = late[0]
    told = f'{first.violations} of 10 sorties over L, the longest {first.longest_sortie_s:g} s'
    assert told in words(page)


def test_trouble_of_every_kind_is_told() -> None:
    campaign = sample_campaign(planners=('robust',), seeds=5)
    results = [
        sample_result(1),
        sample_result(2, exit=MissionExit.ERROR, reason='ValueError: <b> & co (plan, line 3)'),
        sample_result(3, exit=MissionExit.STOPPED, reason='hard stop'),
        sample_result(4, missed=2),
        sample_result(5, samples_lost=7),
    ]
    page = render_campaign_report(FOLDER, campaign, results)
    assert 'error: ValueError: &lt;b&gt; &amp; co (plan, line 3)' in page
    text = words(page)
    for told in ('robust: 4 missions', 'stopped: hard stop', '2 missed', '7 samples lost'):
        assert told in text


def test_without_trouble_that_is_said() -> None:
    campaign = sample_campaign(planners=('robust',), seeds=2)
    text = words(render_campaign_report(FOLDER, campaign, [sample_result(1), sample_result(2)]))
    assert 'None: no sortie over its limit' in text
    assert 'Beside' not in text


@pytest.mark.slow
@pytest.mark.parametrize('flown', [0, 1, 2, 9])
def test_a_campaign_that_was_broken_off_has_a_report(flown: int) -> None:
    page = render_campaign_report(FOLDER, CAMPAIGN, RESULTS[:flown])
    assert Page(page).open == []
    text = words(page)
    assert f'{flown} of 360 missions' in text
    assert 'Not all is flown yet' in text
    assert 'python3 orchestrate.py campaign --resume runs/c' in text


@pytest.mark.slow
def test_many_scenarios_share_a_section(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('c3_station.campaign_groups._SECTIONS_MAX', 1)
    campaign = sample_campaign(scenarios=('minimal', 'ecc2009', 'fleet_8'), seeds=4)
    text = words(render_campaign_report(FOLDER, campaign, sample_results(campaign)))
    assert '3 scenarios variation planner' in text
    assert 'over the lower bound of its scenario' in text


def test_a_report_that_cannot_be_written_is_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / 'report.html').mkdir()
    with pytest.raises(ValueError, match=r'report\.html: cannot be written: Is a directory'):
        write_campaign_report(tmp_path, CAMPAIGN, [])


# --- the figures ---------------------------------------------------------------------------------


def all_figures(*vary: str, planners: tuple[str, ...] = ('ecc2009', 'robust')) -> list[Figure]:
    campaign = sample_campaign(*vary, planners=planners, seeds=30)
    (section,) = sections_of(campaign, sample_results(campaign))
    with mpl.rc_context(STYLE):
        figures = [
            draw_violations(section),
            *(draw_spread(section, metric) for metric in section.metrics),
            *(draw_worst_cases(section, planner) for planner in section.planners),
            draw_tightness(section),
        ]
        if len(planners) > 1:
            figures.append(draw_differences(section, EXPLORED))
    assert None not in figures
    return [figure for figure in figures if figure is not None]


@pytest.mark.slow
@pytest.mark.parametrize(
    ('vary', 'planners'),
    [
        ((), ('robust',)),
        (('surfacing=early_10,early_30,early_50,slow,mixed',), ('ecc2009', 'robust')),
        ((LONG, 'sortie.limit_s=50,60'), ('ecc2009', 'robust')),
    ],
)
def test_no_text_overlaps_and_none_is_cut_off(
    vary: tuple[str, ...], planners: tuple[str, ...]
) -> None:
    for figure in all_figures(*vary, planners=planners):
        check_texts(figure)


def test_every_axis_has_a_unit() -> None:
    for figure in all_figures('surfacing=slow,mixed'):
        for label in (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()):
            assert re.search(r'\((s|%|L)\)$| / ', label) or label == ''


def test_sorties_are_drawn_where_they_are() -> None:
    campaign = sample_campaign(planners=('robust',), seeds=1)
    times = (
        SortieTimes(30.0, 45.0, LIMIT_S),
        SortieTimes(30.0, 45.0, LIMIT_S),
        SortieTimes(66.0, 60.0, LIMIT_S),
        SortieTimes(None, 60.0, LIMIT_S),
    )
    (section,) = sections_of(campaign, [sample_result(1, sortie_times=times)])
    figure = draw_worst_cases(section, 'robust')
    assert figure is not None
    (dots,) = figure.axes[0].collections
    assert np.asarray(dots.get_offsets()).tolist() == [[1.0, 1.1], [0.75, 0.5]]
    assert np.asarray(dots.get_array()).tolist() == [1, 2]
    assert draw_worst_cases(section, 'ecc2009') is None


def test_a_worst_case_that_came_true_is_not_drawn_beyond_it() -> None:
    campaign = sample_campaign(planners=('robust',), seeds=1)
    times = (SortieTimes(60.0, 60.0, LIMIT_S), SortieTimes(30.0, 60.0, LIMIT_S))
    (section,) = sections_of(campaign, [sample_result(1, sortie_times=times)])
    figure = draw_tightness(section)
    assert figure is not None
    (outline,) = figure.axes[0].patches
    corners = outline.get_path().vertices
    filled = [x for x, y in np.asarray(corners) if y > 0.0]
    assert max(filled) == pytest.approx(1.0, abs=1e-6)


# --- the terminal --------------------------------------------------------------------------------


def test_the_table_fits_into_a_terminal() -> None:
    printed = io.StringIO()
    print_sections(sections_of(CAMPAIGN, RESULTS), Console(file=printed, width=80))
    lines = printed.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    header, variation, ecc2009, robust = (line.split() for line in lines[1:5])
    assert header == ['over', 'L', 'missed', 'lost', 'explored', '(s)', 'neglect', 'bound']
    assert variation == ['surfacing=early_10']
    assert ecc2009[0] == 'ecc2009'
    assert int(ecc2009[1].removesuffix('/60')) > 20
    assert ' '.join(robust[:4]) == 'robust 0/60 (0\N{EN DASH}6 %)'
    assert robust[4:6] == ['0', '0']
