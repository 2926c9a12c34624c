"""Flights over blocks of a trial, rendered as a drone with RTK leaves them, beside the truth about every plot."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import build
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, simulate_capture
from fieldkit.vocabulary import Stage
from fieldkit_sim.surveys import Passes, four_directions
from fieldkit_sim.trial.files import PLOTS_FILE, new_trial, write_trial

CAMERA = Intrinsics.pinhole(4000, 3000, 2950.0)
"""Of the flights: 12 megapixels behind a lens of 27 mm on 35 mm film."""
PHOTOS, POSES_FILE = "photos", "true-poses.json"
_KG = 0.915
"""Of the vehicle whose wash moves leaves."""
_POSITION_M, _ANGLE_DEG = 0.02, 1.0
"""By which a flight leaves its commanded poses, and by which positions and angles are reported wrong, per axis."""


@dataclass(frozen=True)
class Survey:
    """A way of flying over a block."""

    passes: tuple[Passes, ...]
    ranges: int = 2
    columns: int = 4
    camera: Intrinsics = CAMERA
    gnss_m: float = _POSITION_M
    """Standard deviation of the positions on record; above 0.1 they are no fixed RTK solutions."""
    wind_m: float = 0.010
    """Sway of the leaves, metres; none has no wash either."""

    @property
    def accuracy_m(self) -> tuple[float, float]:
        """Standard deviations of the positions on record, horizontal and vertical."""
        return self.gnss_m, 1.5 * self.gnss_m

    @property
    def noise(self) -> CaptureNoise:
        """Of its photographs."""
        return CaptureNoise(_POSITION_M, _ANGLE_DEG, *self.accuracy_m, _ANGLE_DEG)

    def poses(self, trial: TrialDescription) -> list[Pose]:
        """As commanded over a block."""
        x, y = (0.5 * side for side in trial.size_m)
        return [pose for some in self.passes for pose in some.poses((-x, -y), (x, y), self.camera)]


_FIVE_8 = (Passes(8.0, -90.0, (0.0,), 0.8, 0.7), four_directions(8.0, -60.0, 0.6, 0.6))
FLIGHTS: Mapping[str, Survey] = MappingProxyType(
    {
        "nadir-12": Survey((Passes(12.0, -90.0, (0.0,), 0.8, 0.8),)),
        "nadir-8": Survey((Passes(8.0, -90.0, (0.0,), 0.8, 0.8),)),
        "five-8": Survey(_FIVE_8),
        "five-8-still": Survey(_FIVE_8, wind_m=0.0),
        "five-8-gps": Survey(_FIVE_8, gnss_m=3.0),
        "oblique-5": Survey((four_directions(5.0, -55.0, 0.7, 0.6),)),
        "oblique-2.5": Survey((Passes(2.5, -50.0, (0.0, 180.0), 0.75, 0.5),), ranges=1, columns=2),
        "40-plots": Survey(
            (Passes(8.0, -90.0, (0.0,), 0.85, 0.8), four_directions(8.0, -60.0, 0.77, 0.75)),
            ranges=4,
            columns=10,
            camera=Intrinsics.pinhole(5472, 3648, 3650.0),
        ),
    }
)
"""As people fly them: an app's nadir grids, nadir and four oblique directions, oblique passes; the last one with the
20 megapixels of a one-inch sensor."""


@dataclass(frozen=True)
class Flight:
    """A rendered flight."""

    survey: Survey
    folder: Path
    """With the photographs in `PHOTOS`, the trial's scene, plots and truth, and `POSES_FILE`."""

    @property
    def photographs(self) -> Path:
        return self.folder / PHOTOS

    @property
    def plots(self) -> Path:
        return self.folder / PLOTS_FILE

    def true_poses(self) -> dict[str, Pose]:
        """By photograph, in the scene's frame."""
        document = json.loads((self.folder / POSES_FILE).read_text("utf-8"))
        return {name: Pose(np.array(rotation), np.array(center)) for name, (rotation, center) in document.items()}


def fly(folder: Path, seed: int, stage: Stage, survey: Survey, progress: Progress) -> Flight:
    """Render a flight over a block; one that is in ``folder`` already is taken as it is."""
    flight = Flight(survey, folder)
    if (folder / POSES_FILE).is_file():
        return flight
    trial = TrialDescription(seed=seed, ranges=survey.ranges, columns=survey.columns, stage=stage)
    scene = new_trial(trial)
    write_trial(folder, scene, overwrite=True, progress=progress)
    with Renderer(build(scene)) as renderer:
        true = simulate_capture(
            flight.photographs,
            renderer,
            survey.poses(trial),
            survey.camera,
            noise=survey.noise,
            seed=seed,
            effects=scene.camera_effects,
            outdoors=Outdoors(survey.wind_m, _KG if survey.wind_m else 0.0),
            site=replace(scene.site, rtk=survey.gnss_m < 0.1, accuracy_m=survey.accuracy_m),
            row_heading_deg=scene.row_heading_deg,
            sidecars=Sidecars(camera=True),
            economy=True,
            overwrite=True,
            progress=progress,
        )
    names = sorted(path.name for path in flight.photographs.glob("*.jpg"))
    document = {name: (p.rotation.tolist(), p.center.tolist()) for name, p in zip(names, true, strict=True)}
    (folder / POSES_FILE).write_text(json.dumps(document), "utf-8")
    return flight
