"""docs/interfaces.md is what the code declares, all of it."""

from __future__ import annotations

import importlib
import pkgutil
import re
from pathlib import Path
from typing import get_args

import auv_sim
import c3_station
import uav_planner
from c3_station.interfaces import interfaces_markdown
from msgs_json.agent_params import AgentParams
from msgs_json.codec import SCHEMA_TYPES
from msgs_json.messages import MissionEvent, OperatorCommand
from msgs_json.params import Params, specs
from msgs_json.topics import TOPICS

PAGE = Path(__file__).resolve().parents[3] / 'docs' / 'interfaces.md'
TEXT = interfaces_markdown()


def test_the_page_is_current() -> None:
    assert PAGE.read_text(encoding='utf-8') == TEXT, (
        'run python -m c3_station.interfaces > docs/interfaces.md'
    )


def test_every_topic_is_there() -> None:
    for topic in TOPICS:
        assert f'| `{topic.name}` | `{topic.ros_type}` | [{topic.qos.name}]' in TEXT


def test_every_message_every_event_and_every_command_has_its_section() -> None:
    headings = set(re.findall('^#+ (.*)$', TEXT, flags=re.MULTILINE))
    assert headings >= set(SCHEMA_TYPES)
    assert headings >= {event.__name__ for event in get_args(MissionEvent)}
    assert headings >= {command.__name__ for command in get_args(OperatorCommand)}


def test_every_link_within_the_page_leads_somewhere() -> None:
    anchors = {
        re.sub('[^a-z0-9_-]', '', heading.lower().replace(' ', '-'))
        for heading in re.findall('^#+ (.*)$', TEXT, flags=re.MULTILINE)
    }
    assert set(re.findall(r'\]\(#(.*?)\)', TEXT)) <= anchors


def test_every_link_to_a_file_leads_somewhere() -> None:
    targets = set(re.findall(r'\]\(([^#].*?)\)', TEXT))
    assert len(targets) > len(SCHEMA_TYPES)
    assert {target for target in targets if not (PAGE.parent / target).exists()} == set()


def test_every_parameter_of_every_node_is_there() -> None:
    for room in (auv_sim, uav_planner, c3_station):
        for module in pkgutil.iter_modules(room.__path__):
            if module.name.endswith('_params'):
                importlib.import_module(f'{room.__name__}.{module.name}')
    # Of AUV, UAV and C3 there is a base between; it stands for no node.
    nodes = {*Params.__subclasses__(), *AgentParams.__subclasses__()} - {AgentParams}
    nodes = {each for each in nodes if '.' in each.__module__}
    assert len(nodes) >= 6
    for node in nodes:
        for spec in specs(node):
            assert f'| `{spec.name}` |' in TEXT
            assert spec.description.replace('|', '\\|') in TEXT


def test_only_names_of_agents_are_called_so() -> None:
    assert '| `transfer` | string |' in TEXT  # a text of a pattern, and no name
    assert '| `auv` | agent name |' in TEXT
