"""A mission in one process is carried by the same world as one of nodes."""

from __future__ import annotations

from c3_station.in_process import fly, in_memory
from c3_station.scenario_files import load_scenario
from msgs_json import codec
from msgs_json.agent_shell import AgentSetting, Frame
from msgs_json.messages import RadioStatus
from msgs_json.ros_messages import Text
from msgs_json.topics import RADIO_RX, RADIO_STATUS


def test_the_world_carries_nothing_that_is_not_signed_with_the_key_of_c3() -> None:
    genuine, other = in_memory(bytes(32)), in_memory(bytes([1]) * 32)
    statuses: list[object] = []
    heard_by: set[str] = set()

    def setting(name: str) -> AgentSetting:
        return (other if name == 'auv_1' else genuine)(name)

    def sink(name: str, frame: Frame) -> None:
        if frame.topic is RADIO_STATUS and isinstance(frame.message, Text):
            statuses.append(codec.decode(frame.message.data)[1])
        if frame.topic is RADIO_RX:
            heard_by.add(name)

    fly(load_scenario('minimal'), sink, make_setting=setting)
    status = statuses[-1]
    assert isinstance(status, RadioStatus)
    assert status.blocked['auth'] > 0
    assert 'c3' in heard_by
