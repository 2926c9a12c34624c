"""fieldkit cache."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from fieldkit.cli.common import JsonOption, answer, emit_json, show, table
from fieldkit.errors import UsageError
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.cache import StageCache

_DAY_S = 86400.0
"""Seconds of a day."""
Action = Literal["show", "prune", "clear"]


def command(
    action: Annotated[Action, Argument()] = "show",
    max_size: Annotated[str, Option(metavar="SIZE")] = "",
    older_than: Annotated[float | None, Option(metavar="DAYS", min=0)] = None,
    as_json: JsonOption = False,
) -> None:
    """Show, prune or clear what earlier runs keep for later ones.

    Features, matches, models and depth maps are kept, so that a repeated or extended run computes only what changed.
    Removing them loses time, never results. FIELDKIT_CACHE chooses the folder.

    Args:
        action: show sizes, prune what is old or too much, or clear all.
        max_size: prune: the longest unused goes until this is left, e.g. 500M or 10G.
        older_than: prune: what was not used for so many days goes.

    Examples:
        fieldkit cache
        fieldkit cache prune --max-size 10G --older-than 30
        fieldkit cache clear
    """
    from fieldkit.cache import StageCache, default_cache_root

    if action == "prune" and not max_size and older_than is None:
        raise UsageError("prune what?", remedy="Give --max-size or --older-than, or use `fieldkit cache clear`.")
    if action != "prune" and (max_size or older_than is not None):
        raise UsageError(f"{action} takes neither --max-size nor --older-than", remedy="Use `fieldkit cache prune`.")
    limit = _bytes(max_size) if max_size else None
    age = None if older_than is None else older_than * _DAY_S
    cache = StageCache(default_cache_root())
    if action == "show":
        _show(cache, as_json)
        return
    removed = cache.clear() if action == "clear" else cache.prune(max_bytes=limit, older_than=age)
    left = sum(size.bytes for size in cache.sizes().values())
    if as_json:
        emit_json({"removed_entries": removed.entries, "removed_bytes": removed.bytes, "bytes": left})
    else:
        entries = count(removed.entries, "entry", "entries")
        answer(f"removed {entries}, {_for_people(removed.bytes)}; {_for_people(left)} left")


def _bytes(text: str) -> int:
    from pydantic import ByteSize, TypeAdapter, ValidationError

    try:
        return TypeAdapter(ByteSize).validate_python(text)
    except ValidationError as error:
        raise UsageError(f"--max-size: not a size: {text}", remedy="Write it like 500M or 10G.") from error


def _for_people(size: int) -> str:
    from pydantic import ByteSize

    return ByteSize(size).human_readable(separator=" ")


def _show(cache: StageCache, as_json: bool) -> None:
    sizes = cache.sizes()
    total = sum(size.bytes for size in sizes.values())
    if as_json:
        stages = {stage: {"entries": size.entries, "bytes": size.bytes} for stage, size in sizes.items()}
        emit_json({"folder": cache.root, "bytes": total, "stages": stages})
        return
    rows = [(stage, str(size.entries), _for_people(size.bytes)) for stage, size in sizes.items()]
    rows.append(("all", str(sum(size.entries for size in sizes.values())), _for_people(total)))
    show(table(f"{cache.root}", ["stage", "entries>", "size>"], rows))
