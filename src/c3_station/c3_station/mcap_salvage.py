"""
Reads what is in an MCAP file that ends somewhere, without its index, or is damaged.

Every record that is whole counts, those of the last chunk too.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from typing import TYPE_CHECKING

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from rosbags.interfaces import Qos
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MAGIC = b'\x89MCAP0\r\n'
"""The first bytes of every MCAP file."""

_RECORD_HEAD = struct.Struct('<BQ')
"""Kind and length of a record."""
_CHUNK_HEAD = struct.Struct('<QQQII')
"""Start, end, size, checksum, and the length of the compression's name, which follows."""
_MESSAGE_HEAD = struct.Struct('<HIQQ')
"""Channel, sequence number, log time, publish time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SalvagedChannel:
    """A topic as the broken bag declares it."""

    topic: str
    ros_type: str
    definition: str
    type_hash: str
    qos: list[Qos]


_DAMAGED = (McapError, ReaderError, ValueError, LookupError, struct.error)
"""What comes of a record that is whole but makes no sense."""


@dataclass(slots=True)
class Salvage:
    """
    What was found in the MCAP files of a bag.

    Raises
    ------
    ValueError
        Of `read`: the file cannot be read, or is none that this recorder can have made.

    """

    channels: dict[str, SalvagedChannel] = field(default_factory=dict)
    """By topic."""
    messages: list[tuple[str, int, bytes]] = field(default_factory=list)
    """Topic, log time and CDR bytes, as written."""

    def read(self, file: Path) -> None:
        """Take in all whole records of a file; one that makes no sense is left out."""
        try:
            data = file.read_bytes()
        except OSError as error:
            raise ValueError(f'{file}: cannot be read: {error.strerror}') from None
        if data[: len(MAGIC)] != MAGIC[: len(data)]:
            raise ValueError(f'{file}: is no MCAP file')
        schemas: dict[int, Schema] = {}
        topics: dict[int, str] = {}
        for kind, content in _records(memoryview(data)[len(MAGIC) :], file):
            with suppress(*_DAMAGED):
                self._take(kind, content, schemas, topics)

    def _take(
        self, kind: int, content: memoryview, schemas: dict[int, Schema], topics: dict[int, str]
    ) -> None:
        match kind:
            case Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(content)))
                schemas[schema.id] = schema
            case Opcode.CHANNEL:
                channel = Channel.read(ReadDataStream(BytesIO(content)))
                schema = schemas[channel.schema_id]
                self.channels[channel.topic] = SalvagedChannel(
                    topic=channel.topic,
                    ros_type=schema.name,
                    definition=schema.data.decode(),
                    type_hash=channel.metadata['topic_type_hash'],
                    qos=parse_qos(channel.metadata['offered_qos_profiles']),
                )
                topics[channel.id] = channel.topic
            case Opcode.MESSAGE:
                channel_id, _, log_time_ns, _ = _MESSAGE_HEAD.unpack_from(content)
                cdr = bytes(content[_MESSAGE_HEAD.size :])
                self.messages.append((topics[channel_id], log_time_ns, cdr))


def _records(data: memoryview, file: Path) -> Iterator[tuple[int, memoryview]]:
    """Yield kind and content of the whole records, those of the chunks in place of the chunks."""
    at = 0
    while at + _RECORD_HEAD.size <= len(data):
        kind, length = _RECORD_HEAD.unpack_from(data, at)
        at += _RECORD_HEAD.size
        content = data[at : at + length]
        if kind == Opcode.CHUNK:
            yield from _chunk_records(content, file)
        elif len(content) == length:
            yield kind, content
        at += length


def _chunk_records(chunk: memoryview, file: Path) -> Iterator[tuple[int, memoryview]]:
    if len(chunk) < _CHUNK_HEAD.size:
        return
    *_, name_length = _CHUNK_HEAD.unpack_from(chunk)
    if name_length:
        raise ValueError(
            f'{file}: its chunks are compressed, which this recorder never does; try: mcap recover'
        )
    # The length of the records, 8 bytes, stands before them.
    yield from _records(chunk[_CHUNK_HEAD.size + 8 :], file)
