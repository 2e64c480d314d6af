"""``orchestrate.py command`` on missions that are flown over real processes, and where none is."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from orchestrated_run import Run

from c3_station.cli import main
from c3_station.exit_codes import ExitCode
from c3_station.mission_record import MissionRecord, read_mission
from c3_station.operator_words import silence
from c3_station.run_folder import RunFolder
from msgs_json.key_file import new_key, write_key
from msgs_json.messages import (
    CommandTaken,
    DirectiveTaken,
    EndMission,
    Event,
    Pause,
    Recall,
    RecoveryReason,
    Resume,
    StayedUp,
)

TAKEN = 'taken; the UAV hears of it when it is in range of C3'


def command(out: Path, *words: str) -> tuple[int, str]:
    """Return exit code and output, on one line."""
    done = subprocess.run(
        [sys.executable, '-m', 'c3_station', 'command', str(out), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=60.0,
        check=False,
    )
    return done.returncode, ' '.join(done.stdout.split())


def ended(run: Run) -> MissionRecord:
    """Return what was recorded; a region that is not explored does not pass, and that is all."""
    code, output = run.end()
    assert code == ExitCode.FAILED
    assert 'not passed: explored_s has no value' in output
    assert 'Traceback' not in output
    record = read_mission(run.out / 'bag')
    assert record.facts.complete
    return record


def events_of(record: MissionRecord, kind: type[Event]) -> list[Event]:
    return [each.event for each in record.events if isinstance(each.event, kind)]


@pytest.mark.ros
def test_the_operator_of_a_running_mission_is_answered_and_obeyed_and_nobody_else(
    tmp_path: Path, runs: list[Run]
) -> None:
    run = Run(tmp_path / 'run', '--rate', '15')
    runs.append(run)
    run.wait_for_flight()
    stranger = tmp_path / 'stranger'
    stranger.mkdir()
    shutil.copy(run.out / 'domain', stranger)
    write_key(stranger / 'key', new_key())
    code, output = command(stranger, 'abort')
    assert code == ExitCode.FAILED
    assert output == silence(RunFolder(stranger), 10.0)
    assert command(run.out, 'recall', 'auv_2') == (ExitCode.OK, TAKEN)
    assert command(run.out, 'pause') == (ExitCode.OK, TAKEN)
    code, output = command(run.out, 'recall', 'auv_9')
    assert code == ExitCode.FAILED
    assert output == 'refused: auv_9: no such AUV; allowed: auv_1, auv_2, auv_3'
    assert command(run.out, 'resume') == (ExitCode.OK, TAKEN)
    assert command(run.out, 'end') == (ExitCode.OK, TAKEN)
    record = ended(run)
    told = [
        each.command for each in events_of(record, CommandTaken) if isinstance(each, CommandTaken)
    ]
    # What was not answered within a second is said again, and C3 says again that it took it.
    assert list(dict.fromkeys(told)) == [
        Recall(auvs=('auv_2',)),
        Pause(),
        Resume(),
        EndMission(),
    ]
    last = events_of(record, DirectiveTaken)[-1]
    assert isinstance(last, DirectiveTaken)
    assert last.directive.recalled == ('auv_1', 'auv_2', 'auv_3')
    reasons = [each.reason for each in events_of(record, StayedUp) if isinstance(each, StayedUp)]
    assert reasons == [RecoveryReason.RECALLED] * 3
    assert record.summary.samples_delivered == record.summary.samples_collected
    (refused,) = record.summary.refusals
    assert (refused.node, refused.reason) == ('c3', 'auth')
    assert command(run.out, 'pause') == (
        ExitCode.BAD_INPUT,
        f'{run.out}: no mission is being flown there on ROS nodes',
    )


@pytest.mark.parametrize(
    ('words', 'problem'),
    [
        (
            ['stop'],
            "'stop' is no command; allowed: recall [AUV ...] | pause | resume | limit SECONDS |"
            ' region [[COL,ROW],...] | end | abort | reset',
        ),
        (['limit', 'long'], "limit is 'long'; allowed: a number of seconds"),
        (['region', '[[1,2]'], "region is '[[1,2]'; allowed: [[COL,ROW],...]"),
        (['pause'], '{out}: no mission is being flown there on ROS nodes'),
    ],
    ids=['word', 'number', 'cells', 'mission'],
)
def test_what_is_no_command_or_no_mission_is_said_at_once(
    tmp_path: Path, words: list[str], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['command', str(tmp_path), *words]) == ExitCode.BAD_INPUT
    assert ' '.join(capsys.readouterr().err.split()) == problem.format(out=tmp_path)
