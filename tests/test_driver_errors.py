"""A vehicle that fails once, whenever that is: the mission's log misses nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from auv_sim.kernel import run_mission
from auv_sim.world_params import make_world
from c3_station.in_process import in_memory, make_agents
from c3_station.node_params import mission_params
from c3_station.scenario import Auv, PlannerChoice, Radio, Scenario, Sortie, Uav
from msgs_json import codec
from msgs_json.agent_shell import AgentShell, Frame
from msgs_json.drivers import VehicleUnavailableError, find_driver
from msgs_json.geometry import GridSpec, Point
from msgs_json.guarded_agent import GuardedAgent
from msgs_json.messages import (
    CellEntered,
    Dived,
    Event,
    MissionCompleted,
    SortieDeparted,
    SortieReturned,
    Surfaced,
)
from msgs_json.ros_messages import Text
from msgs_json.topics import MISSION_EVENTS

PARAMS = mission_params(
    Scenario(
        name='hiccup',
        description='one AUV, six cells',
        region=GridSpec(cols=3, rows=2, cell_m=10.0),
        c3=Point(east_m=15.0, north_m=-30.0),
        uav=Uav(speed_mps=5.0),
        auvs=(Auv(name='auv_1', initial_path=((0, 0), (1, 0))),),
        radio=Radio(range_m=12.0),
        sortie=Sortie(limit_s=60.0),
        planner=PlannerChoice(name='ecc2009', path_cells=2),
        max_mission_s=1000.0,
    )
)


@dataclass(slots=True)
class Trouble:
    """Lets one call of one kind of vehicle fail."""

    group: str
    failing_call: int
    calls: int = 0

    def find_driver(self, group: str, name: str) -> Callable[..., Any]:
        factory: Callable[..., Any] = find_driver(group, name)
        if group != self.group:
            return factory
        return lambda setup, ports: FailingDriver(factory(setup, ports), self)

    def strike(self) -> None:
        self.calls += 1
        if self.calls - 1 == self.failing_call:
            raise VehicleUnavailableError('no link')

    @property
    def has_struck(self) -> bool:
        return self.calls > self.failing_call


class FailingDriver:
    """Calls a driver, unless there is trouble."""

    def __init__(self, driver: object, trouble: Trouble) -> None:
        self._driver = driver
        self._trouble = trouble

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name in ('memory', 'recall'):  # these ask nothing of the vehicle
            return getattr(self._driver, name)  # type: ignore[no-any-return]

        def call(*arguments: object) -> object:
            self._trouble.strike()
            return getattr(self._driver, name)(*arguments)

        return call


class Guarded(AgentShell):
    """A `GuardedAgent` as the kernel takes it."""

    def __init__(self, shell: AgentShell) -> None:
        self.agent = shell.agent
        self._shell = shell
        self._guarded = GuardedAgent(shell, lambda _: None)

    @property
    def is_busy(self) -> bool:
        return self._shell.is_busy

    def tick(self, now_s: float) -> list[Frame]:
        return self._guarded.tick(now_s)

    def receive(self, data: bytes, now_s: float) -> list[Frame]:
        return self._guarded.receive(data, now_s)

    def work(self, now_s: float) -> list[Frame]:
        return self._guarded.work(now_s)


@dataclass(slots=True)
class Log:
    """What happened, by kind, as numbers in order of publication."""

    departed: list[int] = field(default_factory=list)
    returned: list[int] = field(default_factory=list)
    dived: list[int] = field(default_factory=list)
    surfaced: list[int] = field(default_factory=list)
    entered: list[int] = field(default_factory=list)
    samples_delivered: int | None = None
    """Once the mission is complete."""

    def note(self, _: str, frame: Frame) -> None:
        if frame.topic is not MISSION_EVENTS:
            return
        assert isinstance(frame.message, Text)
        event = codec.decode(frame.message.data)[1]
        assert isinstance(event, Event)
        match event:
            case SortieDeparted():
                self.departed.append(event.sortie)
            case SortieReturned():
                assert event.sortie in self.departed
                self.returned.append(event.sortie)
            case Dived():
                self.dived.append(event.leg_id)
            case Surfaced():
                self.surfaced.append(event.leg_id)
            case CellEntered():
                self.entered.append(event.sample_number)
            case MissionCompleted():
                self.samples_delivered = event.samples_delivered


def fly(trouble: Trouble) -> Log:
    log = Log()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('auv_sim.auv_params.find_driver', trouble.find_driver)
        patch.setattr('uav_planner.uav_params.find_driver', trouble.find_driver)
        guarded = {
            name: Guarded(shell) for name, shell in make_agents(PARAMS, in_memory()).items()
        }
    run_mission(make_world(PARAMS.world), guarded, log.note)
    return log


@pytest.mark.slow
@pytest.mark.parametrize('group', ['uav_planner.drivers', 'auv_sim.drivers'])
def test_one_failure_at_any_call_of_a_driver_loses_no_event(group: str) -> None:
    failing_call, has_struck = 0, True
    while has_struck:
        trouble = Trouble(group, failing_call)
        log = fly(trouble)
        where = f'call {failing_call} failed: {log}'
        assert log.samples_delivered == len(log.entered) >= 6, where
        assert log.entered == list(range(len(log.entered))), where
        assert log.dived == log.surfaced == list(range(len(log.dived))), where
        assert log.departed == log.returned == list(range(1, len(log.departed) + 1)), where
        failing_call, has_struck = failing_call + 1, trouble.has_struck
    assert failing_call > 50
