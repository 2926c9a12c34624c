"""Pictures of results: their overviews, and small ones of photographs, if their folder can be found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2

from fieldkit.campaign.reading import Campaign
from fieldkit.captures.decode import read_image
from fieldkit.errors import FieldkitError
from fieldkit.figures.content import Picture
from fieldkit.files import file_beside
from fieldkit.report.sections.loaded import FlownMission, Loaded, PlanRun, Results
from fieldkit.report.sections.shown import MOST_THUMBNAILS, Shown
from fieldkit.results.evaluation import EvaluationReport, ReconstructionEntry, ReferenceReport
from fieldkit.results.report_files import file_sha256, load_evaluation_report
from fieldkit.results.visit import Visit

SIDE = 160
"""Longer side of a thumbnail, pixels; shown at half the size."""
MAP_SIDE = 480
"""The same of a photograph on a map."""
OVERVIEW_SIDE = 1400
"""The same of a result's overview, shown at its size."""

_QUALITY = 72
"""JPEG quality of photographs in the page."""
_LARGEST_BYTES = 64 << 20
"""Largest file that is shown, bytes."""
_MOST_FOLDERS = 400
"""Most folders that are searched for photographs."""


def add_photographs(
    shown: Shown, anchor: str, result: Loaded[ReferenceReport] | Loaded[EvaluationReport], results: Results
) -> None:
    """Thumbnails of a reference's or of every evaluated plot's photographs, unused ones first: people look for them."""
    report = result.report
    plots: list[tuple[str, ReconstructionEntry, tuple[str, ...]]]
    if isinstance(report, ReferenceReport):
        plots = [("", report, (report.source,))]
    else:
        places = (report.source,) if len(report.plots) == 1 else ()
        plots = [(plot.name, plot, (f"{report.source}/{plot.name}", *places)) for plot in report.plots]
    for plot, found, sources in plots:
        names = [image.name for image in sorted(found.image_reports, key=lambda image: image.counts)]
        folders = (find_photographs(source, names, result.folder, results.root) for source in sources)
        if (folder := next((each for each in folders if each is not None), None)) is not None:
            shown.add_pictures(anchor, plot, thumbnails(folder, names, MOST_THUMBNAILS - shown.thumbnails))


def add_campaign_pictures(shown: Shown, anchor: str, result: Loaded[Campaign], _: Results) -> None:
    """Of each plot the last photograph that there is."""
    pictures: dict[str, Picture] = {}
    for visit in sorted(result.report.visits, key=lambda visit: visit.date, reverse=True):
        if visit.plot in pictures or shown.thumbnails + len(pictures) >= MOST_THUMBNAILS:
            continue
        with suppress(FieldkitError, OSError):
            if (picture := _photograph(result.folder, visit)) is not None:
                pictures[visit.plot] = picture
    shown.add_pictures(anchor, "", pictures)


def overview(result: Loaded[Any], plot: str) -> Picture | None:
    """The picture that was written with a result; None where it is not there any more."""
    report = result.report
    if isinstance(report, EvaluationReport):
        names = [entry.name for each in report.plots if each.name == plot for entry in each.files]
    elif isinstance(report, PlanRun):
        names = ["plan.png"]
    else:
        names = [entry.name for entry in (report.record if isinstance(report, FlownMission) else report).files]
    file = _file(result.folder, next((name for name in names if name.endswith(".png")), ""))
    return None if file is None else _small(file, OVERVIEW_SIDE, f"{plot or result.name}: all of it", shown=1)


def _photograph(campaign: Path, visit: Visit) -> Picture | None:
    """The photograph of a visit that looks down most steeply, if it is still there and as it was."""
    plots = load_evaluation_report(campaign / visit.folder).plots if visit.folder else ()
    used = [image for plot in plots for image in plot.image_reports if image.counts]
    kept = visit.photographs.items() if used else ()
    files = {Path(path).name: (campaign / path, sha256) for sha256, path in kept}
    for image in sorted(used, key=lambda image: image.pitch_deg or 0.0):
        file, sha256 = files.pop(Path(image.name).name, (None, ""))
        if file is not None and file.is_file() and file_sha256(file) == sha256:
            return _small(file, MAP_SIDE, f"{visit.plot} on {visit.date}: photograph {file.name}")
    return None


def find_photographs(source: str, names: Sequence[str], near: Path, root: Path) -> Path | None:
    """The folder that holds all photographs of a result; None if it is not found.

    Results know only its name ``source``, or "FOLDER/PLOT". It is searched beside the result's folder ``near``, in
    folders named captures there, and below the report's folder ``root``.
    """
    if not names or not source or Path(source).is_absolute() or ".." in Path(source).parts:
        return None
    for place in _places(near, root):
        folder = place / source
        try:
            if folder.is_dir() and all(_file(folder, name) is not None for name in names):
                return folder
        except OSError:
            continue
    return None


def thumbnails(folder: Path, names: Sequence[str], most: int) -> Mapping[str, Picture]:
    """Small JPEGs of the first ``most`` photographs, without metadata, by name; unreadable ones are left out."""
    files = ((name, _file(folder, name)) for name in names[:most])
    small = ((name, _small(file, SIDE, f"photograph {name}")) for name, file in files if file is not None)
    return {name: picture for name, picture in small if picture is not None}


def _small(file: Path, side: int, description: str, *, shown: int = 2) -> Picture | None:
    """A picture without metadata, a pixel of the page from so many of its own; None where it cannot be read."""
    try:
        pixels = read_image(file, max_side=side) if file.stat().st_size <= _LARGEST_BYTES else None
    except (FieldkitError, OSError, MemoryError):
        return None
    if pixels is None:
        return None
    done, jpeg = cv2.imencode(".jpg", pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    height, width = pixels.shape[:2]
    return Picture(jpeg.tobytes(), max(1, width // shown), max(1, height // shown), description) if done else None


def _places(near: Path, root: Path) -> Iterator[Path]:
    about = [near, near.parent, near.parent.parent]
    yield from about
    yield from (place / "captures" for place in about)
    folders = sorted(root.glob("*"))[:_MOST_FOLDERS] if root.is_dir() else []
    yield from (folder for folder in folders if folder.is_dir() and not folder.name.startswith("."))


def _file(folder: Path, name: str) -> Path | None:
    """The path of a photograph, never outside the folder."""
    if not name or Path(name).is_absolute():
        return None
    try:
        # Captures may keep their photographs in images/.
        for place in (folder, folder / "images"):
            found = file_beside(Path(name), place / "photographs")
            if found is not None and found.is_file():
                return found
    except (OSError, RuntimeError, ValueError):
        return None
    return None
