"""
Messages that are longer than a frame of the radio: cut into fragments, and put together again.

There are no timers. Whoever has something to say repeats it until it is acknowledged or there is
something newer, and every repetition says the fragments that the receiver lacks, at most `WINDOW`
of them. A transfer is named after its content: the same message said again, at the next contact or
by a process that knows nothing of the one before, is the same transfer and goes on where it was.

What a receipt says is all that a sender goes by, not what it heard before: a receiver that forgot
a transfer says that it lacks it, and gets it anew.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass, field
from itertools import islice

from msgs_json.codec import MessageError, Refusal
from msgs_json.frame_size import signed_envelope_bytes
from msgs_json.messages import RADIO_MESSAGES, Fragment, FragmentReceipt

WINDOW = 8
"""
So many fragments are said at a time, and are named missing in a receipt.

Those of a contact that breaks off are lost together; a receipt names them all within any frame.
"""

TRANSFERS_MAX = 8
"""
So many messages to one agent, or from one, are remembered; of more, the least recent is forgotten.

Agents have one or two under way to another: an order, and reports of sorties.
"""

MESSAGE_BYTES_MAX = 2**24
"""16 MiB; a mission order may name a million masked cells, which take 10 MB."""

DATA_BYTES_MIN = 48
"""A fragment but the last that holds less would cost more to keep than it brings."""

_FRAGMENT_BYTES = signed_envelope_bytes(
    Fragment(transfer='f' * 16, index=65_535, total=65_536, data=b'')
)
FRAME_BYTES_MIN = _FRAGMENT_BYTES + DATA_BYTES_MIN // 3 * 4
"""The shortest frame that there are fragments for, names of 32 characters allowed for."""

_SCHEMAS = frozenset(t.__name__ for t in RADIO_MESSAGES) - {
    Fragment.__name__,
    FragmentReceipt.__name__,
}
"""What may be cut up."""


class Outgoing:
    """
    What an agent says in fragments.

    Parameters
    ----------
    frame_bytes
        The longest signed envelope that the radio carries in one piece.

    Raises
    ------
    ValueError
        No fragment fits into so short a frame.

    """

    def __init__(self, frame_bytes: int) -> None:
        if frame_bytes < FRAME_BYTES_MIN:
            raise ValueError(
                f'frame_bytes is {frame_bytes:,}; allowed: at least {FRAME_BYTES_MIN:,}, a signed'
                f' fragment with {DATA_BYTES_MIN} bytes of a message'
            )
        self._data_bytes = (frame_bytes - _FRAGMENT_BYTES) // 4 * 3
        self._missing: dict[str, OrderedDict[str, tuple[int, ...]]] = {}
        """What the last receipt said, by receiver and transfer, the most recent transfer last."""

    def fragments(self, dst: str, schema: str, body: bytes) -> list[Fragment]:
        """
        Return what to say now of a message: the first fragments that the receiver lacks.

        Where it has them all, one is said again, for which it hands the message to its agent
        again: what the agent answered may have been lost.

        Raises
        ------
        ValueError
            The message is too long for anybody to take.

        """
        content = schema.encode() + b'\n' + body
        size = self._data_bytes
        total = -(-len(content) // size)
        if len(content) > MESSAGE_BYTES_MAX or total > 65_536:
            raise ValueError(
                f'a {schema} has {len(content):,} bytes; allowed: at most'
                f' {min(MESSAGE_BYTES_MAX, 65_536 * size):,} in fragments of {size:,}'
            )
        transfer = _transfer_id(content)
        missing = self._missing.setdefault(dst, OrderedDict())
        missing.setdefault(transfer, tuple(range(WINDOW)))
        missing.move_to_end(transfer)
        if len(missing) > TRANSFERS_MAX:
            missing.popitem(last=False)
        indices = [index for index in missing[transfer] if index < total][:WINDOW] or [0]
        return [
            Fragment(
                transfer=transfer,
                index=index,
                total=total,
                data=content[index * size : (index + 1) * size],
            )
            for index in indices
        ]

    def receipt(self, src: str, receipt: FragmentReceipt) -> None:
        """Note what the receiver lacks; of a transfer that is not under way to it, nothing."""
        if receipt.transfer in self._missing.get(src, ()):
            self._missing[src][receipt.transfer] = receipt.missing


@dataclass(slots=True, kw_only=True)
class _Transfer:
    """What has been received of a message."""

    total: int
    parts: dict[int, bytes] = field(default_factory=dict)
    """By index; none are left once the message is complete."""
    bytes_held: int = 0
    message: tuple[str, bytes] | None = None
    """Schema and body once it is complete."""
    last_index: int = 0
    """Of the fragment heard last."""


class Incoming:
    """
    What an agent hears in fragments.

    Whatever is sent, it remembers no more than ``TRANSFERS_MAX`` transfers and ``bytes_max`` bytes
    of each sender; who may be a sender at all is decided before.

    Parameters
    ----------
    bytes_max
        A message that is longer, with its schema's name and a line break, is refused.

    """

    def __init__(self, bytes_max: int = MESSAGE_BYTES_MAX) -> None:
        self._bytes_max = bytes_max
        self._transfers: dict[str, OrderedDict[str, _Transfer]] = {}
        """By sender and transfer, the most recent transfer last."""

    def take(
        self, src: str, fragment: Fragment
    ) -> tuple[FragmentReceipt, tuple[str, bytes] | None]:
        """
        Take a fragment in; return what to answer, and the message if it is to be handed over.

        The message, its schema and its body, is handed over when it is complete and whenever it is
        repeated then. Fragments are said in rising order, so one that does not follow the fragment
        heard before it begins a repetition.

        Raises
        ------
        MessageError
            The fragment is none, or what has come of the transfer does not fit together, or is
            longer than allowed; then the transfer is forgotten and may begin anew.

        """
        _check(src, fragment)
        transfers = self._transfers.setdefault(src, OrderedDict())
        transfer = transfers.setdefault(fragment.transfer, _Transfer(total=fragment.total))
        transfers.move_to_end(fragment.transfer)
        try:
            is_handed_over = _add(transfer, src, fragment)
        except MessageError:
            del transfers[fragment.transfer]
            raise
        while (
            len(transfers) > TRANSFERS_MAX
            or sum(each.bytes_held for each in transfers.values()) > self._bytes_max
        ):
            forgotten, _ = transfers.popitem(last=False)
            if forgotten == fragment.transfer:
                raise MessageError(
                    Refusal.NOT_POSSIBLE,
                    src,
                    f'transfer {forgotten} (`$.body.transfer`) has {transfer.bytes_held:,} bytes'
                    f' so far; at most {self._bytes_max:,} are taken',
                )
        lacking = (index for index in range(transfer.total) if index not in transfer.parts)
        missing = () if transfer.message is not None else tuple(islice(lacking, WINDOW))
        receipt = FragmentReceipt(transfer=fragment.transfer, missing=missing)
        return receipt, transfer.message if is_handed_over else None


def _check(src: str, fragment: Fragment) -> None:
    """Refuse what is no fragment, whatever came before it."""
    if fragment.index >= fragment.total:
        raise MessageError(
            Refusal.MALFORMED,
            src,
            f'`$.body.index` is {fragment.index}; must be less than total, {fragment.total}',
        )
    if len(fragment.data) < DATA_BYTES_MIN and fragment.index < fragment.total - 1:
        raise MessageError(
            Refusal.MALFORMED,
            src,
            f'`$.body.data` has {len(fragment.data)} bytes; must have at least {DATA_BYTES_MIN}'
            ' in all fragments but the last',
        )


def _add(transfer: _Transfer, src: str, fragment: Fragment) -> bool:
    """Add a fragment to its transfer; return whether the message is to be handed over."""
    index = fragment.index
    if fragment.total != transfer.total:
        raise MessageError(
            Refusal.CONTRADICTORY,
            src,
            f'`$.body.total` is {fragment.total}; it was {transfer.total} in transfer'
            f' {fragment.transfer}',
        )
    is_repeated = index <= transfer.last_index
    transfer.last_index = index
    if transfer.message is not None:
        return is_repeated
    if index not in transfer.parts:
        transfer.parts[index] = fragment.data
        transfer.bytes_held += len(fragment.data)
    if len(transfer.parts) < transfer.total:
        return False
    content = b''.join(transfer.parts[part] for part in range(transfer.total))
    transfer.message = _message(content, src, fragment.transfer)
    transfer.parts.clear()
    return True


def _message(content: bytes, src: str, transfer_id: str) -> tuple[str, bytes]:
    """Return schema and body of what was cut up, once it is put together again."""
    if _transfer_id(content) != transfer_id:
        raise MessageError(
            Refusal.CONTRADICTORY,
            src,
            f'`$.body.data` of transfer {transfer_id} do not add up to what it is named after',
        )
    schema, _, body = content.partition(b'\n')
    name = schema[:64].decode(errors='replace')
    if name not in _SCHEMAS:
        raise MessageError(
            Refusal.UNKNOWN_SCHEMA,
            src,
            f'`$.body.data` of transfer {transfer_id} hold a {name!r}; in fragments come'
            f' {", ".join(sorted(_SCHEMAS))}',
        )
    return name, body


def _transfer_id(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
