"""What a report's results look like: their 3D views and overviews, and thumbnails of their photographs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice

from fieldkit.figures.content import Block, Paragraph, Picture, Still, View3D
from fieldkit.figures.drawings import ViewerScene
from fieldkit.report.sections.views_3d import points_of, within_budget

MOST_THUMBNAILS = 300
"""Largest number of a report's thumbnails, about 2 MB."""
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
        self._stills: dict[int, Picture | None] = {}
        self._pictures: dict[tuple[str, str], Mapping[str, Picture]] = {}
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
        """Number of photographs and clouds shown small."""
        return sum(map(len, self._pictures.values()))

    def add_views(self, anchor: str, seen: Seen, overview: Callable[[str], Picture | None]) -> None:
        """Take in views of a result and the ``overview`` of each plot, as long as there is room for more."""
        for plot, scene, note in islice(seen, MOST_VIEWS - len(self._scenes)):
            self._notes[anchor, plot] = note
            if scene is not None:
                place = self._places[anchor, plot] = len(self._scenes)
                self._scenes.append(scene)
                self._stills[place] = overview(plot)

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
        note = self._notes.get((anchor, plot), "")
        place = self._places.get((anchor, plot))
        if place is not None:
            yield View3D(f"view-{place + 1}", self._scenes[place], note, self._stills[place])
        elif note:
            yield Paragraph(note, faint=True)

    def pictures(self, anchor: str, plot: str = "") -> Mapping[str, Picture]:
        """Small pictures of a result, by name."""
        return self._pictures.get((anchor, plot), {})

    def first_still(self, nouns: Iterable[str]) -> Iterator[Still]:
        """An overview of the first kind of result that has any, to begin a report with: a plot's by the plan first."""
        ordered = sorted(self._places.items(), key=lambda item: item[0][1] != "planned")
        places = (k for noun in nouns for (anchor, _), k in ordered if anchor.startswith(f"{noun}-"))
        found = ((self._scenes[place].title, picture) for place in places if (picture := self._stills[place]))
        yield from (Still(picture, title) for title, picture in islice(found, 1))
