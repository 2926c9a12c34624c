"""The provenance of a report's figures: versions, seeds, settings, hashes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fieldkit.campaign.reading import Campaign
from fieldkit.figures.content import Block, Column, Details, Paragraph, Row, Section, Terms, tabulated
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.demo import DemoReport
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.results.plan import PlanSource
from fieldkit.version import __version__

_MOST_SETTINGS = 200
_LONGEST = 200
_SHA256 = Column("SHA-256", mono=True)


def provenance_section(results: Results, command: str) -> Section:
    """The results that a report was made from, and the command that made it."""
    shown = [each for each in results.found if not isinstance(each.report, DemoReport)]
    # The flights of a mission have one file.
    inputs = {each.file: _input(each) for each in shown}
    blocks: list[Block] = [
        Terms((("this report", f"fieldkit {__version__}"), ("command", command)), mono=True),
        tabulated("Inputs of this report", list(inputs.values())),
    ]
    for each in shown:
        if (settings := _settings(each.report)) is not None:
            flat = tuple(_flat(settings))[:_MOST_SETTINGS] or (("settings", "none are given"),)
            blocks.append(Details(f"Settings of {each.name}", (Terms(flat, mono=True),)))
    blocks.append(
        Paragraph(
            "The SHA-256 of a file changes with any change to it: compare it with `sha256sum FILE`. The same inputs, "
            "settings and seed give the same result on the same machine and version.",
            faint=True,
        )
    )
    return Section("provenance", "Provenance", (Details("Versions, settings and hashes", tuple(blocks)),))


def _input(loaded: Loaded[Any]) -> Row:
    report = loaded.report
    written: Any = report
    match report:
        case ReferenceReport():
            made = f"“{report.source}”"
        case EvaluationReport():
            against = report.reference_sha256
            made = f"“{report.source}”, {f'reference {_short(against)}' if against else 'no reference'}"
        case PlanRun():
            written = report.plan or report.settings
            made = _planned_on(getattr(written, "source", None))
        case ComparisonReport():
            made = ", ".join(f"“{each.label}”" for each in report.evaluations)
        case FlownMission():
            written, made = report.record, ""
        case _:
            made = ""
    seed = (_settings(report) or {}).get("seed")
    return {
        "input": f"{loaded.name}/{loaded.file.name}",
        "fieldkit": getattr(written, "fieldkit", None),
        Column("seed", True): str(seed) if isinstance(seed, int) and not isinstance(seed, bool) else None,
        "made from": made or None,
        _SHA256: loaded.sha256,
    }


def _planned_on(source: PlanSource | None) -> str:
    if source is None:
        return ""
    return f"{source.kind} “{source.name}”" + (f", {_short(source.sha256)}" if source.sha256 else "")


def _short(sha256: str) -> str:
    return f"{sha256[:12]}…"


def _settings(report: Any) -> Mapping[str, Any] | None:
    """The settings that a result was made with; None where it has none."""
    match report:
        case ReferenceReport() | EvaluationReport():
            return report.settings
        case PlanRun():
            return None if report.settings is None else report.settings.model_dump(mode="json")
        case Campaign():
            return report.evaluation.model_dump(mode="json")
    return None


def _flat(value: Any, key: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value and depth < 6:
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}" if key else str(name), depth + 1)
        return
    text = "none" if value is None else str(value)
    yield key, text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
