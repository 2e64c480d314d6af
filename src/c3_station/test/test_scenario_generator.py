"""Scenarios that are drawn: they can be flown, come out the same again, and cover their ranges."""

from __future__ import annotations

import itertools
import shlex
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auv_sim.surfacing import surfacing_model
from c3_station.cli import main
from c3_station.in_process import fly
from c3_station.node_params import mission_params
from c3_station.scenario import Scenario
from c3_station.scenario_files import load_scenario, scenario_json
from c3_station.scenario_generator import (
    MODELS,
    QUANTITIES,
    USUAL_MODELS,
    Span,
    generate_scenario,
    read_span,
)
from c3_station.scenario_writer import scenario_yaml
from c3_station.summary import Summarizer, Summary
from msgs_json.geometry import path_length_m, surface_deadline_s, unreachable_cells
from uav_planner.guarantee import initial_problem
from uav_planner.planners import make_planner
from uav_planner.planning import MissionSpec, SortieRequest, SurveyLeg

SEEDS = st.integers(0, 2**53)


def mission_of(scenario: Scenario) -> tuple[MissionSpec, tuple[SurveyLeg, ...]]:
    mission = MissionSpec(
        grid=scenario.region,
        c3=scenario.c3,
        radio_range_m=scenario.radio.range_m,
        uav_speed_mps=scenario.uav.speed_mps,
        tick_s=scenario.tick_s,
        sortie_limit_s=scenario.sortie.limit_s,
        path_cells=scenario.planner.path_cells,
        min_path_cells=scenario.planner.min_path_cells,
        handover_s=scenario.sortie.handover_s,
    )
    legs = tuple(
        SurveyLeg(
            auv=auv.name,
            path=auv.initial_path,
            surface_deadline_s=surface_deadline_s(
                0.0,
                path_length_m([scenario.region.centre(cell) for cell in auv.initial_path]),
                auv.speed_mps,
                scenario.sortie.surface_margin_s,
                scenario.tick_s,
            ),
        )
        for auv in scenario.auvs
    )
    return mission, legs


def drawn(scenario: Scenario) -> dict[str, float]:
    """Return what was drawn, by the names of the options."""
    return {
        'cols': scenario.region.cols,
        'rows': scenario.region.rows,
        'masked': len(scenario.region.masked) / (scenario.region.cols * scenario.region.rows),
        'cell': scenario.region.cell_m,
        'range': scenario.radio.range_m,
        'auvs': len(scenario.auvs),
        'path-cells': scenario.planner.path_cells,
        'min-path-cells': scenario.planner.min_path_cells,
        'tick': scenario.tick_s,
        'limit': scenario.sortie.limit_s,
    }


@st.composite
def requests(draw: st.DrawFn) -> dict[str, Span]:
    """Return ranges that go together, far beyond the usual ones."""
    asked = {}
    for name, least, most in (
        ('cols', 2, 40),
        ('rows', 1, 40),
        ('auvs', 1, 12),
        ('path-cells', 3, 24),
        ('min-path-cells', 1, 3),
    ):
        if draw(st.booleans()):
            ends = sorted((draw(st.integers(least, most)), draw(st.integers(least, most))))
            asked[name] = Span(least=ends[0], most=ends[1])
    for name, least, most in (('cell', 0.1, 20.0), ('range', 20.0, 900.0), ('tick', 0.1, 60.0)):
        if draw(st.booleans()):
            ends = sorted((draw(st.floats(least, most)), draw(st.floats(least, most))))
            asked[name] = Span(least=ends[0], most=ends[1])
    if draw(st.booleans()):
        asked['masked'] = Span(least=0, most=draw(st.floats(0, 0.6)))
    return asked


@settings(max_examples=40)
@given(seed=SEEDS, asked=requests(), models=st.lists(st.sampled_from(sorted(MODELS)), min_size=1))
def test_what_is_drawn_can_be_flown_and_read_back(
    seed: int, asked: dict[str, Span], models: list[str]
) -> None:
    scenario = generate_scenario(seed, asked, models)
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'drawn.yaml'
        path.write_text(scenario_yaml(scenario, 'two\nlines'), encoding='utf-8')
        assert load_scenario(path) == scenario  # checked by `mission_problems`, too
    mission_params(scenario)  # checks the ranges of the nodes' parameters
    for name, span in asked.items():
        assert span.least <= drawn(scenario)[name] <= span.most
    assert {auv.surfacing['model'] for auv in scenario.auvs} <= set(models)
    mission, legs = mission_of(scenario)
    assert initial_problem(mission, legs) is None
    assert scenario.region.cell_m <= scenario.radio.range_m
    plan = make_planner('robust').plan_sortie(SortieRequest(mission=mission, legs=legs, now_s=0.0))
    assert {waypoint.auv for waypoint in plan.route} == {auv.name for auv in scenario.auvs}
    assert plan.worst_case_s <= scenario.sortie.limit_s + 1e-6


@settings(max_examples=20)
@given(seed=SEEDS)
def test_the_same_seed_draws_the_same_bytes(seed: int) -> None:
    first, again = (scenario_yaml(generate_scenario(seed), 'drawn') for _ in range(2))
    assert first == again
    assert first != scenario_yaml(generate_scenario(seed - 1 if seed else 1), 'drawn')


def test_a_seed_draws_what_it_always_drew() -> None:
    """Campaigns are cited by their seeds: a change here is one that the changelog must tell."""
    scenario = generate_scenario(2009, {'masked': Span(least=0, most=0)})
    assert drawn(scenario) | {'limit': None} == {
        'cols': 16,
        'rows': 17,
        'masked': 0.0,
        'cell': 27.0,
        'range': 45.2,
        'auvs': 2,
        'path-cells': 3,
        'min-path-cells': 3,
        'tick': 7.94,
        'limit': None,  # follows from how searches are laid
    }
    assert scenario.auvs[0].initial_path == ((6, 12), (6, 13), (7, 13))
    assert scenario.auvs[1].surfacing == {'model': 'slow', 'least_factor': 0.92}
    with_land = generate_scenario(2009).region
    assert (with_land.cols, with_land.rows, len(with_land.masked)) == (16, 17, 54)
    assert with_land.masked[:5] == ((0, 0), (1, 0), (2, 0), (3, 0), (6, 0))
    assert not generate_scenario(2010).region.masked


def test_land_leaves_the_sea_in_one_piece_and_as_much_of_it_as_is_asked_for() -> None:
    shares = []
    for seed in range(60):
        asked = {'masked': Span(least=0.3, most=0.5), 'rows': Span(least=2, most=30)}
        region = generate_scenario(seed, asked).region
        assert unreachable_cells(region, region.cells[:1]) == ()
        shares.append(len(region.masked) / (region.cols * region.rows))
    assert max(shares) <= 0.5
    assert sorted(shares)[6] > 0.25  # on a small grid there may be no room for more


def test_land_is_on_shores_and_in_islands() -> None:
    regions = [
        generate_scenario(seed, {'masked': Span(least=0.1, most=0.3)}).region for seed in range(20)
    ]
    has_island, has_shore = [], []
    for region in regions:
        rim = [
            cell
            for cell in region.masked
            if cell[0] in (0, region.cols - 1) or cell[1] in (0, region.rows - 1)
        ]
        land = msgspec.structs.replace(region, masked=region.cells)
        has_shore.append(bool(rim))
        has_island.append(bool(unreachable_cells(land, rim)))
    assert sum(has_shore) > 10
    assert sum(has_island) > 10


def test_usual_ranges_are_covered_and_nothing_else() -> None:
    scenarios = [generate_scenario(seed) for seed in range(300)]
    for name, quantity in QUANTITIES.items():
        values = [drawn(scenario)[name] for scenario in scenarios]
        if name == 'masked':
            land = [share for share in values if share > 0.0]
            assert 0.2 * len(values) < len(land) < 0.4 * len(values)
            assert max(land) <= 0.3
            assert max(land) > 0.25
        elif quantity.usual is None:
            assert len(set(values)) > 100
        elif quantity.is_whole:
            assert sorted(set(values)) == list(
                range(int(quantity.usual.least), int(quantity.usual.most) + 1)
            )
        else:
            width = quantity.usual.most - quantity.usual.least
            assert min(values) == quantity.usual.least
            assert quantity.usual.most - 0.05 * width < max(values) <= quantity.usual.most
    range_in_cells = [each.radio.range_m / each.region.cell_m for each in scenarios]
    assert min(range_in_cells) == 1.0  # the least with which an AUV between two cells is heard
    assert max(range_in_cells) > 3.5
    needed_s = [limit_needed_s(each) for each in scenarios]
    slack = [each.sortie.limit_s / s for each, s in zip(scenarios, needed_s, strict=True) if s]
    assert sum(each < 1.0 + 1e-9 for each in slack) > 10  # L leaves not a tick
    assert any(each > 1.9 for each in slack)
    models = {auv.surfacing['model'] for each in scenarios for auv in each.auvs}
    assert models == set(USUAL_MODELS)


def limit_needed_s(scenario: Scenario) -> float:
    """Return how long the first round takes, from what a limit of next to nothing is told."""
    mission, legs = mission_of(scenario)
    surfaced = [SurveyLeg(auv=leg.auv, path=leg.path, surface_deadline_s=0.0) for leg in legs]
    plan = make_planner('robust').plan_sortie(
        SortieRequest(mission=mission, legs=tuple(surfaced), now_s=0.0)
    )
    return plan.worst_case_s


def test_every_model_is_drawn_with_settings_that_it_takes() -> None:
    for name in MODELS:
        settings_drawn = {scenario_json(generate_scenario(seed, {}, [name])) for seed in range(5)}
        assert len(settings_drawn) == 5
        for seed in range(5):
            for auv in mission_params(generate_scenario(seed, {}, [name])).auvs:
                surfacing_model(auv.surfacing)


def test_all_is_drawn_anew_until_a_limit_that_is_asked_for_does() -> None:
    usual_s = [generate_scenario(seed).sortie.limit_s for seed in range(20)]
    assert sum(limit_s > 60 for limit_s in usual_s) > 10
    asked = {'limit': Span(least=40, most=60)}
    limits_s = [generate_scenario(seed, asked).sortie.limit_s for seed in range(20)]
    assert all(40 <= limit_s <= 60 for limit_s in limits_s)


# --- flown ---------------------------------------------------------------------------------------


def flown(scenario: Scenario) -> Summary:
    summarizer = Summarizer()
    fly(scenario, summarizer.frame)
    return summarizer.summary()


SMALL = {name: Span(least=3, most=7) for name in ('cols', 'rows')}


@pytest.mark.parametrize(
    'seed', [*range(8), *(pytest.param(s, marks=pytest.mark.slow) for s in range(8, 80))]
)
def test_robust_flies_what_is_drawn_as_it_promises(seed: int) -> None:
    # As often as not with much more land than is usual.
    asked = SMALL | {'masked': Span(least=0, most=0.5)} if seed % 2 else SMALL
    summary = flown(generate_scenario(seed, asked))
    assert summary.complete
    assert summary.explored_s is not None
    assert (summary.sortie_limit_violations, summary.missed_total, summary.samples_lost) == (
        0,
        0,
        0,
    )
    assert summary.searches_broken_off == 0
    assert summary.refusals == ()
    assert summary.bound_ratio_max is None or summary.bound_ratio_max <= 1.0 + 1e-9


# --- what is typed -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('text', 'span'),
    [
        ('5-20', Span(least=5, most=20)),
        ('12', Span(least=12, most=12)),
        ('0.5-2.5', Span(least=0.5, most=2.5)),
        ('1e-2-1e+3', Span(least=0.01, most=1000)),
    ],
)
def test_a_span_is_typed_as_one_number_or_two(text: str, span: Span) -> None:
    assert read_span(text) == span
    assert read_span(str(span)) == span


@pytest.mark.parametrize('text', ['', '-', '5-', '-5', '1-2-3', 'a', '5..7', 'nan', 'inf'])
def test_what_is_no_span_is_told(text: str) -> None:
    with pytest.raises(ValueError, match='must be a number or two of them such as 5-20, is'):
        read_span(text)


@pytest.mark.parametrize(
    ('asked', 'told'),
    [
        ({'cols': '0'}, 'cols is 0; allowed: 1-200'),
        ({'cols': '20-5'}, 'cols is 20-5; allowed: 1-200'),
        ({'rows': '2.5'}, 'rows is 2.5; allowed: whole numbers'),
        ({'auvs': '1-300'}, 'auvs is 1-300; allowed: 1-200'),
        (
            {'col': '5'},
            r'col is nothing that is drawn \(did you mean cols\?\); allowed: cols, rows',
        ),
        ({'cols': '1', 'rows': '1'}, 'rows is 1; allowed with the rest of it: 2-200'),
        ({'cell': '30-40', 'range': '10-20'}, 'range is 10-20; allowed with the rest of it: 30-'),
        (
            {'path-cells': '2', 'min-path-cells': '3'},
            'path-cells is 2; allowed with the rest of it: 3-24',
        ),
        ({'limit': '0.01'}, r'limit is 0\.01; allowed with the rest of it: \d'),
    ],
)
def test_what_cannot_be_drawn_is_told(asked: dict[str, str], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        generate_scenario(1, {name: read_span(text) for name, text in asked.items()})


def test_seeds_and_models_that_there_are_not_are_told() -> None:
    with pytest.raises(ValueError, match=r'seed is -1; allowed: 0 to 2\^53'):
        generate_scenario(-1)
    with pytest.raises(
        ValueError, match=r"'erly' is unknown \(did you mean early\?\); allowed: on"
    ):
        generate_scenario(1, {}, ['erly'])
    with pytest.raises(ValueError, match='no surfacing model is named'):
        generate_scenario(1, {}, [])


# --- the command ---------------------------------------------------------------------------------


def test_the_command_writes_files_that_say_how_to_draw_them_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = tmp_path / 'first', tmp_path / 'second'
    words = ['generate', '--seed', '7', '--cols', '3-6', '--range', '12.5', '--models', 'early']
    assert main([*words, '--count', '3', '--out', str(first)]) == 0
    paths = sorted(first.iterdir())
    assert [path.name for path in paths] == [f'generated_{seed}.yaml' for seed in (7, 8, 9)]
    printed = capsys.readouterr().out.splitlines()
    assert [line.partition(': ')[0] for line in printed] == [str(path) for path in paths]
    for path in paths:
        command = path.read_text().splitlines()[0].partition('orchestrate.py ')[2]
        assert main([*shlex.split(command), '--out', str(second)]) == 0
        assert (second / path.name).read_bytes() == path.read_bytes()
        scenario = load_scenario(path)
        assert 3 <= scenario.region.cols <= 6
        assert scenario.radio.range_m == 12.5
    texts = [path.read_text() for path in paths]
    assert all(a != b for a, b in itertools.pairwise(texts))


def test_a_file_is_replaced_only_by_force(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'bay.yaml'
    assert main(['generate', '--seed', '1', '--out', str(path)]) == 0
    before = path.read_bytes()
    assert main(['generate', '--seed', '2', '--out', str(path)]) == 2
    told = ' '.join(capsys.readouterr().err.split())
    assert told == f'--out {path}: exists already; name another, or add --force'
    assert path.read_bytes() == before
    assert main(['generate', '--seed', '2', '--out', str(path), '--force']) == 0
    assert path.read_bytes() != before


@pytest.mark.parametrize(
    ('words', 'told'),
    [
        (['--count', '2', '--out', 'bay.yaml'], 'bay.yaml is one file; allowed for 2: a folder'),
        (['--cols', '0'], 'cols is 0; allowed: 1-200'),
        (['--models', 'early,sunk'], "surfacing model 'sunk' is unknown; allowed: on_time, early"),
    ],
)
def test_bad_input_is_one_clear_message(
    words: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(['generate', '--seed', '1', *words]) == 2
    assert told in ' '.join(capsys.readouterr().err.split())
    assert list(tmp_path.iterdir()) == []
