"""The operator's desk, and a UAV that takes what it can fly, on a radio that loses and repeats."""

from __future__ import annotations

import hypothesis.strategies as st
import msgspec
import pytest
from hypothesis import given
from msgspec.structs import replace

from c3_station.operator_desk import DeskMemory, OperatorDesk
from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, Sortie, Uav
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import (
    Abort,
    ChangeLimit,
    ChangeRegion,
    Directive,
    DirectiveRefused,
    EndMission,
    OperatorCommand,
    Pause,
    Recall,
    Reset,
    Resume,
)

LAND = ((2, 1), (0, 0))
SCENARIO = Scenario(
    name='pond',
    description='two AUVs, six cells',
    region=GridSpec(cols=3, rows=3, cell_m=10.0, masked=LAND),
    c3=Point(east_m=0.0, north_m=-5.0),
    uav=Uav(speed_mps=5.0),
    auvs=(
        Auv(name='auv_1', initial_path=((1, 0), (2, 0))),
        Auv(name='auv_2', initial_path=((0, 1), (1, 1))),
    ),
    radio=Radio(range_m=12.0),
    sortie=Sortie(limit_s=40.0),
    planner=PlannerChoice(name='ecc2009', path_cells=3),
    max_mission_s=500.0,
)
BOTH = ('auv_1', 'auv_2')
ORDERED = Directive(
    revision=0, paused=False, aborted=False, recalled=(), sortie_limit_s=40.0, masked=LAND
)


def told(*commands: OperatorCommand) -> OperatorDesk:
    desk = OperatorDesk(SCENARIO)
    for command in commands:
        assert desk.take(command) is None
    return desk


def refusal(revision: int, **instead: object) -> DirectiveRefused:
    kept = DirectiveRefused(revision=revision, problem='no', sortie_limit_s=40.0, masked=LAND)
    return replace(kept, **instead)


# --- commands ------------------------------------------------------------------------------------


def test_without_a_command_what_is_wanted_is_what_was_ordered() -> None:
    desk = told()
    assert desk.wanted == desk.taken == ORDERED
    assert desk.is_settled
    assert not desk.is_all_recalled
    assert desk.taken_out == frozenset()


@pytest.mark.parametrize(
    ('commands', 'wanted'),
    [
        ([Pause()], {'paused': True}),
        ([Pause(), Resume()], {'revision': 2}),
        ([Abort()], {'aborted': True}),
        ([Abort(), Reset()], {'revision': 2}),
        ([Abort(), Pause(), Reset()], {'revision': 3, 'paused': True}),
        ([Abort(), Recall()], {'revision': 2, 'aborted': True, 'recalled': BOTH}),
        ([Abort(), Reset(), EndMission()], {'revision': 3, 'recalled': BOTH}),
        ([Pause(), EndMission()], {'revision': 2, 'recalled': BOTH}),
        ([Recall()], {'recalled': BOTH}),
        ([Recall(auvs=('auv_2',))], {'recalled': ('auv_2',)}),
        ([Recall(auvs=('auv_2',)), Recall(auvs=('auv_1',))], {'revision': 2, 'recalled': BOTH}),
        ([ChangeLimit(sortie_limit_s=60.0)], {'sortie_limit_s': 60.0}),
        ([ChangeRegion(masked=((0, 2),))], {'masked': (*LAND, (0, 2))}),
        ([ChangeRegion(masked=((0, 2), (2, 1)))], {'masked': (*LAND, (0, 2))}),
        ([ChangeRegion(masked=((0, 2),)), ChangeRegion(masked=())], {'revision': 2}),
    ],
)  # fmt: skip
def test_commands_add_up_to_one_directive(
    commands: list[OperatorCommand], wanted: dict[str, object]
) -> None:
    desk = told(*commands)
    assert desk.wanted == replace(ORDERED, **{'revision': 1, **wanted})
    assert desk.taken == ORDERED
    assert not desk.is_settled


@pytest.mark.parametrize(
    'command',
    [
        Resume(),
        Reset(),
        ChangeLimit(sortie_limit_s=40.0),
        ChangeRegion(masked=()),
        ChangeRegion(masked=((0, 0),)),
    ],
    ids=repr,
)
def test_what_is_so_already_makes_no_new_directive(command: OperatorCommand) -> None:
    assert told(command).wanted == ORDERED


def test_what_is_said_twice_counts_once() -> None:
    assert told(Pause(), Pause(), Pause()).wanted.revision == 1


@pytest.mark.parametrize(
    ('before', 'command', 'problem'),
    [
        (
            (),
            Recall(auvs=('auv_1', 'auv_7', 'auv_3')),
            'auv_3, auv_7: no such AUV; allowed: auv_1, auv_2',
        ),
        ((Abort(),), Resume(), 'the mission is aborted, and stays so until a reset'),
        ((Abort(),), EndMission(), 'the mission is aborted, and stays so until a reset'),
        (
            (),
            ChangeRegion(masked=((1, 1), (3, 0))),
            'masked[1] is [3, 0], outside the grid; allowed: columns 0 to 2, rows 0 to 2',
        ),
        (
            (),
            ChangeRegion(masked=((1, 1), (1, 1))),
            'masked[1] is [1, 1], which is masked already; allowed: each cell once',
        ),
    ],
    ids=['recall', 'resume', 'end', 'outside', 'twice'],
)
def test_a_command_that_makes_no_sense_changes_nothing(
    before: tuple[OperatorCommand, ...], command: OperatorCommand, problem: str
) -> None:
    desk = told(*before)
    memory = desk.memory()
    assert desk.take(command) == problem
    assert desk.memory() == memory


def test_cells_taken_out_are_those_that_were_not_masked_in_the_order() -> None:
    assert told(ChangeRegion(masked=((0, 0), (0, 2)))).taken_out == {(0, 2)}


FAR: Cell = (2, 2)
"""Its centre is 39.1 m from C3, 27.1 m of them to be flown at 5 m/s: 6 s there and 6 s back."""
BEYOND = (
    'sortie_limit_s is 11; allowed: at least 12, or no sortie could go to 1 of the cells and be'
    ' back in time: [2, 2]; or take them out of the region first'
)
GUARANTEED = replace(SCENARIO, planner=PlannerChoice(name='robust', path_cells=3))


def test_a_limit_that_leaves_cells_out_of_reach_is_refused() -> None:
    desk = OperatorDesk(GUARANTEED)
    assert desk.take(ChangeLimit(sortie_limit_s=12.0)) is None
    assert desk.take(ChangeLimit(sortie_limit_s=11.0)) == BEYOND
    assert desk.wanted == replace(ORDERED, revision=1, sortie_limit_s=12.0)


def test_cells_out_of_reach_do_not_matter_once_they_are_surveyed() -> None:
    desk = OperatorDesk(GUARANTEED)
    assert desk.take(ChangeLimit(sortie_limit_s=11.0), {FAR}) is None


def test_cells_out_of_reach_may_be_taken_out_and_do_not_come_back() -> None:
    desk = OperatorDesk(GUARANTEED)
    assert desk.take(ChangeRegion(masked=(FAR,))) is None
    assert desk.take(ChangeLimit(sortie_limit_s=11.0)) is None
    assert desk.take(ChangeRegion(masked=())) == BEYOND
    assert desk.take(Abort()) is None
    assert desk.wanted.sortie_limit_s == 11.0


def test_a_planner_that_guarantees_no_limit_goes_everywhere() -> None:
    assert told(ChangeLimit(sortie_limit_s=5.0)).wanted.sortie_limit_s == 5.0


# --- what the UAV says ---------------------------------------------------------------------------


def test_an_answer_to_an_older_directive_settles_nothing() -> None:
    desk = told(Pause(), Resume())
    desk.acknowledged(1)
    assert not desk.refused(refusal(1))
    assert not desk.is_settled
    desk.acknowledged(2)
    assert desk.is_settled


def test_by_what_the_uav_flies_instead_is_wanted_from_then_on() -> None:
    desk = told(ChangeLimit(sortie_limit_s=5.0), ChangeRegion(masked=((0, 2),)), Pause())
    assert desk.refused(refusal(3, masked=(*LAND, (0, 2))))
    flown = replace(ORDERED, revision=3, paused=True, masked=(*LAND, (0, 2)))
    assert desk.wanted == desk.taken == flown
    assert desk.is_settled


def test_a_refusal_counts_once() -> None:
    desk = told(ChangeLimit(sortie_limit_s=5.0))
    assert desk.refused(refusal(1))
    memory = desk.memory()
    assert not desk.refused(refusal(1))
    assert desk.memory() == memory


def test_a_refusal_takes_nothing_back_but_limit_and_region() -> None:
    desk = told(Abort(), Recall(), Pause(), ChangeLimit(sortie_limit_s=5.0))
    desk.refused(refusal(4))
    assert desk.wanted == replace(ORDERED, revision=4, paused=True, aborted=True, recalled=BOTH)


# --- any commands, any radio, any restarts -------------------------------------------------------


class FlyingBy:
    """A UAV that takes every directive, but for limits below 30 s and regions without [1, 2]."""

    def __init__(self) -> None:
        self.flown = ORDERED
        self._answer: DirectiveRefused | int = 0

    def hear(self, directive: Directive) -> DirectiveRefused | int | None:
        """Return a refusal, or the revision of the directive that it has taken."""
        if directive.revision < self.flown.revision:
            return None
        if directive.revision > self.flown.revision:
            before = self.flown
            self.flown = directive
            if not self.can_fly_by_limit(directive):
                self.flown = replace(self.flown, sortie_limit_s=before.sortie_limit_s)
            if not self.can_fly_by_region(directive):
                self.flown = replace(self.flown, masked=before.masked)
            self._answer = directive.revision
            if self.flown != directive:
                self._answer = refusal(
                    directive.revision,
                    sortie_limit_s=self.flown.sortie_limit_s,
                    masked=self.flown.masked,
                )
        return self._answer

    @staticmethod
    def can_fly_by_limit(directive: Directive) -> bool:
        return directive.sortie_limit_s >= 30.0

    @staticmethod
    def can_fly_by_region(directive: Directive) -> bool:
        return (1, 2) not in directive.masked


def answered(desk: OperatorDesk, answer: DirectiveRefused | int | None) -> None:
    match answer:
        case DirectiveRefused():
            desk.refused(answer)
        case int():
            desk.acknowledged(answer)


def another_process(desk: OperatorDesk) -> OperatorDesk:
    memory = msgspec.msgpack.decode(msgspec.msgpack.encode(desk.memory()), type=DeskMemory)
    return OperatorDesk(SCENARIO, memory)


commands = st.sampled_from(
    [Pause(), Resume(), Abort(), Reset(), EndMission(), Recall(), Recall(auvs=('auv_2',))]
)
limits = st.builds(ChangeLimit, sortie_limit_s=st.sampled_from([5.0, 30.0, 40.0, 50.0]))
regions = st.builds(ChangeRegion, masked=st.sampled_from([(), ((0, 2),), ((1, 2),)]))
steps = st.lists(
    commands
    | limits
    | regions
    | st.sampled_from(
        ['the UAV hears', 'C3 hears', 'C3 restarts', 'a late copy', 'a late answer']
    ),
    max_size=30,
)


@given(steps=steps, data=st.data())
def test_what_the_uav_flies_by_is_what_was_wanted_last_and_could_be_flown(
    steps: list[OperatorCommand | str], data: st.DataObject
) -> None:
    desk, uav = OperatorDesk(SCENARIO), FlyingBy()
    said: list[Directive] = [desk.wanted]
    answers: list[DirectiveRefused | int | None] = [None]
    aborted = paused = False
    recalled: set[str] = set()
    for step in steps:
        match step:
            case 'the UAV hears':
                said.append(desk.wanted)
                answers.append(uav.hear(desk.wanted))
            case 'C3 hears':
                answered(desk, answers[-1])
            case 'a late copy':
                answers.append(uav.hear(data.draw(st.sampled_from(said))))
            case 'a late answer':
                answered(desk, data.draw(st.sampled_from(answers)))
            case 'C3 restarts':
                desk = another_process(desk)
            case Abort():
                aborted = True
            case Reset():
                aborted = False
            case Pause():
                paused = True
            case Resume() if not aborted:
                paused = False
            case EndMission() if not aborted:
                paused, recalled = False, {'auv_1', 'auv_2'}
            case Recall(auvs=auvs):
                recalled |= {*auvs} or {'auv_1', 'auv_2'}
        if not isinstance(step, str):
            desk.take(step)
        # Neither a refusal nor a late answer nor another process changes these.
        assert (desk.wanted.aborted, desk.wanted.paused) == (aborted, paused)
        assert {*desk.wanted.recalled} == recalled
        # Of an older one C3 may not know yet that it was taken.
        assert desk.taken.revision <= uav.flown.revision <= desk.wanted.revision
        if desk.is_settled:
            assert desk.wanted == desk.taken == uav.flown
        assert uav.can_fly_by_limit(uav.flown)
        assert uav.can_fly_by_region(uav.flown)
    last = desk.wanted
    answered(desk, uav.hear(desk.wanted))
    assert desk.is_settled
    assert desk.wanted == desk.taken == uav.flown
    if uav.can_fly_by_limit(last):
        assert uav.flown.sortie_limit_s == last.sortie_limit_s
    if uav.can_fly_by_region(last):
        assert uav.flown.masked == last.masked
