"""Words for people that depend on a number, and what is said of several things at once."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


def by_key(pairs: Iterable[tuple[K, V]]) -> dict[K, list[V]]:
    """All values of each key, both in the order in which they come."""
    groups: dict[K, list[V]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def count(number: float, noun: str, plural: str = "", *, of: float | None = None) -> str:
    """``1 photograph``, ``12 photographs``; with a verb ``1 plot has``, ``3 plots have``, ``1 of 13 plots has``.

    Args:
        noun: for one, with what else follows from the number.
        plural: for others; "" puts an s at the end.
        of: how many there are in all.
    """
    whole = "" if of is None else f"of {of:,.0f} "
    return f"{number:,.0f} {whole}{noun if number == 1 else plural or noun + 's'}"


def listed(names: list[str], most: int = 5) -> str:
    """``a, b and c``; beyond ``most`` ``a, b and 7 more``."""
    if len(names) > most:
        rest = len(names) - (most - 1)
        return f"{', '.join(names[: most - 1])} and {rest} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
