"""Local features: OpenCV's SIFT with RootSIFT descriptors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class FeatureSettings:
    """How features are found."""

    working_side: int = 1600
    """Longer side the image is reduced to before detection, pixels; never enlarged."""
    max_features: int = 4096
    """The strongest are kept."""
    contrast_threshold: float = 0.02
    """OpenCV's `contrastThreshold`; lower finds more on dark leaves."""
    edge_threshold: float = 10.0
    """OpenCV's `edgeThreshold`."""
    kept: float = 1.0
    """Share of these that is not withheld at random: plants that match worse are rehearsed with it."""
    draw: int = 0
    """Which ones are withheld."""


@dataclass(frozen=True, eq=False)
class Features:
    """The features of one photograph."""

    keypoints: NDArray[np.float32]
    """(n, 4) float32: x, y and scale in pixels of the full-size photograph (COLMAP's convention: the centre of the
    upper left pixel is (0.5, 0.5)), orientation in radians."""
    descriptors: NDArray[np.uint8]
    """(n, 128) uint8 RootSIFT (Arandjelović & Zisserman 2012), 512 times its unit vector."""
    ground: int = 0
    """How many of the last are those of the ground, seen from above (`fieldkit.reconstruction.ground_view`)."""

    @classmethod
    def none(cls) -> Features:
        return cls(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))

    def with_ground(self, ground: Features) -> Features:
        """Followed by those of the ground."""
        keypoints = np.concatenate([self.keypoints, ground.keypoints])
        return Features(keypoints, np.concatenate([self.descriptors, ground.descriptors]), len(ground))

    @property
    def parts(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Indices of the photograph's own features, and of those of the ground."""
        own, every = len(self) - self.ground, np.arange(len(self))
        return every[:own], every[own:]

    def __len__(self) -> int:
        return len(self.keypoints)

    def largest(self, count: int) -> NDArray[np.int64]:
        """Indices (k,), ascending, of the ``count`` features of the largest scale among the photograph's own, and as
        many of the ground.
        """
        return np.concatenate([
            np.sort(part[np.argsort(-self.keypoints[part, 2], kind="stable")[:count]]) for part in self.parts
        ])  # fmt: skip

    def subset(self, index: NDArray[np.int64]) -> Features:
        """The features of those indices, ascending."""
        ground = int((index >= len(self) - self.ground).sum())
        return Features(self.keypoints[index], self.descriptors[index], ground)

    @cached_property
    def squares(self) -> NDArray[np.int32]:
        """(n,) squared lengths of the descriptors."""
        squares: NDArray[np.int32] = np.square(self.descriptors, dtype=np.int32).sum(axis=1, dtype=np.int32)
        return squares

    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 2) pixel positions."""
        return self.keypoints[:, :2].astype(np.float64)


def extract_features(gray: NDArray[np.uint8], settings: FeatureSettings) -> Features:
    """Features of a grey image (h, w), uint8. An image without texture gives zero features.

    Sorted by their values, so that the order does not depend on the detector's.
    """
    small = reduced(gray, settings)
    enlarged = (gray.shape[1] / small.shape[1], gray.shape[0] / small.shape[0])
    return detect(small, settings, settings.max_features, enlarged)


def reduced(gray: NDArray[np.uint8], settings: FeatureSettings) -> NDArray[np.uint8]:
    """An image (h, w) in the size that features are found in."""
    height, width = gray.shape
    scale = min(1.0, settings.working_side / max(height, width))
    if scale == 1.0:
        return gray
    size = (round(width * scale), round(height * scale))
    return cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.uint8)


def detect(
    gray: NDArray[np.uint8], settings: FeatureSettings, most: int, enlarged: tuple[float, float] = (1.0, 1.0)
) -> Features:
    """The strongest features of an image, in pixels of one that is so much wider and higher."""
    sx, sy = enlarged
    sift = cv2.SIFT_create(  # type: ignore[attr-defined]
        nfeatures=most,
        contrastThreshold=settings.contrast_threshold,
        edgeThreshold=settings.edge_threshold,
        enable_precise_upscale=False,
    )
    found, descriptors = sift.detectAndCompute(gray, None)
    if descriptors is None:
        return Features.none()
    # OpenCV doubles the image with pixel centres aligned at the corners, so its keypoints lie 0.25 px too far right and
    # down (opencv issue 23123). Its precise upscaling has no shift, but finds 3–6 % fewer features on the rigs' plants.
    shift = 0.5 - 0.25
    keypoints = np.array(
        [((k.pt[0] + shift) * sx, (k.pt[1] + shift) * sy, k.size / 2 * sx, np.radians(k.angle)) for k in found],
        np.float32,
    )
    # nfeatures keeps ties, so more than asked for can come back.
    strongest = np.argsort([-k.response for k in found], kind="stable")[:most]
    keypoints, descriptors = keypoints[strongest], descriptors[strongest]
    order = np.lexsort(keypoints.T)
    return Features(keypoints[order], _root_sift(descriptors[order]))


def _root_sift(sift: NDArray[np.float32]) -> NDArray[np.uint8]:
    """L1-normalise, take the square root (then the L2 norm is 1), quantise as COLMAP does."""
    total = np.maximum(sift.sum(axis=1, keepdims=True), 1e-12)
    quantised: NDArray[np.uint8] = np.clip(np.round(512.0 * np.sqrt(sift / total)), 0, 255).astype(np.uint8)
    return quantised
