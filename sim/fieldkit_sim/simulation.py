"""The simulate command as a function: a scene, stations, and what is not exact → a folder of photographs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fieldkit.captures.poses_csv import PoseRow, poses_table, read_poses_csv
from fieldkit.clouds import write_ply
from fieldkit.errors import MetadataError, UsageError
from fieldkit.files import write_atomic
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.regular_files import check_replaceable
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.description import SceneDescription, build, sample_reference
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import Outdoors, Sidecars, simulate_capture
from fieldkit_sim.surveys import Passes, four_directions

Stations = Callable[[Scene, Intrinsics], Sequence[Pose]]
_RING_PITCH_DEG = 35.0
"""Angle at which a ring looks down by default, degrees."""
_DENSE_PITCHES_DEG = (18.0, 38.0, 60.0)
"""Angles at which a dense capture's levels look down, degrees."""
_FILL = 1.05
"""The plants' sphere fills the smaller side of the image but for this."""

_OBLIQUE_DEG = -60.0
"""Pitch of a survey's oblique photographs, degrees."""
_OBLIQUE_LESS = 0.2
"""By how much less of a picture oblique photographs overlap: there are four directions of them."""


@dataclass(frozen=True)
class Simulation:
    """What `simulate` wrote."""

    photographs: int
    """How many."""
    truth: Path
    """The file with the true poses."""
    position_error_m: float
    """Root mean square of true minus commanded positions."""
    triangles: int
    """Of the scene."""


def simulate(
    description: SceneDescription,
    stations: Stations | Sequence[Pose],
    output: Path,
    *,
    outdoors: Outdoors | None = None,
    seed: int = 0,
    poses_csv: bool = True,
    gps: bool = True,
    truth_cloud: Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Simulation:
    """Photograph a described scene as a drone would.

    Args:
        description: the scene, with the camera, its effects and the noise of the photographs.
        stations: commanded poses in the plot frame, or what makes them from the scene and the camera (`ring_about`,
            `dense_about`, `survey_over`).
        output: the capture's folder: JPEGs, and poses.csv (commanded) and camera.toml with ``poses_csv``.
        outdoors: wind, wash and bursts; instead of the description's wind.
        seed: of all noise.
        poses_csv: whether commanded poses and intrinsics are written beside the photographs.
        gps: whether EXIF and XMP have positions and angles.
        truth_cloud: PLY for the plants' true surfaces, outside ``output``; not written where not given.
        overwrite: replace an existing capture, and its truth.

    The true poses go to ``output``.truth.csv.
    """
    progress = progress or Silent()
    outdoors = outdoors or Outdoors(description.wind_m)
    truth = output.parent / f"{output.name}.truth.csv"
    if truth_cloud is not None and truth_cloud.absolute().is_relative_to(output.absolute()):
        raise UsageError("the truth must not lie in the capture's folder", path=truth_cloud)
    if not output.exists():  # else it is the folder that is spoken of
        for file in (truth, truth_cloud):
            if file is not None:
                check_replaceable(file, overwrite=overwrite)
    with progress.stage("scene", len(description.plot.plants) or None) as advance:
        scene = build(description, advance)
        poses = list(stations(scene, description.camera) if callable(stations) else stations)
    with Renderer(scene) as renderer:
        true = simulate_capture(
            output,
            renderer,
            poses,
            description.camera,
            noise=description.noise,
            seed=seed,
            effects=description.camera_effects,
            outdoors=outdoors,
            site=description.site if gps else None,
            row_heading_deg=description.row_heading_deg,
            sidecars=Sidecars(poses=poses_csv, camera=poses_csv),
            overwrite=overwrite,
            progress=progress,
        )
    names = sorted(file.name for file in output.glob("*.jpg"))
    write_atomic(truth, poses_table([PoseRow.of(n, pose, roll=True) for n, pose in zip(names, true, strict=True)]))
    if truth_cloud is not None:
        with progress.stage("truth") as advance:
            write_ply(truth_cloud, sample_reference(description, scene))
            advance(1)
    commanded = np.repeat([pose.center for pose in poses], outdoors.burst, axis=0)
    errors = np.array([pose.center for pose in true]) - commanded
    return Simulation(len(true), truth, float(np.sqrt((errors**2).sum(axis=1).mean())), scene.triangles)


def ring_about(count: int, radius_m: float | None = None, height_m: float | None = None) -> Stations:
    """``count`` stations on a circle about the plants, looking at their middle.

    Where no radius or height is given, 35° above the horizon and so far away that the plants fill the image. The result
    can be pickled.
    """
    return partial(_ring, count=count, radius_m=radius_m, height_m=height_m)


def dense_about(count: int, nearer: float = 1.0) -> Stations:
    """``count`` stations on three circles about the plants, for a reference: 18°, 38° and 60° above the horizon.

    So far away that the plants fill the image, times ``nearer``. The result can be pickled.
    """
    return partial(_dense, count=count, nearer=nearer)


def survey_over(height_m: float, front: float, side: float, *, oblique: bool = False) -> Stations:
    """An app's grid over the plants, straight down, with these shares of overlap; the result can be pickled.

    ``oblique``: four directions more, which overlap less.
    """
    passes: tuple[Passes, ...] = (Passes(height_m, -90.0, (0.0,), front, side),)
    if oblique:
        overlap = (max(0.0, share - _OBLIQUE_LESS) for share in (front, side))
        passes += (four_directions(height_m, _OBLIQUE_DEG, *overlap),)
    return partial(_survey, passes=passes)


def _survey(scene: Scene, intrinsics: Intrinsics, *, passes: Sequence[Passes]) -> list[Pose]:
    (x0, y0, _), (x1, y1, _) = (corner.tolist() for corner in scene.bounds(plants_only=True))
    return [pose for some in passes for pose in some.poses((x0, y0), (x1, y1), intrinsics)]


def _ring(
    scene: Scene, intrinsics: Intrinsics, *, count: int, radius_m: float | None, height_m: float | None
) -> list[Pose]:
    target, distance = _view(scene, intrinsics)
    pitch = np.radians(_RING_PITCH_DEG)
    radius = distance * float(np.cos(pitch)) if radius_m is None else radius_m
    height = float(target[2]) + distance * float(np.sin(pitch)) if height_m is None else height_m
    return ring(count, radius, height, target)


def _dense(scene: Scene, intrinsics: Intrinsics, *, count: int, nearer: float) -> list[Pose]:
    target, distance = _view(scene, intrinsics)
    distance *= nearer
    heights = tuple(float(target[2] + distance * np.sin(np.radians(pitch))) for pitch in _DENSE_PITCHES_DEG)
    radius = distance * float(np.cos(np.radians(_DENSE_PITCHES_DEG[1])))
    return dense_rig(count, target, radius_m=radius, heights_m=heights)


def poses_from_csv(path: Path) -> list[Pose]:
    """Commanded poses of a poses.csv in the plot frame; it needs yaw and pitch."""
    rows, _ = read_poses_csv(path)
    poses = []
    for row in rows:
        if row.yaw_deg is None or row.pitch_deg is None:
            raise MetadataError(
                f"{row.image} has no yaw or pitch", path=path, remedy="Add the columns yaw_deg and pitch_deg."
            )
        poses.append(Pose.from_yaw_pitch(row.position, row.yaw_deg, row.pitch_deg, row.roll_deg or 0.0))
    return poses


def _view(scene: Scene, intrinsics: Intrinsics) -> tuple[np.ndarray, float]:
    """The middle of the plants (3,), and the distance from which the sphere about them fills the image."""
    lower, upper = scene.bounds(plants_only=True)
    radius = 0.5 * float(np.linalg.norm(upper - lower))
    half_angle = min(intrinsics.width / intrinsics.fx, intrinsics.height / intrinsics.fy) / 2.0
    return 0.5 * (lower + upper), _FILL * radius / half_angle


def ring(
    count: int, radius_m: float, height_m: float, target: ArrayLike = (0.0, 0.0, 0.25), *, start_deg: float = 0.0
) -> list[Pose]:
    """``count`` cameras evenly on a horizontal circle about the target, all looking at it.

    Args:
        radius_m: horizontal distance from the target.
        height_m: z of the cameras, plot frame.
        start_deg: azimuth of the first camera, clockwise from north.
    """
    x, y, z = np.asarray(target, dtype=np.float64)
    azimuth = np.radians(start_deg + 360.0 * np.arange(count) / count)
    return [Pose.look_at((x + radius_m * np.sin(a), y + radius_m * np.cos(a), height_m), (x, y, z)) for a in azimuth]


def dense_rig(
    count: int = 45,
    target: ArrayLike = (0.0, 0.0, 0.25),
    *,
    radius_m: float = 1.7,
    heights_m: tuple[float, ...] = (0.7, 1.25, 1.9),
) -> list[Pose]:
    """``count`` cameras on rings at several heights, each ring turned by a share of its step, lowest first.

    Higher rings are narrower, so that all cameras are about equally far from the target.
    """
    z = float(np.asarray(target, dtype=np.float64)[2])
    distance = float(np.hypot(radius_m, heights_m[len(heights_m) // 2] - z))
    poses: list[Pose] = []
    for i, height in enumerate(heights_m):
        n = count // len(heights_m) + (i < count % len(heights_m))
        if n == 0:
            continue
        radius = float(np.sqrt(max(distance**2 - (height - z) ** 2, 0.01)))
        poses += ring(n, radius, height, target, start_deg=360.0 / n * i / len(heights_m))
    return poses
