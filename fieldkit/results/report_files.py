"""Reading and writing reference.json and evaluation.json, and the JSON Schemas of results (docs/schemas)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel

from fieldkit.documents.json_file import read_model, schema_text
from fieldkit.errors import MetadataError
from fieldkit.files import write_atomic
from fieldkit.regular_files import open_regular
from fieldkit.results.evaluation import EvaluationReport, FileEntry, ReferenceReport
from fieldkit.results.mission import MissionRecord
from fieldkit.results.plan import Plan
from fieldkit.results.visit import Visit

REFERENCE_FILE = "reference.json"
EVALUATION_FILE = "evaluation.json"
SCHEMA_FILES: dict[str, type[BaseModel]] = {
    "plan.schema.json": Plan,
    "mission.schema.json": MissionRecord,
    "reference.schema.json": ReferenceReport,
    "evaluation.schema.json": EvaluationReport,
    "visit.schema.json": Visit,
}

_MAX_BYTES = 256 << 20
"""Largest report that is read, bytes."""
_Report = TypeVar("_Report", ReferenceReport, EvaluationReport)


def save_report(path: Path, report: ReferenceReport | EvaluationReport) -> None:
    """Write a report as JSON (UTF-8, indented)."""
    write_atomic(path, report.model_dump_json(indent=2) + "\n")


def load_reference_report(path: Path | str) -> ReferenceReport:
    """Read reference.json; ``path`` is the file or the folder that holds it.

    Raises:
        MetadataError: it is missing, not JSON, of another kind or version, or a field is wrong.
    """
    return _load(path, REFERENCE_FILE, ReferenceReport, "reference")


def load_evaluation_report(path: Path | str) -> EvaluationReport:
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
    """The path of a file the report describes, after comparing it with its size and SHA-256 there."""
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


def _load(path: Path | str, name: str, model: type[_Report], kind: str) -> _Report:
    path = Path(path)
    file = path / name if path.is_dir() else path
    command = "fieldkit reference" if kind == "reference" else "fieldkit evaluate"
    again = f"Give the folder that `{command}` wrote, or run it again."
    return read_model(model, kind, file, again, max_bytes=_MAX_BYTES)
