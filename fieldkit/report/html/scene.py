"""The content of a report's 3D view, as values: layers in one frame, metres, z up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fieldkit.geometry import Pose


@dataclass(frozen=True, eq=False)
class PointLayer:
    """A cloud.

    Attributes:
        name: on the layer's switch.
        points: (n, 3) metres.
        colors: (n, 3) of 0 to 255, uint8; None draws all points in one colour.
        values: (n,) metres to colour the points by, with a scale beside the view; None takes ``colors``.
        limit: end of the scale; ``values`` beyond it have its last colour.
        shown: whether it is switched on at first.
    """

    name: str
    points: NDArray[np.float32]
    colors: NDArray[np.uint8] | None = None
    values: NDArray[np.float32] | None = None
    limit: float = 0.02
    shown: bool = True


@dataclass(frozen=True, eq=False)
class FrustumLayer:
    """Cameras as pyramids.

    Attributes:
        name: on the layer's switch.
        poses: extrinsics, world to camera.
        labels: one per pose, shown when the pointer is over it.
        numbers: one per pose, shown beside it: of stations, as people count them; none for cameras without numbers.
        half_width, half_height: tangents of half the field of view.
        color: CSS hexadecimal, "#rrggbb".
        shown: whether it is switched on at first.
    """

    name: str
    poses: Sequence[Pose]
    labels: Sequence[str]
    half_width: float
    half_height: float
    color: str
    shown: bool = True
    numbers: Sequence[str] = ()


@dataclass(frozen=True)
class PlaceName:
    """A name shown at its place: of a plot, of home.

    Attributes:
        text: shown.
        at: (3,) metres.
    """

    text: str
    at: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class LineLayer:
    """Polylines: legs of a mission, a fence.

    Attributes:
        name: on the layer's switch.
        lines: each (k, 3) metres.
        color: CSS hexadecimal.
        shown: whether it is switched on at first.
    """

    name: str
    lines: Sequence[NDArray[np.float32]]
    color: str
    shown: bool = True


@dataclass(frozen=True, eq=False)
class ViewerScene:
    """One 3D view.

    Attributes:
        title: above the view, and its accessible name.
        points, frusta, lines: its layers, in the order of their switches.
        places: names of places; where two would cover each other, the first is shown.
        north: (x, y) of true north in the frame, of length 1; None where it is not known.
        metric: whether lengths are metres; else they are units of the reconstruction's own.
        subject: what a still picture must hold: the clouds, or the cameras too.
    """

    title: str
    points: Sequence[PointLayer] = field(default=())
    frusta: Sequence[FrustumLayer] = field(default=())
    lines: Sequence[LineLayer] = field(default=())
    places: Sequence[PlaceName] = field(default=())
    north: tuple[float, float] | None = None
    metric: bool = True
    subject: Literal["clouds", "cameras"] = "clouds"
