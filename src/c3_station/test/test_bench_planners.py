"""The benchmark of planners: its families, its figures, its table, and all of it in small."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from campaign_samples import sample_result
from page_checks import Page, check_texts, words
from rich.console import Console

from c3_station.bench import run_benchmarks
from c3_station.bench_families import FAMILIES, Family, Starts, Survey, family_scenario
from c3_station.bench_mission import TimedMission
from c3_station.bench_planners import PlannersOptions, bench_planners, fly_attempts
from c3_station.bench_planners_figures import draw_explored, draw_neglect, draw_planning
from c3_station.bench_planners_report import write_planners_report
from c3_station.bench_planners_table import print_blocks, print_verdicts
from c3_station.bench_statistics import Attempt, blocks_of, verdicts_of
from c3_station.campaign_mission import MissionExit
from uav_planner.planners import PLANNERS
from uav_planner.planning import Planner

ON_TIME, EARLY = FAMILIES[0], FAMILIES[2]
POND = Family(
    name='pond',
    what='two AUVs',
    survey=Survey(
        cols=5,
        rows=4,
        cell_m=10,
        land=((2, 2, 2, 2),),
        c3=(2, 0),
        auvs=2,
        auv_mps=1,
        uav_mps=10,
        range_m=20,
        limit_s=40,
        path_cells=4,
    ),
    starts=Starts.NEAR_C3,
    surfacing='early_30',
)
TINY = Family(
    name='tiny', what='one AUV', survey='minimal', starts=Starts.SHIPPED, surfacing='on_time'
)


def attempt(
    family: Family = ON_TIME,
    planner: str = 'robust',
    seed: int = 0,
    plans_s: tuple[float, ...] = (0.001, 0.002, 0.1),
    **fields: object,
) -> Attempt:
    """Return a mission without trouble that nobody had to fly, explored at twice its bound."""
    flown = TimedMission(
        result=sample_result(1, **{'explored_s': 660.0, **fields}),
        take_off_plan_s=0.3,
        sortie_plans_s=(0.001,),
        path_plans_s=plans_s,
        peak_memory_bytes=90 * 2**20,
    )
    return Attempt(family=family, planner=planner, seed=seed, stop_s=1650.0, flown=flown)


def stopped(**fields: object) -> Attempt:
    """Return a mission that came to its hard stop, at five times its bound."""
    nothing = {'explored_s': None, 'delivered_s': None, 'neglect_fraction': None}
    return attempt(
        **nothing,  # type: ignore[arg-type]
        exit=MissionExit.STOPPED,
        reason='hard stop',
        **fields,  # type: ignore[arg-type]
    )


def refused(planner: str) -> Attempt:
    return Attempt(
        family=ON_TIME, planner=planner, seed=0, stop_s=math.inf, refusal='paths are too long'
    )


ATTEMPTS = [
    attempt(planner='ecc2009', explored_s=495.0, violations=2, plans_s=(0.5,)),
    attempt(planner='robust', explored_s=363.0),
    stopped(planner='random'),
    refused('lanes'),
    attempt(EARLY, 'ecc2009', 0, explored_s=660.0),
    attempt(EARLY, 'ecc2009', 1, explored_s=990.0, violations=1),
    attempt(EARLY, 'robust', 0, explored_s=825.0, revisits=30),
    stopped(family=EARLY, planner='robust', seed=1, revisits=100),
]
BLOCKS = blocks_of(ATTEMPTS)


# --- families ------------------------------------------------------------------------------------


@pytest.mark.parametrize('family', FAMILIES, ids=lambda family: family.name)
def test_every_family_can_be_flown_and_is_the_same_for_all_planners(family: Family) -> None:
    scenario, other = (family_scenario(family, 1, planner) for planner in ('robust', 'lanes'))
    assert other.planner.name == 'lanes'
    # What the shipped file's planner has to show does not count here.
    same = {'planner': scenario.planner, 'pass_conditions': scenario.pass_conditions}
    assert msgspec.structs.replace(other, **same) == scenario
    next_one = family_scenario(family, 2, 'robust')
    assert (scenario.seed, next_one.seed) == (1, 2)
    assert (next_one.auvs == scenario.auvs) is (family.starts is Starts.SHIPPED)


def test_families_have_names_of_their_own_and_all_that_was_asked_for() -> None:
    assert len({family.name for family in FAMILIES}) == len(FAMILIES)
    scenarios = [family_scenario(family, 0, 'robust') for family in FAMILIES]
    sizes = [scenario.region.cols for scenario in scenarios]
    fleets = [len(scenario.auvs) for scenario in scenarios]
    assert (min(sizes), max(sizes)) == (10, 60)
    assert (min(fleets), max(fleets)) == (1, 16)
    assert {'on_time', 'early_10', 'early_30'} == {family.surfacing for family in FAMILIES}
    assert any(scenario.region.masked for scenario in scenarios)


# --- figures of a line ---------------------------------------------------------------------------


def test_a_line_says_what_its_missions_came_to() -> None:
    line = blocks_of(
        [
            attempt(explored_s=363.0, revisits=10, violations=0, sorties_total=8),
            attempt(seed=1, explored_s=429.0, revisits=20, violations=3, sorties_total=9),
        ]
    )[0].lines[0]
    assert (line.explored, line.is_explored) == (2, True)
    assert line.ratio_mean == pytest.approx((1.1 + 1.3) / 2)
    assert line.ratio_worst == pytest.approx(1.3)
    assert (line.revisits, line.violations, line.sorties) == (15.0, 3, 8.5)
    assert line.neglect == pytest.approx(0.15)
    assert (line.plan_p50_s, line.plan_p99_s) == (0.002, 0.1)
    assert (line.take_off_plan_s, line.peak_memory_bytes) == (0.3, 90 * 2**20)


def test_of_all_plans_one_in_a_hundred_is_above_p99() -> None:
    times_s = tuple(number / 1000 for number in range(1, 201))
    line = blocks_of([attempt(plans_s=times_s[::2]), attempt(seed=1, plans_s=times_s[1::2])])[0]
    assert line.lines[0].plan_p99_s == 0.199
    assert line.lines[0].plan_p50_s == 0.101


def test_one_that_was_stopped_counts_with_its_hard_stop() -> None:
    line = blocks_of([attempt(), stopped(seed=1)])[0].lines[0]
    assert (line.explored, line.is_explored) == (1, False)
    assert line.ratio_mean == pytest.approx((2.0 + 5.0) / 2)
    assert line.delivered_s == 501.0


def test_one_that_was_refused_or_failed_has_no_time_to_explore() -> None:
    failed = attempt(explored_s=None, exit=MissionExit.ERROR, reason='KeyError: 7')
    for each, problem in (
        (refused('lanes'), 'refused: paths are too long'),
        (failed, 'KeyError: 7'),
    ):
        line = blocks_of([each])[0].lines[0]
        assert line.ratio_mean == math.inf
        assert not line.is_explored
        assert each.problem == problem


def test_the_best_planner_of_a_family_explored_it_every_time() -> None:
    assert [block.best for block in BLOCKS] == ['robust', 'ecc2009']
    assert blocks_of([stopped()])[0].best is None


def test_the_verdict_is_the_mean_over_families_on_time() -> None:
    verdicts = {each.planner: each for each in verdicts_of(BLOCKS)}
    assert list(verdicts) == ['ecc2009', 'robust', 'random', 'lanes']
    ecc2009 = verdicts['ecc2009']
    assert ecc2009.ratio_mean == pytest.approx(1.5)
    assert (ecc2009.explored, ecc2009.missions, ecc2009.families) == (1, 1, 1)
    assert (ecc2009.best_of, ecc2009.families_total, ecc2009.violations) == (1, 2, 3)
    assert verdicts['random'].ratio_mean == pytest.approx(5.0)
    assert verdicts['lanes'].ratio_mean == math.inf
    both = [attempt(explored_s=330.0), attempt(replace(ON_TIME, name='other'), explored_s=990.0)]
    assert verdicts_of(blocks_of(both))[0].ratio_mean == pytest.approx(2.0)


# --- the table -----------------------------------------------------------------------------------


def printed(width: int) -> str:
    text = io.StringIO()
    console = Console(file=text, width=width)
    print_blocks(BLOCKS, console)
    print_verdicts(verdicts_of(BLOCKS), console)
    return text.getvalue()


@pytest.mark.parametrize('width', [80, 140])
def test_the_table_fits_into_a_terminal(width: int) -> None:
    lines = printed(width).splitlines()
    assert max(map(len, lines)) <= width
    rows = {tuple(line.split()[:2]): line.split() for line in lines}
    assert rows['robust*', '1/1'][2:4] == ['1.100', '1.100']
    assert rows['ecc2009', '1/1'][8] == '2'
    assert rows['random', '0/1'][2:5] == ['\N{GREATER-THAN OR EQUAL TO}5.000'] * 2 + [
        '\N{EN DASH}'
    ]
    assert rows['lanes', '0/1'][2:] == [
        *['\N{GREATER-THAN OR EQUAL TO}\N{EN DASH}'] * 2,
        *['\N{EN DASH}'] * 4,
        '0',
        *['\N{EN DASH}'] * 4,
    ]
    assert '  lanes, 1 mission: refused: paths are too long' in lines
    assert '  random, 1 mission: not explored by the hard stop, 1,650 s' in lines


def test_the_report_holds_all_of_it(tmp_path: Path) -> None:
    page = write_planners_report(tmp_path, BLOCKS).read_text(encoding='utf-8')
    checked = Page(page)
    assert (checked.open, checked.loads, checked.images) == ([], [], 3)
    text = words(page)
    assert 'robust* 1/1 1.100 1.100' in text
    assert 'refused: paths are too long' in text
    figures = {path.name for path in (tmp_path / 'figures').iterdir()}
    assert figures == {'explored.png', 'neglect.png', 'planning.png'}
    missions = msgspec.json.decode((tmp_path / 'missions.json').read_bytes())['missions']
    assert [(each['family'], each['planner'], each['seed']) for each in missions] == [
        (each.family.name, each.planner, each.seed) for each in ATTEMPTS
    ]


@pytest.mark.parametrize('draw', [draw_explored, draw_neglect, draw_planning])
def test_no_text_of_a_figure_is_cut_off_or_hidden(draw) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
    every_family = [
        attempt(family, planner) for family in FAMILIES for planner in ('ecc2009', 'robust')
    ]
    check_texts(draw(blocks_of(every_family)))
    check_texts(draw(BLOCKS))


# --- all of it -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_small_benchmark_from_end_to_end(tmp_path: Path) -> None:
    text = io.StringIO()
    planners = ('ecc2009', 'lanes')
    options = PlannersOptions(planners=planners, seeds=1, out=tmp_path, processes=2)
    bench_planners(options, Console(file=text, width=80), (POND, TINY))
    assert f'report: {tmp_path / "report.html"}' in text.getvalue().replace('\n', '')
    assert (tmp_path / 'report.html').exists()
    missions = msgspec.json.decode((tmp_path / 'missions.json').read_bytes())['missions']
    assert [(each['family'], each['planner']) for each in missions] == [
        (family, planner) for family in ('pond', 'tiny') for planner in planners
    ]
    lanes = msgspec.convert(missions[1]['flown'], TimedMission)
    assert lanes.result.exit is MissionExit.COMPLETE
    assert len(lanes.path_plans_s) >= lanes.result.sorties_total - 1
    assert lanes.peak_memory_bytes > 2**20
    again = fly_attempts((POND,), ('lanes',), 1, 1, Console(file=io.StringIO()))[0].flown
    assert again is not None
    assert msgspec.structs.replace(again.result, number=1, wall_s=lanes.result.wall_s) == (
        msgspec.structs.replace(lanes.result, number=1)
    )


def test_what_is_not_there_is_refused_by_name() -> None:
    console = Console(file=io.StringIO())
    for options, text in (
        (
            PlannersOptions(families=('papr',)),
            r"--families: there is no 'papr' \(did you mean paper",
        ),
        (
            PlannersOptions(planners=('best',)),
            r"--planners: there is no 'best'.*; allowed: .*ecc2009",
        ),
    ):
        with pytest.raises(ValueError, match=text):
            bench_planners(options, console)
    with pytest.raises(ValueError, match='these options are for the benchmark planners'):
        run_benchmarks(['ties'], console, PlannersOptions(seeds=1))


def test_a_planner_that_refuses_is_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_planner() -> Planner:
        raise ValueError('this planner flies nothing')

    planners = {**PLANNERS, 'lanes': no_planner}
    monkeypatch.setattr('uav_planner.planners.PLANNERS', planners)
    refusal = fly_attempts((POND,), ('lanes',), 2, 1, Console(file=io.StringIO()))[1]
    assert (refusal.planner, refusal.seed, refusal.flown) == ('lanes', 1, None)
    assert 'this planner flies nothing' in (refusal.problem or '')
