"""fieldkit cache."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from fieldkit.cli.common import JsonOption, emit_json, say, show, table
from fieldkit.errors import UsageError
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.cache import StageCache

_SIZE_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_TIME_UNITS = {"m": 60.0, "h": 3600.0, "d": 86400.0, "w": 604800.0}


Action = Literal["show", "prune", "clear"]


def command(
    action: Annotated[Action, Argument(help="show sizes, prune what is old or too much, or clear all.")] = "show",
    max_size: Annotated[
        str, Option(metavar="SIZE", help="prune: the longest unused goes until this is left, e.g. 500M or 10G.")
    ] = "",
    older_than: Annotated[
        str, Option(metavar="TIME", help="prune: what was not used for this long goes, e.g. 12h or 30d.")
    ] = "",
    as_json: JsonOption = False,
) -> None:
    """Show, prune or clear what earlier runs keep for later ones.

    Features, matches, models and depth maps are kept, so that a repeated or extended run computes only what changed.
    Removing them loses time, never results. FIELDKIT_CACHE chooses the folder.

    Examples:
        fieldkit cache
        fieldkit cache prune --max-size 10G --older-than 30d
        fieldkit cache clear

    See Also:
        fieldkit doctor
    """
    from fieldkit.cache import StageCache, default_cache_root

    if action == "prune" and not (max_size or older_than):
        raise UsageError("prune what?", remedy="Give --max-size or --older-than, or use `fieldkit cache clear`.")
    if action != "prune" and (max_size or older_than):
        raise UsageError(f"{action} takes neither --max-size nor --older-than", remedy="Use `fieldkit cache prune`.")
    limit = parse_size(max_size) if max_size else None
    age = parse_time(older_than) if older_than else None
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
        say(f"removed {entries}, {format_size(removed.bytes)}; {format_size(left)} left")


def parse_size(text: str) -> int:
    """Bytes of a size such as 500M, 1.5G or 10GiB (powers of 1024)."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?", text.strip(), re.IGNORECASE)
    if match is None:
        raise UsageError(f"--max-size: not a size: {text}", remedy="Write it like 500M or 10G.")
    return round(float(match[1]) * _SIZE_UNITS[match[2].upper()])


def parse_time(text: str) -> float:
    """Seconds of a time such as 90m, 12h, 30d or 2w."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([mhdw])", text.strip(), re.IGNORECASE)
    if match is None:
        raise UsageError(f"--older-than: not a time: {text}", remedy="Write it like 12h or 30d.")
    return float(match[1]) * _TIME_UNITS[match[2].lower()]


def format_size(size: int) -> str:
    """A size for people, in powers of 1024."""
    value = float(size)
    for unit in ("B", "KiB", "MiB", "GiB"):
        if value < 1024:
            return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
        value /= 1024
    return f"{value:.1f} TiB"


def _show(cache: StageCache, as_json: bool) -> None:
    sizes = cache.sizes()
    total = sum(size.bytes for size in sizes.values())
    if as_json:
        stages = {stage: {"entries": size.entries, "bytes": size.bytes} for stage, size in sizes.items()}
        emit_json({"folder": cache.root, "bytes": total, "stages": stages})
        return
    rows = [(stage, str(size.entries), format_size(size.bytes)) for stage, size in sizes.items()]
    rows.append(("all", str(sum(size.entries for size in sizes.values())), format_size(total)))
    show(table(f"{cache.root}", ["stage", "entries>", "size>"], rows))
