"""Reading and writing reference.json and evaluation.json, and the JSON Schemas of results (docs/schemas)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel

from fieldkit.documents.json_file import check_version, read_kind, schema_text, validated
from fieldkit.errors import MetadataError
from fieldkit.files import write_atomic
from fieldkit.regular_files import open_regular
from fieldkit.results.comparison import ComparisonReport
from fieldkit.results.evaluation import EvaluationReport, FileEntry, ReferenceReport
from fieldkit.results.mission import MissionRecord
from fieldkit.results.plan import Plan, station_number
from fieldkit.results.visit import Visit

REFERENCE_FILE = "reference.json"
EVALUATION_FILE = "evaluation.json"
SCHEMA_FILES: dict[str, type[BaseModel]] = {
    "plan.schema.json": Plan,
    "mission.schema.json": MissionRecord,
    "reference.schema.json": ReferenceReport,
    "evaluation.schema.json": EvaluationReport,
    "comparison.schema.json": ComparisonReport,
    "visit.schema.json": Visit,
}

_MAX_BYTES = 256 << 20
_Report = TypeVar("_Report", ReferenceReport, EvaluationReport)


def save_report(path: Path, report: ReferenceReport | EvaluationReport) -> None:
    """Write a report as JSON (UTF-8, indented).

    Raises:
        StorageError: the place is full or not writable.
    """
    write_atomic(path, report.model_dump_json(indent=2) + "\n")


def load_reference_report(path: Path) -> ReferenceReport:
    """Read reference.json; ``path`` is the file or the folder that holds it.

    Raises:
        MetadataError: it is missing, not JSON, of another kind or version, or a field is wrong.
    """
    return _load(path, REFERENCE_FILE, ReferenceReport, "reference")


def load_evaluation_report(path: Path) -> EvaluationReport:
    """Read evaluation.json; ``path`` is the file or the folder that holds it.

    Raises:
        MetadataError: it is missing, not JSON, of another kind or version, or a field is wrong.
    """
    return _load(path, EVALUATION_FILE, EvaluationReport, "evaluation")


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes, hexadecimal. Raises OSError: it cannot be read, or is no regular file."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def describe_files(folder: Path, names: Iterable[str]) -> tuple[FileEntry, ...]:
    """Size and SHA-256 of files in a result's folder; ``names`` are relative, with "/"."""
    return tuple(
        FileEntry(name=name, bytes=(folder / name).stat().st_size, sha256=file_sha256(folder / name)) for name in names
    )


def check_file(folder: Path, report: ReferenceReport | EvaluationReport, name: str) -> Path:
    """The path of a file the report describes, after comparing it with its size and SHA-256 there.

    Raises:
        MetadataError: the report does not list it, it is missing, or it is not the same any more.
    """
    path = folder / name
    entry = next((entry for entry in report.files if entry.name == name), None)
    remedy = f"Build the {report.kind} again."
    if entry is None:
        raise MetadataError(f"the {report.kind} has no {name}", path=folder, remedy=remedy)
    if not path.is_file():
        raise MetadataError(f"is missing, and the {report.kind} needs it", path=path, remedy=remedy)
    if path.stat().st_size != entry.bytes or file_sha256(path) != entry.sha256:
        raise MetadataError(f"was changed after the {report.kind} was built", path=path, remedy=remedy)
    return path


def json_schema(model: type[BaseModel]) -> str:
    """JSON Schema (2020-12) of a report, as text that ends in a newline."""
    return schema_text(model.model_json_schema(mode="validation"))


def _load(path: Path, name: str, model: type[_Report], kind: str) -> _Report:
    path = Path(path)
    file = path / name if path.is_dir() else path
    command = "fieldkit reference" if kind == "reference" else "fieldkit evaluate"
    again = f"Give the folder that `{command}` wrote, or run it again."
    document = read_kind(file, kind, again, max_bytes=_MAX_BYTES)
    check_version(document, model.model_fields["version"].default, file, again)
    _count_from_1(document)
    for plot in document["plots"] if isinstance(document.get("plots"), list) else ():
        if isinstance(plot, dict):
            plot.pop("plants", None)  # figures by definitions that were given up, before there were traits
    return validated(model, document, file, again)


def _count_from_1(document: dict[str, Any]) -> None:
    """Number stations from 1 in a report of a fieldkit that counted them from 0.

    Every station of a plan is named, photographed or missing, so that such a report names "station 0".
    """
    plots = document.get("plots")
    for plot in plots if isinstance(plots, list) else []:
        found = plot.get("adherence") if isinstance(plot, dict) else None
        if not isinstance(found, dict):
            continue
        tables = [found.get(key) for key in ("stations", "photographs")]
        rows = [row for table in tables if isinstance(table, list) for row in table if isinstance(row, dict)]
        missing = found.get("missing")
        missing = missing if isinstance(missing, list) else []
        if "station 0" in [*(row.get("station") for row in rows), *missing]:
            for row in rows:
                row["station"] = _one_more(row.get("station"))
            found["missing"] = [_one_more(name) for name in missing]


def _one_more(station: Any) -> Any:
    number = station.removeprefix("station ") if isinstance(station, str) else ""
    counted = number.isascii() and number.isdecimal() and len(number) < 10
    return f"station {station_number(int(number))}" if counted else station
