"""What commands say of a check's findings: a table for people, entries for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fieldkit.cli.common import say, show, table
from fieldkit.wording import count

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from fieldkit.missions.findings import Finding
    from fieldkit.routing.mission import Shot

_MOST_ROWS = 30


def finding_entries(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Findings as JSON has them, each by itself."""
    return [
        {
            "code": f.code, "severity": f.severity, "item": f.item,
            "photograph": None if f.photograph is None else f.photograph + 1,
            **station_entry(f.planned), "message": f.message,
        }
        for f in findings
    ]  # fmt: skip


def station_entry(planned: Shot | None) -> dict[str, Any]:
    """The plan's station as people number it, and its plot; both None without one."""
    from fieldkit.results.plan import station_number

    if planned is None:
        return {"plot": None, "station": None}
    return {"plot": planned.plot, "station": station_number(planned.station)}


def show_findings(findings: Sequence[Finding], file: Path) -> None:
    """A table of them; those that say the same are one row."""
    from fieldkit.missions.findings import grouped

    groups = grouped(findings)
    rows = [
        (each.first.code, each.first.severity, "" if each.first.item is None else str(each.first.item), each.text)
        for each in groups[:_MOST_ROWS]
    ]
    show(table(f"Findings in {file.name}", ["code", "severity", "item>", "what"], rows))
    if len(groups) > _MOST_ROWS:
        say(f"and {count(len(groups) - _MOST_ROWS, 'more kind')}")
    if len(groups) < len(findings):
        say(f"{len(findings)} findings in all: --json lists each of them")
