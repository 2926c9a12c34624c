"""The two ways to compute depth maps and fuse them, behind one interface."""

from __future__ import annotations

from fieldkit.errors import UsageError
from fieldkit.reconstruction.dense.cuda import Cuda, cuda_devices
from fieldkit.reconstruction.dense.depth_maps import compute_depth_maps
from fieldkit.reconstruction.dense.fusion import fuse
from fieldkit.runtime.shipped import shipped_page


class Cpu:
    """PatchMatch compiled by Numba and fieldkit's own fusion, on one thread."""

    name = "cpu"
    compute_depth_maps = staticmethod(compute_depth_maps)
    fuse = staticmethod(fuse)


Backend = Cpu | Cuda
"""A way to do dense stereo; its ``name`` is recorded with every result."""


def select_backend(choice: str = "auto") -> Backend:
    """The backend to use.

    Args:
        choice: `auto` is `cuda` where pycolmap was built with CUDA and there is a device, else `cpu`.

    Raises:
        UsageError: an unknown choice, or `cuda` without a device (or without a pycolmap that could use it).
    """
    if choice == "cpu":
        return Cpu()
    if choice == "auto":
        return Cuda() if cuda_devices() > 0 else Cpu()
    if choice != "cuda":
        raise UsageError(f"there is no dense stereo backend {choice!r}", remedy="Choose auto, cpu or cuda.")
    if cuda_devices() == 0:
        raise UsageError(
            "the backend cuda needs an NVIDIA GPU and pycolmap built with CUDA, and one of them is missing",
            remedy="Choose --backend cpu, or install pycolmap-cuda12 in pycolmap's place: "
            f"{shipped_page('docs/install.md')} says how.",
        )
    return Cuda()
