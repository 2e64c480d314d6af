"""
Saves what is in a bag whose recorder was killed, or whose disk was full.

Such a bag has no metadata.yaml, and its MCAP file ends somewhere, without its index. Every record
that is whole is taken over, those of the last chunk too.
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
from rosbags.rosbag2 import ReaderError, WriterError
from rosbags.rosbag2.metadata import parse_qos

from c3_station.bag import BagError, BagFacts, BagReader, JazzyWriter, mcap_files

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


def recover_bag(path: Path, out: Path) -> int:
    """
    Write what can be saved of a bag into a new one.

    Parameters
    ----------
    path
        The broken bag: its folder, the MCAP file in it, or a mission's folder with ``bag`` in it.
    out
        The new bag's folder; it must not exist.

    Returns
    -------
    int
        How many messages were saved.

    Raises
    ------
    BagError
        There is nothing to save, nothing to mend, or no way to write ``out``.

    """
    if _is_whole(path):
        raise BagError(f'{path}: is whole and can be read; there is nothing to recover')
    saved = _Saved()
    files = _files(path)
    for file in files:
        saved.read(file)
    if not saved.messages:
        sizes = ', '.join(f'{file.name} of {file.stat().st_size} bytes' for file in files)
        raise BagError(f'{path}: holds no whole message ({sizes}); nothing can be recovered')
    try:
        _write(saved, out)
    except (OSError, WriterError) as error:
        raise BagError(f'{out}: cannot be written: {error}') from None
    return len(saved.messages)


def _is_whole(path: Path) -> bool:
    try:
        with BagReader(path) as reader:
            return sum(1 for _ in reader.messages()) == reader.message_count
    except BagError:
        return False


def _files(path: Path) -> list[Path]:
    if not path.exists():
        raise BagError(f'{path}: there is no such bag')
    if path.is_file():
        return [path]
    files = mcap_files(path) or mcap_files(path / 'bag')
    if not files:
        raise BagError(f'{path}: is no bag: there is no .mcap file in it')
    return files


@dataclass(frozen=True, slots=True, kw_only=True)
class _Channel:
    """A topic as the broken bag declares it."""

    topic: str
    ros_type: str
    definition: str
    type_hash: str
    qos: list[Qos]


_DAMAGED = (McapError, ReaderError, ValueError, LookupError, struct.error)
"""What comes of a record that is whole but makes no sense."""


@dataclass(slots=True)
class _Saved:
    """What was found in the files of a bag."""

    channels: dict[str, _Channel] = field(default_factory=dict)
    """By topic."""
    messages: list[tuple[str, int, bytes]] = field(default_factory=list)
    """Topic, log time and CDR bytes, as written."""

    def read(self, file: Path) -> None:
        """Take in all whole records of a file; one that makes no sense is left out."""
        try:
            data = file.read_bytes()
        except OSError as error:
            raise BagError(f'{file}: cannot be read: {error.strerror}') from None
        if data[: len(MAGIC)] != MAGIC[: len(data)]:
            raise BagError(f'{file}: is no MCAP file')
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
                self.channels[channel.topic] = _Channel(
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
        raise BagError(
            f'{file}: its chunks are compressed, which this recorder never does; try: mcap recover'
        )
    # The length of the records, 8 bytes, stands before them.
    yield from _records(chunk[_CHUNK_HEAD.size + 8 :], file)


def _write(saved: _Saved, out: Path) -> None:
    with JazzyWriter(out) as writer:
        connections = {
            channel.topic: writer.add_connection(
                channel.topic,
                channel.ros_type,
                msgdef=channel.definition,
                rihs01=channel.type_hash,
                offered_qos_profiles=channel.qos,
            )
            for channel in saved.channels.values()
        }
        for topic, log_time_ns, cdr in saved.messages:
            writer.write(connections[topic], log_time_ns, cdr)
        writer.set_facts(BagFacts(complete=False))
