"""The command line, without ROS: what a person types, what comes back, which exit code."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from c3_station.cli import main
from c3_station.exit_codes import ExitCode


def run(*words: object) -> int:
    return main([str(word) for word in words])


def test_a_run_without_ros_leaves_everything_it_promises(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'run'
    assert run('run', tiny, '--no-ros', '--out', out) == ExitCode.OK
    assert {'bag', 'scenario.json', 'summary.json', 'report.html', 'figures'} <= {
        path.name for path in out.iterdir()
    }
    assert any((out / 'figures').glob('*.png'))
    summary = json.loads((out / 'summary.json').read_text())
    assert summary['cells_explored'] == 9
    assert summary['samples_delivered'] == summary['samples_collected'] > 0
    assert 'passed: every condition of the scenario is met' in capsys.readouterr().out


@pytest.mark.slow
def test_report_makes_the_same_again_from_the_bag_alone(tiny: Path, tmp_path: Path) -> None:
    out, again = tmp_path / 'run', tmp_path / 'again'
    run('run', tiny, '--no-ros', '--out', out)
    assert run('report', out / 'bag', '--out', again) == ExitCode.OK
    assert (again / 'summary.json').read_bytes() == (out / 'summary.json').read_bytes()
    assert (again / 'report.html').exists()


@pytest.mark.slow
def test_without_a_bag_the_figures_are_the_same(tiny: Path, tmp_path: Path) -> None:
    run('run', tiny, '--no-ros', '--out', tmp_path / 'with')
    run('run', tiny, '--no-ros', '--no-bag', '--out', tmp_path / 'without')
    figures = [
        json.loads((tmp_path / name / 'summary.json').read_text()) for name in ('with', 'without')
    ]
    for each in figures:
        del each['wall_s'], each['real_time_factor']  # only a bag remembers them
    assert figures[0] == figures[1]


def test_exit_code_tells_a_failed_pass_condition(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny.write_text(tiny.read_text() + 'pass: {explored_s: {max: 1.0}}\n')
    assert run('run', tiny, '--no-ros', '--no-bag', '--out', tmp_path / 'run') == ExitCode.FAILED
    told = capsys.readouterr().out
    assert re.search(r'not passed: explored_s is \d+, more than allowed: at most 1\n', told)


def test_keys_are_set_for_one_run(tiny: Path, tmp_path: Path) -> None:
    out = tmp_path / 'run'
    words = ('sortie.limit_s=45', 'auvs.0.surfacing={model: early, probability: 0.5}')
    assert run('run', tiny, '--no-ros', '--no-bag', '--out', out, '--set', *words) == ExitCode.OK
    flown = json.loads((out / 'scenario.json').read_text())
    assert flown['sortie']['limit_s'] == 45.0
    assert flown['auvs'][0]['surfacing'] == {'model': 'early', 'probability': 0.5}


def test_an_existing_folder_is_refused_and_replaced_only_by_force(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'run'
    words = ('run', tiny, '--no-ros', '--no-bag', '--out', out)
    assert run(*words) == ExitCode.OK
    assert run(*words) == ExitCode.BAD_INPUT
    assert '--force' in capsys.readouterr().err
    (out / 'left_over').touch()
    assert run(*words, '--force') == ExitCode.OK
    assert not (out / 'left_over').exists()


def test_force_never_removes_a_folder_that_is_no_run(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'thesis').mkdir()
    (tmp_path / 'thesis' / 'chapter_1.tex').touch()
    code = run('run', tiny, '--no-ros', '--out', tmp_path / 'thesis', '--force')
    assert code == ExitCode.BAD_INPUT
    assert (tmp_path / 'thesis' / 'chapter_1.tex').exists()
    assert 'not the folder of a run' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('words', 'told'),
    [
        (('run', 'ecc2008', '--no-ros'), 'did you mean ecc2009?'),
        (('run', 'ecc2009', '--no-ros', '--planner', 'magic'), "unknown planner 'magic'"),
        (('run', 'ecc2009', '--no-ros', '--set', 'sortie.limit_s=-5'), 'sortie.limit_s is -5'),
        (('check', 'no/such/file.yaml'), 'no/such/file.yaml: there is no such file'),
        (('report', 'no/such/bag'), 'no/such/bag: there is no such bag'),
        (('recover', 'no/such/bag'), 'no/such/bag: there is no such bag'),
        (('bench', 'warp'), "no benchmark 'warp'"),
        (
            ('generate', '--seed', '1', '--out', '/proc/nowhere/one.yaml'),
            '--out /proc/nowhere/one.yaml: cannot be written, No such file',
        ),
        (
            ('generate', '--seed', '1', '--out', f'{"x" * 300}.yaml'),
            'xxx.yaml: cannot be written, File name too long',
        ),
    ],
)
def test_bad_input_is_one_clear_message(
    words: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*words) == ExitCode.BAD_INPUT
    (message,) = capsys.readouterr().err.splitlines()
    assert told in message


@pytest.mark.slow
def test_a_truncated_bag_is_named_and_can_be_mended(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'run'
    run('run', tiny, '--no-ros', '--out', out)
    (bag,) = (out / 'bag').glob('*.mcap')
    bag.write_bytes(bag.read_bytes()[:-2000])
    (out / 'bag' / 'metadata.yaml').unlink()
    assert run('report', out / 'bag', '--out', tmp_path / 'again') == ExitCode.BAD_INPUT
    assert 'recover' in capsys.readouterr().err
    assert run('recover', out / 'bag', '--out', tmp_path / 'mended') == ExitCode.OK
    run('report', tmp_path / 'mended', '--out', tmp_path / 'again')
    summary = json.loads((tmp_path / 'again' / 'summary.json').read_text())
    assert summary['scenario'] == 'tiny'


def test_rate_is_checked(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run('run', '--rate', 'warp')
    assert ended.value.code == ExitCode.BAD_INPUT
    assert 'warp' in capsys.readouterr().err


@pytest.mark.parametrize(
    'command', ['run', 'campaign', 'report', 'recover', 'bench', 'check', 'generate', 'list']
)
def test_every_command_has_help_with_an_example(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        run(command, '--help')
    assert ended.value.code == 0
    assert f'example: python3 orchestrate.py {command}' in capsys.readouterr().out


def test_help_names_the_benchmarks_that_are_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run('bench', '--help')
    told = ' '.join(capsys.readouterr().out.split())
    assert 'guarantee, planners (default: all but week, ties, guarantee, planners)' in told


def test_scenarios_are_all_drawn_or_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    last = tmp_path / 'generated_3.yaml'
    last.touch()
    words = ('generate', '--seed', 1, '--count', 3, '--out', tmp_path)
    assert run(*words) == ExitCode.BAD_INPUT
    (message,) = capsys.readouterr().err.splitlines()
    assert message == f'--out {last}: exists already; name another, or add --force'
    assert list(tmp_path.iterdir()) == [last]
    assert run(*words, '--force') == ExitCode.OK
    assert len(list(tmp_path.iterdir())) == 3
    assert last.read_text()


def test_check_writes_parameters_for_nodes_started_by_hand(tiny: Path, tmp_path: Path) -> None:
    params = tmp_path / 'params.yaml'
    assert run('check', tiny, '--params', params) == ExitCode.OK
    text = params.read_text()
    for node in ('/auv_1/auv', '/uav/uav', '/c3/c3', '/world/world', '/recorder/recorder'):
        assert f'{node}:\n  ros__parameters:' in text


def test_list_names_what_a_scenario_can_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert run('list') == ExitCode.OK
    told = capsys.readouterr().out
    for name in ('ecc2009', 'fleet_8', 'minimal', 'kinematic', 'topics'):
        assert name in told


def test_without_a_command_it_flies(tmp_path: Path) -> None:
    out = tmp_path / 'run'
    command = [sys.executable, '-m', 'c3_station', '--no-ros', '--no-bag', '--out', str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == ExitCode.OK, done.stdout + done.stderr
    assert json.loads((out / 'summary.json').read_text())['explored_s'] == 457.0
