"""Bags: written as Jazzy writes them, read back in order, saved when they are cut off."""

from __future__ import annotations

import errno
import functools
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from c3_station.bag import (
    BagError,
    BagFacts,
    BagReader,
    BagWriter,
    LogTimes,
    recover_bag,
    stamp_ns,
)
from c3_station.in_process import fly
from c3_station.recorded_topics import RecordedTopic, mission_topics
from c3_station.scenario import Scenario
from c3_station.scenario_files import load_scenario, parse_scenario, scenario_json
from msgs_json import codec, topics
from msgs_json.agent_shell import Frame
from msgs_json.geometry import Point
from msgs_json.messages import RadioStatus
from msgs_json.ros_messages import (
    ClockTime,
    ColouredCells,
    Diagnostics,
    Markers,
    Occupancy,
    Odometry,
    PoseSetpoint,
    RosMessage,
    Text,
    TrackPath,
    to_cdr,
)

ORIGIN = Point(east_m=0.0, north_m=0.0)
EVENTS = RecordedTopic(name='/mission_events', topic=topics.MISSION_EVENTS, publisher='every node')
STATUS = RecordedTopic(name='/c3/mission_status', topic=topics.MISSION_STATUS, publisher='c3')
RECORDED = (EVENTS, STATUS)


def text(number: int) -> bytes:
    """Return a message that is found in a file by its bytes."""
    return to_cdr(Text(f'message {number:06d} of this bag'.encode()))


def write(path: Path, count: int, *, flush_every: int = 10) -> list[bytes]:
    written = [text(number) for number in range(count)]
    with BagWriter(path, RECORDED) as writer:
        for number, cdr in enumerate(written):
            writer.write(RECORDED[number % 2].name, cdr, number * 1_000)
            if number % flush_every == 0:
                writer.flush()
    return written


# --- the format ----------------------------------------------------------------------------------


def test_metadata_is_what_jazzy_writes(tmp_path: Path) -> None:
    write(tmp_path / 'bag', 5)
    metadata = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())
    info = metadata['rosbag2_bagfile_information']
    assert info['version'] == 9
    assert info['storage_identifier'] == 'mcap'
    assert info['relative_file_paths'] == ['bag.mcap']
    assert info['message_count'] == 5
    assert info['duration'] == {'nanoseconds': 4_000}
    status = info['topics_with_message_count'][1]
    assert status['message_count'] == 2
    described = status['topic_metadata']
    store = get_typestore(Stores.ROS2_JAZZY)
    assert described['type_description_hash'] == store.hash_rihs01(topics.STRING)
    assert described['name'] == '/c3/mission_status'
    assert described['type'] == 'std_msgs/msg/String'
    infinite = {'sec': 9223372036, 'nsec': 854775807}
    assert described['offered_qos_profiles'] == [
        {
            'history': 'keep_last',
            'depth': 1,
            'reliability': 'reliable',
            'durability': 'transient_local',
            'deadline': infinite,
            'lifespan': infinite,
            'liveliness': 'automatic',
            'liveliness_lease_duration': infinite,
            'avoid_ros_namespace_conventions': False,
        }
    ]


def test_mcap_channels_have_qos_and_type_hash_as_jazzy_writes_them(tmp_path: Path) -> None:
    write(tmp_path / 'bag', 3)
    with (tmp_path / 'bag' / 'bag.mcap').open('rb') as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    store = get_typestore(Stores.ROS2_JAZZY)
    for channel in summary.channels.values():
        assert channel.message_encoding == 'cdr'
        assert channel.metadata['topic_type_hash'] == store.hash_rihs01(topics.STRING)
        (qos,) = yaml.safe_load(channel.metadata['offered_qos_profiles'])
        assert qos['reliability'] == 'reliable'
        durable = channel.topic == '/c3/mission_status'
        assert qos['durability'] == ('transient_local' if durable else 'volatile')


def test_plain_readers_read_a_mission(tmp_path: Path) -> None:
    scenario = load_scenario('minimal')
    counted = record(tmp_path / 'bag', parse_scenario(scenario_json(scenario).decode()))
    with Reader(tmp_path / 'bag') as reader:
        assert {each.topic: each.msgcount for each in reader.connections} == counted
        store = get_typestore(Stores.ROS2_JAZZY)
        for connection, _, cdr in reader.messages():
            store.deserialize_cdr(cdr, connection.msgtype)
    with (tmp_path / 'bag' / 'bag.mcap').open('rb') as file:
        decoded = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        assert sum(1 for _ in decoded) == sum(counted.values())


def record(path: Path, scenario: Scenario) -> dict[str, int]:
    """Fly a scenario into a bag; return the number of messages by topic."""
    counted = {recorded.name: 0 for recorded in mission_topics(scenario)}
    with BagWriter(path, mission_topics(scenario)) as writer:

        def sink(name: str, frame: Frame) -> None:
            topic = frame.topic.resolve(f'/{name}')
            cdr = to_cdr(frame.message)
            stamp = stamp_ns(frame.topic.ros_type, cdr)
            assert stamp is not None
            writer.write(topic, cdr, stamp)
            counted[topic] += 1

        fly(scenario, sink)
    return counted


def test_facts_come_back_and_are_not_complete_unless_said(tmp_path: Path) -> None:
    facts = BagFacts(wall_s=12.25, real_time_factor=43.5, complete=True)
    with BagWriter(tmp_path / 'told', RECORDED) as writer:
        writer.close(facts)
    with BagWriter(tmp_path / 'untold', RECORDED):
        pass
    with BagReader(tmp_path / 'told') as reader:
        assert reader.facts == facts
    with BagReader(tmp_path / 'untold') as reader:
        assert reader.facts == BagFacts()
        assert not reader.facts.complete


def test_bag_without_messages_is_readable_and_declares_its_topics(tmp_path: Path) -> None:
    write(tmp_path / 'bag', 0)
    with BagReader(tmp_path / 'bag') as reader:
        assert reader.message_count == 0
        assert list(reader.messages()) == []
        assert reader.topics == {recorded.name: topics.STRING for recorded in RECORDED}


# --- round trip ----------------------------------------------------------------------------------


@settings(max_examples=40)
@given(
    messages=st.lists(
        st.tuples(
            st.sampled_from([recorded.name for recorded in RECORDED]),
            st.binary(max_size=40),
            st.integers(0, 5) | st.integers(0, 2**62),
            st.booleans(),
        ),
        max_size=30,
    )
)
def test_messages_come_back_by_time_and_equal_times_as_written(
    tmp_path_factory: pytest.TempPathFactory, messages: list[tuple[str, bytes, int, bool]]
) -> None:
    path = tmp_path_factory.mktemp('round_trip') / 'bag'
    with BagWriter(path, RECORDED) as writer:
        for topic, cdr, log_time_ns, flushed in messages:
            writer.write(topic, cdr, log_time_ns)
            if flushed:
                writer.flush()
    expected = sorted(((t, c, n) for t, c, n, _ in messages), key=lambda each: each[2])
    with BagReader(path) as reader:
        read = [(each.topic, each.cdr, each.log_time_ns) for each in reader.messages()]
        some = [each.cdr for each in reader.messages({EVENTS.name})]
    assert read == expected
    assert some == [cdr for topic, cdr, _ in expected if topic == EVENTS.name]


# --- stamps --------------------------------------------------------------------------------------

STAMPED: list[tuple[str, RosMessage]] = [
    (
        'nav_msgs/msg/Odometry',
        Odometry(
            stamp_s=12.5,
            child_frame_id='uav/base_link',
            position=ORIGIN,
            z_m=0.0,
            heading_rad=0.0,
            speed_mps=0.0,
        ),
    ),
    ('nav_msgs/msg/Path', TrackPath(stamp_s=12.5, points=(ORIGIN,))),
    ('nav_msgs/msg/OccupancyGrid', Occupancy(stamp_s=12.5, cell_m=1.0, values=((0,),))),
    (
        'geometry_msgs/msg/PoseStamped',
        PoseSetpoint(stamp_s=12.5, position=ORIGIN, z_m=0.0, heading_rad=0.0),
    ),
    (
        'visualization_msgs/msg/MarkerArray',
        Markers(
            stamp_s=12.5,
            cells=(ColouredCells(name='x', centres=(), colours=(), width_m=1.0),),
        ),
    ),
    ('diagnostic_msgs/msg/DiagnosticArray', Diagnostics(stamp_s=12.5, statuses=())),
    ('rosgraph_msgs/msg/Clock', ClockTime(time_s=12.5)),
    (
        topics.STRING,
        Text(
            codec.encode(
                RadioStatus(delivered=0, blocked={}), src='world', dst='*', seq=0, stamp_s=12.5
            )
        ),
    ),
]


@pytest.mark.parametrize(('ros_type', 'message'), STAMPED, ids=[each for each, _ in STAMPED])
def test_stamp_is_found_in_the_bytes(ros_type: str, message: RosMessage) -> None:
    cdr = to_cdr(message)
    assert stamp_ns(ros_type, cdr) == 12_500_000_000
    if ros_type != topics.STRING:
        store = get_typestore(Stores.ROS2_JAZZY)
        big_endian = store.serialize_cdr(
            store.deserialize_cdr(cdr, ros_type), ros_type, little_endian=False
        )
        assert stamp_ns(ros_type, bytes(big_endian)) == 12_500_000_000


def test_every_recorded_type_has_a_stamp() -> None:
    recorded = {each.topic.ros_type for each in mission_topics(load_scenario('minimal'))}
    assert recorded <= {ros_type for ros_type, _ in STAMPED}


@given(ros_type=st.sampled_from([each for each, _ in STAMPED]), cdr=st.binary(max_size=40))
def test_bytes_that_are_no_message_have_no_stamp_or_some_time(ros_type: str, cdr: bytes) -> None:
    stamp = stamp_ns(ros_type, cdr)
    assert stamp is None or stamp >= 0


def test_a_message_without_a_stamp_has_the_log_time_of_the_one_before_it_on_its_topic() -> None:
    def text(data: bytes) -> bytes:
        return to_cdr(Text(data))

    times = LogTimes()
    said = [
        ('/auv_1/radio/rx', text(b'{"stamp":12.5}'), 12_500_000_000),
        ('/auv_2/radio/rx', text(b'{"stamp":20}'), 20_000_000_000),
        ('/auv_1/radio/rx', text(b'{"st\xffmp":13}'), 12_500_000_000),
        ('/uav/radio/rx', text(b'?'), 0),
        ('/auv_1/radio/rx', text(b'{"stamp":12}'), 12_000_000_000),
    ]
    for topic, cdr, expected in said:
        assert times.log_time_ns(topic, topics.STRING, cdr) == expected


def test_no_markers_no_stamp() -> None:
    cdr = to_cdr(Markers(stamp_s=12.5, cells=()))
    assert stamp_ns('visualization_msgs/msg/MarkerArray', cdr) is None
    assert stamp_ns('sensor_msgs/msg/Unknown', cdr) is None


@pytest.mark.parametrize(
    'text',
    [
        b'{"zz":' + b'[' * 5000 + b']' * 5000 + b',"stamp":1.0}',
        b'{"stamp":1e11}',
        b'{"stamp":9223372036.9}',
        b'{"stamp":-1.0}',
    ],
    ids=['nested', 'latest of the contract', 'just too late', 'negative'],
)
def test_stranger_s_json_has_no_stamp_and_can_be_recorded(text: bytes, tmp_path: Path) -> None:
    cdr = to_cdr(Text(text))
    stamp = stamp_ns(topics.STRING, cdr)
    assert stamp is None
    with BagWriter(tmp_path / 'bag', mission_topics(load_scenario('minimal'))) as bag:
        bag.write('/mission_events', cdr, stamp or 0)
    with BagReader(tmp_path / 'bag') as reader:
        assert [each.cdr for each in reader.messages()] == [cdr]


def test_latest_stamp_that_fits_can_be_recorded(tmp_path: Path) -> None:
    cdr = to_cdr(Text(b'{"stamp":9223372036.0}'))
    stamp = stamp_ns(topics.STRING, cdr)
    assert stamp == 9_223_372_036_000_000_000
    with BagWriter(tmp_path / 'bag', mission_topics(load_scenario('minimal'))) as bag:
        bag.write('/mission_events', cdr, stamp)
        bag.flush()
    with BagReader(tmp_path / 'bag') as reader:
        assert [each.log_time_ns for each in reader.messages()] == [stamp]


# --- what a mission records ----------------------------------------------------------------------


def test_topics_are_those_of_the_contract_without_the_lockstep() -> None:
    recorded = {each.topic for each in mission_topics(load_scenario('ecc2009'))}
    left_out = set(topics.TOPICS) - recorded
    assert {topic.name for topic in left_out} == {
        '/world/tick',
        '/world/done',
        '/world/hello',
        '/world/go',
        '/world/ready',
        '/world/waiting',
        'command',
        'setpoint_position/local',
        'local_position/odom',
    }


def test_names_are_placed_by_node_and_given_once() -> None:
    names = [each.name for each in mission_topics(load_scenario('ecc2009'))]
    assert len(names) == len(set(names))
    assert {'/clock', '/uav/odom', '/auv_3/radio/rx', '/c3/exploration_map'} < set(names)
    assert '/c3/odom' not in names


def test_vehicle_on_topics_has_its_setpoints_recorded() -> None:
    text = scenario_json(load_scenario('minimal')).decode()
    scenario = parse_scenario(text.replace('"driver":"kinematic"', '"driver":"topics"', 1))
    by_name = {each.name: each.publisher for each in mission_topics(scenario)}
    assert by_name['/uav/setpoint_position/local'] == 'uav'
    assert by_name['/uav/local_position/odom'] == 'autopilot'
    assert '/auv_1/setpoint_position/local' not in by_name


# --- trouble while writing -----------------------------------------------------------------------


def test_existing_folder_is_left_alone(tmp_path: Path) -> None:
    write(tmp_path / 'bag', 3)
    before = (tmp_path / 'bag' / 'bag.mcap').read_bytes()
    with pytest.raises(BagError, match='exists already'):
        BagWriter(tmp_path / 'bag', RECORDED)
    assert (tmp_path / 'bag' / 'bag.mcap').read_bytes() == before


def test_place_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(BagError, match='cannot be written: Not a directory'):
        BagWriter(tmp_path / 'file' / 'bag', RECORDED)


def test_full_disk_is_an_error_that_says_how_to_save_the_rest(tmp_path: Path) -> None:
    writer = BagWriter(tmp_path / 'bag', RECORDED)
    writer.write(EVENTS.name, text(0), 0)
    writer.flush()

    def full() -> NoReturn:
        raise OSError(errno.ENOSPC, 'No space left on device')

    assert writer._writer is not None
    writer._writer.flush = full  # type: ignore[method-assign]
    with pytest.raises(BagError, match=r'No space left on device.*orchestrate.py recover'):
        writer.flush()
    with pytest.raises(BagError, match='is closed'):
        writer.write(EVENTS.name, text(1), 1)
    writer.close()
    assert recover_bag(tmp_path / 'bag', tmp_path / 'saved') == 1


def test_exception_in_the_middle_leaves_a_readable_bag(tmp_path: Path) -> None:
    def interrupted() -> NoReturn:
        with BagWriter(tmp_path / 'bag', RECORDED) as writer:
            writer.write(EVENTS.name, text(0), 0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    with BagReader(tmp_path / 'bag') as reader:
        assert [each.cdr for each in reader.messages()] == [text(0)]


# --- trouble while reading -----------------------------------------------------------------------


def test_missing_or_other_folder_is_no_bag(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='there is no such bag'):
        BagReader(tmp_path / 'none')
    with pytest.raises(BagError, match='is no bag'):
        BagReader(tmp_path)
    (tmp_path / 'text.txt').write_text('x')
    with pytest.raises(BagError, match='cut off or damaged'):
        BagReader(tmp_path / 'text.txt')


def test_bag_is_found_in_a_missions_folder_and_as_a_file(tmp_path: Path) -> None:
    written = write(tmp_path / 'bag', 4)
    for path in (tmp_path, tmp_path / 'bag', tmp_path / 'bag' / 'bag.mcap'):
        with BagReader(path) as reader:
            assert [each.cdr for each in reader.messages()] == written


def test_bag_without_metadata_says_how_to_mend_it(tmp_path: Path) -> None:
    written = write(tmp_path / 'bag', 7)
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    with pytest.raises(BagError, match=r'was not closed.*orchestrate.py recover'):
        BagReader(tmp_path / 'bag')
    assert recover_bag(tmp_path, tmp_path / 'saved') == len(written)


@functools.cache
def whole_file() -> bytes:
    """Return the bytes of a bag of 60 messages in several chunks."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / 'bag', 60)
        return (Path(folder) / 'bag' / 'bag.mcap').read_bytes()


@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_recovery_saves_every_whole_message_wherever_the_file_ends(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    whole = whole_file()
    end = data.draw(st.integers(0, len(whole)), label='bytes left')
    expected = [
        text(number)
        for number in range(60)
        if whole.index(text(number)) + len(text(number)) <= end
    ]
    folder = tmp_path_factory.mktemp('cut')
    (folder / 'bag').mkdir()
    (folder / 'bag' / 'bag.mcap').write_bytes(whole[:end])
    if end == len(whole):
        assert recover_bag(folder, folder / 'saved') == 60  # only metadata.yaml is missing
    elif not expected:
        with pytest.raises(BagError, match='nothing can be recovered'):
            recover_bag(folder, folder / 'saved')
        assert not (folder / 'saved').exists()
        return
    else:
        with (
            pytest.raises(BagError, match='cut off or damaged'),
            BagReader(folder / 'bag' / 'bag.mcap'),
        ):
            pass
        assert recover_bag(folder / 'bag', folder / 'saved') == len(expected)
    with BagReader(folder / 'saved') as reader:
        saved = list(reader.messages())
        assert not reader.facts.complete
    assert [each.cdr for each in saved] == expected
    assert [each.log_time_ns for each in saved] == [n * 1_000 for n in range(len(expected))]
    assert [each.topic for each in saved] == [RECORDED[n % 2].name for n in range(len(expected))]


@settings(max_examples=80, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_damaged_file_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    whole = whole_file()
    at = data.draw(st.integers(0, len(whole) - 1), label='at')
    value = data.draw(st.integers(0, 255), label='byte')
    file = tmp_path_factory.mktemp('damaged') / 'bag.mcap'
    file.write_bytes(whole[:at] + bytes([value]) + whole[at + 1 :])
    for use in (read_all, recover_aside):
        with suppress(BagError):  # anything else fails the test
            use(file)


def read_all(file: Path) -> None:
    with BagReader(file) as reader:
        for _ in reader.messages():
            pass


def recover_aside(file: Path) -> None:
    recover_bag(file, file.with_name('saved'))


def test_recovered_bag_has_the_same_topics_and_types(tmp_path: Path) -> None:
    record(tmp_path / 'bag', load_scenario('minimal'))
    with BagReader(tmp_path / 'bag') as reader:
        declared = reader.topics
        count = reader.message_count
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    assert recover_bag(tmp_path / 'bag', tmp_path / 'saved') == count
    with BagReader(tmp_path / 'saved') as reader:
        assert reader.topics == declared
    before, after = (
        yaml.safe_load((path / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
        for path in (again(tmp_path), tmp_path / 'saved')
    )
    assert after['topics_with_message_count'] == before['topics_with_message_count']


def again(folder: Path) -> Path:
    record(folder / 'again', load_scenario('minimal'))
    return folder / 'again'


def test_recovery_refuses_what_is_whole_missing_empty_or_something_else(tmp_path: Path) -> None:
    write(tmp_path / 'bag', 3)
    with pytest.raises(BagError, match='nothing to recover'):
        recover_bag(tmp_path / 'bag', tmp_path / 'saved')
    with pytest.raises(BagError, match='there is no such bag'):
        recover_bag(tmp_path / 'none', tmp_path / 'saved')
    (tmp_path / 'empty').mkdir()
    with pytest.raises(BagError, match=r'no \.mcap file'):
        recover_bag(tmp_path / 'empty', tmp_path / 'saved')
    (tmp_path / 'empty' / 'a.mcap').write_bytes(b'')
    with pytest.raises(BagError, match=r'a\.mcap of 0 bytes'):
        recover_bag(tmp_path / 'empty', tmp_path / 'saved')
    (tmp_path / 'empty' / 'a.mcap').write_text('no MCAP at all')
    with pytest.raises(BagError, match='is no MCAP file'):
        recover_bag(tmp_path / 'empty', tmp_path / 'saved')


def test_recovery_does_not_write_over_a_bag(tmp_path: Path) -> None:
    write(tmp_path / 'bag', 3)
    write(tmp_path / 'other', 3)
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    with pytest.raises(BagError, match='exists already'):
        recover_bag(tmp_path / 'bag', tmp_path / 'other')


RECORD_AND_DIE = """
import os, signal, sys
from pathlib import Path
from c3_station.bag import BagWriter
from c3_station.recorded_topics import mission_topics
from c3_station.scenario import Scenario
from c3_station.scenario_files import load_scenario
writer = BagWriter(Path(sys.argv[1]), mission_topics(load_scenario('minimal')))
for number in range(50):
    writer.write('/mission_events', b'flushed %d' % number, number)
writer.flush()
writer.write('/mission_events', b'in memory', 50)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_was_flushed_outlives_a_sigkill(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, '-c', RECORD_AND_DIE, str(tmp_path / 'bag')], check=False
    )
    assert run.returncode == -signal.SIGKILL
    with pytest.raises(BagError, match='recover'):
        BagReader(tmp_path / 'bag')
    assert recover_bag(tmp_path / 'bag', tmp_path / 'saved') == 50
    with BagReader(tmp_path / 'saved') as reader:
        assert [each.cdr for each in reader.messages()] == [b'flushed %d' % n for n in range(50)]
