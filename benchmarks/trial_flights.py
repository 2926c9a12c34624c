"""Flights over blocks of a trial, rendered as a drone with RTK leaves them, beside the truth about every plot."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from fieldkit.geometry import Intrinsics, Pose
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import SceneDescription, build
from fieldkit.scenes.plot_description import TrialDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, simulate_capture
from fieldkit_sim.trial.files import PLOTS_FILE, new_trial, write_trial

CAMERA = Intrinsics.pinhole(4000, 3000, 2950.0)
"""Of the flights: 12 megapixels behind a lens of 27 mm on 35 mm film."""
PHOTOS, POSES_FILE = "photos", "true-poses.json"
_KG = 0.915
"""Of the vehicle whose wash moves leaves."""
_POSITION_M, _ANGLE_DEG = 0.02, 1.0
"""By which a flight leaves its commanded poses, and by which positions and angles are reported wrong, per axis."""
_MARGIN_M = 1.0
"""Width about the block over which lines are flown, metres."""


@dataclass(frozen=True)
class Passes:
    """Parallel lines whose photographs look one way."""

    height_m: float
    pitch_deg: float
    yaw_deg: float
    front: float
    side: float
    """Share of a picture straight down that the next one shows, too: along a line, and on the next line."""

    def poses(self, size_m: tuple[float, float]) -> list[Pose]:
        """Over a block of that size (x, y) about the origin; lines run along y."""
        look = np.array([np.sin(np.radians(self.yaw_deg)), np.cos(np.radians(self.yaw_deg))])
        back = 0.0 if self.pitch_deg <= -89.0 else self.height_m / np.tan(np.radians(-self.pitch_deg))
        reach = 0.5 * np.array(size_m) + _MARGIN_M
        pixel_m = self.height_m / CAMERA.fx
        x = _even(reach[0], (1.0 - self.side) * CAMERA.width * pixel_m)
        y = _even(reach[1], (1.0 - self.front) * CAMERA.height * pixel_m)
        places = [(a, b) for k, a in enumerate(x) for b in (y if k % 2 == 0 else y[::-1])]
        return [
            Pose.from_yaw_pitch((*(np.array(place) - back * look), self.height_m), self.yaw_deg, self.pitch_deg)
            for place in places
        ]


def _even(reach: float, step: float) -> np.ndarray:
    """Places from −reach to reach, about a step apart."""
    return np.linspace(-reach, reach, max(1, round(2.0 * reach / step)) + 1)


def _directions(height_m: float, pitch_deg: float, front: float, side: float) -> tuple[Passes, ...]:
    return tuple(Passes(height_m, pitch_deg, yaw, front, side) for yaw in (0.0, 90.0, 180.0, 270.0))


FLIGHTS: Mapping[str, tuple[Passes, ...]] = MappingProxyType(
    {
        "nadir-12": (Passes(12.0, -90.0, 0.0, 0.8, 0.8),),
        "nadir-8": (Passes(8.0, -90.0, 0.0, 0.8, 0.8),),
        "five-8": (Passes(8.0, -90.0, 0.0, 0.8, 0.7), *_directions(8.0, -60.0, 0.6, 0.6)),
        "oblique-5": _directions(5.0, -55.0, 0.7, 0.6),
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
        document = json.loads((self.folder / POSES_FILE).read_text())
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
    scene: SceneDescription = new_trial(trial)
    write_trial(folder, scene, overwrite=True, progress=progress)
    poses = [pose for each in passes for pose in each.poses(trial.size_m)]
    noise = CaptureNoise(_POSITION_M, _ANGLE_DEG, gnss_m, 1.5 * gnss_m, _ANGLE_DEG)
    site = scene.site.__class__(scene.site.origin, gnss_m < 0.1, (gnss_m, 1.5 * gnss_m))
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
    (folder / POSES_FILE).write_text(json.dumps(dict(zip(names, [p.center.tolist() for p in true], strict=True))))
    return flight
