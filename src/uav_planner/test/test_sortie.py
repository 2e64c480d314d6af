from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from msgs_json.geometry import Cell, GridSpec, Point, within_range
from uav_planner.planning import MissionSpec, SurveyLeg
from uav_planner.sortie import (
    Flown,
    Route,
    clear_track,
    flight_ticks,
    flight_time_s,
    home_ticks_of_tracks,
    hop_ticks,
    lay_each_search,
    lay_route,
    lay_search,
    punctual_departure_s,
    search_times_s,
    worst_case_s,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

GRID = GridSpec(cols=10, rows=10, cell_m=10.0)
REFERENCE = MissionSpec(
    grid=GRID,
    c3=Point(east_m=50.0, north_m=0.0),
    radio_range_m=20.0,
    uav_speed_mps=4.0,
    tick_s=1.0,
    sortie_limit_s=60.0,
    path_cells=6,
    min_path_cells=1,
)
FIRST_LEGS = (
    SurveyLeg(auv='auv_1', path=((3, 7), (4, 7)), surface_deadline_s=10.0),
    SurveyLeg(auv='auv_2', path=((2, 9), (3, 9)), surface_deadline_s=10.0),
    SurveyLeg(auv='auv_3', path=((1, 2), (1, 1)), surface_deadline_s=10.0),
)
CELLS = st.tuples(st.integers(0, 9), st.integers(0, 9))
MOVES = ((1, 0), (0, 1), (-1, 0), (0, -1))


def walk_from(start: Cell, moves: Sequence[tuple[int, int]], grid: GridSpec) -> tuple[Cell, ...]:
    path = [start]
    for east, north in moves:
        cell = (path[-1][0] + east, path[-1][1] + north)
        if grid.contains(cell):
            path.append(cell)
    return tuple(path)


ALONG = st.integers(-2000, 12000).map(lambda thousandths: thousandths / 1000)
"""In cells; no lengths that are nothing to `whole_ticks` and something to a vehicle."""


@st.composite
def missions(draw: st.DrawFn) -> MissionSpec:
    """Whole numbers, where hops come out as exact ticks, as often as any others."""
    lengths = st.one_of(st.integers(1, 40).map(float), st.floats(0.5, 40.0))
    cell_m = draw(lengths)
    along = st.one_of(st.integers(-2, 12).map(float), ALONG)
    return replace(
        REFERENCE,
        grid=GridSpec(cols=10, rows=10, cell_m=cell_m),
        c3=Point(east_m=draw(along) * cell_m, north_m=draw(along) * cell_m),
        radio_range_m=draw(lengths),
        uav_speed_mps=draw(lengths),
        tick_s=draw(st.sampled_from([0.1, 0.5, 1.0, 2.0])),
    )


@st.composite
def many_legs(draw: st.DrawFn) -> tuple[SurveyLeg, ...]:
    moves = st.lists(st.sampled_from(MOVES), max_size=6)
    return tuple(
        SurveyLeg(
            auv=f'auv_{number}',
            path=walk_from(draw(CELLS), draw(moves), GRID),
            surface_deadline_s=float(draw(st.integers(0, 120))),
        )
        for number in range(1, draw(st.integers(1, 4)) + 1)
    )


def legs_of(route: Route) -> list[tuple[str, Route]]:
    return [
        (auv, tuple(waypoints))
        for auv, waypoints in itertools.groupby(route, lambda waypoint: waypoint.auv)
    ]


def test_first_route_of_the_reference_mission() -> None:
    route = lay_route(REFERENCE, FIRST_LEGS)
    cleared = (
        ('auv_1', (4, 7)),
        ('auv_1', (3, 7)),
        ('auv_2', (3, 9)),
        ('auv_2', (2, 9)),
        ('auv_3', (1, 1)),
    )
    assert [waypoint.auv for waypoint in route] == [auv for auv, _ in cleared]
    before = REFERENCE.c3
    for waypoint, (_, cell) in zip(route, cleared, strict=True):
        centre = REFERENCE.grid.centre(cell)
        assert before.distance_m(centre) > 20.0 >= waypoint.point.distance_m(centre)
        before = waypoint.point
    assert hop_ticks(REFERENCE, REFERENCE.c3, route[0].point) == 14  # ECC 2009: A1 is met at 14 s
    assert flight_ticks(REFERENCE, route) == 45  # 44 s flown: the contact with A2 saves a tick
    assert worst_case_s(REFERENCE, route, 0.0) == 45.0


@given(mission=missions(), legs=many_legs())
def test_every_cell_of_every_leg_is_cleared_from_the_end_to_the_start(
    mission: MissionSpec, legs: tuple[SurveyLeg, ...]
) -> None:
    """Theorem 1: wherever on its path the AUV is, one of its leg's waypoints has it in range."""
    route = lay_route(mission, legs)
    assert [auv for auv, _ in legs_of(route)] == [leg.auv for leg in legs]
    for leg, (_, waypoints) in zip(legs, legs_of(route), strict=True):
        cursor = 0
        for cell in reversed(leg.path):
            centre = mission.grid.centre(cell)
            distance_m = waypoints[cursor].point.distance_m(centre)
            while not within_range(distance_m, mission.radio_range_m):
                cursor += 1
                assert cursor < len(waypoints), f'{cell} is never in range'
                distance_m = waypoints[cursor].point.distance_m(centre)
        assert all(waypoint.surface_deadline_s == leg.surface_deadline_s for waypoint in waypoints)


@given(mission=missions(), legs=many_legs())
def test_a_route_is_what_a_uav_flies_that_looks_for_the_next_cell_tick_by_tick(
    mission: MissionSpec, legs: tuple[SurveyLeg, ...]
) -> None:
    here = mission.c3
    ticks = 0
    stops = []
    for leg in legs:
        for number, cell in enumerate(reversed(leg.path)):
            centre = mission.grid.centre(cell)
            before = ticks
            while not within_range(here.distance_m(centre), mission.radio_range_m):
                here = here.toward(centre, mission.step_m)
                ticks += 1
            if ticks > before or number == 0:
                stops.append((leg.auv, here))
    while here != mission.c3:
        here = here.toward(mission.c3, mission.step_m)
        ticks += 1
    route = lay_route(mission, legs)
    assert [waypoint.auv for waypoint in route] == [auv for auv, _ in stops]
    for waypoint, (_, point) in zip(route, stops, strict=True):
        assert waypoint.point.distance_m(point) < 1e-6
    assert flight_ticks(mission, route) == ticks
    assert flight_time_s(mission, route) == ticks * mission.tick_s
    assert clear_track(mission, from_c3(mission), track_of(legs)).home_ticks(mission) == ticks


def test_a_cell_is_in_range_even_where_a_tick_is_very_long_beside_the_range() -> None:
    """What `whole_ticks` forgives of five ticks of 1 km is more than 1e-9 of 1 mm of range."""
    mission = replace(
        REFERENCE,
        grid=GridSpec(cols=1, rows=1, cell_m=10.0),
        c3=Point(east_m=5.0, north_m=5.0 - (5 * 1000.0 + 1e-3 + 3e-6)),
        radio_range_m=1e-3,
        uav_speed_mps=1000.0,
    )
    leg = SurveyLeg(auv='auv_1', path=((0, 0),), surface_deadline_s=0.0)
    (waypoint,) = lay_route(mission, (leg,))
    assert waypoint.point == mission.grid.centre((0, 0))
    assert flight_ticks(mission, (waypoint,)) == 12
    tracks = np.zeros((2, 1, 1), dtype=np.intp)
    assert home_ticks_of_tracks(mission, from_c3(mission), tracks, []).tolist() == [12]


def test_a_hop_of_exactly_some_ticks_takes_no_more() -> None:
    assert (5.0 - 4.3 - 0.1) / 0.3 > 2  # so that plain rounding up would take a third tick
    mission = replace(
        REFERENCE,
        grid=GridSpec(cols=1, rows=1, cell_m=10.0),
        c3=Point(east_m=5.0, north_m=4.3),
        radio_range_m=0.1,
        uav_speed_mps=0.3,
    )
    leg = SurveyLeg(auv='auv_1', path=((0, 0),), surface_deadline_s=0.0)
    assert flight_ticks(mission, lay_route(mission, (leg,))) == 4
    tracks = np.zeros((2, 1, 1), dtype=np.intp)
    assert home_ticks_of_tracks(mission, from_c3(mission), tracks, []).tolist() == [4]


def test_a_waypoint_lies_never_past_its_cell() -> None:
    mission = replace(REFERENCE, radio_range_m=1.0, uav_speed_mps=30.0)
    leg = SurveyLeg(auv='auv_1', path=((5, 3),), surface_deadline_s=0.0)
    (waypoint,) = lay_route(mission, (leg,))
    assert waypoint.point.distance_m(mission.grid.centre((5, 3))) < 1e-9


def test_a_leg_in_range_of_the_one_before_has_its_waypoint_all_the_same() -> None:
    """The UAV has to wait somewhere until the second AUV is surfaced."""
    legs = (
        SurveyLeg(auv='auv_1', path=((4, 1),), surface_deadline_s=0.0),
        SurveyLeg(auv='auv_2', path=((5, 1),), surface_deadline_s=30.0),
    )
    route = lay_route(REFERENCE, legs)
    assert [(waypoint.auv, waypoint.point) for waypoint in route] == [
        ('auv_1', REFERENCE.c3),
        ('auv_2', REFERENCE.c3),
    ]
    assert flight_ticks(REFERENCE, route) == 0
    assert worst_case_s(REFERENCE, route, 10.0) == 20.0


@st.composite
def tracks(draw: st.DrawFn) -> tuple[Cell, ...]:
    return walk_from(draw(CELLS), draw(st.lists(st.sampled_from(MOVES), max_size=9)), GRID)


def point_near(mission: MissionSpec, data: st.DataObject) -> Point:
    along = st.one_of(st.integers(-4, 28).map(lambda half: half / 2), st.floats(-2.0, 14.0))
    cell_m = mission.grid.cell_m
    return Point(east_m=data.draw(along) * cell_m, north_m=data.draw(along) * cell_m)


@given(mission=missions(), track=tracks(), share=st.floats(1.0, 4.0), data=st.data())
def test_an_auv_between_two_cells_is_heard_where_both_are(
    mission: MissionSpec, track: tuple[Cell, ...], share: float, data: st.DataObject
) -> None:
    """What `lay_search` promises where cells are no wider than the radio range."""
    range_m = mission.grid.cell_m * data.draw(st.sampled_from([1.0, share]))
    wide = replace(mission, radio_range_m=range_m)
    search = lay_search(wide, point_near(wide, data), track)
    cursor = 0
    for cell, following in itertools.pairwise(track):
        start, end = wide.grid.centre(cell), wide.grid.centre(following)
        between = [start.toward(end, share * wide.grid.cell_m) for share in (0, 0.3, 0.5, 0.8, 1)]
        while not all(
            within_range(search[cursor].distance_m(point), range_m) for point in between
        ):
            cursor += 1
            assert cursor < len(search), f'{cell} to {following} is never in range as a whole'


def test_where_cells_are_wider_than_the_radio_range_that_does_not_hold() -> None:
    mission = replace(REFERENCE, radio_range_m=5.0, uav_speed_mps=0.1)
    track = ((0, 0), (1, 0))
    search = lay_search(mission, Point(east_m=5.0, north_m=0.0), track)
    assert not any(
        all(within_range(point.distance_m(mission.grid.centre(cell)), 5.0) for cell in track)
        for point in search
    )


@given(
    mission=missions(),
    many=st.integers(1, 7).flatmap(
        lambda cells: st.lists(
            st.lists(CELLS, min_size=cells, max_size=cells), min_size=1, max_size=12
        )
    ),
    data=st.data(),
)
def test_many_searches_laid_at_once_are_those_laid_one_by_one(
    mission: MissionSpec, many: list[list[Cell]], data: st.DataObject
) -> None:
    origins = [point_near(mission, data) for _ in range(data.draw(st.integers(1, 3)))]
    searches = lay_each_search(mission, origins, np.array(many).transpose(2, 1, 0))
    for (place, origin), (number, track) in itertools.product(enumerate(origins), enumerate(many)):
        alone = lay_search(mission, origin, track)
        ticks = sum(hop_ticks(mission, *hop) for hop in itertools.pairwise(alone))
        assert searches.ticks[place, number] == ticks
        for laid_m, point in ((searches.first_m, alone[0]), (searches.last_m, alone[-1])):
            laid = laid_m[place, number]
            assert Point(east_m=laid.real, north_m=laid.imag).distance_m(point) < 1e-6


def test_no_legs_no_sortie() -> None:
    assert lay_route(REFERENCE, ()) == ()
    assert flight_ticks(REFERENCE, ()) == 0
    assert worst_case_s(REFERENCE, (), 5.0) == 0.0
    assert punctual_departure_s(REFERENCE, (), 5.0) == 5.0


@given(
    mission=missions(),
    before=many_legs(),
    tracks=st.integers(1, 7).flatmap(
        lambda cells: st.lists(
            st.lists(CELLS, min_size=cells, max_size=cells), min_size=1, max_size=12
        )
    ),
    after=many_legs(),
)
def test_many_tracks_at_once_take_what_each_takes_alone(
    mission: MissionSpec,
    before: tuple[SurveyLeg, ...],
    tracks: list[list[Cell]],
    after: tuple[SurveyLeg, ...],
) -> None:
    flown = clear_track(mission, from_c3(mission), track_of(before))
    alone = [
        clear_track(mission, flown, [*track, *track_of(after)]).home_ticks(mission)
        for track in tracks
    ]
    as_array = np.array(tracks).transpose(2, 1, 0)
    assert home_ticks_of_tracks(mission, flown, as_array, track_of(after)).tolist() == alone


@pytest.mark.parametrize(
    ('deadline_s', 'now_s', 'depart_s'),
    [
        (10.0, 0.0, 0.0),  # 14 s away: too late already
        (30.0, 0.0, 16.0),
        (30.5, 0.0, 17.0),  # between two ticks: there at the next one
        (30.0, 20.0, 20.0),
    ],
)
def test_the_uav_leaves_so_as_to_be_there_when_the_first_auv_must_be_surfaced(
    deadline_s: float, now_s: float, depart_s: float
) -> None:
    leg = replace(FIRST_LEGS[0], surface_deadline_s=deadline_s)
    route = lay_route(REFERENCE, (leg,))
    assert punctual_departure_s(REFERENCE, route, now_s) == depart_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A sortie as it was flown."""

    duration_s: float
    searched_s: dict[str, float]
    """When the UAV began to search the AUVs that it had not heard by then."""


def fly(
    mission: MissionSpec,
    route: Route,
    depart_s: float,
    contacts: dict[str, int],
    start: Point | None = None,
) -> Flight:
    """
    Fly a route tick by tick as an agent does.

    ``contacts``: so many ticks after an AUV's turn began it is heard, wherever the UAV is; any
    other one is heard at the last moment. Then the UAV stays for the hand-over.
    """
    here = start or mission.c3
    ticks = 0
    searched_s = {}
    for auv, waypoints in legs_of(route):
        turn_ticks = ticks
        for number, waypoint in enumerate(waypoints):
            while ticks - turn_ticks != contacts.get(auv):
                if here != waypoint.point:
                    here = here.toward(waypoint.point, mission.step_m)
                elif number > 0 or depart_s + ticks * mission.tick_s >= deadline_s(waypoints):
                    searched_s.setdefault(auv, depart_s + ticks * mission.tick_s)
                    break
                ticks += 1
        ticks += math.ceil(mission.handover_s / mission.tick_s - 1e-6)
    while here != mission.c3:
        here = here.toward(mission.c3, mission.step_m)
        ticks += 1
    return Flight(duration_s=ticks * mission.tick_s, searched_s=searched_s)


def deadline_s(waypoints: Route) -> float:
    return waypoints[0].surface_deadline_s - 1e-6


@st.composite
def sorties(draw: st.DrawFn) -> tuple[MissionSpec, Route, float, Point]:
    """A sortie from C3, or what is left of one from some point; it starts at a tick."""
    mission = replace(draw(missions()), handover_s=draw(st.sampled_from([0.0, 0.7, 2.0, 3.0])))
    route = lay_route(mission, draw(many_legs()))
    start_s = draw(st.integers(0, 100)) * mission.tick_s
    if draw(st.booleans()):
        return mission, route, start_s, mission.c3
    cells = ALONG
    start = Point(
        east_m=draw(cells) * mission.grid.cell_m, north_m=draw(cells) * mission.grid.cell_m
    )
    return mission, route[draw(st.integers(0, len(route))) :], start_s, start


CONTACTS = st.dictionaries(
    st.sampled_from(['auv_1', 'auv_2', 'auv_3', 'auv_4']), st.integers(0, 80)
)


@given(sortie=sorties(), contacts=CONTACTS)
def test_no_contact_makes_a_sortie_longer_than_its_worst_case(
    sortie: tuple[MissionSpec, Route, float, Point], contacts: dict[str, int]
) -> None:
    """
    Theorem 2, with waits and hand-overs: the worst case is to hear everyone at the last moment.

    Then it takes exactly that long, and never longer, from C3 and from wherever it has come to.
    """
    mission, route, start_s, start = sortie
    worst_s = worst_case_s(mission, route, start_s, start)
    assert fly(mission, route, start_s, {}, start).duration_s == pytest.approx(worst_s, abs=1e-9)
    assert fly(mission, route, start_s, contacts, start).duration_s <= worst_s + 1e-9


@given(mission=missions(), legs=many_legs(), depart_ticks=st.integers(0, 100), contacts=CONTACTS)
def test_a_search_begins_when_foreseen_or_earlier(
    mission: MissionSpec,
    legs: tuple[SurveyLeg, ...],
    depart_ticks: int,
    contacts: dict[str, int],
) -> None:
    route = lay_route(mission, legs)
    depart_s = depart_ticks * mission.tick_s
    latest_s = search_times_s(mission, route, depart_s)
    assert list(latest_s) == [leg.auv for leg in legs]
    assert fly(mission, route, depart_s, {}).searched_s == pytest.approx(latest_s, abs=1e-6)
    for auv, searched_s in fly(mission, route, depart_s, contacts).searched_s.items():
        assert searched_s <= latest_s[auv] + 1e-6


def test_hand_overs_before_a_search_delay_it() -> None:
    mission = replace(REFERENCE, handover_s=5.0)
    route = lay_route(mission, FIRST_LEGS)
    assert search_times_s(mission, route, 0.0) == fly(mission, route, 0.0, {}).searched_s


def test_hand_overs_and_waits_of_the_reference_mission() -> None:
    """45 s of flight, the last 11 of them home."""
    route = lay_route(REFERENCE, FIRST_LEGS)
    slow = replace(REFERENCE, handover_s=4.5)  # five ticks for each of three
    assert worst_case_s(slow, route, 0.0) == 45.0 + 15.0
    late = replace(route[-1], surface_deadline_s=50.0)
    assert hop_ticks(slow, late.point, REFERENCE.c3) == 11
    assert worst_case_s(slow, (*route[:-1], late), 0.0) == 50.0 + 5.0 + 11.0
    # Over A3 already, the others met: hand-over and the way home are left.
    assert worst_case_s(slow, route[-1:], 60.0, late.point) == 5.0 + 11.0
    assert worst_case_s(slow, (), 60.0, late.point) == 11.0


def from_c3(mission: MissionSpec) -> Flown:
    return Flown(point=mission.c3, ticks=0)


def track_of(legs: tuple[SurveyLeg, ...]) -> list[Cell]:
    return [cell for leg in legs for cell in reversed(leg.path)]
