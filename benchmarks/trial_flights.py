"""Flights over blocks of a trial, rendered as a drone with RTK leaves them, beside the truth about every plot."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fieldkit.geometry import Intrinsics
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import build
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, simulate_capture
from fieldkit_sim.surveys import Passes, four_directions
from fieldkit_sim.trial.files import PLOTS_FILE, new_trial, write_trial

CAMERA = Intrinsics.pinhole(4000, 3000, 2950.0)
"""Of the flights: 12 megapixels behind a lens of 27 mm on 35 mm film."""
PHOTOS, POSES_FILE = "photos", "true-poses.json"
_KG = 0.915
"""Of the vehicle whose wash moves leaves."""
_POSITION_M, _ANGLE_DEG = 0.02, 1.0
"""By which a flight leaves its commanded poses, and by which positions and angles are reported wrong, per axis."""


FLIGHTS: Mapping[str, tuple[Passes, ...]] = MappingProxyType(
    {
        "nadir-12": (Passes(12.0, -90.0, 0.0, 0.8, 0.8),),
        "nadir-8": (Passes(8.0, -90.0, 0.0, 0.8, 0.8),),
        "five-8": (Passes(8.0, -90.0, 0.0, 0.8, 0.7), *four_directions(8.0, -60.0, 0.6, 0.6)),
        "oblique-5": four_directions(5.0, -55.0, 0.7, 0.6),
    }
)
"""As people fly them: an app's nadir grids, nadir and four oblique directions, oblique passes."""


@dataclass(frozen=True)
class Flight:
    """A rendered flight."""

    folder: Path
    """With the photographs in `PHOTOS`, the trial's scene, plots and truth, and `POSES_FILE`."""

    @property
    def photographs(self) -> Path:
        return self.folder / PHOTOS

    @property
    def plots(self) -> Path:
        return self.folder / PLOTS_FILE

    def centers(self) -> dict[str, np.ndarray]:
        """True camera centres by photograph: metres east, north and up of the scene's origin."""
        document = json.loads((self.folder / POSES_FILE).read_text("utf-8"))
        return {name: np.array(center) for name, center in document.items()}


def fly(
    folder: Path,
    trial: TrialDescription,
    passes: Sequence[Passes],
    *,
    wind_m: float,
    gnss_m: float = _POSITION_M,
    progress: Progress,
) -> Flight:
    """Render a flight over a block; one that is in ``folder`` already is taken as it is.

    Args:
        wind_m: sway of the leaves; none has no wash either.
        gnss_m: standard deviation of the positions on record; above 0.1 they are no fixed RTK solutions.
    """
    flight = Flight(folder)
    if (folder / POSES_FILE).is_file():
        return flight
    scene = new_trial(trial)
    write_trial(folder, scene, overwrite=True, progress=progress)
    reach_m = (0.5 * trial.size_m[0], 0.5 * trial.size_m[1])
    poses = [pose for some in passes for pose in some.poses((-reach_m[0], -reach_m[1]), reach_m, CAMERA)]
    noise = CaptureNoise(_POSITION_M, _ANGLE_DEG, gnss_m, 1.5 * gnss_m, _ANGLE_DEG)
    site = replace(scene.site, rtk=gnss_m < 0.1, accuracy_m=(gnss_m, 1.5 * gnss_m))
    with Renderer(build(scene)) as renderer:
        true = simulate_capture(
            flight.photographs,
            renderer,
            poses,
            CAMERA,
            noise=noise,
            seed=trial.seed,
            effects=scene.camera_effects,
            outdoors=Outdoors(wind_m, _KG if wind_m else 0.0),
            site=site,
            row_heading_deg=scene.row_heading_deg,
            sidecars=Sidecars(camera=True),
            economy=True,
            overwrite=True,
            progress=progress,
        )
    names = sorted(path.name for path in flight.photographs.glob("*.jpg"))
    centers = dict(zip(names, [pose.center.tolist() for pose in true], strict=True))
    (folder / POSES_FILE).write_text(json.dumps(centers), "utf-8")
    return flight
