"""The report's interactive 3D view: a fragment of HTML per view, one script and one style for all.

The page has `viewer_style` in one ``<style>`` and `viewer_script` in one ``<script>``, which starts each view when it
comes near. Nothing is fetched, so the page works from disk, and a Content Security Policy needs to allow only these two
elements.

Colours come from custom properties (``--fk-view-ground`` …; web/viewer.css), which take the page's ``--ink``,
``--faint``, ``--line``, ``--ground`` and ``--accent`` where it has them, and follow ``prefers-color-scheme``, or
``data-theme="light"`` or ``"dark"`` on the root element.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape
from numpy.typing import ArrayLike, NDArray

from fieldkit.arrays import ByteArray, FloatArray
from fieldkit.clouds.neighbors import z_order
from fieldkit.errors import InputError
from fieldkit.figures.content import FrustumLayer, ViewerScene
from fieldkit.figures.style import DISTANCE_RAMP, format_nominal, unbroken, visible
from fieldkit.runtime.shipped import shipped_page

BUNDLE, LICENSE = "viewer.min.js", "LICENSE.three.txt"
_PLAIN = ("#6f9a80", "#c58a4a", "#7c8fc4", "#b0739b")  # of clouds without colours and values, in turn
_SIZE_STEP = 0.25  # of the point size, CSS pixels


def viewer_script() -> str:
    """The content of the page's one ``<script>``: the view with three.js and its licence."""
    bundle = _folder() / "vendor" / BUNDLE
    try:
        text = bundle.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(
            "the 3D view's script is missing from this installation",
            path=str(bundle),
            remedy="In a checkout run `make setup`, or `scripts/build_viewer.sh` alone; both need npm "
            f"({shipped_page('docs/install.md')}). Wheels contain it: install fieldkit's again.",
        ) from None
    return re.sub(r"<(?=/script|!--)", r"\\x3c", text, flags=re.IGNORECASE)  # only in strings, where both mean the same


def viewer_style() -> str:
    """The content of the page's one ``<style>`` for all views."""
    style = (_folder() / "web" / "viewer.css").read_text(encoding="utf-8")
    ramp = f"linear-gradient(90deg, {', '.join(DISTANCE_RAMP)})"
    return f"{style}.fk-view-bar, .fk-view-mark-scale {{ background: {ramp}; }}\n"


def viewer_html(scene: ViewerScene, *, identifier: str) -> str:
    """A view as a fragment: its data, and the markup of its switches, scale, point size and buttons.

    The scene's text is escaped; ``identifier`` is the element's id, unique in the page.
    """
    packed = [pack_points(layer.points, layer.colors, layer.values, layer.limit) for layer in scene.points]
    data = {
        "points": [
            {name: value for name, value in vars(block).items() if name != "text"} | {"color": color}
            for block, color in zip(packed, cycle(_PLAIN), strict=False)
        ],
        "frusta": [_frustum_data(layer) for layer in scene.frusta],
        "lines": [
            {"lines": [plain_floats(np.reshape(line, (-1, 3))) for line in layer.lines], "color": layer.color}
            for layer in scene.lines
        ],
        "places": [{"text": visible(place.text), "at": plain_floats(np.array(place.at))} for place in scene.places],
        "metric": scene.metric,
        "north": None if scene.north is None else plain_floats(np.array(scene.north), 6),
        "palette": list(DISTANCE_RAMP),
        "focus": _focus(scene),
    }
    limits: dict[float, list[str]] = {}
    for layer in scene.points:
        if layer.values is not None:
            limits.setdefault(float(layer.limit), []).append(layer.name)
    largest = max((len(layer.points) for layer in scene.points), default=0)
    size = np.clip(np.round(600.0 / max(largest, 1) ** 0.5 / _SIZE_STEP) * _SIZE_STEP, 1.25, 4.0)
    return (
        environment()
        .get_template("view.html.jinja")
        .render(
            name=identifier,
            scene=scene,
            packed=list(zip(scene.points, packed, strict=True)),
            palette=_PLAIN,
            scales=limits,
            point_size=f"{size:g}",
            both=any(layer.values is not None and layer.colors is not None for layer in scene.points),
            data=Markup(_json(data)),
        )
    )


def _folder() -> Traversable:
    return files("fieldkit.report.html")


def _json(data: dict[str, Any]) -> str:
    # An escaped < can neither end the element nor open a comment.
    text = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _frustum_data(layer: FrustumLayer) -> dict[str, Any]:
    return {
        "centers": [plain_floats(pose.center) for pose in layer.poses],
        "rotations": [plain_floats(pose.rotation, 6) for pose in layer.poses],
        "labels": [visible(label) for label in layer.labels],
        "numbers": [visible(number) for number in layer.numbers],
        "width": float(layer.half_width),
        "height": float(layer.half_height),
        "color": layer.color,
    }


def _focus(scene: ViewerScene) -> dict[str, Any]:
    """The extent of the first view: the box of the middle 98 % of the points, and the box that also holds the cameras.

    Without points it holds the cameras and the ground below.
    """
    inner = _box([_robust_box(layer.points) for layer in scene.points])
    cameras = _box([np.reshape([pose.center for pose in layer.poses], (-1, 3)) for layer in scene.frusta])
    outer = _box([inner, cameras])
    if not len(outer):
        outer = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    if not len(inner):
        outer[0, 2], outer[1, 2] = min(outer[0, 2], 0.0), max(outer[1, 2], 0.0)
        inner = outer
    return {"inner": plain_floats(inner), "outer": plain_floats(outer)}


def _robust_box(points: Any) -> Any:
    p = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    p = p[np.isfinite(p).all(axis=1)]
    return np.percentile(p, (1.0, 99.0), axis=0) if len(p) else p


def _box(arrays: Sequence[Any]) -> Any:
    """(2, 3) lower and upper corner of all points of (n, 3) arrays; (0, 3) where there are none."""
    stacked = np.concatenate([np.zeros((0, 3)), *arrays])
    return np.stack([stacked.min(axis=0), stacked.max(axis=0)]) if len(stacked) else stacked


NO_VALUE = 255
"""Level of points without a distance."""
_STEP_M = 1e-4  # finer than the accuracy of any cloud here
_LEAST_STEPS = 4095
"""Least number of steps along a cloud's longest side."""
_STEPS = 65535
"""Most steps along a cloud's longest side: 16 bits."""


@dataclass(frozen=True)
class PackedPoints:
    """A layer's block."""

    count: int
    """Points with a coordinate that is not finite are left out."""
    origin: tuple[float, float, float]
    """Metres; coordinate = origin + step × integer."""
    step: float
    colored: bool
    """Whether colours follow the coordinates; so ``valued`` for values."""
    valued: bool
    text: Markup
    """Base64."""


def pack_points(
    points: ArrayLike, colors: ArrayLike | None = None, values: ArrayLike | None = None, limit: float = 1.0
) -> PackedPoints:
    """A cloud as a block: points (n, 3) metres, colours (n, 3) of 0 to 255, values (n,).

    Values below 0 count as 0, those beyond ``limit``, the scale's end, as ``limit``, and NaN as none.
    """
    p = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    tones = None if colors is None else np.asarray(colors, dtype=np.uint8).reshape(-1, 3)
    levels = None if values is None else _levels(np.asarray(values, dtype=np.float64).reshape(-1), limit)
    kept = np.flatnonzero(np.isfinite(p).all(axis=1))
    p = p[kept]
    order = z_order(p)
    origin, step = _frame(p)
    grid = np.rint((p[order] - origin) / step).astype(np.uint16)
    parts = [_planes(grid)]
    if tones is not None:
        parts.append(_tones(tones[kept][order]))
    if levels is not None:
        parts.append(levels[kept][order].tobytes())
    block = gzip.compress(b"".join(parts), compresslevel=6, mtime=0)
    x, y, z = (float(value) for value in origin)
    return PackedPoints(
        len(p), (x, y, z), step, tones is not None, levels is not None, Markup(base64.b64encode(block).decode("ascii"))
    )


def _levels(values: FloatArray, limit: float) -> ByteArray:
    known = ~np.isnan(values)
    levels = np.full(len(values), NO_VALUE, dtype=np.uint8)
    levels[known] = np.rint(np.clip(values[known] / limit, 0.0, 1.0) * (NO_VALUE - 1)).astype(np.uint8)
    return levels


def _frame(points: FloatArray) -> tuple[FloatArray, float]:
    if not len(points):
        return np.zeros(3), _STEP_M
    lower = points.min(axis=0)
    extent = float((points.max(axis=0) - lower).max())
    step = max(extent / _STEPS, min(_STEP_M, extent / _LEAST_STEPS))
    return lower, step if step > 0 else _STEP_M


def _planes(grid: NDArray[np.uint16]) -> bytes:
    steps = np.diff(grid, axis=0, prepend=np.zeros((1, 3), dtype=np.uint16)).astype(np.int16)
    zigzag = ((steps << 1) ^ (steps >> 15)).astype(np.uint16)
    high, low = (zigzag >> 8).astype(np.uint8), (zigzag & 0xFF).astype(np.uint8)
    return high.T.tobytes() + low.T.tobytes()


def _tones(colors: ByteArray) -> bytes:
    red, green, blue = colors.T
    planes = np.stack([green, red - green, blue - green])
    return np.diff(planes, axis=1, prepend=np.zeros((3, 1), dtype=np.uint8)).tobytes()


def plain_floats(values: ArrayLike, digits: int = 4) -> list[Any]:
    """Coordinates as plain floats for JSON, rounded to ``digits`` decimals; ValueError for one that is not finite."""
    numbers = np.asarray(values, dtype=np.float64)
    if not np.isfinite(numbers).all():
        raise ValueError("a coordinate is no finite number")
    plain: list[Any] = np.round(numbers, digits).tolist()
    return plain


TEMPLATES = Path(__file__).parent / "templates"
_CODE = re.compile("`([^`]+)`")


@cache
def environment() -> Environment:
    """The engine with this page's templates and filters."""
    engine = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_shown,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    engine.filters.update(unbroken=unbroken, nominal=format_nominal, coded=_coded)
    return engine


def _coded(text: str) -> Markup:
    """Text in which what stands between backticks is code: commands to copy."""
    shown = escape(visible(unbroken(text)))
    return Markup(_CODE.sub(r"<code>\1</code>", str(shown))) if "`" in text else shown


def _shown(value: Any) -> Any:
    """The engine's output for an expression: foreign text without hidden characters."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value
