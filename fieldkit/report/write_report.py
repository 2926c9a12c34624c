"""fieldkit report: one HTML file from a folder of results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fieldkit.errors import UsageError
from fieldkit.files import check_writable, write_atomic
from fieldkit.regular_files import check_replaceable
from fieldkit.report.html.document import render
from fieldkit.report.sections.loaded import read_results
from fieldkit.report.sections.page import build_page, counts
from fieldkit.runtime.progress import Progress, Silent

REPORT_FILE = "report.html"
POINTS = 1_000_000
"""Default limit of the points of all 3D views of a report together."""

MOST_POINTS = 10_000_000
"""Largest limit of the points of all 3D views together."""
_SUFFIXES = (".html", ".htm", "")


@dataclass(frozen=True)
class ReportSummary:
    """The written report, its size and how much it shows."""

    output: Path
    bytes: int
    references: int
    plans: int
    missions: int
    evaluations: int
    campaigns: int
    unreadable: tuple[str, ...]
    """Names of damaged results."""
    views: int
    """Of 3D views."""
    points: int
    """Of all views together."""
    points_found: int
    """Before thinning."""
    thumbnails: int
    comparisons: int = 0


def write_report(
    folder: Path | str,
    output: Path | str | None = None,
    *,
    points: int = POINTS,
    title: str = "",
    overwrite: bool = False,
    progress: Progress | None = None,
) -> ReportSummary:
    """Write the results of a folder as one HTML file that needs no network and no other file.

    The same results give the same file, byte for byte.

    Args:
        folder: a result of fieldkit, or a folder that holds results up to two levels below. Only the report is
            written to it, if ``output`` is None.
        output: the file; None takes report.html in the folder.
        points: largest number in all 3D views together; more are thinned at random from a fixed seed.
        title: of the report; empty takes the folder's name.
        overwrite: replace an older file.

    Raises:
        UsageError: the file is not HTML by its suffix, it exists and ``overwrite`` is off, no regular file is there, or
            a number is out of range.
        MetadataError: the folder holds no result of fieldkit, or all are damaged.
        StorageError: the folder cannot be read, or the file not written.
    """
    if not 1000 <= points <= MOST_POINTS:
        raise UsageError(f"cannot show {points} points", remedy=f"Give 1000 to {MOST_POINTS}.")
    folder = Path(folder)
    home = folder if folder.is_dir() else folder.parent
    output = home / REPORT_FILE if output is None else Path(output)
    if output.suffix.lower() not in _SUFFIXES:
        raise UsageError(
            f"a report is an HTML file, not {output.suffix}",
            path=output,
            remedy=f"Give {output.with_suffix('.html').name}; for a PDF, open it in a browser and print it to a file.",
        )
    check_replaceable(output, overwrite=overwrite)
    results = read_results(folder)
    check_writable(output.parent)
    progress = progress or Silent()
    command = f"fieldkit report {results.root.name}"
    page, shown = build_page(results, title=title, command=command, most_points=points, progress=progress)
    with progress.stage("Writing the report"):
        data = render(page).encode("utf-8")
        write_atomic(output, data)
    return ReportSummary(
        output,
        len(data),
        unreadable=tuple(each.name for each in results.unreadable),
        views=shown.views,
        points=shown.points,
        points_found=shown.points_found,
        thumbnails=shown.thumbnails,
        **{f"{noun}s": number for noun, number in counts(results).items()},
    )
