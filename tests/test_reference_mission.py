"""
The mission of ECC 2009, flown in one process: the paper's figures, and an independent trace.

The paper: P. B. Sujit, J. Sousa, F. L. Pereira, "Coordination strategies between UAV and AUVs for
ocean exploration", European Control Conference 2009. It prints the first sortie and the figures
of the whole mission; the trace (``data/ecc2009_trace.json``) is another program's mission.
"""

from __future__ import annotations

import functools
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from c3_station.in_process import fly, in_memory
from c3_station.scenario_files import load_scenario
from c3_station.summary import MeetingSummary, Summarizer, Summary
from msgs_json.agent_shell import Frame
from msgs_json.geometry import Cell
from msgs_json.ros_messages import to_cdr

TRACE: dict[str, Any] = json.loads(
    (Path(__file__).parent / 'data' / 'ecc2009_trace.json').read_text()
)


@functools.cache
def summary() -> Summary:
    summarizer = Summarizer()
    fly(load_scenario('ecc2009'), summarizer.frame)
    return summarizer.summary()


def meetings() -> list[tuple[int, MeetingSummary]]:
    """Return every meeting of the mission with the number of its sortie."""
    return [(sortie.index, met) for sortie in summary().sorties for met in sortie.meetings]


def turns(path: tuple[Cell, ...]) -> int:
    moves = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(path)]
    return sum(before != after for before, after in pairwise(moves))


# --- the paper -----------------------------------------------------------------------------------


def test_first_sortie_is_the_papers() -> None:
    first = summary().sorties[0]
    assert [(met.auv, met.time_s) for met in first.meetings] == [
        # A1 surfaces at 10 s; the UAV, on its way since 0 s, has it in range at 14 s.
        ('auv_1', 14.0),
        ('auv_2', 20.0),
        ('auv_3', 33.0),
    ]
    assert first.departed_s == 0.0  # S_1 = 10 s is too near to wait for: at once
    assert first.returned_s == 44.0  # the whole sortie takes 44 s in the paper too


def test_first_paths_have_the_papers_shapes() -> None:
    first, second, third = (met.path for met in summary().sorties[0].meetings)
    assert [len(path) - 1 for path in (first, second, third)] == [6, 6, 6]  # q = 6
    assert turns(first) == 0  # "A1 straight", southwards: (4,7) to (4,1)
    assert (first[0], first[-1]) == ((4, 7), (4, 1))
    assert turns(second) == 0  # "A2 straight", eastwards along the northern edge
    assert (second[0], second[-1]) == ((3, 9), (9, 9))
    assert turns(third) == 1  # "A3 takes one turn": east, then north
    assert (third[0], third[-1]) == ((1, 1), (3, 5))


def test_figures_of_the_mission() -> None:
    figures = summary()
    # The paper: 456 s. The trace: 458 s; one tick less here, see below.
    assert figures.explored_s == 457.0
    # The paper: "the sortie time constraint was not violated", L = 60 s.
    assert figures.sortie_limit_violations == 0
    durations_s = [sortie.duration_s for sortie in figures.sorties]
    # The longest is the seventh; the trace's longest is 59 s as well.
    assert durations_s == [44.0, 49.0, 58.0, 56.0, 48.0, 56.0, 59.0, 55.0, 41.0]
    # The paper: 20, 39 and 33 s. The trace: 6, 27 and 38 s, each with its own start cells.
    # Here 1 or 2 s less than the trace: A1 is met as soon as it surfaces within R of C3.
    assert figures.neglect_s == {'auv_1': 4.0, 'auv_2': 26.0, 'auv_3': 37.0}
    # (4 + 26 + 37) / 457. The paper: 20 % of 460 s.
    assert figures.neglect_fraction == pytest.approx(67 / 457)
    # 94 cells after the initial paths, three AUVs that are met at 10, 17 and 21 s at the earliest:
    # 32, 31 and 31 cells, 10 s each, the last two at 327 and 331 s.
    assert figures.lower_bound_s == 331.0


def test_figures_that_the_paper_does_not_have() -> None:
    figures = summary()
    # 100 cells; the 130 moves up to 457 s enter 97 of them for the first time.
    assert (figures.cells_total, figures.cells_explored) == (100, 100)
    assert (figures.moves_total, figures.revisits) == (130, 33)
    # Three start cells and 141 moves in all; the AUVs finish the legs that they are on.
    assert (figures.samples_collected, figures.samples_delivered) == (144, 144)
    # The ninth sortie tells A1 and A2 to stay up, and brings the last samples home.
    assert (figures.delivered_s, figures.mission_s) == (530.0, 530.0)
    # lambda at the first meetings; the paper's 24.2, 27.4 and 32.14 s depend on figures it lacks.
    assert [met.slack_s for met in figures.sorties[0].meetings] == [17.0, 29.0, 5.0]
    # No shorter path was ever needed, and none was out of reach.
    assert {met.plan_status for _, met in meetings() if met.path} == {'ok'}
    assert figures.refusals == ()
    assert figures.radio is not None
    # Nothing but distance ever blocks an honest mission: nobody talks under water.
    assert {reason for reason, count in figures.radio.blocked.items() if count} == {'range'}


# --- the trace -----------------------------------------------------------------------------------

# Where our time differs from the trace's, seconds. In sortie 2 A1 surfaces at 74 s within R of C3,
# where the UAV still waits. A contact is when they can hear each other, so it is met there and
# then; the prototype lets it wait for the departure at 75 s. All later meetings keep this second.
# In sortie 8 the same happens once more.
SAME = 0.0
SINCE_SORTIE_2 = -1.0
ONCE_MORE = -2.0


def test_every_meeting_is_the_traces_but_for_a_second_that_is_explained() -> None:
    with_path = [(sortie, met) for sortie, met in meetings() if met.path]
    assert len(with_path) == len(TRACE['meetings']) == 23
    for (sortie, met), traced in zip(with_path, TRACE['meetings'], strict=True):
        assert (sortie, met.auv) == (traced['sortie'], f'auv_{traced["auv"]}')
        assert [list(cell) for cell in met.path] == traced['path']
        expected_s = SAME if sortie == 1 else SINCE_SORTIE_2
        if (sortie, met.auv) == (8, 'auv_1'):
            expected_s = ONCE_MORE
        assert met.time_s - traced['time_s'] == expected_s


def test_every_return_is_the_traces_but_for_that_second() -> None:
    returned_s = [sortie.returned_s for sortie in summary().sorties[: len(TRACE['back_at_c3_s'])]]
    assert returned_s == [
        traced_s + (SAME if index == 0 else SINCE_SORTIE_2)
        for index, traced_s in enumerate(TRACE['back_at_c3_s'])
    ]


def test_the_trace_is_explored_and_neglects_later_by_those_seconds() -> None:
    figures = summary()
    assert figures.explored_s == TRACE['explored_s'] + SINCE_SORTIE_2
    more_s = [
        traced_s - ours_s
        for traced_s, ours_s in zip(TRACE['neglect_s'], figures.neglect_s.values(), strict=True)
    ]
    # A1's two seconds within R of C3. A2 and A3 already lie at the surface in sortie 2, and are
    # met one second earlier.
    assert more_s == [2.0, 1.0, 1.0]


# --- again ---------------------------------------------------------------------------------------


def test_twice_the_same_mission_is_the_same_to_the_byte() -> None:
    assert recording() == recording()


def recording() -> list[tuple[str, str, bytes]]:
    """Fly the mission; return every message that was published, as a bag would hold it."""
    found: list[tuple[str, str, bytes]] = []

    def record(name: str, frame: Frame) -> None:
        found.append((name, frame.topic.name, to_cdr(frame.message)))

    fly(load_scenario('ecc2009'), record, make_setting=in_memory(key=bytes(32)))
    return found
