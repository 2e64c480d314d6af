"""
Bags: rosbag2 folders with MCAP storage, as ROS 2 Jazzy writes and reads them.

Messages are stored as the CDR bytes that went over the topic. The log time of a message is its
own stamp, so that a bag shows simulated time whatever the wall clock did.
"""

from __future__ import annotations

import os
import struct
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, cast

import msgspec
from rosbags.interfaces import (
    Connection,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.interfaces import Qos as BagQos
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer, WriterError
from rosbags.rosbag2.storage_mcap import Channel, McapWriter, write_channel, write_string
from rosbags.typesys import Stores, get_typestore

from c3_station.mcap_salvage import Salvage
from msgs_json.messages import Seconds
from msgs_json.ros_messages import NANOSECONDS, nanoseconds, text_from_cdr
from msgs_json.topics import STRING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator
    from pathlib import Path
    from types import TracebackType
    from typing import Self

    from c3_station.recorded_topics import RecordedTopic
    from msgs_json.topics import Qos

RECOVER = 'python3 orchestrate.py recover'
"""What mends a bag that was not closed."""


class BagError(ValueError):
    """A bag cannot be written or read; the text names it and says what to do."""


class BagFacts(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What a bag says about its own making; the values of wall time are in no message."""

    wall_s: float | None = None
    """From the first tick to the last."""
    real_time_factor: float | None = None
    """Simulated time over wall time."""
    complete: bool = False
    """Whether the recorder saw the mission to its end and closed the bag itself."""


# --- stamps --------------------------------------------------------------------------------------


class _Stamped(msgspec.Struct):
    """The part of a JSON envelope that is looked at here."""

    stamp: Seconds


class _Signed(msgspec.Struct):
    """The part that says who speaks."""

    src: str


_stamp_decoder = msgspec.json.Decoder(_Stamped)
_source_decoder = msgspec.json.Decoder(_Signed)

_STAMP_AT = {
    'diagnostic_msgs/msg/DiagnosticArray': 4,
    'geometry_msgs/msg/PoseStamped': 4,
    'nav_msgs/msg/OccupancyGrid': 4,
    'nav_msgs/msg/Odometry': 4,
    'nav_msgs/msg/Path': 4,
    'rosgraph_msgs/msg/Clock': 4,
    # That of the first marker, behind the number of markers.
    'visualization_msgs/msg/MarkerArray': 8,
}
"""Where the time of a message stands in its CDR bytes, behind the 4 bytes of encapsulation."""
_LATEST_NS = 2**63 - 1
"""What a bag's metadata can say (292 years); a message may claim more."""


def stamp_ns(ros_type: str, cdr: bytes) -> int | None:
    """
    Return the time that a message carries, in nanoseconds; None where it carries none.

    Read from fixed places in the bytes (a recorder does not take messages apart); JSON envelopes
    by their ``stamp``.
    """
    if ros_type == STRING:
        try:
            stamp = nanoseconds(_stamp_decoder.decode(text_from_cdr(cdr)).stamp)
        except (ValueError, RecursionError):  # the latter: nested too deeply, whatever it says
            return None
        return stamp if 0 <= stamp <= _LATEST_NS else None
    offset = _STAMP_AT.get(ros_type)
    if offset is None or len(cdr) < offset + 8 or cdr[0] != 0 or cdr[1] not in (0, 1):
        return None
    order = '<' if cdr[1] else '>'
    if offset > 4 and struct.unpack_from(f'{order}I', cdr, 4) == (0,):
        return None
    seconds, fraction = struct.unpack_from(f'{order}iI', cdr, offset)
    return None if seconds < 0 else int(seconds * NANOSECONDS + fraction)


class LogTimes:
    """
    The log times of a mission's messages.

    A message without a stamp (what the radio delivers may be damaged) has that of the one before
    it on its topic: between topics there is no order.
    """

    def __init__(self) -> None:
        self._latest_ns: dict[str, int] = {}

    def log_time_ns(self, topic: str, ros_type: str, cdr: bytes) -> int:
        """Return the log time of the next message on a topic, in nanoseconds."""
        stamp = stamp_ns(ros_type, cdr)
        if stamp is None:
            return self._latest_ns.get(topic, 0)
        self._latest_ns[topic] = stamp
        return stamp


def source_of(cdr: bytes) -> str:
    """Return who sent a JSON envelope, as it claims; empty where it says nothing of the kind."""
    try:
        return _source_decoder.decode(text_from_cdr(cdr)).src
    except (ValueError, RecursionError):
        return ''


# --- writing -------------------------------------------------------------------------------------


class _JazzyMcapWriter(McapWriter):
    """MCAP with the hash of the type in every channel, where Jazzy's storage plugin has it."""

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        """Declare a channel; as in the base class, with one entry more in its metadata."""
        metadata = BytesIO()
        for text in (
            *('offered_qos_profiles', offered_qos_profiles),
            *('topic_type_hash', connection.digest),
        ):
            write_string(metadata, text)
        channel = Channel(
            connection.id, connection.msgtype, connection.topic, 'cdr', metadata.getvalue()
        )
        self.channels.append(channel)
        self.channel_stats[connection.id] = 0
        write_channel(self.chunk.bio, channel, self.schemas)


class _JazzyWriter(Writer):
    """rosbags' writer, set to what Jazzy's recorder writes."""

    STORAGE_PLUGINS = {StoragePlugin.MCAP: _JazzyMcapWriter}  # noqa: RUF012  as in the base class

    def __init__(self, path: Path) -> None:
        super().__init__(path, version=9, storage_plugin=StoragePlugin.MCAP)

    def flush(self) -> None:
        """Put everything written so far on the disk: it outlives a SIGKILL, and a power cut."""
        storage = cast('_JazzyMcapWriter', self.storage)
        if storage.chunk.msgs:
            storage.close_chunk()
        storage.bio.flush()
        os.fsync(storage.bio.fileno())

    def set_facts(self, facts: BagFacts) -> None:
        """Set what the bag says about itself."""
        for key, value in msgspec.to_builtins(facts).items():
            self.set_custom_data(key, str(value))


class BagWriter:
    """
    Writes one bag, its topics declared beforehand; a context manager.

    Leaving the context closes the bag, whatever happened: what was recorded stays readable.

    Raises
    ------
    BagError
        Here and in every method: the folder exists already, or cannot be written to.

    """

    def __init__(self, path: Path, topics: Iterable[RecordedTopic]) -> None:
        self.path = path
        self._writer = _JazzyWriter(path) if not path.exists() else None
        if self._writer is None:
            raise BagError(f'{path}: exists already; a bag is never written over another')
        store = get_typestore(Stores.ROS2_JAZZY)
        with self._writing() as writer:
            writer.open()
            self._connections = {
                recorded.name: writer.add_connection(
                    recorded.name,
                    recorded.topic.ros_type,
                    typestore=store,
                    offered_qos_profiles=[_bag_qos(recorded.topic.qos)],
                )
                for recorded in topics
            }
            writer.flush()

    def write(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
        """Add a message; ``topic`` is an absolute name that was declared."""
        with self._writing() as writer:
            writer.write(self._connections[topic], log_time_ns, cdr)

    def flush(self) -> None:
        """Make everything written so far outlive a power cut; call it a few times a second."""
        with self._writing() as writer:
            writer.flush()

    def close(self, facts: BagFacts | None = None) -> None:
        """Close the bag with what it says about itself; once is enough."""
        if self._writer is not None:
            with self._writing() as writer:
                writer.set_facts(facts or BagFacts())
                writer.close()
            self._writer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @contextmanager
    def _writing(self) -> Iterator[_JazzyWriter]:
        if self._writer is None:
            raise BagError(f'{self.path}: is closed')
        try:
            yield self._writer
        except (OSError, WriterError) as error:
            # What reached the disk stays; there is no use in trying again.
            with suppress(OSError):
                self._writer.abort()
            self._writer = None
            reason = error.strerror if isinstance(error, OSError) else error
            raise BagError(
                f'{self.path}: cannot be written: {reason}; what was recorded before can be saved'
                f' with: {RECOVER} {self.path}'
            ) from None


def _bag_qos(qos: Qos) -> BagQos:
    infinite = QosTime(9_223_372_036, 854_775_807)  # RMW_DURATION_INFINITE
    spec = qos.value
    return BagQos(
        history=QosHistory.KEEP_LAST,
        depth=spec.depth,
        reliability=QosReliability.RELIABLE if spec.reliable else QosReliability.BEST_EFFORT,
        durability=(
            QosDurability.TRANSIENT_LOCAL if spec.transient_local else QosDurability.VOLATILE
        ),
        deadline=infinite,
        lifespan=infinite,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=infinite,
        avoid_ros_namespace_conventions=False,
    )


# --- reading -------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BagMessage:
    """One message of a bag."""

    topic: str
    ros_type: str
    log_time_ns: int
    cdr: bytes


_BROKEN = (
    ReaderError,
    OSError,
    ValueError,
    struct.error,
    LookupError,
    TypeError,
    AssertionError,
    OverflowError,
    MemoryError,
)
"""What rosbags' reader raises on files that are cut off or damaged."""


class BagReader:
    """
    Reads a bag: its folder, the MCAP file in it, or a mission's folder with ``bag`` in it.

    Raises
    ------
    BagError
        There is no bag, or it is cut off or damaged.

    """

    def __init__(self, path: Path) -> None:
        self.path = find_bag(path)
        with self._reading():
            self._reader = Reader(self.path)
            self._reader.open()
            self.facts = _facts(self._reader.storage.metadata.custom)
            self.topics = {each.topic: each.msgtype for each in self._reader.connections}

    @property
    def message_count(self) -> int:
        """Return the number of messages."""
        return self._reader.message_count

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yield the messages (of some topics) by log time, equal ones as they were written."""
        wanted = [
            each for each in self._reader.connections if topics is None or each.topic in topics
        ]
        if not wanted:
            return
        with self._reading():
            for connection, log_time_ns, cdr in self._reader.messages(wanted):
                yield BagMessage(connection.topic, connection.msgtype, log_time_ns, bytes(cdr))

    def close(self) -> None:
        """Close the files."""
        self._reader.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    @contextmanager
    def _reading(self) -> Iterator[None]:
        try:
            yield
        except _BROKEN as error:
            raise BagError(
                f'{self.path}: is cut off or damaged ({error}); save what is in it with:'
                f' {RECOVER} {self.path}'
            ) from None


def find_bag(path: Path) -> Path:
    """
    Return where the bag is: ``path`` itself, or ``bag`` in a mission's folder.

    Raises
    ------
    BagError
        Nothing there looks like a bag, or it was not closed.

    """
    if not path.exists():
        raise BagError(f'{path}: there is no such bag')
    if path.is_file():
        return path
    folder = path / 'bag' if (path / 'bag').is_dir() else path
    if (folder / 'metadata.yaml').is_file():
        return folder
    if _mcap_files(folder):
        raise BagError(
            f'{folder}: was not closed: it has no metadata.yaml; mend it with: {RECOVER} {folder}'
        )
    raise BagError(f'{path}: is no bag: it has neither metadata.yaml nor an .mcap file')


def _mcap_files(folder: Path) -> list[Path]:
    """Return the MCAP files of a bag's folder, in the order in which they were written."""
    return sorted(folder.glob('*.mcap'))


def _facts(custom: dict[str, str] | None) -> BagFacts:
    """Return the facts among a bag's custom data; a bag of another maker has none."""
    try:
        return msgspec.convert(custom or {}, BagFacts, strict=False)
    except msgspec.ValidationError:
        return BagFacts()


# --- mending -------------------------------------------------------------------------------------


def recover_bag(path: Path, out: Path) -> int:
    """
    Write what can be saved of a bag that was not closed, or is damaged, into a new one.

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
    salvage = salvage_bag(path)
    if not salvage.messages:
        sizes = ', '.join(
            f'{file.name} of {file.stat().st_size} bytes' for file in _files_to_salvage(path)
        )
        raise BagError(f'{path}: holds no whole message ({sizes}); nothing can be recovered')
    try:
        _write_salvage(salvage, out)
    except (OSError, WriterError) as error:
        raise BagError(f'{out}: cannot be written: {error}') from None
    return len(salvage.messages)


def salvage_bag(path: Path) -> Salvage:
    """
    Return all that is in a bag, whole or not.

    Raises
    ------
    BagError
        There is none, or it cannot be read.

    """
    salvage = Salvage()
    for file in _files_to_salvage(path):
        try:
            salvage.read(file)
        except ValueError as error:
            raise BagError(str(error)) from None
    return salvage


def _is_whole(path: Path) -> bool:
    try:
        with BagReader(path) as reader:
            return sum(1 for _ in reader.messages()) == reader.message_count
    except BagError:
        return False


def _files_to_salvage(path: Path) -> list[Path]:
    if not path.exists():
        raise BagError(f'{path}: there is no such bag')
    if path.is_file():
        return [path]
    files = _mcap_files(path) or _mcap_files(path / 'bag')
    if not files:
        raise BagError(f'{path}: is no bag: there is no .mcap file in it')
    return files


def _write_salvage(salvage: Salvage, out: Path) -> None:
    with _JazzyWriter(out) as writer:
        connections = {
            channel.topic: writer.add_connection(
                channel.topic,
                channel.ros_type,
                msgdef=channel.definition,
                rihs01=channel.type_hash,
                offered_qos_profiles=channel.qos,
            )
            for channel in salvage.channels.values()
        }
        for topic, log_time_ns, cdr in salvage.messages:
            writer.write(connections[topic], log_time_ns, cdr)
        writer.set_facts(BagFacts(complete=False))
