"""Local features: OpenCV's SIFT with RootSIFT descriptors, in photographs and in these as if taken straight down.

An oblique photograph turned about its own centre until it looks down shows level ground in its true shape, whatever the
camera's height. Features found there are matched at angles where those of the photograph are not (Mikolajczyk & Schmid
2004 correct for such changes feature by feature; here the ground's direction is known). Soil does not sway.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array, FloatArray, IntArray
from fieldkit.geometry import Intrinsics
from fieldkit.reconstruction.dense.masks import EXG_THRESHOLD, excess_green
from fieldkit.reconstruction.settings import FeatureSettings


class Partners(NamedTuple):
    """Which learned features of a photograph match those of n photographs."""

    place: int
    """Which of the n it is."""
    partner: IntArray
    """(m, n) for each of its m learned features one of each photograph's; −1 for none."""


@dataclass(frozen=True, eq=False)
class Features:
    """The features of one photograph."""

    keypoints: Float32Array
    """(n, 4) float32: x, y and scale in pixels of the full-size photograph (COLMAP's convention: the centre of the
    upper left pixel is (0.5, 0.5)), orientation in radians."""
    descriptors: ByteArray
    """(n, 128) uint8 RootSIFT (Arandjelović & Zisserman 2012), 512 times its unit vector."""
    ground: int = 0
    """How many of the last are those of the ground, seen from above (`fieldkit.reconstruction.features`)."""
    partners: Partners | None = None
    """Of the learned features before those (`fieldkit.reconstruction.learned`): they have neither a scale nor an
    orientation nor descriptors of this kind, only matches."""

    @classmethod
    def none(cls) -> Features:
        return cls(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))

    def with_ground(self, ground: Features) -> Features:
        """Followed by those of the ground."""
        return replace(self._and(ground.keypoints, ground.descriptors), ground=len(ground))

    def with_learned(self, points: Float32Array, partners: Partners) -> Features:
        """Followed by learned ones at ``points`` (m, 2), pixels of the photograph."""
        keypoints = np.pad(points, ((0, 0), (0, 2)))
        return replace(self._and(keypoints, np.zeros((len(points), 128), np.uint8)), partners=partners)

    def _and(self, keypoints: Float32Array, descriptors: ByteArray) -> Features:
        both = (np.concatenate([self.keypoints, keypoints]), np.concatenate([self.descriptors, descriptors]))
        return Features(*both, partners=self.partners)

    @property
    def parts(self) -> tuple[IntArray, IntArray, IntArray]:
        """Indices of the photograph's own features, of learned ones, and of those of the ground."""
        ground = len(self) - self.ground
        own, every = ground - (0 if self.partners is None else len(self.partners.partner)), np.arange(len(self))
        return every[:own], every[own:ground], every[ground:]

    def partners_in(self, other: Features) -> IntArray:
        """(k, 2) the matches of learned features, sorted by the first."""
        if self.partners is None or other.partners is None:
            return np.zeros((0, 2), np.int64)
        index = self.partners.partner[:, other.partners.place]
        matched = np.flatnonzero(index >= 0)
        return np.stack([self.parts[1][matched], other.parts[1][index[matched]]], axis=1)

    def __len__(self) -> int:
        return len(self.keypoints)

    def largest(self, count: int) -> IntArray:
        """Indices (k,), ascending, of the ``count`` features of the largest scale among the photograph's own, of all
        learned ones, and of as many of the ground.
        """
        own, learned, ground = self.parts
        most = [np.sort(part[np.argsort(-self.keypoints[part, 2], kind="stable")[:count]]) for part in (own, ground)]
        return np.concatenate([most[0], learned, most[1]])

    def subset(self, index: IntArray) -> Features:
        """The features of those indices, ascending: of the learned ones all or none."""
        _, learned, ground = (int(np.isin(part, index).sum()) for part in self.parts)
        return Features(self.keypoints[index], self.descriptors[index], ground, self.partners if learned else None)

    @cached_property
    def squares(self) -> NDArray[np.int32]:
        """(n,) squared lengths of the descriptors."""
        squares: NDArray[np.int32] = np.square(self.descriptors, dtype=np.int32).sum(axis=1, dtype=np.int32)
        return squares

    @property
    def points(self) -> FloatArray:
        """(n, 2) pixel positions."""
        return self.keypoints[:, :2].astype(np.float64)


SOIL_SHARE = 0.5
"""Least share of a photograph's features that are of its soil, as long as there are so many: leaves repeat and sway,
and their edges are stronger, so that without a share of its own soil has none. In a canopy at V10 the information of a
pair (`mapping.uncertainty`) goes from 8 to 2000 / px² with it, and from 0 to 460 between directions 41° apart."""
_WEAKER = 0.5
"""Factor of the contrast from which features may be soil's where there are more than enough."""
_OCTAVE_LAYERS = 3
"""OpenCV's `nOctaveLayers`: it compares the contrast times so many with its threshold."""
_OFF_PLANTS = 1.0
"""Distance of a feature of the soil from the nearest plant, in diameters of the feature: edges of leaves against soil
are strong and of no place."""


def extract_features(image: ByteArray, settings: FeatureSettings) -> Features:
    """Features of an image, uint8: (h, w) grey, or (h, w, 3) RGB, of which `SOIL_SHARE` are to be of the soil.

    An image without texture gives zero features. Sorted by their values, so that the order does not depend on the
    detector's.
    """
    height, width = image.shape[:2]
    image = reduced(image, settings)  # the full size is not kept meanwhile
    enlarged = (width / image.shape[1], height / image.shape[0])
    return detect(image, settings, settings.max_features, SOIL_SHARE, enlarged)


def reduced(image: ByteArray, settings: FeatureSettings) -> ByteArray:
    """An image (h, w) or (h, w, 3) in the size that features are found in."""
    height, width = image.shape[:2]
    scale = min(1.0, settings.working_side / max(height, width))
    if scale == 1.0:
        return image
    size = (round(width * scale), round(height * scale))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.uint8)


def detect(
    image: ByteArray,
    settings: FeatureSettings,
    most: int,
    soil_share: float,
    enlarged: tuple[float, float] = (1.0, 1.0),
) -> Features:
    """The strongest features of an image, in pixels of one that is so much wider and higher.

    Of a colour image at least a share is of the soil, where there are so many; the others are the strongest of all.
    """
    sx, sy = enlarged
    gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    sift = cv2.SIFT_create(  # type: ignore[attr-defined]
        contrastThreshold=_WEAKER * settings.contrast_threshold,
        edgeThreshold=settings.edge_threshold,
        enable_precise_upscale=False,
    )
    strongest = sorted(sift.detect(gray, None), key=lambda point: -point.response)
    strong = sum(point.response * _OCTAVE_LAYERS >= settings.contrast_threshold for point in strongest)
    if strong < most:  # soil in the shade of a canopy needs weaker ones, where leaves have more than enough
        strongest = strongest[:strong]
    if image.ndim == 3 and strongest:
        away_px = cv2.distanceTransform((excess_green(image) <= EXG_THRESHOLD).astype(np.uint8), cv2.DIST_L2, 3)
        x, y = np.array([point.pt for point in strongest]).astype(int).T
        soil = away_px[y, x] > _OFF_PLANTS * np.array([point.size for point in strongest])
        kept = np.flatnonzero(soil)[: max(round(soil_share * most), soil[:most].sum())]
        others = np.flatnonzero(~soil)[: most - len(kept)]
        more = np.flatnonzero(soil)[len(kept) : most - len(others)]
        strongest = [strongest[k] for k in np.concatenate([kept, others, more])]
    found, descriptors = sift.compute(gray, strongest[:most])
    if descriptors is None:
        return Features.none()
    # OpenCV doubles the image with pixel centres aligned at the corners, so its keypoints lie 0.25 px too far right and
    # down (opencv issue 23123). Its precise upscaling has no shift, but finds 3–6 % fewer features on the rigs' plants.
    shift = 0.5 - 0.25
    keypoints = np.array(
        [((k.pt[0] + shift) * sx, (k.pt[1] + shift) * sy, k.size / 2 * sx, np.radians(k.angle)) for k in found],
        np.float32,
    )
    order = np.lexsort(keypoints.T)
    return Features(keypoints[order], _root_sift(descriptors[order]))


def _root_sift(sift: Float32Array) -> ByteArray:
    """L1-normalise, take the square root (then the L2 norm is 1), quantise as COLMAP does."""
    total = np.maximum(sift.sum(axis=1, keepdims=True), 1e-12)
    quantised: ByteArray = np.clip(np.round(512.0 * np.sqrt(sift / total)), 0, 255).astype(np.uint8)
    return quantised


_LEAST_DEG = 25.0
"""Least angle off straight down of an optical axis for turning to gain, degrees."""
_MOST_DEG = 80.0
"""Largest angle off straight down of rays that are drawn, degrees."""
_MAX_FEATURES = 2048
"""Most features of a turned photograph."""
_MAX_SIDE = 1600
"""Longest side of a turned photograph, pixels."""
_EDGE_PX = 8.0
"""Distance to a photograph's border within which features are left out, pixels: the drawing's own outline is full of
corners."""


class _Turned(NamedTuple):
    """A view straight down."""

    to_photo: FloatArray
    """(3, 3) homography from its pixels to the photograph's."""
    size: tuple[int, int]
    spacing: float
    """Of its pixels, as a share of the camera's height."""


def extract_ground_features(
    image: ByteArray, camera: Intrinsics, rotation: FloatArray, settings: FeatureSettings
) -> Features:
    """Features of the view straight down, of the soil first; none where the camera looks down anyway, or at the sky.

    Positions are pixels of the photograph. Scales are shares of the camera's height above ground, orientations those
    about the vertical, from the x axis towards −y: both agree between photographs.

    Args:
        image: (h, w) or (h, w, 3) the photograph. Its lens's distortion is not taken out, for any warp gives the
            positions back.
        rotation: (3, 3) camera from world, whose z axis points up.
    """
    small = reduced(image, settings)
    view = _turned(camera.scaled(small.shape[1], small.shape[0]), rotation)
    if view is None:
        return Features.none()
    drawn = cv2.warpPerspective(small, view.to_photo, view.size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    found = detect(drawn.astype(np.uint8), settings, 2 * _MAX_FEATURES, 1.0)
    if not len(found):
        return found
    keypoints = found.keypoints.astype(np.float64)
    placed = np.column_stack([keypoints[:, :2] - 0.5, np.ones(len(found))]) @ view.to_photo.T
    pixels = placed[:, :2] / placed[:, 2:] + 0.5
    # The drawing's own outline is full of corners.
    inside = (pixels > _EDGE_PX).all(axis=1) & (pixels < np.array(small.shape[1::-1]) - _EDGE_PX).all(axis=1)
    inside &= placed[:, 2] > 0
    keypoints[:, :2] = pixels * (image.shape[1] / small.shape[1], image.shape[0] / small.shape[0])
    keypoints[:, 2] *= view.spacing
    found = Features(keypoints.astype(np.float32), found.descriptors, len(found)).subset(np.flatnonzero(inside))
    return found.subset(found.largest(_MAX_FEATURES))


def is_oblique(rotation: FloatArray) -> bool:
    """Whether turning a camera (3, 3), from world, straight down gains anything."""
    return bool(_LEAST_DEG <= _off_down_deg(rotation) < _MOST_DEG)


def _off_down_deg(rotation: FloatArray) -> float:
    return float(np.degrees(np.arccos(np.clip(-rotation[2, 2], -1.0, 1.0))))


def _turned(camera: Intrinsics, rotation: FloatArray) -> _Turned | None:
    if not is_oblique(rotation):
        return None
    rays = _border_rays(camera) @ rotation
    rays = rays[-rays[:, 2] > np.cos(np.radians(_MOST_DEG)) * np.linalg.norm(rays, axis=1)]
    if len(rays) < 3:
        return None
    # Where rays of the picture's border meet the plane one camera height below, x to the right and −y down.
    plane = np.column_stack([rays[:, 0], -rays[:, 1]]) / -rays[:, 2:]
    low, high = plane.min(axis=0), plane.max(axis=0)
    spacing = 1.0 / (camera.fx * np.cos(np.radians(_off_down_deg(rotation))) ** 1.5)
    spacing = max(spacing, float((high - low).max()) / _MAX_SIDE)
    width, height = np.ceil((high - low) / spacing).astype(int)
    to_world = np.array([[spacing, 0.0, low[0]], [0.0, -spacing, -low[1]], [0.0, 0.0, -1.0]])
    return _Turned(camera.matrix() @ rotation @ to_world, (int(width), int(height)), spacing)


def _border_rays(camera: Intrinsics) -> FloatArray:
    """(k, 3) rays of pixels along the picture's border, camera frame."""
    along, zero, one = np.linspace(0.0, 1.0, 33), np.zeros(33), np.ones(33)
    x, y = np.concatenate([(along, zero), (along, one), (zero, along), (one, along)], axis=1)
    pixels = np.column_stack([x * camera.width, y * camera.height, np.ones(len(x))])
    rays: FloatArray = pixels @ np.linalg.inv(camera.matrix()).T
    return rays
