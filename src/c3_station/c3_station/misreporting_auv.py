"""An AUV that says it is in the cell beside the one it is in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from msgs_json.agent import Transmit
from msgs_json.geometry import is_before
from msgs_json.messages import SurfacingReport

if TYPE_CHECKING:
    from msgs_json.agent import Agent, Output
    from msgs_json.geometry import GridSpec
    from msgs_json.messages import Message


class MisreportingAuv:
    """
    An AUV's agent, whose reports are off by one cell from a time on.

    It swims where it is told, and its samples say rightly where they were taken.
    """

    def __init__(self, agent: Agent, region: GridSpec, from_s: float) -> None:
        self.name, self.peers, self.finished = agent.name, agent.peers, agent.finished
        self._agent = agent
        self._region = region
        self._from_s = from_s

    def tick(self, now_s: float) -> list[Output]:
        """Move the vehicle to ``now_s`` and act on what was known until then."""
        return self._misreported(self._agent.tick(now_s), now_s)

    def receive(self, src: str, message: Message, now_s: float) -> list[Output]:
        """Act on a message heard at ``now_s``."""
        return self._misreported(self._agent.receive(src, message, now_s), now_s)

    def _misreported(self, outputs: list[Output], now_s: float) -> list[Output]:
        self.peers, self.finished = self._agent.peers, self._agent.finished
        return outputs if is_before(now_s, self._from_s) else list(map(self._off, outputs))

    def _off(self, output: Output) -> Output:
        match output:
            case Transmit(dst, SurfacingReport() as report):
                beside = self._region.neighbours(report.cell)[0]
                return Transmit(dst, msgspec.structs.replace(report, cell=beside))
            case _:
                return output
