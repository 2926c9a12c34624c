"""One reference view with its source views, as the kernels take them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fieldkit.reconstruction.dense.patchmatch import OFFSET_U, OFFSET_V, start, sweep
from fieldkit.reconstruction.dense.rays import Active
from fieldkit.reconstruction.dense.settings import Settings
from fieldkit.reconstruction.dense.support import gray, pack_source, relative_camera, support_weights
from fieldkit.reconstruction.dense.views import View

_NO_DEPTHS = np.zeros((1, 1, 1), dtype=np.float32)
_FIRST_RANGE_PX = 4.0
_SAME_PX = 0.05


@dataclass(frozen=True, eq=False)
class Planes:
    """Plane hypotheses of a view's active pixels, in the order of `active_pixels`.

    Attributes:
        planes: (n, 3) float32 inverse depth (1/m) and its change per pixel to the right and down.
        costs: (n,) float32.
    """

    planes: NDArray[np.float32]
    costs: NDArray[np.float32]


@dataclass(eq=False)
class Problem:
    """Arrays of one reference view; see `patchmatch.start` and `patchmatch.sweep` for what each holds."""

    active: Active
    settings: Settings
    packed: NDArray[np.uint32]
    sizes: NDArray[np.int64]
    cameras: NDArray[np.float32]
    back: NDArray[np.float32]
    support: NDArray[np.float32]
    lens: NDArray[np.float32]
    pixel_w: float
    """Change of inverse depth that moves the typical source pixel by one, 1/m."""
    depths: NDArray[np.float32] = field(default_factory=lambda: _NO_DEPTHS)

    @classmethod
    def build(cls, view: View, active: Active, sources: list[View], settings: Settings) -> Problem:
        images = [pack_source(gray(source.image)) for source in sources]
        bases = np.concatenate([[0], np.cumsum([image.size for image in images])])[:-1]
        sizes = [(int(b), image.shape[1], image.shape[0]) for b, image in zip(bases, images, strict=False)]
        cameras = [relative_camera(view.intrinsics, view.pose, s.intrinsics, s.pose) for s in sources]
        back = [relative_camera(s.intrinsics, s.pose, view.intrinsics, view.pose) for s in sources]
        mask = view.mask if view.mask is not None else np.ones(view.image.shape[:2], dtype=np.bool_)
        support = support_weights(
            view.image,
            gray(view.image),
            mask,
            active.pixels,
            OFFSET_U,
            OFFSET_V,
            np.float32(settings.color_sigma),
            np.float32(settings.off_mask_weight),
            np.float32(settings.noise**2),
        )
        camera = view.intrinsics
        lens = np.array([camera.fx, camera.fy, camera.cx - 0.5, camera.cy - 0.5], dtype=np.float32)
        return cls(
            active,
            settings,
            np.concatenate([image.ravel() for image in images]) if images else np.zeros(1, dtype=np.uint32),
            np.array(sizes, dtype=np.int64).reshape(-1, 3),
            np.array(cameras, dtype=np.float32).reshape(-1, 12),
            np.array(back, dtype=np.float32).reshape(-1, 12),
            support,
            lens,
            _pixel_inverse_depth(view, sources),
        )

    def empty(self) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Planes (n, 3) without content and the mask (n,) that says so."""
        count = len(self.active.pixels)
        planes = np.zeros((count, 3), dtype=np.float32)
        planes[:, 0] = self.active.ranges.mean(axis=1)
        return planes, np.ones(count, dtype=np.bool_)

    def set_depths(self, sources: list[tuple[View, Active, Planes]]) -> None:
        """Give the source views' inverse depths for the round trips of `refine`."""
        shape = np.array([active.index.shape for _, active, _ in sources]).reshape(-1, 2).max(axis=0, initial=1)
        self.depths = np.zeros((max(1, len(sources)), *shape), dtype=np.float32)
        for k, (_, active, result) in enumerate(sources):
            self.depths[k][active.pixels[:, 0], active.pixels[:, 1]] = result.planes[:, 0]

    def solve(
        self,
        planes: NDArray[np.float32],
        fresh: NDArray[np.bool_],
        key: np.uint64,
        starts: int,
        fresh_starts: int,
        sweeps: int,
    ) -> Planes:
        """Random starts and sweeps by the photographs alone; ``planes`` is written to."""
        count = len(planes)
        costs = np.full(count, 9.0, dtype=np.float32)
        if not count or not len(self.sizes):
            return Planes(planes, costs)
        best = min(self.settings.best_sources, len(self.sizes))
        noise = np.float32(self.settings.noise**2)
        start(
            planes, costs, fresh, self.active.pixels, self.active.ranges, self.packed, self.sizes, self.cameras,
            self.support, self.lens, _NO_DEPTHS, self.back, key, starts, noise, best,
        )  # fmt: skip
        self._sweep(planes, costs, key, sweeps, geometric=0.0)
        return Planes(planes, costs)

    def refine(self, first: Planes, key: np.uint64) -> Planes:
        """Sweeps that also ask for agreement with the source views' depths (`set_depths`)."""
        planes, costs = first.planes.copy(), first.costs.copy()
        if not len(planes) or not len(self.sizes):
            return Planes(planes, costs)
        self._sweep(planes, costs, key, self.settings.geometric_sweeps, geometric=self.settings.geometric_weight)
        return Planes(planes, costs)

    def _sweep(
        self, planes: NDArray[np.float32], costs: NDArray[np.float32], key: np.uint64, sweeps: int, geometric: float
    ) -> None:
        settings = self.settings
        best = min(settings.best_sources, len(self.sizes))
        reach = _FIRST_RANGE_PX * self.pixel_w
        for step in range(sweeps):
            for color in (0, 1):
                sweep(
                    planes, costs, self.active.pixels, self.active.index, self.active.ranges, self.packed, self.sizes,
                    self.cameras, self.support, self.lens, self.depths, self.back, key, color, step,
                    settings.perturbations, np.float32(reach), np.float32(_SAME_PX * self.pixel_w),
                    np.float32(settings.noise**2), best, np.float32(geometric),
                    np.float32(settings.geometric_cap_px), geometric > 0 and step == 0,
                )  # fmt: skip
            reach *= 0.5


def _pixel_inverse_depth(view: View, sources: list[View]) -> float:
    """Inverse depth that moves a source pixel by one: 1 / (f · baseline), the median over the sources."""
    if not sources:
        return 1.0
    moved = [s.intrinsics.fx * float(np.linalg.norm(s.pose.center - view.pose.center)) for s in sources]
    return 1.0 / max(float(np.median(moved)), 1e-9)
