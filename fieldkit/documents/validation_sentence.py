"""What pydantic found wrong with a document, as one sentence for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


def validation_sentence(key: str, problems: Sequence[ErrorDetails], texts: Mapping[str, str]) -> str:
    """The first problem as "key: what is wrong", and how many more there are; without a key only what is wrong."""
    first = problems[0]
    problem = {"missing": "is missing", **texts}.get(first["type"])
    if problem is None:
        problem = first["msg"].removeprefix("Value error, ")
        problem = problem[:1].lower() + problem[1:]
    given = first.get("input")
    if first["type"].startswith(("float_", "int_")) and isinstance(given, str) and len(given) < 40:
        problem = f'should be a number and is the text "{given}"{": with a point" if "," in given else ""}'
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"{key}: {problem}{more}" if key else f"{problem}{more}"
