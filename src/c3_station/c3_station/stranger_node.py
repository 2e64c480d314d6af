"""
A stranger on the graph: says forged messages on every radio topic, as many as it can.

It publishes where only a radio should, into what vehicles say and into what they hear, after what
it has heard come through. ``bench flood`` flies missions with it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from c3_station.forgeries import Stranger
from msgs_json.host_node import HostedNode, run
from msgs_json.ros_messages import Text, text_from_cdr, to_cdr
from msgs_json.topics import RADIO_RX, RADIO_TX

MESSAGES_PER_S = 1000.0

_PERIOD_S = 0.01
_SEED = 10_000


class StrangerNode(HostedNode):
    """Forges what it hears and publishes it; says at its end how many messages that were."""

    def __init__(self, agents: Sequence[str]) -> None:
        super().__init__('stranger', '/stranger')
        self._rng = np.random.default_rng(_SEED)
        self._stranger = Stranger(self._rng)
        self._has_heard = False
        self._unheard: set[bytes] = set()
        """What it has said itself, which it hears as well."""
        self._said = 0
        self._radio = [
            self.raw_publisher(topic, f'/{agent}')
            for topic in (RADIO_RX, RADIO_TX)
            for agent in agents
        ]
        for agent in agents:
            self.listen(RADIO_RX, text_from_cdr, self._hear, f'/{agent}')
        self.every(_PERIOD_S, self._say)

    def close(self) -> None:
        """Tell how much was said."""
        sys.stdout.write(f'{self._said}\n')

    def _hear(self, payload: bytes) -> None:
        if payload in self._unheard:
            self._unheard.discard(payload)
        else:
            self._stranger.hear(payload)
            self._has_heard = True

    def _say(self) -> None:
        if not self._has_heard:
            return
        for forgery in self._stranger.forgeries(round(MESSAGES_PER_S * _PERIOD_S)):
            publisher = self._radio[self._rng.integers(len(self._radio))]
            if publisher.topic_name.endswith(RADIO_RX.name):
                self._unheard.add(forgery.payload)
            publisher.publish(to_cdr(Text(forgery.payload)))
            self._said += 1


def main(agents: list[str]) -> int:
    """Run the node against agents of these names."""
    return run(lambda: [StrangerNode(agents)])


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
