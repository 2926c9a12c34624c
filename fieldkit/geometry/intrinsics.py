"""Camera intrinsics in COLMAP's camera models."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.geometry.pose import Pose

PARAMETER_NAMES: dict[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
"""The supported models and their parameters, in COLMAP's order (colmap.github.io/cameras.html)."""

_LENGTHS = frozenset({"f", "fx", "fy", "cx", "cy"})


@dataclass(frozen=True)
class Intrinsics:
    """A camera model with its size and parameters."""

    model: str
    """A key of `PARAMETER_NAMES`."""
    width: int
    """Pixels."""
    height: int
    """Pixels."""
    params: tuple[float, ...]
    """In COLMAP's order; focal lengths and principal point in pixels, with (0, 0) the upper left corner of the upper
    left pixel, so that its centre is (0.5, 0.5)."""

    def __post_init__(self) -> None:
        names = PARAMETER_NAMES.get(self.model)
        if names is None:
            raise ValueError(f"camera model {self.model!r} is not one of {', '.join(PARAMETER_NAMES)}")
        if len(self.params) != len(names):
            raise ValueError(f"{self.model} takes {len(names)} parameters ({', '.join(names)}), not {len(self.params)}")
        if self.width <= 0 or self.height <= 0 or not all(np.isfinite(self.params)) or min(self.fx, self.fy) <= 0:
            raise ValueError("width, height and focal length must be positive and finite")

    @classmethod
    def pinhole(cls, width: int, height: int, focal: float) -> Intrinsics:
        """A distortion-free camera with its principal point in the middle; ``focal`` in pixels."""
        return cls("PINHOLE", width, height, (focal, focal, width / 2, height / 2))

    def _get(self, name: str, otherwise: float = 0.0) -> float:
        names = PARAMETER_NAMES[self.model]
        return self.params[names.index(name)] if name in names else otherwise

    @property
    def fx(self) -> float:
        return self._get("fx", self._get("f"))

    @property
    def fy(self) -> float:
        return self._get("fy", self._get("f"))

    @property
    def cx(self) -> float:
        return self._get("cx")

    @property
    def cy(self) -> float:
        return self._get("cy")

    @property
    def distorted(self) -> bool:
        """Whether any distortion parameter is not zero."""
        names = PARAMETER_NAMES[self.model]
        return any(value != 0.0 for name, value in zip(names, self.params, strict=True) if name not in _LENGTHS)

    def matrix(self) -> FloatArray:
        """(3, 3) calibration matrix K, without the distortion."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def without_distortion(self) -> Intrinsics:
        """The PINHOLE camera with the same size, focal lengths and principal point."""
        return Intrinsics("PINHOLE", self.width, self.height, (self.fx, self.fy, self.cx, self.cy))

    def scaled(self, width: int, height: int) -> Intrinsics:
        """The same camera at another image size (pixels). A one-focal model needs the aspect ratio kept to 1 %."""
        sx, sy = width / self.width, height / self.height
        if "f" in PARAMETER_NAMES[self.model] and abs(sx / sy - 1.0) > 0.01:
            raise ValueError(f"{self.width}×{self.height} to {width}×{height} changes the aspect ratio of {self.model}")
        factor = {"f": 0.5 * (sx + sy), "fx": sx, "cx": sx, "fy": sy, "cy": sy}
        names = PARAMETER_NAMES[self.model]
        params = tuple(v * factor.get(n, 1.0) for n, v in zip(names, self.params, strict=True))
        return replace(self, width=width, height=height, params=params)

    def at_size(self, width: int, height: int) -> Intrinsics | None:
        """As `scaled`, to another size of the same aspect ratio (to a pixel), or None for another ratio."""
        if abs(self.width * height - self.height * width) > max(self.width, self.height, width, height):
            return None
        return self if (self.width, self.height) == (width, height) else self.scaled(width, height)

    def project(self, points: FloatArray) -> FloatArray:
        """Camera-frame points (n, 3) to pixels (n, 2); points at z ≤ 0 give NaN."""
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        x, y = self._distort(x, y)
        pixels = np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=1)
        pixels[points[:, 2] <= 0] = np.nan
        return pixels

    def sees(self, points: FloatArray, pose: Pose | None = None) -> BoolArray:
        """(n,) which camera-frame points (n, 3) fall into the picture, hidden or not.

        With a ``pose`` points in the world, and without the lens's distortion: beyond the picture it folds over.
        """
        if pose is not None:
            return self.without_distortion().sees(pose.to_camera(points))
        pixels = self.project(points)
        with np.errstate(invalid="ignore"):
            return np.asarray(((pixels >= 0.0) & (pixels <= (self.width, self.height))).all(axis=1))

    def undistort(self, pixels: FloatArray) -> FloatArray:
        """Pixels (n, 2) of this camera as pixels (n, 2) of `without_distortion` (fixed-point iteration)."""
        if not self.distorted:
            return np.array(pixels, dtype=np.float64)
        focal, principal = np.array([self.fx, self.fy]), np.array([self.cx, self.cy])
        distorted = (pixels - principal) / focal
        ideal = distorted
        for _ in range(30):
            ideal = ideal + distorted - np.stack(self._distort(ideal[:, 0], ideal[:, 1]), axis=1)
        pixels_ideal: FloatArray = ideal * focal + principal
        return pixels_ideal

    def _distort(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        """Brown-Conrady distortion of normalised coordinates, as OpenCV and COLMAP define it."""
        k1, k2, k3 = self._get("k1", self._get("k")), self._get("k2"), self._get("k3")
        p1, p2 = self._get("p1"), self._get("p2")
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        radial = radial / (1 + r2 * (self._get("k4") + r2 * (self._get("k5") + r2 * self._get("k6"))))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )
