"""Commands as words: what is written for one is read as that one."""

from __future__ import annotations

from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given
from msgspec.structs import replace

from c3_station.operator_words import parse_command, silence, wishes, words_of
from c3_station.run_folder import RunFolder
from c3_station.scenario_files import load_scenario
from msgs_json.messages import (
    Abort,
    ChangeLimit,
    ChangeRegion,
    Directive,
    EndMission,
    OperatorCommand,
    Pause,
    Recall,
    Reset,
    Resume,
)

SCENARIO = load_scenario('harbour')
ORDERED = Directive(
    revision=0,
    paused=False,
    aborted=False,
    recalled=(),
    sortie_limit_s=SCENARIO.sortie.limit_s,
    masked=SCENARIO.region.masked,
)
cells = st.tuples(st.integers(0, 50), st.integers(0, 50))
commands = (
    st.sampled_from([Pause(), Resume(), EndMission(), Abort(), Reset(), Recall()])
    | st.builds(Recall, auvs=st.lists(st.sampled_from(['auv_1', 'auv_2']), max_size=2).map(tuple))
    | st.builds(ChangeLimit, sortie_limit_s=st.integers(1, 99_999).map(float))
    | st.builds(ChangeRegion, masked=st.lists(cells, max_size=3).map(tuple))
)


def test_an_operator_who_is_not_answered_is_told_what_to_check() -> None:
    folder = RunFolder(Path('runs/ecc2009'))
    told = silence(folder, 10.0)
    assert told.startswith('runs/ecc2009: its C3 does not answer within 10 s. Check that ')
    for checked in ('still being flown', str(folder.key), 'clock', 'replay', 'log'):
        assert checked in told


@given(commands)
def test_what_is_written_for_a_command_is_read_as_that_one(command: OperatorCommand) -> None:
    assert parse_command(words_of(command).split()) == command


@pytest.mark.parametrize(
    ('words', 'problem'),
    [
        ('', r"^'' is no command; allowed: recall \[AUV ...\] \| pause"),
        ('stop', "^'stop' is no command"),
        ('pause now', "^'pause now' is no command"),
        ('limit', "^'limit' is no command"),
        ('limit long', "^limit is 'long'; allowed: a number of seconds"),
        ('limit 0', 'Expected `float` > 0.0'),
        ('limit nan', 'sortie_limit_s'),
        ('region [[1,2]', r"^region is '\[\[1,2\]'; allowed: \[\[COL,ROW\],...\]"),
        ('region [[1,-2]]', r'`\$.masked\[0\]\[1\]`'),
        ('recall ../auv', r'`\$.auvs\[0\]`'),
    ],
)
def test_what_is_no_command_is_said_so(words: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        parse_command(words.split())


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({}, 'as ordered'),
        ({'aborted': True, 'paused': True}, 'aborted, paused'),
        ({'recalled': ('auv_1', 'auv_2')}, 'auv_1, auv_2 recalled'),
        ({'sortie_limit_s': 12.5}, 'limit 12.5 s'),
        ({'masked': (*SCENARIO.region.masked, (9, 9))}, '1 cell taken out'),
        ({'masked': (*SCENARIO.region.masked, (9, 9), (9, 8))}, '2 cells taken out'),
    ],
)
def test_what_differs_from_the_order_is_told(changes: dict[str, object], words: str) -> None:
    assert wishes(replace(ORDERED, **changes), SCENARIO) == words
