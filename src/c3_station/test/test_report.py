"""Reports: what is on the page, what is drawn, and that a broken-off mission has one too."""

from __future__ import annotations

import functools
import itertools
import json
import re
import tempfile
from base64 import b64encode
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import msgspec
import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from page_checks import Page, check_texts, words

from c3_station import map_figures, paper, time_figures
from c3_station.bag import BagError, BagFacts, BagReader, BagWriter, stamp_ns
from c3_station.figure_style import BLACK, GREY, LAND, SKY, STYLE, VERMILLION
from c3_station.figures import FIGURES, DrawnFigure, draw_figures
from c3_station.forgeries import ForgeryKind, Stranger
from c3_station.in_process import fly
from c3_station.mission_record import MissionRecord, bag_records, gather_mission, read_mission
from c3_station.paper import PAPER_FIGURES, comparisons, is_reference_mission
from c3_station.recorded_topics import mission_topics
from c3_station.report import fly_again, render_report, write_report
from c3_station.scenario import Faults, Scenario, ScheduledCommand
from c3_station.scenario_changes import read_change
from c3_station.scenario_files import (
    load_scenario,
    parse_scenario,
    scenario_json,
    with_choices,
)
from c3_station.summary import LoggedEvent, failed_conditions, summarize
from msgs_json.agent_shell import Frame
from msgs_json.messages import ContactState, Met, Missed
from msgs_json.ros_messages import Text, to_cdr

NAMES = ['routes', 'first_sortie', 'coverage', 'contacts', 'neglect', 'sorties', 'survey']
MAPS = ['routes', 'first_sortie', 'survey']
FACTS = BagFacts(wall_s=2.5, real_time_factor=212.0, complete=True)


def record_bag(scenario: Scenario, path: Path) -> None:
    with BagWriter(path, mission_topics(scenario)) as writer:

        def sink(name: str, frame: Frame) -> None:
            cdr = to_cdr(frame.message)
            stamp = stamp_ns(frame.topic.ros_type, cdr)
            assert stamp is not None
            writer.write(frame.topic.resolve(f'/{name}'), cdr, stamp)

        fly(scenario, sink)
        writer.close(FACTS)


@functools.cache
def recorded(name: str) -> MissionRecord:
    with tempfile.TemporaryDirectory() as folder:
        record_bag(load_scenario(name), Path(folder) / 'bag')
        return read_mission(Path(folder))


@pytest.fixture(scope='module')
def minimal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('minimal')
    record_bag(load_scenario('minimal'), folder / 'bag')
    return folder


# --- the record ----------------------------------------------------------------------------------


def test_record_holds_what_the_bag_does(minimal: Path) -> None:
    record = read_mission(minimal / 'bag')
    with BagReader(minimal / 'bag') as reader:
        summary = summarize(bag_records(reader), reader.facts)
    assert record.summary == summary
    assert record.facts == FACTS
    assert record.scenario == load_scenario('minimal')
    assert set(record.tracks) == {'auv_1', 'uav'}
    assert summary.mission_s is not None
    for track in record.tracks.values():
        assert track.times_s == [float(tick) for tick in range(int(summary.mission_s) + 1)]
        assert len(track.positions) == len(track.z_m) == len(track.times_s)
    assert len(record.routes) == len(summary.sorties)
    for (_, route), sortie in zip(record.routes, summary.sorties, strict=True):
        assert route[0] == route[-1] == load_scenario('minimal').c3
        assert len(route) > 2 or not sortie.meetings
    assert len(record.survey) == summary.samples_delivered
    assert [each.stamp_s for each in record.events] == sorted(
        each.stamp_s for each in record.events
    )


def test_what_the_uav_did_not_say_is_in_no_survey(minimal: Path) -> None:
    with BagReader(minimal / 'bag') as reader:
        records = list(bag_records(reader))
        facts = reader.facts
    genuine = gather_mission(records, facts)
    assert genuine.strange == 0
    by_radio = [
        (place, message)
        for place, (topic, _, message) in enumerate(records)
        if topic == '/c3/radio/rx' and isinstance(message, Text) and b'SampleBatch' in message.data
    ]
    place, heard = by_radio[0]
    damaged = Text(re.sub(rb'"value":\d', b'"value":9', heard.data))
    assert damaged != heard
    outside = Text(re.sub(rb'"cell":\[\d+', b'"cell":[999', heard.data))
    broken = Text(heard.data[:-1])
    _, time_s, _ = records[place]
    for each in (damaged, outside, broken):
        strange = [('/c3/radio/rx', time_s, each)]
        for at in (place, place + 1):
            record = gather_mission([*records[:at], *strange, *records[at:]], facts)
            assert record.survey == genuine.survey
            assert record.strange == 1
    # Without what the UAV said, all but the damaged value is known to be wrong.
    unsaid = [each for each in records if each[0] != '/uav/radio/tx']
    strange = [('/c3/radio/rx', time_s, each) for each in (outside, broken)]
    record = gather_mission([*unsaid, *strange], facts)
    assert (record.survey, record.strange) == (genuine.survey, 2)
    page = render_report(record, (), 'rebuild', None)
    assert '2 messages reached C3 otherwise than the UAV said' in ' '.join(page.split())


def test_what_a_stranger_says_by_radio_is_recorded_and_in_no_figure(minimal: Path) -> None:
    with BagReader(minimal / 'bag') as reader:
        records = list(bag_records(reader))
        facts = reader.facts
    genuine = gather_mission(records, facts)
    stranger = Stranger(np.random.default_rng(1))
    payloads = [
        (topic, time_s, message.data)
        for topic, time_s, message in records
        if '/radio/' in topic and isinstance(message, Text)
    ]
    for _, _, payload in payloads:
        stranger.hear(payload)
    # What is on the topic of what an agent says is told from the agent's own by the world only.
    forged = [
        (f'/{agent}/radio/rx', time_s, Text(forgery.payload))
        for (_, time_s, _), forgery in zip(
            payloads, stranger.forgeries(len(payloads)), strict=True
        )
        for agent in ('c3', 'uav', 'auv_1')
    ]
    record = gather_mission(sorted([*records, *forged], key=lambda each: each[1]), facts)
    assert record.strange > len(ForgeryKind)
    assert replace(record, strange=0) == genuine


# --- the files -----------------------------------------------------------------------------------


def test_report_writes_summary_page_and_figures(minimal: Path, tmp_path: Path) -> None:
    summary = write_report(minimal / 'bag', tmp_path / 'out').summary
    assert failed_conditions(summary, load_scenario('minimal')) == []
    content = json.loads((tmp_path / 'out' / 'summary.json').read_text())
    assert content['explored_s'] == summary.explored_s
    assert (content['wall_s'], content['real_time_factor']) == (2.5, 212.0)
    drawn = sorted((tmp_path / 'out' / 'figures').iterdir())
    assert [file.name for file in drawn] == sorted(f'{name}.png' for name in NAMES)
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    for file in drawn:
        assert b64encode(file.read_bytes()).decode() in page


@pytest.mark.slow
def test_report_is_the_same_each_time(minimal: Path, tmp_path: Path) -> None:
    (tmp_path / 'out').mkdir()
    (tmp_path / 'out' / 'summary.json').write_text('of an earlier run')
    for name in ('out', 'again'):
        write_report(minimal, tmp_path / name)
    for name in ('summary.json', 'figures/routes.png', 'figures/survey.png'):
        assert (tmp_path / 'out' / name).read_bytes() == (tmp_path / 'again' / name).read_bytes()
    pages = [(tmp_path / name / 'report.html').read_text() for name in ('out', 'again')]
    assert pages[0] == pages[1].replace(str(tmp_path / 'again'), str(tmp_path / 'out'))


def test_report_that_cannot_be_made_is_a_clear_error(minimal: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match='there is no such bag'):
        write_report(tmp_path / 'none', tmp_path / 'out')
    (tmp_path / 'file').write_text('')
    with pytest.raises(ValueError, match='the report cannot be written'):
        write_report(minimal, tmp_path / 'file')


# --- the page ------------------------------------------------------------------------------------


OUT = Path('out')


def page_of(record: MissionRecord, figures: tuple[DrawnFigure, ...] = ()) -> str:
    again = fly_again(record, OUT)
    return render_report(record, figures, 'python3 orchestrate.py report bag', again)


@functools.cache
def eventful() -> MissionRecord:
    """Return a mission of kills and forgeries in which the operator changes region and limit."""
    commands = (
        (5.0, {'command': 'change_region', 'masked': [[3, 1], [3, 2]]}),
        (60.0, {'command': 'change_limit', 'sortie_limit_s': 40.0}),
    )
    scenario = msgspec.structs.replace(
        load_scenario('minimal'),
        faults=Faults(kills=4, forged=60, disk_full_s=10.0),
        operator=tuple(ScheduledCommand(at_s=at_s, command=each) for at_s, each in commands),
    )
    with tempfile.TemporaryDirectory() as folder:
        record_bag(scenario, Path(folder) / 'bag')
        return read_mission(Path(folder))


def test_page_tells_which_nodes_died_and_what_they_refused() -> None:
    record = eventful()
    page = page_of(record)
    assert Page(page).open == []
    text = words(page)
    restarts = ', '.join(
        f'{count} \N{MULTIPLICATION SIGN} {name}'
        for name, count in sorted(record.summary.restarts.items())
    )
    assert sum(record.summary.restarts.values()) == 4
    assert f'Restarts and failures Restarts: {restarts}.' in text
    assert 'died and was started again (restart 1)' in text
    assert 'could not store, and kept silent: store in memory: no space left on device' in text
    assert 'stored again' in text
    (first, *_) = sorted(
        record.summary.refusals, key=lambda each: (each.node, each.reason, each.sender)
    )
    assert 'Refused messages What a node did not believe' in text
    assert f'{first.node} {first.sender} {first.reason} {first.count} {first.detail[:4]}' in text
    quiet = words(page_of(recorded('minimal')))
    assert 'Restarts' not in quiet
    assert 'Refused messages' not in quiet


def test_page_speaks_of_the_region_and_the_limit_as_they_were_changed() -> None:
    record = eventful()
    assert record.summary.cells_total == 10
    text = words(page_of(record))
    assert '10 of 10 cells entered, 100 %, in' in text
    assert '2 more were taken out by the operator' in text
    assert 'of 30 s to 40 s' in text
    assert 'no planner can before' not in text
    unreached = msgspec.structs.replace(record.summary, out_of_reach=((0, 1), (2, 2)))
    text = words(page_of(replace(record, summary=unreached)))
    assert 'within the limit: [0, 1], [2, 2].' in text


def test_page_is_well_formed_and_needs_nothing_else() -> None:
    record = recorded('ecc2009')
    text = page_of(record, draw_figures(record))
    page = Page(text)
    assert page.open == []
    assert page.loads == []
    assert page.images == len(NAMES)
    assert 'url(' not in text
    assert '@import' not in text


def test_page_of_the_reference_mission_says_what_the_paper_says() -> None:
    text = words(page_of(recorded('ecc2009')))
    assert 'Passed' in text
    assert 'Not passed' not in text
    assert 'whole region explored 456 s 457 s +1 s p. 120, Fig. 7(b)' in text
    assert 'first sortie back at C3 44 s 44 s 0 s' in text
    assert 'neglect of A3 7.17 % 8.1 % +0.93 points' in text
    assert '457 s region explored; no planner can before 331 s' in text
    assert '0 of 9 sorties over their limit; longest 59 s of 60 s' in text
    assert '97.8 % is the most that a sortie took of its worst case' in text
    assert '64 s the UAV waited at C3 before its sorties' in text
    assert '105 s greatest age of a sample that C3 did not have yet 0 of 9' in text
    assert '1 0 s 44 s 44 s 45 s 97.8 % 45 s A1 at 14 s' in text
    assert 'A1 at 14 s, [4, 7], λ 17 s, 6 cells to [4, 1]' in text
    assert 'stays up for recovery' in text
    assert 'python3 orchestrate.py report bag' in text
    assert 'python3 orchestrate.py run ecc2009 --planner ecc2009 --seed 0' in text


@pytest.mark.slow
def test_page_says_how_much_of_the_region_is_land() -> None:
    assert '12 cells of 25 m, 37 of them masked · version' in words(page_of(recorded('harbour')))
    assert '10 cells of 10 m · version' in words(page_of(recorded('ecc2009')))


def test_the_line_to_fly_again_flies_the_same() -> None:
    record = recorded('ecc2009')
    assert record.scenario is not None
    robust = with_choices(record.scenario, planner='robust', seed=7)
    line = 'python3 orchestrate.py run ecc2009 --planner robust --seed 7'
    assert fly_again(replace(record, scenario=robust), OUT) == line
    sortie = msgspec.structs.replace(robust.sortie, limit_s=50.0)
    changed = msgspec.structs.replace(robust, sortie=sortie)
    gone = msgspec.structs.replace(
        robust, planner=msgspec.structs.replace(robust.planner, name='of_the_past')
    )
    line = 'python3 orchestrate.py run out/scenario.json'
    for scenario in (changed, gone, msgspec.structs.replace(robust, name='my_bay')):
        assert fly_again(replace(record, scenario=scenario), OUT) == line
    assert fly_again(replace(record, scenario=None), OUT) is None


@pytest.mark.slow
def test_the_report_comes_with_the_scenario_as_flown(tmp_path: Path) -> None:
    changed = with_choices(load_scenario('minimal'), changes=[read_change('sortie.limit_s=50')])
    record_bag(changed, tmp_path / 'bag')
    record = write_report(tmp_path / 'bag', tmp_path / 'out')
    assert record.scenario is not None
    assert load_scenario(tmp_path / 'out' / 'scenario.json') == changed


def test_other_missions_are_not_put_beside_the_paper() -> None:
    text = words(page_of(recorded('minimal')))
    assert 'Beside the paper' not in text
    assert '212 real time; flown in 2.5 s of wall time' in text


TROUBLE = ('given up', 'asked for help', 'in vain', 'roken off', 'of lost AUVs', 'on board a lost')


def test_a_mission_without_trouble_does_not_speak_of_it() -> None:
    text = words(page_of(recorded('ecc2009'))).partition('What the figures mean')[0]
    assert [trouble for trouble in TROUBLE if trouble in text] == []


def with_trouble() -> MissionRecord:
    """Return the reference mission as if it had been a worse one."""
    record = recorded('ecc2009')
    first, second, *others = record.summary.sorties
    second = msgspec.structs.replace(
        second,
        bound_ratio=1.004,
        missed=('auv_2', 'auv_3'),
        given_up=('auv_3',),
        not_reached=('auv_1', 'auv_2'),
    )
    summary = msgspec.structs.replace(
        record.summary,
        sorties=(first, second, *others),
        missed_total=4,
        searches_broken_off=1,
        lost=('auv_3',),
        heard_again=('auv_2',),
        aborted=('auv_1',),
        samples_missing={'auv_1': 0, 'auv_2': 0, 'auv_3': 7},
    )
    return replace(record, summary=summary)


def test_page_tells_who_was_lost_who_asked_for_help_and_what_was_left_out() -> None:
    text = words(page_of(with_trouble()))
    assert 'A3 was given up and not heard again; its cells went to the others. 7 of its' in text
    assert 'A2 was given up and heard again.' in text
    assert 'A1 asked for help.' in text
    assert 'Searches in vain: 4.' in text
    assert 'Searches broken off to be home within the limit: 1.' in text
    assert 'A2 searched in vain A3 searched in vain and given up' in text
    assert 'Broken off , not reached: A1, A2' in text
    assert 'all data at C3 but that of lost AUVs; mission over' in text
    assert 'did not have yet; on board a lost AUV until the end' in text
    assert '<td class="n bad">100.4' in page_of(with_trouble())


def test_failed_conditions_come_first() -> None:
    content = json.loads(scenario_json(load_scenario('minimal')))
    content['pass'] = {'explored_s': {'max': 60.0}}
    record = replace(recorded('minimal'), scenario=parse_scenario(json.dumps(content)))
    text = words(page_of(record))
    is_what = f'explored_s is {record.summary.explored_s:g}, more than allowed: at most 60'
    assert f'Not passed ✗ {is_what} ✓ samples_lost' in text


def test_text_from_the_bag_is_escaped() -> None:
    scenario = msgspec.structs.replace(
        load_scenario('minimal'), description='<script>alert(1)</script> & co'
    )
    page = page_of(replace(recorded('minimal'), scenario=scenario))
    assert '<script>' not in page
    assert '&lt;script&gt;alert(1)&lt;/script&gt; &amp; co' in page


@pytest.mark.slow
@pytest.mark.parametrize('share', [0.0, 0.02, 0.5])
def test_mission_that_broke_off_has_a_report(share: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        record_bag(load_scenario('minimal'), Path(folder) / 'bag')
        with BagReader(Path(folder)) as reader:
            records = list(bag_records(reader))
    record = gather_mission(records[: int(share * len(records))], BagFacts())
    page = page_of(record, draw_figures(record))
    assert Page(page).open == []
    text = words(page)
    assert 'The record ends before C3 called the mission complete' in text
    assert 'The recorder did not see the mission to its end' in text
    assert ('No verdict' if record.scenario is None else 'Not passed') in text


# --- the paper -----------------------------------------------------------------------------------


def test_reference_mission_is_known_by_what_is_flown() -> None:
    scenario = load_scenario('ecc2009')
    assert is_reference_mission(scenario)
    other = msgspec.structs.replace
    assert is_reference_mission(other(scenario, seed=7, name='again', description=''))
    assert not is_reference_mission(other(scenario, tick_s=0.5))
    assert not is_reference_mission(other(scenario, auvs=scenario.auvs[:2]))
    radio = other(scenario.radio, range_m=25.0)
    assert not is_reference_mission(other(scenario, radio=radio))
    planner = other(scenario.planner, path_cells=5)
    assert not is_reference_mission(other(scenario, planner=planner))
    early = other(scenario.auvs[0], surfacing={'model': 'early', 'probability': 0.1})
    assert not is_reference_mission(other(scenario, auvs=(early, *scenario.auvs[1:])))


def test_paper_is_cited_for_every_figure() -> None:
    source = Path(paper.__file__).read_text()
    assert 'European Control Conference 2009' in source.replace('\n', ' ')
    assert all(figure.place for figure in PAPER_FIGURES)
    shares = {each.what: each.value for each in PAPER_FIGURES if each.what.startswith('neglect')}
    total = shares.pop('neglect of all AUVs')
    assert sum(shares.values()) == pytest.approx(total)


def test_comparison_of_a_mission_without_sorties_is_empty_not_wrong() -> None:
    summary = summarize([])
    for comparison in comparisons(summary):
        if comparison.figure.what != 'sorties over the limit':
            assert comparison.measured is None
            assert comparison.difference is None


def test_comparison_of_the_reference_mission() -> None:
    by_name = {each.figure.what: each for each in comparisons(recorded('ecc2009').summary)}
    for exact in ('A1 met', 'A2 met', 'A3 met'):
        assert by_name[f'{exact} for the first time'].difference == 0.0
    for auv in ('A1', 'A2', 'A3'):
        assert by_name[f'turns in the first path of {auv}'].difference == 0
    assert by_name['whole region explored'].measured == 457.0


# --- the figures ---------------------------------------------------------------------------------


def drawn(name: str, record: MissionRecord) -> Figure:
    draw = {each[0]: each[3] for each in FIGURES}[name]
    assert record.scenario is not None
    with mpl.rc_context(STYLE):
        figure = draw(record, record.scenario)
    assert figure is not None
    return figure


@pytest.mark.parametrize(
    ('mission', 'name'),
    [
        *itertools.product(['ecc2009', 'minimal'], NAMES),
        *itertools.product(['harbour'], MAPS),
    ],
)
def test_no_text_overlaps_and_none_is_cut_off(mission: str, name: str) -> None:
    check_texts(drawn(name, recorded(mission)))


@pytest.mark.parametrize('name', ['routes', 'coverage', 'sorties'])
def test_no_text_overlaps_where_the_operator_has_changed_the_mission(name: str) -> None:
    check_texts(drawn(name, eventful()))


def test_every_axis_has_a_unit() -> None:
    for name in NAMES:
        axes = drawn(name, recorded('ecc2009')).axes[0]
        labels = [axes.get_xlabel(), axes.get_ylabel()]
        for label in labels:
            assert re.search(r'\((m|s|%)\)$', label) or label in ('sortie', '')
    bar = drawn('survey', recorded('ecc2009')).axes[1]
    assert bar.get_xlabel() == 'sea temperature (°C)'


def test_waits_drawn_are_the_neglect_of_the_summary() -> None:
    record = recorded('ecc2009')
    explored_s = record.summary.explored_s
    assert explored_s is not None
    for auv, neglect_s in record.summary.neglect_s.items():
        waits = time_figures._waits(record, auv, 1e9)
        drawn_s = sum(
            max(0.0, min(begin_s + length_s, explored_s) - begin_s) for begin_s, length_s in waits
        )
        assert drawn_s == neglect_s


def test_waits_at_c3_drawn_are_those_of_the_summary() -> None:
    record = recorded('ecc2009')
    waits = spans(drawn('neglect', record), len(record.summary.neglect_s), GREY)
    assert sum(end_s - begin_s for begin_s, end_s in waits) == record.summary.c3_wait_s == 64.0
    assert waits[:2] == [(0.0, 0.0), (44.0, 74.0)]


def spans(figure: Figure, row: int, colour: str) -> list[tuple[float, float]]:
    """Return the bars of a colour in a row: beginning and end, seconds."""
    found = []
    for bars in figure.axes[0].collections:
        if [mpl.colors.to_hex(face) for face in bars.get_facecolor()] == [colour.lower()]:
            boxes = [path.get_extents() for path in bars.get_paths()]
            found += [(float(box.x0), float(box.x1)) for box in boxes if box.y0 < row < box.y1]
    return sorted(found)


def test_contacts_drawn_are_what_c3_showed_and_when() -> None:
    record = recorded('ecc2009')
    figure = drawn('contacts', record)
    # A1 is due at S_1 = 10 s and met at 14 s; C3 hears of it at 44 s. Its next path ends at 74 s.
    assert spans(figure, 0, SKY)[0] == (10.0, 44.0)
    assert spans(figure, 0, '#CFE6F5')[:2] == [(0.0, 10.0), (44.0, 74.0)]
    for row, changes in enumerate(record.contacts.values()):
        assert changes[-1][1] is None
        due = [time_s for time_s, contact in changes if contact is ContactState.DUE]
        assert [begin_s for begin_s, _ in spans(figure, row, SKY)] == due
    assert legend_of(figure) == {'silent, as expected', 'due', 'up for recovery', 'met'}


def legend_of(figure: Figure) -> set[str]:
    (legend,) = figure.legends
    return {text.get_text() for text in legend.get_texts() if text.get_text().strip()}


def with_contacts(*changes: tuple[float, ContactState | None]) -> MissionRecord:
    record = recorded('minimal')
    missed = LoggedEvent(60.0, 'uav', Missed(sortie=1, auv='auv_1'))
    return replace(
        record,
        contacts={'auv_1': changes},
        events=(*record.events, missed),
        summary=msgspec.structs.replace(record.summary, missed_total=1),
    )


def test_every_contact_state_is_drawn_in_its_own_way() -> None:
    record = with_contacts(
        (0.0, ContactState.EXPECTED_SILENT),
        (20.0, ContactState.DUE),
        (40.0, ContactState.OVERDUE),
        (60.0, ContactState.LOST),
        (80.0, ContactState.EXPECTED_SILENT),
        (90.0, None),
    )
    figure = drawn('contacts', record)
    assert spans(figure, 0, '#CFE6F5') == [(0.0, 20.0), (80.0, 90.0)]
    assert spans(figure, 0, SKY) == [(20.0, 40.0)]
    assert spans(figure, 0, VERMILLION) == [(40.0, 60.0)]
    assert spans(figure, 0, BLACK) == [(60.0, 80.0)]
    ((recovered_s, end_s),) = spans(figure, 0, '#DDDDDD')
    assert (recovered_s, end_s) == (90.0, record.tracks['auv_1'].times_s[-1])
    *_, met, missed = figure.axes[0].get_lines()
    assert list(np.asarray(missed.get_xdata())) == [60.0]
    assert list(np.asarray(met.get_xdata())) == [
        each.stamp_s for each in record.events if isinstance(each.event, Met)
    ]
    assert len(legend_of(figure)) == 7
    looks = [tuple(look.items()) for _, look in time_figures._CONTACTS.values()]
    assert len(set(looks)) == len(ContactState) + 1


def test_record_without_a_status_has_no_figure_of_contacts() -> None:
    record = replace(recorded('minimal'), contacts={})
    assert record.scenario is not None
    assert time_figures.draw_contacts(record, record.scenario) is None


def test_sorties_with_searches_in_vain_or_broken_off_are_marked() -> None:
    def marked(record: MissionRecord) -> list[list[float]]:
        lines = drawn('sorties', record).axes[0].get_lines()
        by_marker = {line.get_marker(): list(np.asarray(line.get_xdata())) for line in lines}
        return [by_marker['X'], by_marker['<']]

    assert marked(recorded('ecc2009')) == [[], []]
    assert marked(with_trouble()) == [[2], [2]]


def test_coverage_ends_at_all_cells_and_stays_below_the_bound() -> None:
    lines = drawn('coverage', recorded('ecc2009')).axes[0].get_lines()
    bound, entered, delivered = (
        (np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in lines[:3]
    )
    assert bound[1][-1] == entered[1][-1] == delivered[1][-1] == 100.0
    assert bound[0][np.argmax(bound[1] >= 100.0)] == 331.0
    assert entered[0][np.argmax(entered[1] >= 100.0)] == 457.0
    for time_s in range(1, 530):
        at = [line[1][np.searchsorted(line[0], time_s, 'right') - 1] for line in (bound, entered)]
        assert at[1] <= at[0]


def test_coverage_is_of_the_region_as_it_was_at_the_time() -> None:
    record = eventful()
    assert record.scenario is not None
    (_, before), (changed_s, after) = record.regions(record.scenario)
    assert (before.cells_total, after.cells_total) == (12, 10)
    figure = drawn('coverage', record)
    entered, delivered, change = figure.axes[0].get_lines()
    assert np.asarray(entered.get_ydata())[-1] == np.asarray(delivered.get_ydata())[-1] == 100.0
    shares = zip(np.asarray(entered.get_xdata()), np.asarray(entered.get_ydata()), strict=True)
    for time_s, share in shares:
        cells = share * (after if time_s >= changed_s else before).cells_total / 100.0
        assert cells == pytest.approx(round(cells))
    assert list(np.asarray(change.get_xdata())) == [changed_s] * 2
    assert 'region changed by the operator' in legend_of(figure)


@pytest.mark.parametrize('name', MAPS)
def test_cells_that_the_operator_took_out_are_crossed_out_on_every_map(name: str) -> None:
    figure = drawn(name, eventful())
    crossed = [
        (each.get_x(), each.get_y(), each.get_width(), each.get_height())
        for each in figure.axes[0].patches
        if isinstance(each, Rectangle) and each.get_hatch() == 'xxxx'
    ]
    assert sorted(crossed) == [(30.0, 10.0, 10.0, 10.0), (30.0, 20.0, 10.0, 10.0)]
    assert 'taken out by the operator' in legend_of(figure)


def test_each_sortie_is_drawn_against_the_limit_of_its_departure() -> None:
    record = eventful()
    (limits,) = (
        line for line in drawn('sorties', record).axes[0].get_lines() if line.get_ls() == '--'
    )
    numbers, limits_s = np.asarray(limits.get_xdata()), np.asarray(limits.get_ydata())
    flown_by = [
        limits_s[np.searchsorted(numbers, sortie.index, 'right') - 1]
        for sortie in record.summary.sorties
    ]
    assert flown_by == [sortie.limit_s for sortie in record.summary.sorties]
    assert {*flown_by} == {30.0, 40.0}


def test_bars_of_the_sorties_are_their_durations() -> None:
    record = recorded('ecc2009')
    bars = drawn('sorties', record).axes[0].patches
    heights = [bar.get_height() for bar in bars]  # type: ignore[attr-defined]
    assert heights == [sortie.duration_s for sortie in record.summary.sorties]


@pytest.mark.parametrize('name', MAPS)
def test_land_is_drawn_on_every_map_and_said_to_be_land(name: str) -> None:
    record = recorded('harbour')
    assert record.scenario is not None
    region = record.scenario.region
    figure = drawn(name, record)
    (land,) = (
        each
        for each in figure.axes[0].collections
        if isinstance(each, QuadMesh) and to_hex(each.cmap(0.5)).upper() == LAND
    )
    values = np.ma.filled(land.get_array(), np.nan).reshape(region.rows, region.cols)
    np.testing.assert_array_equal(~np.isnan(values), region.mask)
    assert 'masked (land, no-go)' in legend_of(figure)


@pytest.mark.parametrize('name', MAPS)
def test_where_there_is_no_land_nothing_is_said_of_it(name: str) -> None:
    legends = drawn(name, recorded('ecc2009')).legends
    texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    assert not any('masked' in text for text in texts)


def test_line_keeps_to_the_right_of_its_route() -> None:
    route = [0j, 10 + 0j, 10 + 10j, 10 + 0j, 20 + 0j]  # east, north, back south, east
    line = map_figures._keeping_right(route, 1.0)
    assert line.tolist() == [-1j, 11 - 1j, 11 + 10j, 9 + 10j, 9 - 1j, 20 - 1j]
    for a, b in itertools.pairwise(line):
        assert abs(a - b) > 0.0


def test_vehicle_that_stands_still_has_a_route_of_one_place() -> None:
    record = recorded('minimal')
    track = record.tracks['auv_1']
    assert map_figures._cell_centres(track, 0.0) == [5 + 5j]
    assert map_figures._keeping_right([5 + 5j], 1.0).tolist() == [5 + 5j]
