"""
A node that is none of the mission's: it hears the radio's topics and publishes on them.

As a program of its own, it says as many forged messages as it can, to agents that it is given by
name, and how many they were. ``bench flood`` flies missions with it.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from c3_station.forgeries import ForgeryKind, Stranger
from msgs_json.codec import MessageError
from msgs_json.guest_node import GuestNode
from msgs_json.ros_messages import Text, text_from_cdr, to_cdr
from msgs_json.topics import RADIO_RX, RADIO_TX

_HEARD_MAX = 100
"""So many messages are taken in at a time, so that whoever runs the node is not held up."""

_PER_TURN = 10
_TURN_S = 0.01
_SEED = 10_000


class StrangerNode:
    """
    Publishes forged messages on ``radio/rx`` and ``radio/tx`` of agents.

    What it says again as it was goes to ``radio/tx``, where the world refuses it. The world counts
    what it puts on ``radio/rx``, and a copy from somebody else would be counted there, too.

    Parameters
    ----------
    agents
        Names of those whose radios it hears, and can speak to.
    rng
        Draws what is forged.
    domain_id
        The graph of the mission; None: the one of the environment.

    """

    def __init__(
        self, agents: Sequence[str], rng: np.random.Generator, domain_id: int | None = None
    ) -> None:
        self.has_heard = False
        """Whether there is something to forge after."""
        self._stranger = Stranger(rng)
        self._is_for_rx = False
        self._own: set[bytes] = set()
        """What it has said itself and will hear as well."""
        self._guest = GuestNode('stranger', 'stranger', domain_id)
        self._publish: dict[tuple[str, str], Callable[[bytes], None]] = {
            (topic.name, agent): self._guest.publisher(topic, f'/{agent}').publish
            for topic in (RADIO_RX, RADIO_TX)
            for agent in agents
        }
        for agent in agents:
            self._guest.listen(RADIO_RX, self._hear, f'/{agent}')

    def listen(self) -> None:
        """Hear what has come."""
        self._guest.take(_HEARD_MAX)

    def forge_for(self, agent: str) -> None:
        """Publish one forged message, on the topic that it hears or on the one that it speaks."""
        (forgery,) = self._stranger.forgeries(1)
        self._is_for_rx = not self._is_for_rx
        topic = RADIO_TX
        if self._is_for_rx and forgery.kind is not ForgeryKind.REPLAY:
            topic = RADIO_RX
            self._own.add(forgery.payload)
        self._publish[topic.name, agent](to_cdr(Text(forgery.payload)))

    def wait(self, duration_s: float) -> None:
        """Hear what comes within so long."""
        self._guest.spin(duration_s)

    def close(self) -> None:
        """Leave the graph."""
        self._guest.close()

    def _hear(self, cdr: bytes) -> None:
        payload = text_from_cdr(cdr)
        if payload in self._own:
            self._own.discard(payload)
            return
        with suppress(MessageError):  # a radio may damage what it carries
            self._stranger.hear(payload)
            self.has_heard = True


def main(agents: Sequence[str]) -> int:
    """Forge until a signal comes; print how many messages those were."""
    is_told_to_end = False

    def end(signum: int, frame: object) -> None:
        nonlocal is_told_to_end
        is_told_to_end = True

    signal.signal(signal.SIGINT, end)
    rng = np.random.default_rng(_SEED)
    node = StrangerNode(agents, rng)
    said = 0
    while not is_told_to_end:
        node.wait(_TURN_S)
        if node.has_heard:
            for index in rng.integers(len(agents), size=_PER_TURN):
                node.forge_for(agents[index])
            said += _PER_TURN
    node.close()
    sys.stdout.write(f'{said}\n')
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
