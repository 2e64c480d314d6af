"""A node that is none of the mission's: it hears the radio's topics and publishes on them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from c3_station.forgeries import ForgeryKind, Stranger
from c3_station.scenario import C3, UAV, Scenario
from msgs_json import codec
from msgs_json.codec import MessageError
from msgs_json.geometry import is_before
from msgs_json.guest_node import GuestNode
from msgs_json.randomness import agent_rng
from msgs_json.ros_messages import Text, text_from_cdr, to_cdr
from msgs_json.topics import RADIO_RX, RADIO_TX

_BATCH = 50
"""So many at a time: a queue that overflows would refuse them for the nodes."""
_HEARD_MAX = 100
"""So many messages are taken in at a time, so that the orchestrator is not held up."""


class ScheduledStranger:
    """
    Publishes forged messages on ``radio/rx`` and ``radio/tx`` of agents, when they are due.

    What it says again as it was goes to ``radio/tx``, where the world refuses it. The world counts
    what it puts on ``radio/rx``, and a copy from somebody else would be counted there, too.
    """

    def __init__(
        self, domain_id: int, scenario: Scenario, forged_s: Sequence[tuple[float, str]]
    ) -> None:
        """Join the graph; ``forged_s`` says when to forge what for whom, in order."""
        self._due = deque(forged_s)
        self._stranger = Stranger(agent_rng(scenario.seed, 'faults.stranger'))
        self._has_heard = False
        self._is_for_rx = False
        self._guest = GuestNode('stranger', 'orchestrator', domain_id)
        agents = (C3, UAV, *(auv.name for auv in scenario.auvs))
        self._say: dict[tuple[str, str], Callable[[bytes], None]] = {
            (topic.name, agent): self._guest.publisher(topic, f'/{agent}').publish
            for topic in (RADIO_RX, RADIO_TX)
            for agent in agents
        }
        for agent in agents:
            self._guest.listen(RADIO_RX, self._hear, f'/{agent}')

    def speak(self, now_s: float) -> None:
        """Hear what came, and publish what is due."""
        self._guest.take(_HEARD_MAX)
        if not self._has_heard:
            return
        for _ in range(_BATCH):
            if not self._due or is_before(now_s, self._due[0][0]):
                return
            _, agent = self._due.popleft()
            (forgery,) = self._stranger.forgeries(1)
            self._is_for_rx = not self._is_for_rx
            is_for_rx = self._is_for_rx and forgery.kind is not ForgeryKind.REPLAY
            topic = RADIO_RX if is_for_rx else RADIO_TX
            self._say[topic.name, agent](to_cdr(Text(forgery.payload)))

    def close(self) -> None:
        """Leave the graph."""
        self._guest.close()

    def _hear(self, cdr: bytes) -> None:
        payload = text_from_cdr(cdr)
        try:
            # Its own words come back to it.
            if codec.open_envelope(payload).auth is None:
                return
            self._stranger.hear(payload)
        except MessageError:
            return
        self._has_heard = True
