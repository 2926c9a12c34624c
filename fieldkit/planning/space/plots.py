"""Plots as planning knows them without photographs: the plants' surfaces, and obstacles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.errors import SceneError
from fieldkit.planning.space.cameras import Cameras
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.recorded import recorded_plants
from fieldkit.scenes.sampling import neighbour_points, sample_visible
from fieldkit.scenes.simulated_field import build_plants
from fieldkit.sites.fitted import Stretch

_POINTS = 40_000
"""Number of visible points of a scene's plants."""
_PIXELS = 800
"""Side of the depth maps that show them, pixels."""
LOWEST_M = 0.03
"""Height above the ground below which plants do not count, metres."""
_MARGIN_M = 0.03
"""Width of the box about the plants beyond them, metres."""
_MEASURED_M = 0.05
"""Step in which people state plants' heights, metres."""


@dataclass(frozen=True, eq=False)
class Plot:
    """A plot without photographs."""

    reference: Cloud
    """PC_env, visible points of the plants' surfaces, with normals if known, plot frame."""
    obstacles: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    """(m, 3) further points that hide others and that cameras keep clear of, such as other rows; plot frame."""
    matches: FloatArray | None = None
    """(m, m) counted between each pair of recorded views; None if unknown."""
    stretch: Stretch | None = None
    """How a plan's cameras are moved to fit this plot; None if they are not."""

    @classmethod
    def of(cls, description: SceneDescription) -> tuple[Plot, Volume]:
        """A scene's plants and its volume of interest, without soil, light and textures: about 0.2 CPU s."""
        check_plants(description)
        if description.recorded is not None:
            reference, volume = of_interest(description, recorded_plants(description.recorded))
            return cls(reference), volume
        plants = build_plants(description.plot)
        (visible,) = sample_visible(plants, (_POINTS,), description.reference.seed, pixels=_PIXELS)
        reference, volume = of_interest(description, visible)
        return cls(reference, neighbour_points(plants)), volume

    @property
    def height_m(self) -> float:
        """Of the highest plant above the ground."""
        return float(self.reference.points[:, 2].max())

    @property
    def measured_height_m(self) -> float:
        """The same as a person measures it before a flight, to 5 cm."""
        return _MEASURED_M * round(self.height_m / _MEASURED_M)

    def fitted(self, cameras: Cameras) -> Cameras:
        """A plan's cameras as they are flown over this plot."""
        return cameras if self.stretch is None else cameras.stretched(self.stretch)

    @property
    def points(self) -> FloatArray:
        """(m, 3) all points that cameras keep clear of."""
        both: FloatArray = np.concatenate([self.reference.points, self.obstacles.reshape(-1, 3)])
        return both


def check_plants(description: SceneDescription) -> None:
    """Raise SceneError if a scene has no plants to plan for."""
    if description.recorded is None and not description.plot.plants:
        raise SceneError("the scene has no plants to plan for", remedy="Add plants; a trial is no single plot.")


def of_interest(description: SceneDescription, visible: Cloud) -> tuple[Cloud, Volume]:
    """The plants' visible points that count, and the volume of interest about them.

    Points below 3 cm are left out, since the soil is bumpy. A scene made from a reference keeps the reference's volume,
    down to its lowest plant point.
    """
    if description.recorded is None:
        return above_soil(visible)
    bounds = description.bounds.volume
    reference = visible.select(bounds.contains(visible.points))
    if not len(reference):
        raise SceneError("no plant lies in the scene's bounds", remedy="Make the scene again from its reference.")
    lowest = max(bounds.lower[2], float(reference.points[:, 2].min()))
    return reference, Volume((bounds.lower[0], bounds.lower[1], lowest), bounds.upper)


def above_soil(visible: Cloud) -> tuple[Cloud, Volume]:
    """The points above `LOWEST_M`, and the box about them with 3 cm around. Raises SceneError if there are none."""
    reference = visible.select(visible.points[:, 2] > LOWEST_M)
    if not len(reference):
        raise SceneError(
            f"no part of the plants is visible above {1000 * LOWEST_M:.0f} mm",
            remedy="Let the plants stand on the ground and be higher than that.",
        )
    around = Volume.around(reference.points, margin_m=_MARGIN_M)
    return reference, Volume((around.lower[0], around.lower[1], LOWEST_M), around.upper)
