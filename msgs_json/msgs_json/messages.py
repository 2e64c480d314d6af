"""
The messages Shearwater's agents exchange, as strict types.

Every type is the body of an envelope (`codec.Envelope`); the name of the class is the envelope's
``schema``. Units are in the field names, cells are ``[col, row]``, positions are in frame ``map``
(ENU, metres), times are seconds of ROS time (simulated missions start at 0).
"""

from __future__ import annotations

import enum
import re
from typing import Annotated

import msgspec

from msgs_json.geometry import Cell, GridSpec, Point, path_problem

Name = Annotated[
    str,
    msgspec.Meta(
        # Python's $ also stands before a line break at the end; JSON Schema's does not.
        pattern=r'^[a-z][a-z0-9_]*(?!\n)$',
        max_length=32,
        description='agent name, such as auv_1',
    ),
]
Seconds = Annotated[float, msgspec.Meta(ge=0, le=1e11, extra_json_schema={'x-unit': 's'})]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
SpeedMps = Annotated[float, msgspec.Meta(gt=0, le=1000, extra_json_schema={'x-unit': 'm/s'})]
Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]
Path = Annotated[
    tuple[Cell, ...],
    msgspec.Meta(
        min_length=2, max_length=10_001, description='P_0 ... P_q, neighbour by neighbour'
    ),
]


class Message(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every message: immutable, keyword-only, strict."""


# --- over the radio ----------------------------------------------------------------------------


class Leg(Message, frozen=True):
    """A path to swim and the time at which the AUV is surfaced at the latest (ECC 2009, S_i)."""

    leg_id: Count
    """Counted per AUV, 0 for the initial path."""
    path: Path
    surface_deadline_s: Seconds

    def __post_init__(self) -> None:
        problem = path_problem(self.path)
        if problem:
            raise ValueError(f'path: {problem}')


class AuvOrder(Message, frozen=True):
    """An AUV of the mission, as deployed."""

    name: Name
    speed_mps: SpeedMps
    leg: Leg


class MissionOrder(Message, frozen=True):
    """C3 to UAV: the mission to fly, AUVs in visiting order."""

    mission_id: Annotated[str, msgspec.Meta(min_length=1, max_length=128)]
    region: GridSpec
    c3: Point
    radio_range_m: Annotated[
        float, msgspec.Meta(gt=0, le=1e6, description='radius of the disc, R')
    ]
    sortie_limit_s: Annotated[float, msgspec.Meta(gt=0, le=1e6, description='L')]
    path_cells: Annotated[int, msgspec.Meta(ge=1, le=10_000, description='moves of a path, q')]
    min_path_cells: Annotated[int, msgspec.Meta(ge=1, le=10_000, description='Delta')]
    surface_margin_s: Annotated[float, msgspec.Meta(ge=0, le=1e6, description='added to S_i')]
    handover_s: Annotated[
        float, msgspec.Meta(ge=0, le=1e6, description='kept free in a sortie for each AUV met')
    ]
    lost_after_sorties: Annotated[
        int, msgspec.Meta(ge=1, le=1000, description='searches in vain after which an AUV is lost')
    ]
    auvs: Annotated[tuple[AuvOrder, ...], msgspec.Meta(min_length=1, max_length=1000)]


class Sample(Message, frozen=True):
    """One survey sample, taken when the AUV reached the centre of a cell."""

    auv: Name
    number: Count
    """Counted per AUV from 0; with the AUV's name the unique key of the sample."""
    cell: Cell
    entered_s: Seconds
    value: Annotated[float, msgspec.Meta(ge=-1e9, le=1e9, description='unit of the survey field')]


class SampleSpan(Message, frozen=True):
    """Samples of an AUV with numbers that follow each other."""

    auv: Name
    first: Count
    until: Count
    """The first number that is not among them."""

    def __post_init__(self) -> None:
        if self.until <= self.first:
            raise ValueError(f'until is {self.until}; allowed: more than first, {self.first}')


class SampleBatch(Message, frozen=True):
    """AUV to UAV, and UAV to C3: samples to take over, repeated until a receipt names them."""

    samples: Annotated[tuple[Sample, ...], msgspec.Meta(min_length=1)]


class SampleReceipt(Message, frozen=True):
    """
    UAV to AUV, and C3 to UAV: which samples of an AUV need not be said again, and why.

    It names all of them, not only the new ones: one that was lost on the way is made up for by the
    next.
    """

    held: tuple[SampleSpan, ...]
    """The receiver has stored them, and says so until C3 has them."""
    at_c3: tuple[SampleSpan, ...]
    """They are at C3; whoever kept them until now may forget them."""


class LegOutcome(enum.Enum):
    """Why an AUV surfaced."""

    COMPLETED = 'completed'
    """It reached the end of its path."""
    DEADLINE = 'deadline'
    """Its surface time came while it was still on its path."""
    EARLY = 'early'
    """It came up before, for a reason of its own."""
    ABORTED = 'aborted'
    """It came up to ask for help and takes no further path."""


class SurfacingReport(Message, frozen=True):
    """AUV to UAV, repeated while surfaced: where it is and what it has sampled on its leg."""

    auv: Name
    leg_id: Count
    outcome: LegOutcome
    moves_done: Count
    """How many moves of the leg's path were completed; the rest of its cells were not reached."""
    cell: Cell
    """The last cell entered, ``path[moves_done]``; the next path starts there."""
    position: Point
    """Where it lies; between two cells, where its time was up on the way."""
    surfaced_s: Seconds
    samples_taken: Count
    """How many in all legs; the numbers of its samples are below."""
    samples: tuple[Sample, ...]
    """The oldest ones that nobody is known to hold, as many as fit into a frame of the radio."""


class PathAssignment(Message, frozen=True):
    """UAV to AUV: the next leg."""

    auv: Name
    leg: Leg


class RecoveryReason(enum.Enum):
    """Why an AUV is to stay at the surface."""

    RECALLED = 'recalled'
    """The operator wants it back."""

    EXPLORED = 'explored'
    """Nothing is left to survey."""
    ABORTED = 'aborted'
    """It asked for help."""
    OFF_COURSE = 'off_course'
    """What it reports contradicts the leg that it was given."""


class RecoveryOrder(Message, frozen=True):
    """UAV to AUV: no further leg; stay at the surface until picked up."""

    auv: Name
    leg_id: Count
    """The leg that was the AUV's last."""
    reason: RecoveryReason


class Acknowledged(enum.Enum):
    """The messages that are acknowledged."""

    MISSION_ORDER = 'MissionOrder'
    PATH_ASSIGNMENT = 'PathAssignment'
    RECOVERY_ORDER = 'RecoveryOrder'
    SORTIE_REPORT = 'SortieReport'
    DIRECTIVE = 'Directive'


class Acknowledgement(Message, frozen=True):
    """The receiver has stored what a message says; its sender may stop repeating it."""

    acknowledges: Acknowledged
    reference: Count
    """Leg id, sortie number or revision of the message; 0 for a mission order."""


class Directive(Message, frozen=True):
    """
    C3 to UAV: all that the operator wants now, where it differs from the order or not.

    It says what is to be, not what is to change: one that was missed is made up for by the next.
    """

    revision: Count
    """Counted by C3; 0 is the order itself."""
    paused: bool
    """No sortie is to begin."""
    aborted: bool
    """The UAV is to be at C3: it breaks off a sortie, and begins none."""
    recalled: tuple[Name, ...]
    """AUVs that get no further path: at their next meeting they are told to stay up."""
    sortie_limit_s: Annotated[float, msgspec.Meta(gt=0, le=1e6, description='L')]
    masked: tuple[Cell, ...]
    """Cells that are not part of the region, those of the order included."""


class DirectiveRefused(Message, frozen=True):
    """
    UAV to C3: it flies by a directive, but for the time limit or the region.

    Those it keeps, as far as it cannot fly by others.
    """

    revision: Count
    problem: Annotated[str, msgspec.Meta(max_length=1000)]
    sortie_limit_s: Annotated[float, msgspec.Meta(gt=0, le=1e6, description='L, as it is')]
    masked: tuple[Cell, ...]
    """As they are."""


class Meeting(Message, frozen=True):
    """The UAV met an AUV: when, where, and what it handed over."""

    auv: Name
    time_s: Seconds
    cell: Cell
    ended_leg_id: Count
    outcome: LegOutcome
    next_leg: Leg | None
    """None where the AUV was told to stay up for recovery."""


class ExpectedContact(Message, frozen=True):
    """When the UAV will begin to search an AUV."""

    auv: Name
    time_s: Seconds


class SortieOutlook(Message, frozen=True):
    """The sortie that the UAV will fly next."""

    departs_s: Seconds
    returns_by_s: Seconds
    """With the worst case of its route."""
    contacts: tuple[ExpectedContact, ...]
    """In flying order; an AUV that it will not search is not there."""


class SortieReport(Message, frozen=True):
    """UAV to C3: a sortie has ended; the samples that it brings come in batches of their own."""

    sortie: Annotated[int, msgspec.Meta(ge=1, le=2**53, description='counted from 1')]
    departed_s: Seconds
    returned_s: Seconds
    meetings: tuple[Meeting, ...]
    missed: tuple[Name, ...]
    """AUVs that were searched and not heard."""
    not_reached: tuple[Name, ...]
    """AUVs that were not searched, or not to the end."""
    lost: tuple[Name, ...]
    """AUVs given up in this sortie or before and not heard again; others survey their cells."""
    cargo: tuple[SampleSpan, ...]
    """All samples that the UAV has taken over and not yet heard to be at C3."""
    next_sortie: SortieOutlook | None
    """None after the last one."""


TransferId = Annotated[
    str,
    msgspec.Meta(
        pattern=r'^[0-9a-f]{16}(?!\n)$',
        description='the first 16 hex digits of the SHA-256 of what is cut up',
    ),
]
FragmentIndex = Annotated[int, msgspec.Meta(ge=0, le=65_535)]


class Fragment(Message, frozen=True):
    """A part of a message that is longer than a frame of the radio, whoever says it to whom."""

    transfer: TransferId
    """Of the message's schema, a line break and its body: what is said again is the same."""
    index: FragmentIndex
    """Counted from 0, less than total."""
    total: Annotated[int, msgspec.Meta(ge=1, le=65_536, description='parts of the message')]
    data: Annotated[
        bytes,
        msgspec.Meta(
            min_length=1,
            description='the part; all but the last are equally long',
            extra_json_schema={
                'pattern': r'^([A-Za-z0-9+/]{4})*([A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?(?!\n)$'
            },
        ),
    ]


class FragmentReceipt(Message, frozen=True):
    """The answer to every fragment: what to say next of its message."""

    transfer: TransferId
    missing: Annotated[
        tuple[FragmentIndex, ...],
        msgspec.Meta(
            max_length=64,
            description='the first fragments that the receiver lacks; none: it has them all',
        ),
    ]


RADIO_MESSAGES: tuple[type[Message], ...] = (
    MissionOrder,
    PathAssignment,
    RecoveryOrder,
    Acknowledgement,
    SurfacingReport,
    SampleBatch,
    SampleReceipt,
    SortieReport,
    Fragment,
    FragmentReceipt,
    Directive,
    DirectiveRefused,
)
"""What may go over ``radio/tx`` and ``radio/rx``."""


# --- from operators ----------------------------------------------------------------------------


def _snake_case(name: str) -> str:
    return re.sub('(?<!^)(?=[A-Z])', '_', name).lower()


class Command(Message, frozen=True, kw_only=True, tag_field='command', tag=_snake_case):
    """Base of what `OperatorCommand` bodies hold; ``command`` is the class name in snake case."""


class Recall(Command, frozen=True):
    """Have AUVs stay up when they are met next; their cells go to the others."""

    auvs: tuple[Name, ...] = ()
    """Empty: all of them."""


class Pause(Command, frozen=True):
    """Let no further sortie begin; the present one is flown to its end."""


class Resume(Command, frozen=True):
    """Let sorties begin again after a pause."""


class ChangeLimit(Command, frozen=True):
    """Fly by another sortie time limit from the next sortie on."""

    sortie_limit_s: Annotated[float, msgspec.Meta(gt=0, le=1e6, description='L')]


class ChangeRegion(Command, frozen=True):
    """Survey without some cells from the next sortie on; those masked in the order stay so."""

    masked: tuple[Cell, ...]


class EndMission(Command, frozen=True):
    """Recall all AUVs, so that the mission ends when their data is at C3."""


class Abort(Command, frozen=True):
    """Have the UAV come to C3 at once, and stay there until a reset."""


class Reset(Command, frozen=True):
    """Take an abort back; nothing else does."""


OperatorCommand = Recall | Pause | Resume | ChangeLimit | ChangeRegion | EndMission | Abort | Reset


# --- for operators -----------------------------------------------------------------------------


class MissionState(enum.Enum):
    """Where the mission stands, as far as C3 knows."""

    STARTING = 'starting'
    """The UAV has not acknowledged its order."""
    SURVEYING = 'surveying'
    """There are cells of which no sample has been delivered."""
    RECOVERING = 'recovering'
    """The whole region is delivered, or all AUVs are recalled; some are still out."""
    PAUSED = 'paused'
    """The operator lets no sortie begin."""
    ABORTED = 'aborted'
    """The operator has the UAV stay at C3, until a reset."""
    COMPLETED = 'completed'
    """Every AUV is lost or up for recovery with its data at C3, and the UAV is home."""


class ContactState(enum.Enum):
    """What it means that an AUV is not heard."""

    EXPECTED_SILENT = 'expected_silent'
    """It is under water, as planned."""
    DUE = 'due'
    """It must have surfaced by now; nobody has searched it yet."""
    OVERDUE = 'overdue'
    """It was searched in vain."""
    LOST = 'lost'
    """It was given up after so many searches in vain."""


class AuvStatus(Message, frozen=True):
    """What C3 knows of an AUV."""

    name: Name
    leg_id: Count
    predicted_cells: tuple[Cell, ...]
    """Where it can surface: the cells of its present leg."""
    surface_deadline_s: Seconds | None
    """When it is up at the latest; None once it stays up for recovery."""
    contact: ContactState | None
    """None once it stays up for recovery."""
    next_contact_s: Seconds | None
    """When the UAV will begin to search it; None where no sortie to it is planned."""
    searches_in_vain: Count
    """Since it was last met."""
    last_met_s: Seconds | None
    samples_delivered: Count


class MissionStatus(Message, frozen=True):
    """C3's picture of the mission."""

    mission_id: str
    state: MissionState
    sorties: Count
    cells_total: Count
    cells_delivered: Count
    samples_delivered: Count
    directive: Directive
    """What the operator wants."""
    directive_taken: Count
    """Revision of the one by which the UAV flies."""
    auvs: tuple[AuvStatus, ...]


class BlockReason(enum.Enum):
    """Why a radio message did not get through."""

    SUBMERGED = 'submerged'
    RANGE = 'range'
    LOSS = 'loss'
    BANDWIDTH = 'bandwidth'
    SIZE = 'size'
    MALFORMED = 'malformed'
    UNKNOWN_SENDER = 'unknown_sender'
    AUTH = 'auth'
    REPLAY = 'replay'


class RadioStatus(Message, frozen=True):
    """The channel's counters since the start of the mission."""

    delivered: Count
    blocked: dict[str, Count]
    """By `BlockReason` value; reasons that did not occur are there with 0."""
    duplicated: Count = 0
    """Copies that the channel added to what was said; each is delivered or blocked as well."""
    corrupted: Count = 0
    """How many of those delivered were not heard as they were said."""


# --- the mission's log: one type per thing that happened ----------------------------------------


class Event(Message, frozen=True, kw_only=True, tag_field='event', tag=_snake_case):
    """Base of what `MissionEvent` bodies hold; ``event`` is the class name in snake case."""


class MissionStarted(Event, frozen=True):
    """C3: the mission as it was loaded; makes a bag complete in itself."""

    scenario: msgspec.Raw
    """The scenario with every default filled in, a JSON object."""
    planner: str
    seed: Count
    software_version: str


class CellEntered(Event, frozen=True):
    """AUV: reached the centre of a cell and took its sample."""

    cell: Cell
    sample_number: Count


class Surfaced(Event, frozen=True):
    """AUV: came up."""

    leg_id: Count
    outcome: LegOutcome
    cell: Cell


class Dived(Event, frozen=True):
    """AUV: took its next leg and went down."""

    leg_id: Count
    path: Path
    surface_deadline_s: Seconds


class StayedUp(Event, frozen=True):
    """AUV: was told to stay at the surface."""

    reason: RecoveryReason


class PlanningAhead(Event, frozen=True):
    """UAV: has come further with the plan of the whole mission, which it makes before take-off."""

    share: Share
    """Of the work that is done."""


class SortieDeparted(Event, frozen=True):
    """UAV: left C3, or met an AUV while still there."""

    sortie: Count
    limit_s: Seconds
    """L."""
    predicted_s: Seconds
    """The planner's own figure for the sortie."""
    worst_case_s: Seconds
    """The route from this departure, waits included, without an AUV met at C3 to begin it."""
    order: tuple[Name, ...]
    """The AUVs to meet, one after another."""


class Met(Event, frozen=True):
    """UAV: met an AUV, took its data and handed over its next path."""

    sortie: Count
    auv: Name
    cell: Cell
    leg_id: Count
    """The leg that ended."""
    path: tuple[Cell, ...]
    """The path handed over, P_0 first; empty where the AUV stays up for recovery."""
    slack_s: float | None
    """lambda, before the choice; None where no path was planned."""
    sortie_time_s: float | None
    """T_j, the planner's own figure for the next sortie with this path."""
    plan_status: str | None
    """``ok``, ``shortened`` (less than q moves) or ``infeasible`` (the limit is not kept)."""


class Missed(Event, frozen=True):
    """UAV: searched an AUV's whole path without hearing it."""

    sortie: Count
    auv: Name


class SearchBrokenOff(Event, frozen=True):
    """UAV: turned home because to go on could break the sortie limit, or by an abort."""

    sortie: Count
    not_reached: tuple[Name, ...]


class GivenUp(Event, frozen=True):
    """UAV: took an AUV for lost; its cells go to the others."""

    sortie: Count
    auv: Name


class HeardAgain(Event, frozen=True):
    """UAV: heard an AUV that it had given up."""

    auv: Name


class SortieReturned(Event, frozen=True):
    """UAV: is back at C3."""

    sortie: Count
    duration_s: Seconds


class SamplesDelivered(Event, frozen=True):
    """C3: took over samples."""

    samples: Count
    """Those that were not there yet."""
    cells_delivered: Count
    oldest_age_s: Seconds | None
    """How long ago the oldest of the new samples was taken; None where there is none."""


class CommandTaken(Event, frozen=True):
    """C3: took a command of the operator; the UAV hears of it when it is in range."""

    command: OperatorCommand
    revision: Count
    """Of the directive that says so."""


class CommandRefused(Event, frozen=True):
    """C3: does not take a command, or the UAV cannot fly by what came of some."""

    command: OperatorCommand | None
    """None where the UAV says so."""
    problem: str


class DirectiveTaken(Event, frozen=True):
    """UAV: flies by what the operator wants from now on, as far as it can."""

    directive: Directive
    """By which it flies."""


class MissionCompleted(Event, frozen=True):
    """C3: each AUV is lost or up for recovery with its data here, and the UAV is home."""

    cells_delivered: Count
    samples_delivered: Count
    lost: tuple[Name, ...]


class MessageRefused(Event, frozen=True):
    """
    Any node: refused a message of a sender for a reason.

    All are counted; the first is logged, the tenth, the hundredth and so on.
    """

    sender: str
    reason: str
    detail: str
    """What was wrong with this one."""
    count: Annotated[int, msgspec.Meta(ge=1, le=2**53)] = 1
    """How many there were by now."""


class StorageFailed(Event, frozen=True):
    """Any agent: cannot store what it learns, and says nothing by radio until it can."""

    problem: str


class StorageRestored(Event, frozen=True):
    """Any agent: stores again what it learns, and speaks."""


class NodeRestarted(Event, frozen=True):
    """World: a node has died and is back; no time has passed meanwhile."""

    node: str
    restarts: Count
    """How often that was so far."""


class MissionResumed(Event, frozen=True):
    """World: the mission goes on where it was when all its processes had ended."""


class MissionStopped(Event, frozen=True):
    """World: the simulation ended before C3 called the mission complete."""

    reason: str
    node: str | None
    """The node at fault, where there is one."""


MissionEvent = (
    MissionStarted
    | CellEntered
    | Surfaced
    | Dived
    | StayedUp
    | PlanningAhead
    | SortieDeparted
    | Met
    | Missed
    | SearchBrokenOff
    | GivenUp
    | HeardAgain
    | SortieReturned
    | SamplesDelivered
    | CommandTaken
    | CommandRefused
    | DirectiveTaken
    | MissionCompleted
    | MessageRefused
    | StorageFailed
    | StorageRestored
    | NodeRestarted
    | MissionResumed
    | MissionStopped
)


# --- lockstep ------------------------------------------------------------------------------------


Life = Count
"""
When a process came up, in microseconds of its machine's steady clock.

It tells the process from the one that it replaces, which came up before it.
"""


class NodeKind(enum.Enum):
    """The part a node plays in lockstep."""

    AGENT = 'agent'
    RECORDER = 'recorder'


class Hello(Message, frozen=True):
    """A node is up, with all its publishers and subscriptions made."""

    kind: NodeKind
    life: Life
    next_seq: Count = 0
    """Number of what it will say next by radio."""
    latest_s: Seconds = 0.0
    """The latest time of which anything is left of its former lives; the mission goes on there."""


class Go(Message, frozen=True):
    """The world has heard every node it waits for; again when one came up anew."""

    number: Count
    lives: dict[str, Life]
    """Who was heard, by name; a node that has another life is not meant."""


class Ready(Message, frozen=True):
    """A node has heard `Go`: both directions work. The recorder's: it hears every life in it."""

    go: Count
    """The number of that `Go`."""
    stored: dict[str, Count] = msgspec.field(default_factory=dict)
    """The recorder's: how many messages it holds of each node, of former lives too."""


class Tick(Message, frozen=True):
    """The world: it is tick ``tick`` now. The same tick may be sent again."""

    tick: Count
    time_s: Seconds
    published: Count | None
    """
    Sent on recorder ticks only: messages published by all agents up to the tick before.

    The recorder answers once it holds them all.
    """
    go: Count = 0
    """The last `Go` that the nodes have answered; who was greeted later is not meant."""
    last: bool = False
    """Nothing is published any more."""


class Done(Message, frozen=True):
    """
    A node has worked off a tick and everything delivered to it so far (cumulative counts).

    Or it is still at it, and says that it is alive.
    """

    tick: Count
    received: Count
    """Messages from ``radio/rx`` worked off."""
    sent: Count
    """Messages sent on ``radio/tx``."""
    published: Count
    """Messages published on recorded topics, ``radio/tx`` included."""
    finished: bool
    """The agent's part of the mission is over; C3's ends the mission."""
    life: Life
    """That of its `Hello`; the counts are those of this life."""
    busy: bool = False
    """More is to come of this tick: the world has to wait, however long it takes."""
    noise: Count = 0
    """What else came from ``radio/rx`` and was refused: no sound message of this world's nodes."""


class Waiting(Message, frozen=True):
    """The world: who has been silent for too long, so that time stands still."""

    lives: dict[str, Life]
    """By name; who came up anew since is not meant."""
    problem: str
    """What is missing, for people."""


LOCKSTEP_MESSAGES: tuple[type[Message], ...] = (Hello, Go, Ready, Tick, Done, Waiting)
STATUS_MESSAGES: tuple[type[Message], ...] = (MissionStatus, RadioStatus)
