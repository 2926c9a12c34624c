"""adherence.csv: one row per photograph and source, for spreadsheets and data frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fieldkit.documents.csv_text import csv_text
from fieldkit.files import write_atomic
from fieldkit.results.evaluation import AdherenceEntry, PoseEntry

SOURCES = ("planned", "commanded", "reported", "tagged", "reconstructed")
COLUMNS = ("image", "station", "source", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")


def write_adherence_csv(path: Path, found: AdherenceEntry) -> None:
    """Write the poses of a plot's photographs; UTF-8, commas, decimal points, empty cells for missing values.

    Raises:
        StorageError: the place is full or not writable.
    """
    write_atomic(path, adherence_csv(found))


def adherence_csv(found: AdherenceEntry) -> str:
    """The table as text: plot frame, one row per photograph and source that knows it, in the photographs' order."""
    return csv_text(COLUMNS, _rows(found))


def _rows(found: AdherenceEntry) -> Iterator[list[object]]:
    for row in found.photographs:
        for source in SOURCES:
            pose: PoseEntry | None = getattr(row, source)
            if pose is not None:
                yield [row.image, row.station, source, *pose.position_m, pose.yaw_deg, pose.pitch_deg]
