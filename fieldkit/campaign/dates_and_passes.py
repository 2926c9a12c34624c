"""Dates and passes: which photographs of a plot were taken together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date, datetime, timedelta

ANOTHER_PASS = timedelta(hours=2)
"""A longer break between photographs of a plot on one date makes them another pass; a shorter one is a re-flight."""
_MIDNIGHT = timedelta(minutes=30)
_DATE = re.compile(r"(\d{4})-?(\d{2})-?(\d{2})")


def folder_date(name: str) -> str | None:
    """The date that a folder's name is (2026-06-30, 20260630), as ISO 8601; None where it is none."""
    found = _DATE.fullmatch(name.strip())
    if found is None or (name.count("-") not in (0, 2)):
        return None
    try:
        return date(*map(int, found.groups())).isoformat()
    except ValueError:
        return None


def days(times: Sequence[datetime]) -> list[tuple[str, list[int]]]:
    """Indices by local date (ISO 8601), in order of time; what follows shortly after midnight belongs to before it."""
    groups: list[tuple[str, list[int]]] = []
    for k in sorted(range(len(times)), key=lambda k: times[k]):
        day = times[k].date().isoformat()
        goes_on = bool(groups) and times[k] - times[groups[-1][1][-1]] <= _MIDNIGHT
        if groups and (groups[-1][0] == day or goes_on):
            groups[-1][1].append(k)
        else:
            groups.append((day, [k]))
    return groups


def best_pass(times: Sequence[datetime | None]) -> tuple[list[int], list[int]]:
    """Indices of the pass with the most photographs (of several the last), and of those of all others.

    Photographs without a time stay with the best.
    """
    timed = sorted((taken, k) for k, taken in enumerate(times) if taken is not None)
    passes: list[list[int]] = []
    for place, (taken, k) in enumerate(timed):
        if place and taken - timed[place - 1][0] <= ANOTHER_PASS:
            passes[-1].append(k)
        else:
            passes.append([k])
    best = max(range(len(passes)), key=lambda n: (len(passes[n]), n), default=0)
    others = sorted(k for n, group in enumerate(passes) if n != best for k in group)
    return [k for k in range(len(times)) if k not in set(others)], others
