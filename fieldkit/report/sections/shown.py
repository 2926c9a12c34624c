"""What a report's results look like: their 3D views, and pictures of flights."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path

import cv2

from fieldkit.captures.decode import read_image
from fieldkit.errors import FieldkitError
from fieldkit.figures.content import MOST_ROWS, Block, Paragraph, Picture, View3D, ViewerScene
from fieldkit.files import file_beside
from fieldkit.report.sections.loaded import Loaded, Results
from fieldkit.report.sections.views_3d import points_of, within_budget
from fieldkit.results.evaluation import (
    FIELD_PICTURE,
    PHOTO_FILE,
    EvaluationReport,
)

_QUALITY = 72
"""JPEG quality of photographs in the page."""
_LARGEST_BYTES = 64 << 20
"""Largest file that is shown, bytes."""


PLOT_SIDE = 320
"""Longer side of a plot's photograph, pixels: 400 of them are some 12 MB."""
_FIELD_SIDE = 1800
"""Longer side of a field's picture, pixels."""
MOST_VIEWS = 10
"""Largest number of a report's views: browsers keep at most sixteen alive."""

Seen = Iterable[tuple[str, ViewerScene | None, str]]
"""By plot (empty where a result is of one thing): its view, and a note on it or why there is none."""


class Shown:
    """Views and pictures by the anchor of their result's section, and by plot."""

    def __init__(self) -> None:
        self._scenes: list[ViewerScene] = []
        self._places: dict[tuple[str, str], int] = {}
        self._notes: dict[tuple[str, str], str] = {}
        self._pictures: dict[tuple[str, str], Mapping[str, Picture]] = {}
        self._first: tuple[str, str] | None = None
        self.points_found = 0

    @property
    def points(self) -> int:
        """Number of points of all views together."""
        return points_of(self._scenes)

    @property
    def views(self) -> int:
        """Number of views."""
        return len(self._scenes)

    @property
    def thumbnails(self) -> int:
        """Number of pictures of fields and plots."""
        return sum(map(len, self._pictures.values()))

    def add_views(self, anchor: str, seen: Seen) -> None:
        """Take in views of a result, as long as there is room for more."""
        for plot, scene, note in islice(seen, MOST_VIEWS - len(self._scenes)):
            self._notes[anchor, plot] = note
            if scene is not None:
                self._places[anchor, plot] = len(self._scenes)
                self._scenes.append(scene)

    def add_pictures(self, anchor: str, plot: str, pictures: Mapping[str, Picture]) -> None:
        """Take in small pictures of a result, by name."""
        self._pictures[anchor, plot] = pictures

    def thin(self, most_points: int) -> None:
        """Keep at most so many points in all views together."""
        self.points_found = self.points
        self._scenes = within_budget(self._scenes, most_points)

    def has_view(self, anchor: str, plot: str = "") -> bool:
        """Whether there is a view."""
        return (anchor, plot) in self._places

    def view_blocks(self, anchor: str, plot: str = "") -> Iterator[Block]:
        """A view, or why there is none."""
        if (anchor, plot) == self._first:
            yield Paragraph("Its 3D view is at the top of the page.", faint=True)
            return
        note = self._notes.get((anchor, plot), "")
        place = self._places.get((anchor, plot))
        if place is not None:
            yield View3D(f"view-{place + 1}", self._scenes[place], note)
        elif note:
            yield Paragraph(note, faint=True)

    def first_view(self) -> list[Block]:
        """The view that a report begins with, and that is not shown again: of captures, else of what there is."""
        for noun in ("evaluation", "reference", "plan", "mission"):
            for place in reversed(self._places):
                if place[0] == f"{noun}-1":
                    blocks = list(self.view_blocks(*place))
                    self._first = place
                    return blocks
        return []

    def pictures(self, anchor: str, plot: str = "") -> Mapping[str, Picture]:
        """Small pictures of a result, by name."""
        return self._pictures.get((anchor, plot), {})


def add_photographs(shown: Shown, anchor: str, result: Loaded[EvaluationReport], _: Results) -> None:
    """The pictures of field and plots that the evaluation of a flight has, by their files."""
    report = result.report
    if report.flight is None:
        return
    shown.add_pictures(anchor, "", thumbnails(result.folder, [FIELD_PICTURE], _FIELD_SIDE))
    for each in report.plots[:MOST_ROWS]:
        names = [file.name for file in each.files if file.name.endswith(f"/{PHOTO_FILE}")]
        shown.add_pictures(anchor, each.name, thumbnails(result.folder, names, PLOT_SIDE))


def thumbnails(folder: Path, names: Sequence[str], side: int) -> Mapping[str, Picture]:
    """Small JPEGs of photographs, without metadata, by name; unreadable ones are left out."""
    pictures = {}
    for name in names:
        file = _file(folder, name)
        with suppress(FieldkitError, OSError, MemoryError):
            if file is not None and file.stat().st_size <= _LARGEST_BYTES:
                pixels = read_image(file, max_side=side)
                _, jpeg = cv2.imencode(".jpg", pixels[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
                height, width = pixels.shape[:2]
                size = max(1, width // 2), max(1, height // 2)
                pictures[name] = Picture(jpeg.tobytes(), *size, f"photograph {name}")
    return pictures


def _file(folder: Path, name: str) -> Path | None:
    """The path of a picture, never outside the folder."""
    if not name or Path(name).is_absolute():
        return None
    try:
        found = file_beside(Path(name), folder / "evaluation.json")
    except (OSError, RuntimeError, ValueError):
        return None
    return found if found is not None and found.is_file() else None
