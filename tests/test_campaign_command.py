"""Campaigns from the command line: what is stored, what survives, what comes out again."""

import os
import re
import shlex
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import msgspec
import pytest
from patience import PATIENCE_S, wait_until

import c3_station
from c3_station.campaign_mission import MissionResult
from c3_station.campaign_store import STORE, CampaignStore
from c3_station.cli import main
from c3_station.exit_codes import ExitCode


def run(*words: object) -> int:
    return main(['campaign', *(str(word) for word in words)])


def rows(out: Path) -> list[MissionResult]:
    """Return all results but what differs between two flights of the same mission."""
    with CampaignStore(out) as store:
        return [msgspec.structs.replace(result, wall_s=0.0) for result in store.results()]


def change(out: Path, statement: str) -> None:
    with closing(sqlite3.connect(out / STORE)) as database, database:
        database.execute(statement)


# --- what is flown -------------------------------------------------------------------------------


def test_a_campaign_leaves_its_results_a_table_and_a_report(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'out'
    planners = ('--planner', 'ecc2009,robust')
    vary = ('--vary', 'surfacing=early_50,slow', 'sortie.limit_s=40,60')
    assert run(tiny, '--missions', 2, *planners, *vary, '--jobs', 1, '--out', out) == ExitCode.OK
    with CampaignStore(out) as store:
        assert len(store.results()) == store.campaign.missions_total == 2 * 2 * 4
        assert store.missing() == []
    told = capsys.readouterr().out
    assert '16 missions in 0:00:' in told
    assert 'surfacing=early_50 sortie.limit_s=40' in told
    assert f'report: {out}/report.html' in told
    assert 'Shearwater campaign report' in (out / 'report.html').read_text()


@pytest.mark.slow
def test_the_number_of_jobs_changes_nothing(tiny: Path, tmp_path: Path) -> None:
    for jobs in (1, 2, 3):
        words = ('--missions', 12, '--seed', 5, '--vary', 'surfacing=early_50,mixed')
        assert run(tiny, *words, '--jobs', jobs, '--out', tmp_path / str(jobs)) == ExitCode.OK
    first = rows(tmp_path / '1')
    assert len(first) == 24
    assert rows(tmp_path / '2') == rows(tmp_path / '3') == first


@pytest.mark.slow
def test_the_line_of_a_mission_flies_it_again(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, again = tmp_path / 'out', tmp_path / 'again'
    vary = ('--vary', 'auvs.surfacing={model: early, probability: 0.9},{model: slow}')
    run('ecc2009', '--missions', 3, *vary, '--planner', 'ecc2009', '--jobs', 2, '--out', out)
    capsys.readouterr()
    assert run('--mission', out, 3) == ExitCode.OK
    with_ros, without_ros = capsys.readouterr().out.splitlines()
    assert without_ros == f'{with_ros} --no-ros'
    words = shlex.split(without_ros)
    assert words[:2] == ['python3', 'orchestrate.py']
    assert words[words.index('--set') + 1] == 'auvs.surfacing={model: early, probability: 0.9}'
    main([*words[2:], '--no-bag', '--out', str(again)])
    summary = msgspec.json.decode((again / 'summary.json').read_bytes())
    figures = msgspec.to_builtins(rows(out)[2])
    assert summary['seed'] == 1
    same = summary.keys() & figures.keys() - {'wall_s', 'restarts'}
    assert len(same) == 14
    assert sum(summary['restarts'].values()) == figures['restarts']
    assert {key: summary[key] for key in same} == {key: figures[key] for key in same}
    assert [sortie['duration_s'] for sortie in summary['sorties']] == [
        duration_s for duration_s, *_ in figures['sortie_times']
    ]


def test_a_scenario_that_has_changed_does_not_pass_for_the_old_one(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(tiny, '--missions', 1, '--jobs', 1, '--out', tmp_path / 'out')
    tiny.write_text(tiny.read_text().replace('range_m: 20.0', 'range_m: 25.0'))
    capsys.readouterr()
    assert run('--mission', tmp_path / 'out', 1) == ExitCode.FAILED
    assert 'has changed since' in capsys.readouterr().out


@pytest.mark.slow
def test_violations_fail_a_campaign_only_if_asked_for(tmp_path: Path) -> None:
    words = ('--missions', 2, '--planner', 'ecc2009', '--vary', 'surfacing=mixed', '--jobs', 1)
    out = ('--out', tmp_path / 'out')
    assert run('ecc2009', *words, *out) == ExitCode.OK
    assert [result.violations > 0 for result in rows(tmp_path / 'out')] == [True, True]
    assert run('--report', tmp_path / 'out') == ExitCode.OK
    assert run('--report', tmp_path / 'out', '--fail-on-violation') == ExitCode.FAILED


@pytest.mark.slow
def test_errors_fail_a_campaign_and_are_shown(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'out'
    run(tiny, '--missions', 3, '--jobs', 1, '--out', out)
    change(out, "update missions set exit = 'error', reason = 'ValueError: x' where number = 2")
    capsys.readouterr()
    assert run('--report', out) == ExitCode.FAILED
    told = capsys.readouterr().out
    assert '1 mission ended in an error, first 2: ValueError: x' in told
    assert f'run {tiny} --planner ecc2009 --seed 1 --no-ros' in told
    assert 'error: ValueError: x' in (out / 'report.html').read_text()


# --- broken off, and gone on ---------------------------------------------------------------------


@pytest.mark.slow
def test_what_is_flown_is_not_flown_again(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'out'
    words = (tiny, '--missions', 6, '--jobs', 1, '--out', out)
    run(*words)
    whole = rows(out)
    change(out, 'delete from missions where number in (2, 5)')
    change(out, 'update missions set wall_s = 99')
    capsys.readouterr()
    assert run('--report', out) == ExitCode.FAILED
    assert '2 missions still to be flown' in capsys.readouterr().out
    assert 'Not all is flown yet' in (out / 'report.html').read_text()
    assert run(*words) == ExitCode.OK
    assert '2 missions in' in capsys.readouterr().out
    assert rows(out) == whole
    with CampaignStore(out) as store:
        assert [result.wall_s == 99 for result in store.results()] == [
            number not in (2, 5) for number in range(1, 7)
        ]
    change(out, 'delete from missions where number = 3')
    assert run('--resume', out, '--jobs', 2) == ExitCode.OK
    assert rows(out) == whole
    assert run('--resume', out) == ExitCode.OK  # nothing left: it is told again


def test_another_campaign_does_not_go_into_the_same_folder(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'out'
    run(tiny, '--missions', 2, '--jobs', 1, '--out', out)
    capsys.readouterr()
    assert run(tiny, '--missions', 3, '--out', out) == ExitCode.BAD_INPUT
    message = capsys.readouterr().err
    assert 'holds another campaign: its seeds are 0 to 1; asked for are 0 to 2' in message
    assert len(rows(out)) == 2
    (tmp_path / 'thesis').mkdir()
    (tmp_path / 'thesis' / 'report.html').write_text('mine')
    assert run(tiny, '--out', tmp_path / 'thesis') == ExitCode.BAD_INPUT
    assert (tmp_path / 'thesis' / 'report.html').read_text() == 'mine'


@pytest.mark.slow
def test_results_of_two_kinds_of_code_are_not_mixed(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / 'out'
    run(tiny, '--missions', 2, '--jobs', 1, '--out', out)
    monkeypatch.setattr('c3_station.software.code_digest', lambda: 'another')
    assert run('--resume', out) == ExitCode.OK  # it is complete
    change(out, 'delete from missions where number = 2')
    capsys.readouterr()
    assert run('--resume', out) == ExitCode.BAD_INPUT
    assert 'code another; results of both are not mixed' in capsys.readouterr().err


# --- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('words', 'told'),
    [
        ((), 'no scenario is named'),
        (('ecc2008',), 'did you mean ecc2009?'),
        (('ecc2009', '--planner', 'magic'), "unknown planner 'magic'"),
        (('ecc2009', '--planner', 'ecc2009,'), "unknown planner ''"),
        (('ecc2009', '--vary', 'sortie.limit=5'), 'did you mean limit_s?'),
        (('ecc2009', '--vary', 'surfacing=slw'), 'did you mean slow?'),
        (('ecc2009', '--vary', 'sortie.limit_s'), 'allowed: KEY=VALUE'),
        (('ecc2009', '--jobs', 2, '--dask', 'tcp://x:1'), '--jobs and --dask exclude each other'),
        (('--resume', 'no/such/folder'), 'no/such/folder: holds no campaign'),
        (('--report', 'no/such/folder'), 'no/such/folder: holds no campaign'),
        (('--mission', 'no/such/folder', 1), 'no/such/folder: holds no campaign'),
        (('ecc2009', '--resume', 'x', '--missions', 3), 'scenarios, missions cannot be chosen'),
        (('ecc2009', '--out', '/proc/nowhere'), '--out /proc/nowhere: cannot be made'),
    ],
)
def test_bad_input_is_one_clear_message(
    words: tuple[object, ...], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*words) == ExitCode.BAD_INPUT
    (message,) = capsys.readouterr().err.splitlines()
    assert told in message


def test_a_mission_that_is_not_there_is_refused(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(tiny, '--missions', 2, '--jobs', 1, '--out', tmp_path / 'out')
    for number in ('0', '3', '1.5', 'two'):
        assert run('--mission', tmp_path / 'out', number) == ExitCode.BAD_INPUT
        assert 'allowed: 1 to 2' in capsys.readouterr().err


@pytest.mark.parametrize('count', ['0', '-3', 'many', '1e3'])
def test_counts_are_checked(count: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run('ecc2009', f'--missions={count}')
    assert ended.value.code == ExitCode.BAD_INPUT
    assert 'must be a whole number 1 ... 1,000,000' in capsys.readouterr().err


# --- processes -----------------------------------------------------------------------------------


@contextmanager
def campaign_process(*words: object) -> Iterator[subprocess.Popen[str]]:
    """Start a campaign as from a terminal, in a group of processes of its own."""
    command = [sys.executable, '-m', 'c3_station', 'campaign', *map(str, words)]
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):  # as a rule they have all ended
                os.killpg(process.pid, signal.SIGKILL)


def flown(out: Path) -> int:
    if not (out / STORE).exists():
        return 0
    with closing(sqlite3.connect(out / STORE)) as database:
        (count,) = database.execute('select count(*) from missions').fetchone()
    return int(count)


def members(group: int) -> dict[int, str]:
    """Return the processes of a group that live, with their command lines."""
    found = {}
    for folder in Path('/proc').iterdir():
        if folder.name.isdecimal():
            try:
                state, _, group_id = (folder / 'stat').read_text().rpartition(')')[2].split()[:3]
                command = (folder / 'cmdline').read_text()
            except (FileNotFoundError, ProcessLookupError):
                continue  # it has just ended
            if int(group_id) == group and state != 'Z':
                found[int(folder.name)] = command
    return found


def workers(group: int) -> list[int]:
    """Return the workers: what the fork server has forked, not itself (the eldest)."""
    servers = [pid for pid, command in members(group).items() if 'forkserver' in command]
    return sorted(servers)[1:]


LONG = ('--missions', 300, '--jobs', 2)


@pytest.mark.slow
def test_a_campaign_that_is_killed_goes_on_where_it_was(tiny: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    with campaign_process(tiny, *LONG, '--out', out) as process:
        wait_until(lambda: flown(out) > 40)
        assert len(workers(process.pid)) == 2
        process.kill()
        process.wait()
        # The workers notice, and nothing is left of it.
        wait_until(lambda: not members(process.pid))
    before = rows(out)
    assert 40 <= len(before) < 300
    assert run('--resume', out) == ExitCode.OK
    after = rows(out)
    assert [result.number for result in after] == list(range(1, 301))
    known = {result.number: result for result in before}
    assert [result for result in after if result.number in known] == before
    assert run(tiny, *LONG, '--out', tmp_path / 'whole') == ExitCode.OK
    assert rows(tmp_path / 'whole') == after


@pytest.mark.slow
@pytest.mark.parametrize(
    ('kill', 'signum'),
    [(os.killpg, signal.SIGINT), (os.kill, signal.SIGTERM)],  # as a terminal does, and a system
    ids=['ctrl_c', 'sigterm'],
)
def test_who_ends_it_keeps_what_is_flown_and_leaves_nobody_behind(
    tiny: Path, tmp_path: Path, kill: Callable[[int, int], None], signum: int
) -> None:
    out = tmp_path / 'out'
    with campaign_process(tiny, '--missions', 3000, '--jobs', 2, '--out', out) as process:
        wait_until(lambda: flown(out) > 40)
        kill(process.pid, signum)
        told, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == ExitCode.INTERRUPTED
        wait_until(lambda: not members(process.pid))
    assert 'Traceback' not in told
    stored = re.search(r'stopped: ([\d,]+) of 3,000 missions are stored', told)
    assert stored
    assert int(stored[1].replace(',', '')) == flown(out) > 40
    assert f'python3 orchestrate.py campaign --resume {out}' in told


@pytest.mark.slow
def test_ctrl_c_ends_also_missions_that_hang(tiny: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    with campaign_process(tiny, '--missions', 3000, '--jobs', 2, '--out', out) as process:
        wait_until(lambda: flown(out) > 0 and len(workers(process.pid)) == 2)
        for worker in workers(process.pid):
            os.kill(worker, signal.SIGSTOP)
        process.send_signal(signal.SIGINT)
        told, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == ExitCode.INTERRUPTED
        wait_until(lambda: not members(process.pid))
    assert f'stopped: {flown(out)} of 3,000 missions are stored' in told


@pytest.mark.slow
def test_missions_of_a_worker_that_was_killed_are_flown_again(tiny: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    with campaign_process(tiny, *LONG, '--out', out) as process:
        # Once only: a second kill may meet a mission that is flown alone for the first one's sake,
        # and is then that mission's end.
        wait_until(lambda: flown(out) >= 40)
        os.kill(workers(process.pid)[-1], signal.SIGKILL)
        told, _ = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == ExitCode.OK, told
    assert {(result.exit.value, result.reason) for result in rows(out)} == {('complete', None)}
    assert flown(out) == 300


@pytest.mark.slow
def test_two_processes_do_not_fly_the_same_campaign(tiny: Path, tmp_path: Path) -> None:
    out = tmp_path / 'out'
    with campaign_process(tiny, *LONG, '--out', out) as process:
        wait_until(lambda: flown(out) >= 5)
        assert run('--resume', out) == ExitCode.BAD_INPUT
        assert run('--report', out) == ExitCode.FAILED  # to look is allowed; it is not complete
        assert process.poll() is None


# --- Dask ----------------------------------------------------------------------------------------


def test_without_dask_its_option_says_what_to_install(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, 'distributed', None)
    code = run(tiny, '--dask', 'tcp://127.0.0.1:1', '--out', tmp_path / 'out')
    assert code == ExitCode.BAD_INPUT
    message = capsys.readouterr().err
    assert message.startswith('--dask: Dask is not installed')
    assert 'pip install distributed' in message


@pytest.mark.slow
def test_a_dask_cluster_flies_the_same(
    tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from distributed import LocalCluster

    words = (tiny, '--missions', 40, '--vary', 'surfacing=early_50,mixed')
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        assert run(*words, '--dask', address, '--out', tmp_path / 'dask') == ExitCode.OK
    assert run(*words, '--jobs', 2, '--out', tmp_path / 'here') == ExitCode.OK
    assert rows(tmp_path / 'dask') == rows(tmp_path / 'here')
    assert len(rows(tmp_path / 'dask')) == 80


@pytest.mark.slow
def test_a_dask_cluster_that_cannot_be_used_is_named(
    tiny: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from distributed import LocalCluster

    def message(address: str) -> str:
        code = run(tiny, '--dask', address, '--out', tmp_path / 'out')
        assert code == ExitCode.BAD_INPUT
        return capsys.readouterr().err

    monkeypatch.setattr('c3_station.campaign_dask._CONNECT_S', 1)
    assert 'no scheduler answers there' in message('tcp://127.0.0.1:1')
    assert 'no scheduler answers there' in message('nonsense://x')
    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        monkeypatch.setattr('c3_station.campaign_dask.this_software', other_software)
        assert 'has other code' in message(cluster.scheduler_address)
        monkeypatch.undo()
        cluster.scale(0)
        wait_until(lambda: not cluster.workers)
        assert 'the cluster has no workers' in message(cluster.scheduler_address)


def other_software() -> str:
    return f'of {os.getpid()}'


@contextmanager
def dask_worker(address: str, **environment: str) -> Iterator[None]:
    """Let a worker join a cluster, from a shell of its own."""
    command = [sys.executable, '-m', 'distributed.cli.dask_worker', address]
    with subprocess.Popen(
        [*command, '--nthreads', '1', '--no-nanny', '--no-dashboard'],
        env=os.environ | environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            yield
        finally:
            process.kill()


@pytest.mark.slow
def test_a_worker_with_other_code_that_joins_later_ends_the_campaign(
    tiny: Path, tmp_path: Path
) -> None:
    from distributed import LocalCluster

    out, other = tmp_path / 'out', tmp_path / 'other'
    shutil.copytree(Path(c3_station.__file__).parent, other / 'c3_station')
    (other / 'c3_station' / 'new.py').touch()
    path = f'{other}{os.pathsep}{os.environ["PYTHONPATH"]}'
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        campaign_process(
            tiny, '--missions', 3000, '--dask', cluster.scheduler_address, '--out', out
        ) as process,
    ):
        wait_until(lambda: flown(out) > 0)
        with dask_worker(cluster.scheduler_address, PYTHONPATH=path):
            told, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == ExitCode.FAILED
    assert re.search(r'a worker on .* has other code, .*; allowed: ', told)
    assert f'stopped: {flown(out):,} of 3,000 missions are stored' in told


@pytest.mark.slow
def test_a_scheduler_that_goes_away_costs_what_was_in_the_air(tiny: Path, tmp_path: Path) -> None:
    from distributed import LocalCluster

    out = tmp_path / 'out'
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        campaign_process(
            tiny, '--missions', 2000, '--dask', cluster.scheduler_address, '--out', out
        ) as process,
    ):
        wait_until(lambda: flown(out) > 10)
        cluster.close()
        told, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == ExitCode.FAILED
    assert 'the scheduler is gone\nstopped: ' in told
    assert f'python3 orchestrate.py campaign --resume {out}' in told
    assert flown(out) > 10
