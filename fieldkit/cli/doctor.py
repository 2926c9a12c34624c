"""fieldkit doctor."""

from __future__ import annotations

from fieldkit.cli.common import DebugOption, JsonOption, console, emit_json, table

_STYLES = {"ok": "green", "warn": "yellow", "fail": "bold red"}
EXIT_UNUSABLE = 3


def command(as_json: JsonOption = False, debug: DebugOption = False) -> int:
    """Check this machine: packages, renderer, GPU, cores, memory and cache, each with a remedy.

    Examples:
        fieldkit doctor
        fieldkit doctor --json > machine.json

    Exit codes:
        0  fieldkit works here, warnings or not
        3  something that it needs does not

    See Also:
        fieldkit cache
    """
    from dataclasses import asdict

    from fieldkit.doctor.diagnostics import diagnose

    checks = list(diagnose())
    worst = max((check.status for check in checks), key=list(_STYLES).index)
    if as_json:
        emit_json({"status": worst, "checks": [asdict(check) for check in checks]})
    else:
        rows = table("fieldkit doctor", "check", "status", "found")
        for check in checks:
            remedy = f"\n→ {check.remedy}" if check.remedy else ""
            rows.add_row(check.name, f"[{_STYLES[check.status]}]{check.status}[/]", _escape(check.detail + remedy))
        console().print(rows)
    return EXIT_UNUSABLE if worst == "fail" else 0


def _escape(text: str) -> str:
    from rich.markup import escape

    return escape(text)
