"""The operator's end of the wire: says one command to C3 and waits for what becomes of it."""

from __future__ import annotations

import time
from contextlib import closing
from pathlib import Path

from c3_station.node_params import C3
from c3_station.operator_desk import OPERATOR
from msgs_json import codec
from msgs_json.authentication import Authenticator
from msgs_json.codec import MessageError
from msgs_json.guest_node import GuestNode
from msgs_json.key_file import read_key
from msgs_json.messages import CommandRefused, CommandTaken, OperatorCommand
from msgs_json.ros_messages import Text, text_from_cdr, to_cdr
from msgs_json.topics import COMMAND, MISSION_EVENTS

PATIENCE_S = 10.0
_REPEAT_S = 1.0
"""A mission at full speed leaves C3 little time for newcomers; commands may come twice."""
_LISTEN_S = 0.05

Answer = CommandTaken | CommandRefused
"""It names the command: where two operators give the same one at a time, it is for both."""


def say_to_c3(command: OperatorCommand, domain_id: int, key_file: Path) -> Answer | None:
    """
    Say a command to the C3 of a mission; return what it made of it, None where it is silent.

    Raises
    ------
    ValueError
        The key cannot be used.

    """
    authenticator = Authenticator(read_key(str(key_file)))
    with closing(_Operator(domain_id)) as operator:
        return operator.ask(command, authenticator)


class _Operator:
    def __init__(self, domain_id: int) -> None:
        self._answer: Answer | None = None
        self._command: OperatorCommand | None = None
        self._guest = GuestNode(OPERATOR, OPERATOR, domain_id)
        self._publisher = self._guest.publisher(COMMAND, f'/{C3}')
        self._guest.listen(MISSION_EVENTS, self._hear)

    def ask(self, command: OperatorCommand, authenticator: Authenticator) -> Answer | None:
        """Say a command until it is answered, for a while."""
        self._command = command
        begun_s = said_s = time.monotonic()
        said_s -= _REPEAT_S
        while self._answer is None and time.monotonic() < begun_s + PATIENCE_S:
            is_heard = self._publisher.get_subscription_count() > 0
            if is_heard and time.monotonic() >= said_s + _REPEAT_S:
                said_s = time.monotonic()
                payload = codec.encode(
                    command,
                    src=OPERATOR,
                    dst=C3,
                    # Whoever speaks for the operator next, from whichever process, counts on.
                    seq=time.time_ns() // 1000,
                    stamp_s=time.time_ns() / 1e9,
                )
                self._publisher.publish(to_cdr(Text(authenticator.sign(payload))))
            self._guest.spin(_LISTEN_S)
        return self._answer

    def close(self) -> None:
        """Leave the graph."""
        self._guest.close()

    def _hear(self, cdr: bytes) -> None:
        try:
            envelope, body = codec.decode(text_from_cdr(cdr))
        except (MessageError, ValueError):
            return  # the nodes count what cannot be read
        if envelope.src == C3 and isinstance(body, Answer) and body.command == self._command:
            self._answer = body
