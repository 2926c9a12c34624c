"""The provenance of a report's figures: versions, seeds, settings, hashes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fieldkit.figures.content import Block, Column, Details, Paragraph, Section, Table, Terms
from fieldkit.report.sections.loaded_results import EvaluationResult, PlanResult, ReferenceResult, Results
from fieldkit.results.evaluation import FileEntry
from fieldkit.version import __version__
from fieldkit.wording import count

_MOST_SETTINGS = 200
_MOST_FILES = 1000
_LONGEST = 200


def provenance_section(results: Results, command: str) -> Section:
    """The command and the results that a report was made with.

    Args:
        results: shown in it.
        command: that made it.
    """
    blocks: list[Block] = [
        Terms((("this report", f"fieldkit {__version__}"), ("command", command)), mono=True),
        _inputs(results),
    ]
    made_with: list[tuple[str, Mapping[str, Any]]] = [
        *((result.name, result.report.settings) for result in results.references),
        *((result.name, result.report.settings) for result in results.evaluations),
        *(
            (result.name, result.settings.model_dump(mode="json"))
            for result in results.plans
            if result.settings is not None
        ),
        *((result.name, result.campaign.evaluation.model_dump(mode="json")) for result in results.campaigns),
    ]
    blocks += [_settings(f"Settings of {name}", settings) for name, settings in made_with]
    files = list(_files(results))
    if files:
        columns = (Column("file"), Column("bytes", True), Column("SHA-256", mono=True))
        note = "" if len(files) <= _MOST_FILES else f"The first {_MOST_FILES} of {len(files)}."
        table = Table("Files, as the results describe them", columns, tuple(files[:_MOST_FILES]), note)
        blocks.append(Details(f"{count(len(files), 'file')} with SHA-256", (table,)))
    blocks.append(
        Paragraph(
            "The SHA-256 of a file changes with any change to it: compare it with `sha256sum FILE`. The same inputs, "
            "settings and seed give the same result on the same machine and version.",
            faint=True,
        )
    )
    return Section("provenance", "Provenance", (Details("Versions, settings and hashes", tuple(blocks)),))


def _inputs(results: Results) -> Table:
    rows: list[tuple[str | None, ...]] = [
        (f"{r.name}/reference.json", r.report.fieldkit, _seed(r.report.settings), f"“{r.report.source}”", r.sha256)
        for r in results.references
    ]
    for p in results.plans:
        version = p.plan.fieldkit if p.plan is not None else p.settings.fieldkit if p.settings is not None else None
        seed = p.settings.seed if p.settings is not None else None
        file = "plan.json" if p.plan is not None else "search.json"
        rows.append((f"{p.name}/{file}", version, None if seed is None else str(seed), _source(p), p.sha256 or None))
    rows += dict.fromkeys((m.name, m.record.fieldkit, None, None, m.sha256) for m in results.missions)
    for e in results.evaluations:
        against = e.report.reference_sha256
        made = f"“{e.report.source}”, {f'reference {_short(against)}' if against else 'no reference'}"
        rows.append((f"{e.name}/evaluation.json", e.report.fieldkit, _seed(e.report.settings), made, e.sha256))
    for k in results.comparisons:
        made = ", ".join(f"“{each.label}”" for each in k.report.evaluations)
        rows.append((f"{k.name}/compare.json", k.report.fieldkit, None, made, k.sha256))
    for c in results.campaigns:
        rows.append((f"{c.name}/campaign.toml", None, str(c.campaign.evaluation.seed), None, c.sha256))
    columns = (
        Column("input"),
        Column("fieldkit"),
        Column("seed", True),
        Column("made from"),
        Column("SHA-256", mono=True),
    )
    return Table("Inputs of this report", columns, tuple(rows))


def _source(result: PlanResult) -> str | None:
    source = (
        result.plan.source
        if result.plan is not None
        else result.settings.source
        if result.settings is not None
        else None
    )
    if source is None:
        return None
    return f"{source.kind} “{source.name}”" + (f", {_short(source.sha256)}" if source.sha256 else "")


def _short(sha256: str) -> str:
    return f"{sha256[:12]}…"


def _seed(settings: Mapping[str, Any]) -> str | None:
    seed = settings.get("seed")
    return str(seed) if isinstance(seed, int) and not isinstance(seed, bool) else None


def _settings(title: str, settings: Mapping[str, Any]) -> Details:
    flat = list(_flat(settings))
    shown = tuple(flat[:_MOST_SETTINGS])
    return Details(title, (Terms(shown or (("settings", "none are given"),), mono=True),))


def _flat(value: Any, key: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value and depth < 6:
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}" if key else str(name), depth + 1)
        return
    text = "none" if value is None else str(value)
    yield key, text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def _files(results: Results) -> Iterator[tuple[str, str, str]]:
    found: list[ReferenceResult | EvaluationResult] = [*results.references, *results.evaluations]
    for result in found:
        entries: list[FileEntry] = list(result.report.files)
        if isinstance(result, EvaluationResult):
            entries += [entry for plot in result.report.plots for entry in plot.files]
        for entry in entries:
            yield f"{result.name}/{entry.name}", f"{entry.bytes:,}", entry.sha256
