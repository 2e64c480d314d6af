"""Strict decoding of a choice between models that a parameter holds as JSON."""

from __future__ import annotations

from typing import TypeVar, get_args

import msgspec

T = TypeVar('T')


def decode_tagged(parameter: str, text: str, decoder: msgspec.json.Decoder[T]) -> T:
    """
    Return what a parameter holds; the decoder is that of a union of tagged structs.

    Raises
    ------
    ValueError
        Names the parameter, its value, the JSON path at fault and what is allowed.

    """
    try:
        return decoder.decode(text)
    except msgspec.MsgspecError as error:
        allowed = ' or '.join(_shape(choice) for choice in _candidates(text, decoder))
        raise ValueError(f'{parameter} is {text!r}: {error}; allowed is {allowed}') from None


def _candidates(text: str, decoder: msgspec.json.Decoder[T]) -> list[type[msgspec.Struct]]:
    """Return the choice that a text names, or all where it names none."""
    choices = list(get_args(decoder.type))
    try:
        named = msgspec.json.decode(text, type=dict[str, object])
    except msgspec.MsgspecError:
        return choices
    return [
        choice
        for choice in choices
        if choice.__struct_config__.tag == named.get(choice.__struct_config__.tag_field)
    ] or choices


def _shape(choice: type[msgspec.Struct]) -> str:
    config = choice.__struct_config__
    fields = [
        field.encode_name if field.required else f'{field.encode_name} (optional)'
        for field in msgspec.structs.fields(choice)
    ]
    return '{' + ', '.join([f'"{config.tag_field}": "{config.tag}"', *fields]) + '}'
