"""
What a mission is: the scenario file as strict types.

Units are in the key names; every key with a default may be left out of the file. Ranges are those
of the node parameters that the values end up in, so that what loads here also starts as nodes.
"""

from __future__ import annotations

import enum
from typing import Annotated, Any

import msgspec

from auv_sim.radio_model import Link, LinkModel
from msgs_json.geometry import Cell, GridSpec, Point
from msgs_json.messages import Name
from uav_planner.candidate_paths import SEARCHED_MOVES_MAX

C3 = 'c3'
UAV = 'uav'
"""Names of the agents that are not AUVs."""

NotNegative = Annotated[float, msgspec.Meta(ge=0, le=1e6)]
Wind = Annotated[float, msgspec.Meta(ge=-100, le=100)]
PathCells = Annotated[int, msgspec.Meta(ge=1, le=SEARCHED_MOVES_MAX)]
"""A planner that lists all paths takes less, and says so when it is asked for its first sortie."""

RESERVED_NAMES = frozenset({'c3', 'diagnostics', 'operator', 'recorder', 'uav', 'world'})
"""Names of the other nodes (and of what stands beside them in the topic tree): not for an AUV."""


class Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every part of a scenario file."""


class Uav(Section, frozen=True, kw_only=True):
    """The UAV."""

    speed_mps: Annotated[float, msgspec.Meta(ge=0.01, le=1000)]
    altitude_m: Annotated[float, msgspec.Meta(ge=0, le=20_000)] = 30.0
    arrival_radius_m: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 0.0
    """Closer than this to a waypoint counts as there; real vehicles need some metres."""
    wind_east_mps: Wind = 0.0
    """Steady wind over the simulated UAV, toward the east; planners do not know of it."""
    wind_north_mps: Wind = 0.0
    driver: str = 'kinematic'


class Auv(Section, frozen=True, kw_only=True):
    """One AUV; the list of them is the visiting order."""

    name: Name
    initial_path: Annotated[tuple[Cell, ...], msgspec.Meta(min_length=2, max_length=10_001)]
    speed_mps: Annotated[float, msgspec.Meta(ge=0.01, le=100)] = 1.0
    depth_m: Annotated[float, msgspec.Meta(ge=1, le=11_000)] = 5.0
    driver: str = 'kinematic'
    surfacing: dict[str, Any] = msgspec.field(default_factory=lambda: {'model': 'on_time'})
    """Surfacing model of the simulator; see `auv_sim.surfacing`."""


class Radio(LinkModel, frozen=True, kw_only=True):
    """The channel between surfaced vehicles; what holds for all links stands here as well."""

    range_m: Annotated[float, msgspec.Meta(ge=0.001, le=1e6)]
    max_message_bytes: Annotated[int, msgspec.Meta(ge=720, le=2**30)] = 1_048_576
    queue_frames: Annotated[int, msgspec.Meta(ge=1, le=2**30)] = 16
    """So many frames wait while a radio is sending; what is said beyond that is blocked."""
    links: tuple[Link, ...] = ()
    """Those that differ."""

    @property
    def link(self) -> LinkModel:
        """Return what holds for all links."""
        return LinkModel(**{name: getattr(self, name) for name in LinkModel.__struct_fields__})


class Sortie(Section, frozen=True, kw_only=True):
    """What a sortie must keep to."""

    limit_s: Annotated[float, msgspec.Meta(gt=0, le=1e6)]
    surface_margin_s: NotNegative = 0.0
    """Added to every surface deadline S_i."""
    handover_s: NotNegative = 0.0
    """Kept free for each AUV met; what the radio needs beyond the moment of hearing it."""
    lost_after_sorties: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 3
    """After so many searches in vain an AUV is lost, and the others survey its cells."""


class PlannerChoice(Section, frozen=True, kw_only=True):
    """Which planner chooses the paths, and how long they may be."""

    name: str = 'robust'
    path_cells: PathCells
    """Moves of a full path, q."""
    min_path_cells: PathCells = 1
    """Delta."""
    options: dict[str, Any] = msgspec.field(default_factory=dict)
    """Settings of that planner alone."""


class Faults(Section, frozen=True, kw_only=True):
    """What else goes wrong, drawn from the seed; see docs/faults.md."""

    kills: Annotated[int, msgspec.Meta(ge=0, le=10_000)] = 0
    """So many times a node's process is killed, node by node in turn."""
    hangs: Annotated[int, msgspec.Meta(ge=0, le=10_000)] = 0
    """So many times one hangs until it is killed."""
    forged: Annotated[int, msgspec.Meta(ge=0, le=1_000_000)] = 0
    """Hostile messages that nodes hear by radio, all together."""
    disk_full_s: NotNegative = 0.0
    """For so long each node can store nothing, once."""
    clock_jump_s: NotNegative = 0.0
    """The ROS clock of each node jumps by up to so much, forth or back, once."""
    off_by_one: Name | None = None
    """The AUV that from some time on reports a neighbour of the cell it is in."""
    nodes: tuple[Name, ...] = ()
    """Whom all this but `off_by_one` befalls: `c3`, `uav` or AUVs; none named: everybody."""
    until_s: Annotated[float, msgspec.Meta(ge=0, le=1e7)] | None = None
    """Faults begin before this time; by default the least that the mission can take."""


class OnDeath(enum.Enum):
    """What the orchestrator does when a node dies, or hangs."""

    RESTART = 'restart'
    """It is started again, and the mission goes on."""
    END = 'end'
    """The mission ends, and what was recorded is kept."""


class OnDeathOf(Section, frozen=True, kw_only=True):
    """That for each kind of node; a dead world or recorder always ends the mission."""

    auvs: OnDeath = OnDeath.RESTART
    uav: OnDeath = OnDeath.RESTART
    c3: OnDeath = OnDeath.RESTART


class Limits(Section, frozen=True, kw_only=True):
    """A closed interval; an end that is left out is open."""

    min: float | None = None
    max: float | None = None


class PassConditions(Section, frozen=True, kw_only=True):
    """What the mission's summary must show for exit code 0; null figures never pass."""

    explored_s: Limits = Limits()
    delivered_s: Limits = Limits()
    neglect_fraction: Limits = Limits()
    sortie_limit_violations: Limits = Limits()
    samples_lost: Limits = Limits(max=0.0)
    """Samples of AUVs that are not lost at the end, collected and not at C3."""


PROMISES = ('sortie_limit_violations', 'samples_lost')
"""Pass conditions that ask for what any planner should keep, not for how good one is."""


class ScheduledCommand(Section, frozen=True, kw_only=True):
    """What the operator does at a time."""

    at_s: NotNegative
    command: dict[str, Any]
    """See `msgs_json.messages.OperatorCommand`."""


class Scenario(Section, frozen=True, kw_only=True):
    """A mission."""

    name: Annotated[str, msgspec.Meta(pattern='^[a-z][a-z0-9_]*$', max_length=64)]
    description: str
    region: GridSpec
    c3: Point
    uav: Uav
    auvs: Annotated[tuple[Auv, ...], msgspec.Meta(min_length=1, max_length=200)]
    radio: Radio
    sortie: Sortie
    planner: PlannerChoice
    tick_s: Annotated[float, msgspec.Meta(ge=0.001, le=3600)] = 1.0
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**53)] = 0
    field: dict[str, Any] = msgspec.field(default_factory=lambda: {'kind': 'synthetic'})
    """The surveyed scalar field; see `auv_sim.survey_field`."""
    max_mission_s: Annotated[float, msgspec.Meta(ge=1, le=1e7)]
    """Hard stop, seconds of simulated time; generous."""
    faults: Faults = Faults()
    on_death: OnDeath | OnDeathOf = OnDeath.RESTART
    """One for all kinds of nodes, or one for each."""
    operator: tuple[ScheduledCommand, ...] = ()
    """Commands that C3 takes as if the operator gave them, in order of time."""
    pass_conditions: PassConditions = msgspec.field(name='pass', default=PassConditions())

    def on_death_of(self) -> OnDeathOf:
        """Return what happens when a node of each kind dies."""
        if isinstance(self.on_death, OnDeathOf):
            return self.on_death
        return OnDeathOf(auvs=self.on_death, uav=self.on_death, c3=self.on_death)
