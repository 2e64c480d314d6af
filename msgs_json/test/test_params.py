from __future__ import annotations

from typing import Annotated, Any

import msgspec
import pytest

from msgs_json.params import Params, ParamSpec, param, specs, validated


class GliderParams(Params, frozen=True):
    """Parameters of a node that there is not."""

    name: Annotated[str, param('agent name')] = ''
    speed_mps: Annotated[float, param('speed', unit='m/s', ge=0.1, le=2.0)] = 0.3
    dives: Annotated[int, param('how many', ge=1, le=100)] = 10
    real: Annotated[bool, param('whether it gets wet')] = False
    cells: Annotated[tuple[int, ...], param('col, row, ...')] = (3, 7)
    peers: Annotated[list[str], param('names')] = msgspec.field(default_factory=lambda: ['c3'])


def test_a_declaration_is_read_in_order() -> None:
    found = specs(GliderParams)
    assert [spec.name for spec in found] == [
        *('name', 'speed_mps', 'dives', 'real', 'cells', 'peers')
    ]
    assert found[1] == ParamSpec(
        name='speed_mps',
        value_type=float,
        item_type=None,
        default=0.3,
        minimum=0.1,
        maximum=2.0,
        unit='m/s',
        description='speed',
    )
    assert (found[0].minimum, found[0].unit) == (None, '')


def test_lists_know_the_type_of_their_items() -> None:
    *_, cells, peers = specs(GliderParams)
    assert (cells.value_type, cells.item_type, cells.default) == (list, int, (3, 7))
    assert (peers.value_type, peers.item_type, peers.default) == (list, str, ['c3'])


def test_valid_values_and_defaults() -> None:
    params = validated(GliderParams, {'speed_mps': 1, 'cells': [1, 2, 3, 4]})
    assert params == GliderParams(speed_mps=1.0, cells=(1, 2, 3, 4))
    assert type(params.speed_mps) is float


@pytest.mark.parametrize('speed_mps', [0.1, 2.0])
def test_a_range_includes_its_ends(speed_mps: float) -> None:
    assert validated(GliderParams, {'speed_mps': speed_mps}).speed_mps == speed_mps


@pytest.mark.parametrize(
    ('values', 'in_text'),
    [
        ({'speed_mps': 2.1}, ['speed_mps', '<= 2.0', '2.1']),
        ({'speed_mps': 0.0}, ['speed_mps', '>= 0.1', '0.0']),
        ({'speed_mps': float('nan')}, ['speed_mps', 'nan']),
        ({'speed_mps': '1.0'}, ['speed_mps', 'float', "'1.0'"]),
        ({'dives': 1.5}, ['dives', 'int', '1.5']),
        ({'dives': True}, ['dives', 'int', 'True']),
        ({'real': 1}, ['real', 'bool', '1']),
        ({'cells': [1, 'two']}, ['cells', 'int', "'two'"]),
        ({'colour': 'red'}, ['colour']),
    ],
)
def test_errors_name_parameter_value_and_what_is_allowed(
    values: dict[str, Any], in_text: list[str]
) -> None:
    with pytest.raises(ValueError, match='parameter ') as refused:
        validated(GliderParams, values)
    for part in in_text:
        assert part in str(refused.value)
