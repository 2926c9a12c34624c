"""A bad radio link: packets that are lost, doubled or late, the same ones for the same seed."""

from __future__ import annotations

import heapq
import math
import random
from dataclasses import dataclass

from fieldkit.errors import UsageError


@dataclass(frozen=True)
class Faults:
    """What a link does to packets, each way and each packet by itself."""

    loss: float = 0.0  # share that never arrives
    duplicate: float = 0.0  # share that arrives twice
    delay_s: float = 0.0  # mean time under way; each takes half to one and a half times as long: some overtake others
    seed: int = 0

    def __post_init__(self) -> None:
        for name, share in (("loss", self.loss), ("duplicate", self.duplicate)):
            if not 0.0 <= share <= 1.0:
                raise UsageError(f"{name}: {share:g} is not a share", remedy="Give a number from 0 to 1, such as 0.05.")


class Channel:
    """One direction of a link.

    Args:
        faults: of it.
        direction: its number, so that the two directions of one seed differ.
    """

    def __init__(self, faults: Faults, direction: int) -> None:
        self._faults = faults
        self._random = random.Random(f"{faults.seed}/{direction}")
        self._under_way: list[tuple[float, int, bytes]] = []
        self._order = 0
        self.sent = self.lost = self.doubled = 0

    def put(self, packet: bytes, now_s: float) -> None:
        """Send a packet."""
        # The same numbers are drawn whatever becomes of the packet: runs with other shares stay comparable.
        lost, doubled, *late = (self._random.random() for _ in range(4))
        self.sent += 1
        if lost < self._faults.loss:
            self.lost += 1
            return
        copies = 1 + (doubled < self._faults.duplicate)
        self.doubled += copies - 1
        for copy in range(copies):
            due = now_s + self._faults.delay_s * (0.5 + late[copy])
            heapq.heappush(self._under_way, (due, self._order, packet))
            self._order += 1

    def arrived(self, now_s: float) -> list[bytes]:
        """The packets that have arrived by now and were not yet taken."""
        packets = []
        while self._under_way and self._under_way[0][0] <= now_s:
            packets.append(heapq.heappop(self._under_way)[2])
        return packets

    @property
    def next_s(self) -> float:
        """When the next one arrives; infinity where none is under way."""
        return self._under_way[0][0] if self._under_way else math.inf
