"""Reading and writing visit.json."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fieldkit.documents.json_file import check_version, read_kind, validated
from fieldkit.files import write_atomic
from fieldkit.results.visit import Visit

VISIT_FILE = "visit.json"
_VERSION = Visit.model_fields["version"].default
_MAX_BYTES = 8 << 20
EARLIER_FIGURES = ("height_m", "cover", "hull_m3")
"""Of plants, by definitions that were given up: they are not comparable, and no longer read."""
_REMEDY = "Move it away, and run `fieldkit evaluate` on the photographs again."


def save_visit(folder: Path, visit: Visit) -> None:
    """Write visit.json (UTF-8, indented) into a visit's folder, which is made where it is missing.

    Raises:
        StorageError: the place is full or not writable; an older file is left as it was.
    """
    write_atomic(folder / VISIT_FILE, visit.model_dump_json(indent=2) + "\n")


def visit_document(folder: Path) -> dict[str, Any]:
    """The object in a folder's visit.json, of whatever version.

    Raises:
        MetadataError: it is missing, not JSON, or no visit.
    """
    return read_kind(folder / VISIT_FILE, "visit", _REMEDY, max_bytes=_MAX_BYTES)


def visit_of_document(document: dict[str, Any], folder: Path) -> Visit:
    """The visit that `visit_document` read.

    Raises:
        MetadataError: it is of another version, or a field is wrong.
    """
    file = folder / VISIT_FILE
    check_version(document, _VERSION, file, _REMEDY)
    kept = {name: value for name, value in document.items() if name not in EARLIER_FIGURES}
    return validated(Visit, kept, file, _REMEDY)
