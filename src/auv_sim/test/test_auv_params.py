"""An AUV's parameters as somebody types them who starts its node by hand."""

from __future__ import annotations

import msgspec
import pytest

from auv_sim.auv_params import AuvParams, make_auv
from msgs_json.agent_shell import AgentSetting
from msgs_json.drivers import NoPorts
from msgs_json.store import MemoryStore

BAY = AuvParams(name='auv_1', cols=3, rows=2, masked=(1, 0, 2, 1), initial_path=(0, 0, 0, 1))
"""
In the terminal view, north up::

    . . #
    . # .
"""


def in_memory() -> AgentSetting:
    return AgentSetting(store=MemoryStore(), authenticator=None)


def test_a_path_beside_land_is_taken() -> None:
    assert make_auv(BAY, NoPorts(), in_memory()).agent.name == 'auv_1'


@pytest.mark.parametrize(
    ('changes', 'told'),
    [
        ({'masked': (1, 0, 2)}, 'parameter masked is (1, 0, 2); it must hold col, row of each'),
        ({'masked': (1, 0, 3, 1)}, 'parameter masked, cell 1, is [3, 1], outside the grid'),
        ({'masked': (-1, 0)}, 'parameter masked, cell 0, is [-1, 0], outside the grid'),
        ({'masked': (1, 0, 1, 0)}, 'masked, cell 1, is [1, 0], which is masked already'),
        (
            {'initial_path': (0, 0, 1, 0)},
            'parameter initial_path is (0, 0, 1, 0): cell [1, 0] is masked (land, no-go)',
        ),
        ({'initial_path': (0, 0, 0, 2)}, 'cell [0, 2] lies outside the region of 3 x 2 cells'),
        ({'initial_path': (0, 0)}, 'initial_path is (0, 0); it must hold col, row of at least 2'),
        ({'initial_path': (0, 0, 0, 1, 1)}, 'it must hold col, row of at least 2'),
    ],
)
def test_what_is_no_region_or_no_path_is_told_by_parameter(
    changes: dict[str, tuple[int, ...]], told: str
) -> None:
    with pytest.raises(ValueError, match='parameter ') as refused:
        make_auv(msgspec.structs.replace(BAY, **changes), NoPorts(), in_memory())
    assert told in str(refused.value)
