"""What is drawn for a photograph, before camera and noise; drawings are kept for others from the same pose."""

from __future__ import annotations

from collections import OrderedDict
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.scenes.edge_smoothing import smooth_edges
from fieldkit.scenes.renderer import Renderer

_SAMPLES = 4
KEPT_BYTES = 384 << 20


class Drawing(NamedTuple):
    """A view of a scene: image (h, w, 3) uint8 and, where asked for, depth (h, w) in metres, 0 where nothing is hit."""

    image: NDArray[np.uint8]
    depth: NDArray[np.float32] | None


class Draw(Protocol):
    """Draws a renderer's scene."""

    def __call__(
        self, renderer: Renderer, pose: Pose, intrinsics: Intrinsics, *, depth: bool, economy: bool
    ) -> Drawing:
        """The view from a pose, with ``depth`` or without; ``economy`` as in `simulate_capture`."""
        ...


def draw(renderer: Renderer, pose: Pose, intrinsics: Intrinsics, *, depth: bool, economy: bool) -> Drawing:
    """See `Draw`: with four samples per pixel, or with one and edges smoothed afterwards."""
    samples = 0 if economy else _SAMPLES
    if depth:
        image, distance = renderer.render(pose, intrinsics, samples=samples)
    else:
        image, distance = renderer.photograph(pose, intrinsics, samples=samples), None
    return Drawing(smooth_edges(image) if economy else image, distance)


class KeptDrawings:
    """`draw` that keeps the drawings used last: of two sets of cameras that share a pose, it is drawn once.

    A kept drawing is the same to the bit as a new one. The scene must stand still.

    Args:
        limit_bytes: of the drawings together; the one asked for last is always kept.
    """

    def __init__(self, limit_bytes: int = KEPT_BYTES) -> None:
        self._limit, self._bytes = limit_bytes, 0
        self._kept: OrderedDict[tuple[bytes, Intrinsics, bool, bool], Drawing] = OrderedDict()

    def __call__(
        self, renderer: Renderer, pose: Pose, intrinsics: Intrinsics, *, depth: bool, economy: bool
    ) -> Drawing:
        key = (pose.rotation.tobytes() + pose.center.tobytes(), intrinsics, depth, economy)
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = draw(renderer, pose, intrinsics, depth=depth, economy=economy)
            self._bytes += _bytes(found)
        self._kept.move_to_end(key)
        while self._bytes > self._limit and len(self._kept) > 1:
            self._bytes -= _bytes(self._kept.popitem(last=False)[1])
        return found


def _bytes(drawing: Drawing) -> int:
    return drawing.image.nbytes + (0 if drawing.depth is None else drawing.depth.nbytes)
