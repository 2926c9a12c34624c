"""What commands say of a check's findings: a table for people, entries for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fieldkit.cli.common import say, show, table
from fieldkit.wording import count

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from fieldkit.results.finding import Finding

_MOST_ROWS = 30


def finding_entries(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Findings as JSON has them, each by itself."""
    from fieldkit.results.plan import station_number

    return [
        {
            "code": f.code, "severity": f.severity, "item": f.item,
            "photograph": None if f.photograph is None else f.photograph + 1,
            "plot": f.subject or None, "station": None if f.station is None else station_number(f.station),
            "message": f.message,
        }
        for f in findings
    ]  # fmt: skip


def show_findings(findings: Sequence[Finding], file: Path) -> None:
    """A table of them; those that say the same are one row."""
    from fieldkit.missions.findings import group_text, ranked

    groups = ranked(findings)
    rows = [
        (group[0].code, group[0].severity, "" if group[0].item is None else str(group[0].item), group_text(group))
        for group in groups[:_MOST_ROWS]
    ]
    show(table(f"Findings in {file.name}", ["code", "severity", "item>", "what"], rows))
    if len(groups) > _MOST_ROWS:
        say(f"and {count(len(groups) - _MOST_ROWS, 'more kind')}")
    if len(groups) < len(findings):
        say(f"{len(findings)} findings in all: --json lists each of them")
