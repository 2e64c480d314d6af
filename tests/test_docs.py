"""The documentation says what is: links, commands, figures, dependencies, examples, layout."""

import functools
import io
import json
import math
import re
import shlex
import sys
import textwrap
from argparse import ArgumentParser, _SubParsersAction
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from rich.console import Console
from rosbags.typesys import Stores, get_typestore

import orchestrate
from c3_station import cli
from c3_station.bench_ties import print_ties
from c3_station.graph import mission_nodes
from c3_station.in_process import fly
from c3_station.lower_bound import lower_bound_s
from c3_station.recorded_topics import mission_topics
from c3_station.scenario_files import load_scenario, shipped_scenarios, with_choices
from c3_station.summary import Summarizer, Summary
from msgs_json import messages
from msgs_json.driver_checks import check_uav_driver
from uav_planner.candidate_paths import DOCUMENTED_TIE_ORDER
from uav_planner.guarantee_oracle import count_refusals
from uav_planner.oracle_boards import BLOCK, STRIP, Board
from uav_planner.planners import PLANNERS, make_planner

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / 'README.md'
PAGES = [README, ROOT / 'CHANGELOG.md', *sorted((ROOT / 'docs').rglob('*.md'))]
LAYOUT = ROOT / 'docs' / 'foxglove' / 'shearwater.json'

each_page = pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def text_of(page: Path) -> str:
    return page.read_text(encoding='utf-8')


def prose(page: Path) -> str:
    """Return a page without its code blocks."""
    return re.sub(r'^ *```.*?^ *```$', '', text_of(page), flags=re.DOTALL | re.MULTILINE)


def words(page: Path) -> str:
    """Return a page with single spaces for its line breaks."""
    return ' '.join(text_of(page).split())


def blocks(page: Path, language: str) -> list[str]:
    found = re.findall(
        rf'^( *)```{language}\n(.*?)^ *```$', text_of(page), flags=re.DOTALL | re.MULTILINE
    )
    return [textwrap.dedent(code) for _, code in found]


def command_lines(page: Path) -> Iterator[list[str]]:
    """Yield the words of every command in the shell blocks of a page."""
    for block in blocks(page, 'bash'):
        for line in block.replace('\\\n', ' ').splitlines():
            words = shlex.split(line, comments=True)
            if words:
                yield words


# --- links ------------------------------------------------------------------------------------


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page: those that GitHub gives its headings, and named ones."""
    headings = re.findall(r'^#+ (.*)$', prose(page), flags=re.MULTILINE)
    named = re.findall(r'<a id="([^"]+)">', text_of(page))
    # Punctuation is dropped.
    return {re.sub(r'[^\w\- ]', '', each.lower()).replace(' ', '-') for each in headings} | {
        *named
    }


@each_page
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r'\]\(([^)\s]+)\)', prose(page))
    broken = []
    for target in targets:
        if re.match(r'[a-z]+:', target):
            continue
        file, _, anchor = target.partition('#')
        linked = (page.parent / file).resolve() if file else page
        if not linked.exists() or (anchor and anchor not in anchors(linked)):
            broken.append(target)
    assert broken == []


def test_every_page_is_reached_from_the_readme() -> None:
    reached, waiting = {README}, [README]
    while waiting:
        page = waiting.pop()
        for target in re.findall(r'\]\(([^)#\s]+\.md)', prose(page)):
            linked = (page.parent / target).resolve()
            if linked not in reached and linked.exists():
                reached.add(linked)
                waiting.append(linked)
    assert set(PAGES) <= reached


# --- commands ---------------------------------------------------------------------------------


def sub_commands(chosen: str) -> Mapping[str, ArgumentParser]:
    parser = cli._parser(chosen)
    (action,) = (each for each in parser._actions if isinstance(each, _SubParsersAction))
    return action.choices


@each_page
def test_commands_can_be_parsed(page: Path) -> None:
    for words in command_lines(page):
        match words:
            case ['python3', 'orchestrate.py', *arguments]:
                words = arguments or ['run']
                cli._parser(words[0]).parse_args(words)  # exits where it cannot
            case ['python3', script, *_]:
                assert (ROOT / script).is_file(), script


def test_every_sub_command_and_option_is_in_the_readme() -> None:
    shown = text_of(README)
    missing = []
    for name in sub_commands(''):
        parser = sub_commands(name)[name]
        if f'| `{name}' not in shown:
            missing.append(name)
        missing += [
            f'{name} {option}'
            for action in parser._actions
            for option in action.option_strings
            if option not in ('-h', '--help') and option not in shown
        ]
    assert missing == []


def test_every_shipped_scenario_is_in_the_docs() -> None:
    for page in (README, ROOT / 'docs' / 'scenarios.md'):
        shown = text_of(page)
        assert [name for name in shipped_scenarios() if f'`{name}`' not in shown] == []


def nodes_started(command: str) -> list[tuple[str, str, str]]:
    """Return package, executable and namespace of the nodes that the README starts."""
    line = re.compile(
        rf'^{command} --ros-args(?: -r __ns:=/(\w+))? --params-file', flags=re.MULTILINE
    )
    # Without a namespace a node is where its executable says, under its own name.
    return sorted(
        (package, node, namespace or node)
        for block in blocks(README, 'bash')
        for package, node, namespace in line.findall(block)
    )


@pytest.mark.parametrize(
    'command', [r'ros2 run (\w+) (\w+)', r'\.\./\.\./install/(\w+)/lib/\1/(\w+)']
)
def test_the_mission_by_hand_starts_the_nodes_of_the_mission(command: str) -> None:
    nodes = mission_nodes(load_scenario('ecc2009'), bag=True)
    expected = sorted((node.package, node.executable, node.name) for node in nodes)
    assert nodes_started(command) == expected


# --- figures ----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def reference() -> Summary:
    summarizer = Summarizer()
    fly(load_scenario('ecc2009'), summarizer.frame)
    return summarizer.summary()


def listed(values: list[float]) -> str:
    return ', '.join(f'{value:g}' for value in values)


def test_the_method_quotes_the_reference_mission_as_it_is(reference: Summary) -> None:
    first = reference.sorties[0]
    assert first.returned_s is not None
    contacts = listed([*(each.time_s for each in first.meetings), first.returned_s])
    slacks = listed([each.slack_s or 0.0 for each in first.meetings])
    longest_s = max(sortie.duration_s or 0.0 for sortie in reference.sorties)
    worst_s = [sortie.worst_case_s for sortie in reference.sorties]
    over = sum(each > first.limit_s for each in worst_s)
    neglect = [f'{each:g}' for each in reference.neglect_s.values()]
    share = f'{reference.neglect_fraction:.1%}'.replace('%', ' %')
    quoted = [
        f'| 14, 20, 33, 44 s | {contacts} s |',
        f'| 456 s | {reference.explored_s:g} s |',
        f'| {reference.sortie_limit_violations}, the longest {longest_s:g} s |',
        f'| {share} ({", ".join(neglect[:-1])} and {neglect[-1]} s) |',
        f'| {slacks} s |',
        f'home at {reference.mission_s:g} s',
        f'Of {reference.moves_total} moves up to {reference.explored_s:g} s,'
        f' {reference.revisits} revisit',
        f'before {reference.lower_bound_s:g} s',
        f'{over} of {len(worst_s)} departures ({max(worst_s):g} s at most)',
    ]
    method = words(ROOT / 'docs' / 'method.md')
    assert [each for each in quoted if each not in method] == []


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """What `bench ties` prints of a planner."""

    documented: str
    """When the region was explored in the documented order."""
    explored: str
    late: str


@functools.cache
def ensemble(planner: str) -> Ensemble:
    printed = io.StringIO()
    scenario = with_choices(load_scenario('ecc2009'), planner=planner)
    print_ties(scenario, Console(file=printed, width=120))
    documented, explored, late = (
        re.findall(pattern, printed.getvalue(), flags=re.MULTILINE)
        for pattern in (
            rf'^ *{DOCUMENTED_TIE_ORDER.name} +([\d.]+ s) ',
            r'^explored: ([\d.]+ to [\d.]+ s, median [\d.]+ s), 48 of 48 missions;',
            r'a sortie over L in (\d+ of 48)$',
        )
    )
    return Ensemble(documented=documented[0], explored=explored[0], late=late[0])


@pytest.mark.slow
def test_the_method_quotes_the_ensemble_as_it_is() -> None:
    flown = ensemble('ecc2009')
    assert f'explored after {flown.explored}' in words(ROOT / 'docs' / 'method.md')
    for page in (README, ROOT / 'docs' / 'method.md'):
        assert flown.late in words(page)


@pytest.mark.slow
@pytest.mark.parametrize('planner', ['ecc2009', 'robust'])  # those that ask for a tie order
def test_the_planners_are_compared_by_what_they_flew(planner: str) -> None:
    flown = ensemble(planner)
    row = f'| `{planner}` | {flown.documented} | {flown.explored} | {flown.late} |'
    assert row in text_of(ROOT / 'docs' / 'planners.md').splitlines()


def test_the_planners_that_are_said_to_keep_the_limit_claim_it() -> None:
    rows = re.findall(
        r'^\| `(\w+)`(?: \(default\))? \| [^|]+ \| (always)?[^|]*\|$',
        text_of(ROOT / 'docs' / 'planners.md'),
        flags=re.MULTILINE,
    )
    assert {name: bool(always) for name, always in rows} == {
        name: make_planner(name).guarantees_limit for name in PLANNERS
    }


# Of those of `bench guarantee`, which takes minutes.
QUOTED_BOARDS = [
    STRIP,
    replace(STRIP, limit_s=11.0),
    pytest.param(replace(BLOCK, limit_s=10.0), marks=pytest.mark.slow),
]


@pytest.mark.parametrize(
    'board',
    QUOTED_BOARDS,
    ids=lambda board: f'{board.cols}x{board.rows}-{board.moves}-{board.limit_s:g}',
)
def test_the_guarantee_quotes_what_the_oracle_counts(board: Board) -> None:
    moves = '1' if board.moves == 1 else f'1 ... {board.moves}'
    rows = re.findall(
        rf'^\| {board.cols} x {board.rows} \| {moves} \| {board.speed_mps:g} m/s'
        rf' \|(?: \d+,)* {board.limit_s:g}(?:, \d+)* s \| (.*) \|$',
        text_of(ROOT / 'docs' / 'guarantee.md'),
        flags=re.MULTILINE,
    )
    count = count_refusals(board.mission, board.legs)
    share = f' ({count.refused / count.winning:.2%})'.replace('%', ' %') if count.refused else ''
    assert rows == [f'{count.paths:,} | {count.winning:,} | {count.refused:,}{share}']


def test_the_bounds_are_those_of_the_shipped_scenarios() -> None:
    rows = []
    for name in shipped_scenarios():
        scenario = load_scenario(name)
        starts = {auv.initial_path[0] for auv in scenario.auvs}
        (cell_s,) = {scenario.region.cell_m / auv.speed_mps for auv in scenario.auvs}
        rounds = math.ceil((scenario.region.cells_total - len(starts)) / len(scenario.auvs))
        rows.append(
            f'| `{name}` | {scenario.region.cells_total} | {len(scenario.auvs)}'
            f' | {rounds * cell_s:g} s | {lower_bound_s(scenario):g} s |'
        )
    lines = text_of(ROOT / 'docs' / 'bounds.md').splitlines()
    assert [line for line in lines if line.startswith('| `')] == rows


# --- architecture -----------------------------------------------------------------------------


def test_the_modules_named_in_the_architecture_exist() -> None:
    rows = re.findall(
        r'^\| \[`(\w+)`\]\(\.\./(\S+)\) \| (.*) \|$',
        text_of(ROOT / 'docs' / 'architecture.md'),
        flags=re.MULTILINE,
    )
    packages = {name: (ROOT / folder, content) for name, folder, content in rows}
    del packages['tests']
    assert len(packages) == 4
    missing = [
        f'{package}: {module}'
        for package, (folder, content) in packages.items()
        for module in re.findall(r'`([\w*]+)/?`', content)
        if not [*folder.glob(module), *folder.glob(f'{module}.py')]
    ]
    assert missing == []


# --- dependencies -----------------------------------------------------------------------------


def table_rows(page: Path) -> dict[str, str]:
    """Return the second column of all tables of a page by the first."""
    rows = re.findall(r'^\| ([^|]+?) \| ([^|]+?) \|$', text_of(page), flags=re.MULTILINE)
    return dict(rows)


def test_every_pinned_package_has_its_line() -> None:
    pins = [
        pin
        for name in (orchestrate.RUNTIME, orchestrate.TESTS)
        for pin in orchestrate.requirements(name, system_ros=False)
    ]
    explained = table_rows(ROOT / 'docs' / 'dependencies.md').keys() - {'package', '---'}
    assert explained == {Requirement(pin).name for pin in pins}


def test_packages_are_needed_by_those_that_are_named() -> None:
    page = text_of(ROOT / 'docs' / 'dependencies.md')
    below = re.findall(
        r'^\| package \| needed by \|\n\|---\|---\|\n((?:\|.*\n)+)', page, re.MULTILINE
    )
    assert len(below) == 2
    wrong = []
    for table in below:
        for name, users in re.findall(r'^\| (\S+) \| (.*) \|$', table, re.MULTILINE):
            for user in users.split(', '):
                needs = (Requirement(each).name for each in metadata.requires(user) or ())
                if canonicalize_name(name) not in map(canonicalize_name, needs):
                    wrong.append(f'{user} does not need {name}')
    assert wrong == []


# --- changelog and citation -------------------------------------------------------------------


def package_version() -> str:
    version = ElementTree.parse(ROOT / 'msgs_json' / 'package.xml').findtext('version')
    assert version
    return version


def test_the_changelog_is_well_formed() -> None:
    headings = re.findall(r'^##(#?) (.*)$', text_of(ROOT / 'CHANGELOG.md'), flags=re.MULTILINE)
    versions = [heading for level, heading in headings if not level]
    kinds = {heading for level, heading in headings if level}
    assert versions
    assert all(
        re.fullmatch(r'\[(Unreleased|\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d|Unreleased)\]?', each)
        for each in versions
    )
    assert kinds <= {'Added', 'Changed', 'Deprecated', 'Removed', 'Fixed', 'Security'}


def test_the_citation_is_well_formed() -> None:
    citation = yaml.safe_load(text_of(ROOT / 'CITATION.cff'))
    assert citation['cff-version'] == '1.2.0'
    assert {'message', 'title', 'authors', 'abstract', 'keywords'} <= citation.keys()
    assert (citation['type'], citation['license']) == ('software', 'Apache-2.0')
    assert citation['version'] == package_version()
    assert f'Version {package_version()}' in text_of(README)
    (paper,) = citation['references']
    assert [author['family-names'] for author in paper['authors']] == ['Sujit', 'Sousa', 'Pereira']
    assert (paper['year'], paper['start'], paper['end']) == (2009, 115, 120)


# --- code in the docs -------------------------------------------------------------------------


def test_the_driver_of_the_how_to_conforms(monkeypatch: pytest.MonkeyPatch) -> None:
    driver_code, test_code = blocks(ROOT / 'docs' / 'drivers.md', 'python')
    driver = ModuleType('gull_shearwater.driver')
    monkeypatch.setitem(sys.modules, 'gull_shearwater', ModuleType('gull_shearwater'))
    monkeypatch.setitem(sys.modules, 'gull_shearwater.driver', driver)
    exec(driver_code, vars(driver))
    shown: dict[str, Any] = {}
    exec(test_code, shown)
    assert shown['check_uav_driver'] is check_uav_driver
    shown['test_the_gull_conforms']()


@pytest.mark.slow
def test_the_readme_reads_a_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(['run', 'minimal', '--no-ros', '--out', 'runs/first']) == 0
    capsys.readouterr()
    (code,) = blocks(README, 'python')
    exec(code, {})
    assert capsys.readouterr().out.startswith('10.0 auv_1 [[1, 0], ')


# --- Foxglove ---------------------------------------------------------------------------------

DRAWN = {
    'nav_msgs/msg/OccupancyGrid',
    'nav_msgs/msg/Path',
    'visualization_msgs/msg/MarkerArray',
    'foxglove.PoseInFrame',
}
"""What the 3D panel draws, of all that we publish."""

_store = get_typestore(Stores.ROS2_JAZZY)


@pytest.fixture(scope='module')
def layout() -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(text_of(LAYOUT))
    return loaded


@pytest.fixture(scope='module')
def topics() -> dict[str, str]:
    """Return the type of every topic in a bag of the reference mission."""
    recorded = mission_topics(load_scenario('ecc2009'))
    return {each.name: each.topic.ros_type for each in recorded}


def scripts(layout: dict[str, Any]) -> dict[str, tuple[str, str, str]]:
    """Return output topic, input topic and code of every user script."""
    found = {}
    for script in layout['userNodes'].values():
        code = script['sourceCode']
        (source,) = re.findall(r'^export const inputs = \["([^"]+)"\];$', code, re.MULTILINE)
        (output,) = re.findall(r'^export const output = "([^"]+)";$', code, re.MULTILINE)
        assert f'Input<"{source}">' in code
        found[output] = (output, source, code)
    return found


def panels(layout: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    return [
        config for name, config in layout['configById'].items() if name.partition('!')[0] == kind
    ]


def leaves(tree: Any) -> Iterator[str]:  # noqa: ANN401  JSON
    if isinstance(tree, str):
        yield tree
    else:
        assert tree['direction'] in ('row', 'column')
        yield from leaves(tree['first'])
        yield from leaves(tree['second'])


def test_every_panel_of_the_layout_has_its_place(layout: dict[str, Any]) -> None:
    assert sorted(leaves(layout['layout'])) == sorted(layout['configById'])


def test_the_scripts_of_the_layout_read_what_there_is(
    layout: dict[str, Any], topics: dict[str, str]
) -> None:
    for _, source, code in scripts(layout).values():
        if 'PoseInFrame' in code:
            assert topics[source] == 'nav_msgs/msg/Odometry'
        else:
            assert topics[source] == 'std_msgs/msg/String'
            (fields,) = re.findall(r'const \{ ([^}]+) \} = JSON\.parse', code)
            assert set(fields.split(', ')) <= set(messages.MissionStatus.__struct_fields__)


def test_the_3d_panel_shows_topics_of_types_that_it_draws(
    layout: dict[str, Any], topics: dict[str, str]
) -> None:
    made = {
        output: 'foxglove.PoseInFrame'
        for output, _, code in scripts(layout).values()
        if 'PoseInFrame' in code
    }
    (panel,) = panels(layout, '3D')
    known = topics | made
    assert [topic for topic in panel['topics'] if topic not in known] == []
    assert {known[topic] for topic in panel['topics']} == DRAWN
    assert panel['followTf'] == 'map'


def test_plots_and_lists_show_what_there_is(
    layout: dict[str, Any], topics: dict[str, str]
) -> None:
    for panel in panels(layout, 'RawMessages'):
        assert panel['topicPath'] in topics
    (panel,) = panels(layout, 'DiagnosticSummary')
    assert topics[panel['topicToRender']] == 'diagnostic_msgs/msg/DiagnosticArray'
    for panel in panels(layout, 'Plot'):
        for series in panel['paths']:
            topic, *fields = series['value'].split('.')
            if topic in topics:
                assert ends_in_a_number(topics[topic], fields)
            else:
                _, _, code = scripts(layout)[topic]
                assert f'  {fields[0]}: number;' in code


def ends_in_a_number(ros_type: str, fields: list[str]) -> bool:
    """Return whether a path of fields leads to a number in a message."""
    kind: object = ros_type
    for field in fields:
        _, kind = dict(_store.fielddefs[str(kind)][1])[field]
    return kind == ('float64', 0)
