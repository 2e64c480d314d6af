"""Single nodes as a person starts them: parameters, signals, order, names, bad input."""

from __future__ import annotations

import resource
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path

import pytest
from domain_coordinator import domain_id
from patience import PATIENCE_S, wait_until
from slow_planner import NAME, SLICES, let_nodes_fly_with_it

from c3_station.graph import write_params
from c3_station.mission_record import read_mission
from c3_station.processes import executable
from c3_station.ros_environment import graph_environment
from c3_station.scenario_files import load_scenario
from c3_station.summary import Summary
from msgs_json import codec
from msgs_json.geometry import GridSpec, Point
from msgs_json.guest_node import GuestNode
from msgs_json.messages import (
    Acknowledgement,
    AuvOrder,
    Leg,
    Message,
    MissionOrder,
    PathAssignment,
    PlanningAhead,
    SortieDeparted,
    SurfacingReport,
)
from msgs_json.node_exit import NodeExit
from msgs_json.ros_messages import Odometry, Text, odometry_from_cdr, text_from_cdr, to_cdr
from msgs_json.topics import MISSION_EVENTS, ODOM, RADIO_RX, RADIO_TX

pytestmark = pytest.mark.ros

NODES = [
    ('auv_sim', 'auv'),
    ('auv_sim', 'world'),
    ('auv_sim', 'fleet'),
    ('uav_planner', 'uav'),
    ('c3_station', 'c3'),
    ('c3_station', 'recorder'),
]


class Node:
    """One executable under way, with its output."""

    def __init__(self, package: str, name: str, *words: str) -> None:
        self._process = subprocess.Popen(
            [str(executable(package, name)), '--ros-args', *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def signal(self, signum: signal.Signals) -> None:
        self._process.send_signal(signum)

    def limit_files(self, size_bytes: int) -> None:
        """Let it write no file beyond a size, as on a full disk."""
        resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE, (size_bytes, size_bytes))

    def is_up(self) -> bool:
        return self._process.poll() is None

    def end(self) -> tuple[int, str]:
        """Wait for the end; return exit code and output."""
        output, _ = self._process.communicate(timeout=PATIENCE_S)
        return self._process.returncode, output

    def kill(self) -> None:
        if self.is_up():
            self._process.kill()
            self._process.communicate()


Start = Callable[..., Node]


@pytest.fixture
def domain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Keep a graph free for the test."""
    with domain_id() as number:
        for name, value in graph_environment(number, tmp_path).items():
            monkeypatch.setenv(name, value)
        yield number


@pytest.fixture
def start(domain: int) -> Iterator[Start]:
    """Start nodes on the graph of the test; none outlives it."""
    begun: list[Node] = []

    def begin(package: str, name: str, *words: object) -> Node:
        begun.append(Node(package, name, *map(str, words)))
        return begun[-1]

    yield begin
    for node in begun:
        node.kill()


class Listener(GuestNode):
    """The test's own node on the graph."""

    def hearers(self, topic: str) -> set[str]:
        """Return the namespaces of all nodes that subscribe to a topic."""
        return {each.node_namespace for each in self.node.get_subscriptions_info_by_topic(topic)}

    def others(self) -> set[str]:
        """Return the names of the nodes on the graph."""
        return set(self.node.get_node_names())

    def wait_for(self, holds: Callable[[], bool]) -> None:
        """Wait until something holds, and hear what is said meanwhile."""
        wait_until(holds, lambda: self.spin(0.1))


@pytest.fixture
def listener(domain: int) -> Iterator[Listener]:
    """Return a node of the test's own."""
    node = Listener('listener', '/', domain)
    yield node
    node.close()


@pytest.fixture
def params(tmp_path: Path) -> Path:
    """Return the parameter file of the reference mission, as fast as possible."""
    path = tmp_path / 'params.yaml'
    write_params(load_scenario('ecc2009'), path, rate=0.0, bag=tmp_path / 'bag')
    return path


def mission(start: Start, params: Path, order: list[str]) -> dict[str, Node]:
    """Start the nodes of the reference mission by hand, in an order."""
    executables = {
        'world': ('auv_sim', 'world'),
        'c3': ('c3_station', 'c3'),
        'uav': ('uav_planner', 'uav'),
        'recorder': ('c3_station', 'recorder'),
        'auv_1': ('auv_sim', 'auv'),
        'auv_2': ('auv_sim', 'auv'),
        'auv_3': ('auv_sim', 'auv'),
    }
    return {
        name: start(*executables[name], '-r', f'__ns:=/{name}', '--params-file', params)
        for name in order
    }


def summary_of(bag: Path) -> Summary:
    return read_mission(bag).summary


# --- alone ---------------------------------------------------------------------------------------


def test_every_node_starts_alone_and_ends_when_told(
    start: Start, tmp_path: Path, listener: Listener
) -> None:
    nodes = {}
    for package, name in NODES:
        extra = ['-p', f'out:={tmp_path / "alone"}'] if name == 'recorder' else []
        place = ['-r', '__ns:=/auv_1'] if name == 'auv' else []
        nodes[name] = start(package, name, *place, *extra)
    listener.wait_for(lambda: nodes.keys() <= listener.others())
    assert [name for name, node in nodes.items() if not node.is_up()] == []
    for node, signum in zip(nodes.values(), cycle([signal.SIGINT, signal.SIGTERM]), strict=False):
        node.signal(signum)
    for name, node in nodes.items():
        code, output = node.end()
        assert code == NodeExit.OK, f'{name}: {output}'
        assert 'Traceback' not in output, name


@pytest.mark.parametrize(
    ('package', 'name', 'words', 'told'),
    [
        ('auv_sim', 'auv', ['-p', 'speed_mps:=-1.0'], 'speed_mps'),
        ('auv_sim', 'auv', ['-p', 'initial_path:=[0, 0, 5, 5]'], 'initial_path'),
        ('auv_sim', 'auv', ['-p', 'driver:=submarine'], 'submarine'),
        ('uav_planner', 'uav', ['-p', 'planner:=magic'], 'magic'),
        ('uav_planner', 'uav', ['-p', 'speed_mps:=fast'], 'speed_mps'),
        ('c3_station', 'c3', ['-p', 'scenario:=atlantis'], 'atlantis'),
        ('auv_sim', 'world', ['-p', 'tick_s:=0.0'], 'tick_s'),
        ('c3_station', 'recorder', ['-p', 'scenario:=atlantis'], 'atlantis'),
    ],
)
def test_a_bad_parameter_is_one_clear_message(
    start: Start, package: str, name: str, words: list[str], told: str
) -> None:
    code, output = start(package, name, '-r', '__ns:=/auv_1', *words).end()
    assert code == NodeExit.BAD_PARAMETERS, output
    assert told in output
    assert 'Traceback' not in output


# --- together ------------------------------------------------------------------------------------


def test_nodes_started_by_hand_wait_for_each_other(
    start: Start, params: Path, tmp_path: Path, listener: Listener
) -> None:
    nodes = mission(start, params, ['auv_3', 'uav', 'auv_1', 'c3', 'auv_2', 'world'])
    listener.wait_for(lambda: {'auv', 'uav', 'c3', 'world'} <= listener.others())
    assert all(node.is_up() for node in nodes.values())
    nodes |= mission(start, params, ['recorder'])
    code, output = nodes['world'].end()
    assert code == NodeExit.OK, output
    for name in ('c3', 'uav', 'auv_1', 'auv_2', 'auv_3', 'recorder'):
        nodes[name].signal(signal.SIGINT)
        code, output = nodes[name].end()
        assert code == NodeExit.OK, f'{name}: {output}'
    figures = summary_of(tmp_path / 'bag')
    assert figures.explored_s == 457.0
    assert figures.samples_delivered == figures.samples_collected == 144


def test_nodes_may_live_in_other_namespaces(start: Start, params: Path, tmp_path: Path) -> None:
    text = params.read_text().replace('/auv_1/auv:', '/north/auv_1/auv:')
    for node in ('/world/world', '/recorder/recorder'):
        head = f'{node}:\n  ros__parameters:\n'
        assert head in text
        text = text.replace(head, f'{head}    namespaces: ["auv_1=/north/auv_1"]\n')
    params.write_text(text)
    nodes = mission(start, params, ['world', 'c3', 'uav', 'recorder', 'auv_2', 'auv_3'])
    place = ['-r', '__ns:=/north/auv_1', '--params-file', params]
    nodes['auv_1'] = start('auv_sim', 'auv', *place)
    code, output = nodes['world'].end()
    assert code == NodeExit.OK, output
    nodes['recorder'].signal(signal.SIGINT)
    nodes['recorder'].end()
    assert summary_of(tmp_path / 'bag').explored_s == 457.0


def test_a_fleet_flies_in_one_process(start: Start, tmp_path: Path) -> None:
    params = tmp_path / 'params.yaml'
    write_params(load_scenario('ecc2009'), params, rate=0.0, bag=tmp_path / 'bag')
    # The default fleet is auv_1, auv_2 and auv_3, each with its own section of the file.
    fleet = start('auv_sim', 'fleet', '-r', '__ns:=/fleet_1', '--params-file', params)
    nodes = mission(start, params, ['recorder', 'world', 'c3', 'uav'])
    code, output = nodes['world'].end()
    assert code == NodeExit.OK, output
    for node in (fleet, nodes['recorder']):
        node.signal(signal.SIGTERM)
        code, output = node.end()
        assert code == NodeExit.OK, output
    assert summary_of(tmp_path / 'bag').explored_s == 457.0


# --- strangers -----------------------------------------------------------------------------------

NOT_FOR_ANY_RADIO = [
    b'',
    b'{',
    b'\xff\xfe',
    b'null',
    b'[' * 50_000,
    b'{"zz":' + b'[' * 5000 + b']' * 5000 + b'}',
    b'{"stamp":1e11}',
    b'{"schema":"PathAssignment"}',
    b'{"schema":"PathAssignment","version":1,"src":"uav","dst":"auv_1","seq":0,"stamp":NaN,'
    b'"body":{},"auth":null}',
    b'{"schema":"PathAssignment","version":1,"src":"uav","dst":"auv_1","seq":999,"stamp":1.0,"body":'
    b'{"auv":"auv_1","leg":{"leg_id":1,"path":[[0,0],[9,9]],"surface_deadline_s":-5}},"auth":null}',
    b'{"schema":"RecoveryOrder","version":1,"src":"stranger","dst":"auv_1","seq":0,"stamp":1.0,'
    b'"body":{"auv":"auv_1","leg_id":0,"reason":"explored"},"auth":null}',
]


def test_garbage_on_every_radio_topic_is_refused_and_counted(
    start: Start, params: Path, tmp_path: Path, listener: Listener
) -> None:
    params.write_text(params.read_text().replace('rate: 0.0', 'rate: 100.0'))
    nodes = mission(start, params, ['recorder', 'world', 'c3', 'uav', 'auv_1', 'auv_2', 'auv_3'])
    publishers = [
        listener.publisher(topic, f'/{name}')
        for name in ('c3', 'uav', 'auv_1', 'auv_2', 'auv_3')
        for topic in (RADIO_TX, RADIO_RX)
    ]
    sent = 0
    while nodes['world'].is_up():
        for publisher in publishers:
            publisher.publish(to_cdr(Text(NOT_FOR_ANY_RADIO[sent % len(NOT_FOR_ANY_RADIO)])))
        sent += 1
        listener.spin(0.1)
    code, output = nodes['world'].end()
    assert code == NodeExit.OK, output
    assert 'Traceback' not in output
    for name in ('c3', 'uav', 'auv_1', 'auv_2', 'auv_3', 'recorder'):
        nodes[name].signal(signal.SIGINT)
        code, output = nodes[name].end()
        assert code == NodeExit.OK, f'{name}: {output}'
        assert 'Traceback' not in output, name
    figures = summary_of(tmp_path / 'bag')
    assert figures.explored_s == 457.0  # the mission took no notice
    assert figures.samples_delivered == figures.samples_collected == 144
    assert figures.radio is not None
    assert figures.radio.blocked['malformed'] > sent
    assert figures.radio.blocked['unknown_sender'] > 0
    refused = {(refusal.node, refusal.reason) for refusal in figures.refusals}
    assert {('auv_1', 'malformed'), ('c3', 'malformed'), ('uav', 'malformed')} <= refused


def test_recorder_on_a_full_disk_says_why_once_and_ends(
    start: Start, tmp_path: Path, listener: Listener
) -> None:
    recorder = start('c3_station', 'recorder', '-p', f'out:={tmp_path / "bag"}')
    publisher = listener.publisher(RADIO_TX, '/c3')
    listener.wait_for(lambda: listener.hearers('/c3/radio/tx') == {'/recorder'})
    listener.wait_for(lambda: publisher.get_subscription_count() == 1)
    recorder.limit_files(4096)  # less than the declared topics take

    def shout() -> bool:
        # More than is kept in memory: writing fails, not only the flush that comes later.
        publisher.publish(to_cdr(Text(b'x' * 2_000_000)))
        return not recorder.is_up()

    listener.wait_for(shout)
    code, output = recorder.end()
    assert code == NodeExit.NOT_RECORDING, output
    assert output.count('[FATAL]') == 1, output
    assert 'cannot be written: File too large' in output
    assert 'is closed' not in output


def test_nobody_but_world_and_recorder_hears_a_vehicle(
    start: Start, params: Path, listener: Listener
) -> None:
    params.write_text(params.read_text().replace('rate: 0.0', 'rate: 50.0'))
    nodes = mission(start, params, ['recorder', 'world', 'c3', 'uav', 'auv_1', 'auv_2', 'auv_3'])
    listener.wait_for(lambda: len(listener.hearers('/auv_1/odom')) >= 2)
    listener.spin(2.0)  # whoever else there is has come up by now
    for name in ('auv_1', 'auv_2', 'auv_3', 'uav'):
        assert listener.hearers(f'/{name}/odom') == {'/world', '/recorder'}
        assert listener.hearers(f'/{name}/radio/tx') == {'/world', '/recorder'}
        assert listener.hearers(f'/{name}/radio/rx') == {f'/{name}', '/recorder'}
    assert listener.hearers('/mission_events') == {'/recorder'}
    assert nodes['world'].is_up()


# --- at sea --------------------------------------------------------------------------------------


def test_in_real_time_an_auv_ticks_on_the_clock_and_answers_its_radio(
    start: Start, listener: Listener
) -> None:
    words = ['-p', 'tick_s:=0.1', '-p', 'speed_mps:=20.0', '-p', 'initial_path:=[0, 0, 0, 1]']
    auv = start('auv_sim', 'auv', '-r', '__ns:=/auv_1', *words)
    said: list[tuple[codec.Envelope, Message]] = []
    odometry: list[Odometry] = []
    listener.listen(RADIO_TX, lambda cdr: said.append(codec.decode(text_from_cdr(cdr))), '/auv_1')
    listener.listen(ODOM, lambda cdr: odometry.append(odometry_from_cdr(cdr)), '/auv_1')
    radio = listener.publisher(RADIO_RX, '/auv_1')

    listener.wait_for(lambda: bool(said))
    report = said[-1][1]
    assert isinstance(report, SurfacingReport)
    assert (report.cell, report.leg_id) == ((0, 1), 0)
    assert abs(odometry[-1].stamp_s - time.time()) < 5.0
    assert len({message.stamp_s for message in odometry}) > 3

    leg = Leg(leg_id=1, path=((0, 1), (1, 1)), surface_deadline_s=time.time() + 60.0)
    order = codec.encode(
        PathAssignment(auv='auv_1', leg=leg), src='uav', dst='auv_1', seq=0, stamp_s=time.time()
    )
    radio.publish(to_cdr(Text(order)))
    listener.wait_for(lambda: isinstance(said[-1][1], SurfacingReport) and said[-1][1].leg_id == 1)
    assert any(isinstance(body, Acknowledgement) for _, body in said)
    assert min(message.z_m for message in odometry) <= -1.0
    auv.signal(signal.SIGINT)
    code, output = auv.end()
    assert code == NodeExit.OK, output


def test_in_real_time_a_uav_plans_ahead_before_it_flies(
    start: Start, listener: Listener, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    let_nodes_fly_with_it(monkeypatch, tmp_path, 0.2)
    words = ['-p', 'tick_s:=0.1', '-p', f'planner:={NAME}']
    uav = start('uav_planner', 'uav', '-r', '__ns:=/uav', *words)
    heard: list[Message] = []
    for topic in (RADIO_TX, MISSION_EVENTS):
        listener.listen(
            topic, lambda cdr: heard.append(codec.decode(text_from_cdr(cdr))[1]), '/uav'
        )
    radio = listener.publisher(RADIO_RX, '/uav')
    listener.wait_for(lambda: listener.hearers('/uav/radio/rx') == {'/uav'})
    listener.wait_for(lambda: radio.get_subscription_count() == 1)

    leg = Leg(leg_id=0, path=((0, 0), (0, 1)), surface_deadline_s=time.time())
    order = MissionOrder(
        mission_id='strip',
        region=GridSpec(cols=3, rows=3, cell_m=10.0),
        c3=Point(east_m=15.0, north_m=0.0),
        radio_range_m=20.0,
        sortie_limit_s=60.0,
        path_cells=4,
        min_path_cells=1,
        surface_margin_s=0.0,
        handover_s=0.0,
        lost_after_sorties=3,
        auvs=(AuvOrder(name='auv_1', speed_mps=1.0, leg=leg),),
    )
    spoken = codec.encode(order, src='c3', dst='uav', seq=0, stamp_s=time.time())
    radio.publish(to_cdr(Text(spoken)))
    listener.wait_for(lambda: any(isinstance(body, SortieDeparted) for body in heard))
    assert isinstance(heard[0], Acknowledgement)
    shares = [body.share for body in heard[1:-1] if isinstance(body, PlanningAhead)]
    assert shares == sorted(shares)
    assert len(shares) == len(heard) - 2 == SLICES
    uav.signal(signal.SIGINT)
    code, output = uav.end()
    assert code == NodeExit.OK, output
