"""ArduCopter 4.5.6's side of a mission transfer, as a pure state machine over one kind of list.

Measured (sim/sitl/probe_items) and kept as it is: items are asked for with MISSION_REQUEST one by one; each is checked
and stored at once, so that an upload that breaks off leaves a mix of new and old items; a list that is announced
shorter is cut at once; silence is asked into once a second and given up after eight; an item out of turn is answered
INVALID_SEQUENCE and the transfer goes on. Fences are checked and taken as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fieldkit.link.item_rules import (
    MAX_ITEMS,
    Kind,
    WireItem,
    fence_problem,
    stored,
    stored_fence_item,
    stored_rally_item,
)
from fieldkit.missions.autopilots.accepting import Result

ASK_AGAIN_S = 1.0
GIVE_UP_S = 8.0

Peer = tuple[int, int]
"""System and component id of a ground station."""


@dataclass(frozen=True)
class Ask:
    """MISSION_REQUEST for an item."""

    to: Peer
    seq: int


@dataclass(frozen=True)
class Acknowledge:
    """MISSION_ACK."""

    to: Peer
    result: Result


@dataclass(frozen=True)
class Count:
    """MISSION_COUNT."""

    to: Peer
    count: int


@dataclass(frozen=True)
class Item:
    """MISSION_ITEM_INT, or MISSION_ITEM where it was asked for so."""

    to: Peer
    seq: int
    item: WireItem
    as_float: bool = False


@dataclass(frozen=True)
class Text:
    """STATUSTEXT."""

    severity: int
    text: str


Answer = Ask | Acknowledge | Count | Item | Text
Answers = tuple[Answer, ...]


@dataclass(frozen=True)
class Receiving:
    """An upload under way.

    Attributes:
        peer: who uploads.
        count: items announced.
        next_seq: the one that is asked for.
        heard_s: when the last item was taken.
        asked_s: when one was last asked for.
        staged: items that are not stored before all are here (fences).
    """

    peer: Peer
    count: int
    next_seq: int
    heard_s: float
    asked_s: float
    staged: tuple[WireItem, ...] = ()


@dataclass(frozen=True)
class ItemList:
    """One of an autopilot's lists.

    Attributes:
        kind: which.
        items: as they are stored. The first one of a mission is never given back: home is in its place.
        receiving: the upload under way, or None.
        locked: the mission is being flown; it cannot be cleared.
    """

    kind: Kind
    items: tuple[WireItem, ...] = ()
    receiving: Receiving | None = None
    locked: bool = False

    def on_count(self, peer: Peer, count: int, now_s: float) -> tuple[ItemList, Answers]:
        """MISSION_COUNT: an upload begins, or begins again."""
        if self.receiving is not None and self.receiving.peer != peer:
            return self, (Acknowledge(peer, Result.DENIED),)
        if count > MAX_ITEMS:
            refused: Answers = (Acknowledge(peer, Result.NO_SPACE),)
            return self, (*refused, Text(4, f"Only {MAX_ITEMS} items are supported"))
        items = self.items if self.kind is Kind.FENCE else self.items[:count]
        begun = replace(self, items=items, receiving=Receiving(peer, count, 0, now_s, now_s))
        if count == 0:
            return begun._complete(peer)
        return begun, (Ask(peer, 0),)

    def on_item(self, peer: Peer, seq: int, item: WireItem, now_s: float) -> tuple[ItemList, Answers]:
        """MISSION_ITEM_INT."""
        receiving = self.receiving
        if receiving is None:
            return self, (Acknowledge(peer, Result.ERROR),)
        if seq != receiving.next_seq:
            return self, (Acknowledge(peer, Result.INVALID_SEQUENCE),)
        if peer != receiving.peer:
            return self, (Acknowledge(peer, Result.DENIED),)
        kept = _RULES[self.kind](item)
        if isinstance(kept, Result):
            return replace(self, receiving=None), (Acknowledge(peer, kept),)
        if self.kind is Kind.FENCE:
            items, staged = self.items, (*receiving.staged, kept)
        else:
            items, staged = (*self.items[:seq], kept, *self.items[seq + 1 :]), ()
        following = replace(receiving, next_seq=seq + 1, heard_s=now_s, asked_s=now_s, staged=staged)
        changed = replace(self, items=items, receiving=following)
        if following.next_seq == following.count:
            return changed._complete(peer)
        return changed, (Ask(peer, following.next_seq),)

    def on_clear(self, peer: Peer) -> tuple[ItemList, Answers]:
        """MISSION_CLEAR_ALL."""
        if self.receiving is not None and self.receiving.peer != peer:
            return self, (Acknowledge(peer, Result.DENIED),)
        if self.locked:
            return replace(self, receiving=None), (Acknowledge(peer, Result.ERROR),)
        answers: Answers = (Acknowledge(peer, Result.ACCEPTED),)
        return replace(self, items=(), receiving=None), (*answers, *self._indexed())

    def on_request_list(self, peer: Peer) -> tuple[ItemList, Answers]:
        """MISSION_REQUEST_LIST: a download begins."""
        if self.receiving is not None:
            return self, (Acknowledge(peer, Result.DENIED),)
        return self, (Count(peer, len(self.items)),)

    def on_request(self, peer: Peer, seq: int, home: WireItem, *, as_float: bool) -> tuple[ItemList, Answers]:
        """MISSION_REQUEST_INT or MISSION_REQUEST: one item of a download."""
        if self.receiving is not None:
            return self, (Acknowledge(peer, Result.DENIED),)
        if seq >= len(self.items):
            return self, (Count(peer, len(self.items)), Acknowledge(peer, Result.INVALID_SEQUENCE))
        item = home if self.kind is Kind.MISSION and seq == 0 else self.items[seq]
        return self, (Item(peer, seq, item, as_float),)

    def on_time(self, now_s: float) -> tuple[ItemList, Answers]:
        """What silence leads to; call it often enough."""
        receiving = self.receiving
        if receiving is None:
            return self, ()
        if _elapsed(receiving.heard_s, now_s) >= GIVE_UP_S:
            given_up: Answers = (Acknowledge(receiving.peer, Result.OPERATION_CANCELLED),)
            return replace(self, receiving=None), (*given_up, Text(4, "Mission upload timeout"))
        if _elapsed(receiving.asked_s, now_s) >= ASK_AGAIN_S:
            asked = replace(self, receiving=replace(receiving, asked_s=now_s))
            return asked, (Ask(receiving.peer, receiving.next_seq),)
        return self, ()

    def _complete(self, peer: Peer) -> tuple[ItemList, Answers]:
        receiving = self.receiving
        assert receiving is not None
        done = replace(self, receiving=None)
        accepted: Answers = (Acknowledge(peer, Result.ACCEPTED),)
        if self.kind is Kind.MISSION:
            return done, (*accepted, Text(6, "Flight plan received"))
        if self.kind is Kind.RALLY:
            return done, accepted
        problem = fence_problem(receiving.staged)
        if problem is not None:
            severity = 4 if "vertex" in problem else 6
            texts = (Text(severity, problem), Text(4, "Fence validation failed"))
            return done, (Acknowledge(peer, Result.ERROR), *texts)
        return replace(done, items=receiving.staged), (*accepted, *self._indexed())

    def _indexed(self) -> Answers:
        return (Text(7, "Fence Indexed OK"),) if self.kind is Kind.FENCE else ()


def _elapsed(since_s: float, now_s: float) -> float:
    return round(now_s - since_s, 3)  # ArduPilot counts milliseconds


_RULES = {Kind.MISSION: stored, Kind.FENCE: stored_fence_item, Kind.RALLY: stored_rally_item}
