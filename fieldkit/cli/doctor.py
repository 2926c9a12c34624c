"""fieldkit doctor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldkit.cli.common import JsonOption, emit_json, show, table

if TYPE_CHECKING:
    from fieldkit.figures.content import Level

_LEVELS: dict[str, Level] = {"ok": "good", "warn": "note", "fail": "problem"}
EXIT_UNUSABLE = 3
"""Exit code where this machine cannot run fieldkit."""


def command(as_json: JsonOption = False) -> int:
    """Check this machine: packages, renderer, GPU, cores, memory and cache, each with a remedy.

    Examples:
        fieldkit doctor
        fieldkit doctor --json > machine.json
    """
    from dataclasses import asdict

    from fieldkit.doctor import diagnose

    checks = list(diagnose())
    worst = max((check.status for check in checks), key=list(_LEVELS).index)
    if as_json:
        emit_json({"status": worst, "checks": [asdict(check) for check in checks]})
    else:
        from fieldkit.figures.content import Mark

        rows = [
            (
                check.name,
                Mark(_LEVELS[check.status], check.status),
                f"{check.detail}\n→ {check.remedy}" if check.remedy else check.detail,
            )
            for check in checks
        ]
        show(table("fieldkit doctor", ["check", "status", "found"], rows))
    return EXIT_UNUSABLE if worst == "fail" else 0
