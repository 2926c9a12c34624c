"""Bursts made steady: one photograph of leaves at their mean place, and how far they moved beside the camera."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, ByteArray, Float32Array
from fieldkit.cache import StageCache, digest
from fieldkit.captures import Capture, Photo, read_image
from fieldkit.reconstruction.dense.masks import plant_mask
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.finding import Finding
from fieldkit.runtime.context import Context

_AGREE_PX = 1.0
"""Flows there and back that end farther apart are dropped; pixels of half size."""
_LEAST_AGREEING = 0.4
"""Share of a photograph's flows; of 0.8 to 0.9 in bursts, 0.1 between photographs of other views."""
_MEDIAN_PX = 5
"""Side of the median filter over the mean motion, pixels of half size."""
_REFINEMENTS = 1  # of 5 by default; more cost time and smooth leaves' motion away
_STEP_PX = 8  # of the map of motion, pixels of half size
_ROUNDS = 6
"""Number of rounds in which a plane's flow is fitted."""
_FLOOR_PX = 0.2
"""Least scale of what is off a plane's flow, pixels of half size."""
_LEAST_CELLS = 50
"""Least number of cells on plants that tell sway."""


@contextmanager
def steady_capture(capture: Capture, context: Context) -> Iterator[Capture]:
    """A capture with a picture of each of its bursts (`fieldkit.captures.bursts`), in files that last as the block."""
    bursts = [photo for photo in capture.photos if photo.burst]
    if not bursts:
        yield capture
        return
    # Workers of a cluster see the folder of the cache, but not this machine's temporary ones.
    shared = context.cache.root if context.scheduler else None
    with tempfile.TemporaryDirectory(prefix="fieldkit-bursts-", dir=shared) as folder:
        with context.progress.stage("Bursts", len(bursts)) as advance:
            work = partial(_written, folder=Path(folder), cache_root=context.cache.root)
            made = {photo.name: each for photo, each in zip(bursts, context.map(work, bursts, advance), strict=True)}
        photos = tuple(made[photo.name][0] if photo.name in made else photo for photo in capture.photos)
        apart = [finding for _, findings in made.values() for finding in findings]
        yield replace(capture, photos=photos, findings=(*capture.findings, *apart))


def _written(photo: Photo, folder: Path, cache_root: Path | None) -> tuple[Photo, list[Finding]]:
    """A burst's photograph with its picture, which is written into a folder, and what became of its members."""
    key = digest("bursts", STAGES["bursts"], [each.sha256 for each in photo.burst])

    def made() -> dict[str, np.ndarray]:
        found = steady_photograph(photo.burst)
        png = cv2.imencode(".png", cv2.cvtColor(found.image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 1])[1]
        return {"png": png, "sway": np.array(found.sway_px), "agrees": found.agrees}

    kept = StageCache(cache_root).kept("bursts", key, made)
    path = folder / f"{key}.png"
    path.write_bytes(kept["png"].tobytes())
    sway, agrees = float(kept["sway"]), kept["agrees"]
    message = f"shows another view than {photo.name}, the first of its burst; not used"
    apart = [
        Finding(each.name, "burst-apart", message, True)
        for each, agreed in zip(photo.burst, agrees, strict=True)
        if not agreed
    ]
    members = tuple(each for each, agreed in zip(photo.burst, agrees, strict=True) if agreed)
    done = replace(photo, path=path, format="PNG", sha256=key, burst=members, sway_px=None if np.isnan(sway) else sway)
    return done, apart


@dataclass(frozen=True, eq=False)
class Steady:
    """What a burst shows."""

    image: ByteArray
    """(h, w, 3) RGB: the first photograph, every pixel moved to its mean place, the camera's motion included."""
    sway_px: float
    """How far plants moved beside the camera's own motion: standard deviation over the burst, per axis, pixels of the
    photographs; NaN where there are none, or no photograph agrees with the first."""
    agrees: BoolArray
    """(photographs,) whether each shows what the first does."""


def steady_photograph(photos: tuple[Photo, ...]) -> Steady:
    """The mean of a burst by dense optical flow from its first photograph to each other (DIS, half size).

    The camera's motion is found on the soil, as flow of a plane (a homography's, to second order). What remains of it
    on plants is parallax: one pattern of distances, times a direction in each photograph. So of all flows over all
    plants the first principal component is taken out; the rest is sway.
    """
    first = read_image(photos[0])
    height, width = first.shape[:2]
    size = (width // 2, height // 2)
    half = _bytes(cv2.resize(first, size, interpolation=cv2.INTER_AREA))
    grays = (read_image(photo, gray=True) for photo in photos[1:])
    mean, sway, agrees = _followed(
        half, (_bytes(cv2.resize(gray, size, interpolation=cv2.INTER_AREA)) for gray in grays)
    )
    shift = np.zeros_like(mean)
    for axis in range(2):
        shift[..., axis] = cv2.medianBlur(np.ascontiguousarray(mean[..., axis]), _MEDIAN_PX)
    scale = 0.5 * (width / size[0] + height / size[1])
    return Steady(_moved(first, shift), scale * sway, np.array(agrees))


def quick_sway_px(photos: Sequence[Photo], side: int) -> float:
    """The sway of a burst alone (`Steady.sway_px`), in pictures whose longer side has so many pixels."""
    first = read_image(photos[0], max_side=side)
    _, sway, _ = _followed(first, (read_image(photo, max_side=side, gray=True) for photo in photos[1:]))
    return float(sway * max(photos[0].width, photos[0].height) / max(first.shape[:2]))


def _followed(first: ByteArray, others: Iterable[ByteArray]) -> tuple[Float32Array, float, list[bool]]:
    """Mean flow (h, w, 2) from a photograph to itself and others, sway in its pixels, and who agrees.

    ``first`` (h, w, 3) is RGB, ``others`` (h, w) are grey.
    """
    gray = _bytes(cv2.cvtColor(first, cv2.COLOR_RGB2GRAY))
    plants = plant_mask(first)
    assert plants is not None
    h, w = gray.shape
    y, x = np.mgrid[:h, :w].astype(np.float32)
    planes = _Planes(x / w - 0.5, y / w - 0.5 * h / w)
    camera, moved, seen = np.zeros((h, w, 2), np.float32), np.zeros((h, w, 2), np.float32), np.ones((h, w), np.float32)
    cells, known, agrees = [np.zeros((*x[_cells].shape, 2), np.float32)], [seen[_cells] > 0], [True]
    for other in others:
        flow, agree = _flow(gray, other, x, y)
        agrees.append(bool(agree.mean() >= _LEAST_AGREEING))
        if not agrees[-1]:
            continue
        plane = planes.fitted(flow, agree & ~plants if (agree & ~plants).any() else agree)
        rest = (flow - plane) * agree[..., None]
        camera, moved, seen = camera + plane, moved + rest, seen + agree
        cells.append(rest[_cells])
        known.append(agree[_cells])
    sway = _sway(np.array(cells), np.logical_and.reduce(known), plants[_cells])
    return camera / len(cells) + moved / seen[..., None], sway, agrees


_cells = (slice(_STEP_PX // 2, None, _STEP_PX), slice(_STEP_PX // 2, None, _STEP_PX))


def _flow(one: ByteArray, other: ByteArray, x: Float32Array, y: Float32Array) -> tuple[Float32Array, BoolArray]:
    """Flow (h, w, 2) from one grey image to another, and where the flow back agrees and stays in the picture."""
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    dis.setFinestScale(0)
    dis.setVariationalRefinementIterations(_REFINEMENTS)
    there, back = (
        np.asarray(dis.calc(a, b, np.zeros((*a.shape, 2), np.float32)), "f4") for a, b in ((one, other), (other, one))
    )
    end_x, end_y = x + there[..., 0], y + there[..., 1]
    returned = cv2.remap(back, end_x, end_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    h, w = one.shape
    inside = (end_x >= 0) & (end_x <= w - 1) & (end_y >= 0) & (end_y <= h - 1)
    return there, inside & (np.linalg.norm(there + returned, axis=2) < _AGREE_PX)


class _Planes:
    """The flows that a plane can have where the camera moves a little, over an image; (x, y) (h, w), about 1 wide."""

    def __init__(self, x: Float32Array, y: Float32Array) -> None:
        one, none = np.ones_like(x), np.zeros_like(x)
        self._basis = np.stack(
            [
                np.stack([one, x, y, none, none, none, x * x, x * y], -1),
                np.stack([none, none, none, one, x, y, x * y, y * y], -1),
            ],
            axis=2,
        )

    def fitted(self, flow: Float32Array, where: BoolArray) -> Float32Array:
        """The one next to a flow (h, w, 2) at some pixels, at all: least squares, reweighted after Cauchy."""
        rows, want = self._basis[_cells][where[_cells]].astype(float), flow[_cells][where[_cells]].astype(float)
        weight: NDArray[np.floating] = np.ones(len(rows))
        best = np.zeros(8)
        for _ in range(_ROUNDS):
            a, b = rows * weight[:, None, None], want * weight[:, None]
            best = np.linalg.lstsq(a.reshape(-1, 8), b.ravel(), rcond=None)[0]
            off = np.linalg.norm(want - rows @ best, axis=1)
            weight = 1.0 / np.sqrt(1.0 + (off / max(_FLOOR_PX, 3.0 * float(np.median(off)))) ** 2)
        return np.asarray(self._basis @ best.astype(np.float32))


def _sway(rest: Float32Array, known: BoolArray, plants: BoolArray) -> float:
    """How far plants' cells moved beside the camera, root mean square, per axis.

    ``rest`` (k, rows, columns, 2) are flows less the plane's; ``known`` (rows, columns) is where all are known.
    """
    motion, here = np.full(known.shape, np.nan, np.float32), known & plants
    if len(rest) < 2 or here.sum() < _LEAST_CELLS:
        return float("nan")
    rest = rest - rest.mean(axis=0)
    flat = rest[:, here].transpose(1, 0, 2).reshape(here.sum(), -1)  # a row of x and y of all photographs per cell
    parallax = np.linalg.svd(flat, full_matrices=False)[2][0]
    each = rest[:, known].transpose(1, 0, 2).reshape(known.sum(), -1)
    each = each - np.outer(each @ parallax, parallax)
    motion[known] = np.sqrt((each**2).sum(axis=1) / (2 * (len(rest) - 1) - 1))
    return float(np.sqrt(np.mean(motion[here] ** 2)))


def _bytes(image: Any) -> ByteArray:
    return np.asarray(image, dtype=np.uint8)


def _moved(image: ByteArray, shift: Float32Array) -> ByteArray:
    """An image (h, w, 3) whose pixels are moved by a shift known at half size; black where nothing came from."""
    height, width = image.shape[:2]
    h, w = shift.shape[:2]
    y, x = np.mgrid[:h, :w].astype(np.float32)
    back = shift
    for _ in range(3):  # what moves to a place comes from there less the shift at where it comes from
        from_x, from_y = x - back[..., 0], y - back[..., 1]
        back = np.asarray(cv2.remap(shift, from_x, from_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), "f4")
    back = np.asarray(cv2.resize(back, (width, height), interpolation=cv2.INTER_LINEAR), "f4")
    y, x = np.mgrid[:height, :width].astype(np.float32)
    from_x, from_y = x - back[..., 0] * (width / w), y - back[..., 1] * (height / h)
    return np.asarray(cv2.remap(image, from_x, from_y, cv2.INTER_LANCZOS4), dtype=np.uint8)
