"""A small reconstruction made by hand: cameras on a ring about a plant, a synthesised sparse model, a made-up cloud."""

from pathlib import Path

import numpy as np
import pycolmap

from fieldkit.captures.model import CameraGroup, Capture, Photo
from fieldkit.clouds import Cloud, Volume
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.colmap_model import model_points, new_model
from fieldkit.reconstruction.features import Features
from fieldkit.reconstruction.result import MetricFrame, Reconstruction, SparseResult
from fieldkit.results.evaluation import ImageReport, StageTime
from fieldkit.results.finding import Finding
from fieldkit.results.frame import Plane

INTRINSICS = Intrinsics("SIMPLE_RADIAL", 1600, 1200, (1400.0, 800.0, 600.0, -0.01))

ORIGIN = LocalFrame(50.6, 6.98, 70.0, "sea level")


def plant_cloud(points: int = 4000, seed: int = 0) -> Cloud:
    """A stem and four leaves, 0.4 m high, with colours and normals."""
    rng = np.random.default_rng(seed)
    along, leaf = rng.uniform(0, 1, points), rng.integers(0, 5, points)
    angle = leaf * 1.3 + 0.2
    stem = np.stack([0.004 * rng.normal(size=points), 0.004 * rng.normal(size=points), 0.02 + 0.38 * along], axis=1)
    out = 0.22 * along
    width = 0.02 * (1 - along) * rng.uniform(-1, 1, points)
    height = 0.12 + 0.05 * leaf + 0.35 * out - 1.6 * out**2
    leaves = np.stack(
        [out * np.cos(angle) - width * np.sin(angle), out * np.sin(angle) + width * np.cos(angle), height], axis=1
    )
    xyz = np.where((leaf == 4)[:, None], stem, leaves)
    shade = rng.uniform(0.6, 1.0, points)[:, None]
    colors = (shade * np.where((leaf == 4)[:, None], [110, 130, 60], [60, 150, 50])).astype(np.uint8)
    return Cloud(xyz, colors, np.tile(np.float32([0, 0, 1]), (points, 1)))


def ring(count: int, radius: float = 0.6, height: float = 0.45) -> dict[str, Pose]:
    """Level cameras on a circle that look at the plant's middle."""
    angles = 2 * np.pi * np.arange(count) / count
    centers = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.full(count, height)], axis=1)
    return {f"IMG_{i + 1:04d}.jpg": Pose.look_at(center, (0.0, 0.0, 0.2)) for i, center in enumerate(centers)}


def sparse_model(poses: dict[str, Pose], points: int = 40) -> pycolmap.Reconstruction:
    """Points of the plant, each seen in all images."""
    xyz = plant_cloud(points, seed=5).points
    pixels = [INTRINSICS.project(pose.to_camera(xyz)).astype(np.float32) for pose in poses.values()]
    features = [
        Features(np.concatenate([p, np.ones_like(p)], axis=1), np.zeros((points, 128), np.uint8)) for p in pixels
    ]
    model = new_model(tuple(poses), [INTRINSICS], [0] * len(poses), tuple(poses.values()), features)
    for index, point in enumerate(xyz):
        model.add_point3D(point, pycolmap.Track([pycolmap.TrackElement(i + 1, index) for i in range(len(poses))]))
    return model


def prior_of(pose: Pose) -> PosePrior:
    """The pose's position in the source frame, whose z = 0 lies 1.2 m below the ground."""
    return PosePrior(pose.center + np.array([0.0, 0.0, 1.2]), 0.03, source="geo.txt")


def reconstruction(*, metric: bool = True, scene: bool = True, cloud: Cloud | None = None) -> Reconstruction:
    """Eight photographs: six count, IMG_0007 is registered but wrong, IMG_0008 is not registered."""
    poses = ring(8)
    names = tuple(poses)
    good = names[:6]
    model = sparse_model({name: poses[name] for name in names[:7]})
    observations = model.compute_num_observations()
    images = tuple(
        ImageReport(
            name=name,
            features=1000 + 10 * index,
            registered=index < 7,
            right=None if index == 7 or not metric else index < 6,
            reason={6: "wrong pose: 3.200 m from the known position (bound 0.150 m)", 7: "no pair verified"}.get(
                index, ""
            ),
            observations=observations // 7 if index < 7 else 0,
            reprojection_px=0.5 if index < 7 else None,
            position_residual_m=None if index == 7 or not metric else 3.2 if index == 6 else 0.003,
            angle_residual_deg=None,
        )
        for index, name in enumerate(names)
    )
    photos = tuple(
        Photo(path=Path("/nowhere") / name, name=name, width=1600, height=1200, format="JPEG", sha256="0" * 64)
        for name in names
    )
    capture = Capture(
        folder=Path("/nowhere/plot 7"),
        image_folder=Path("/nowhere/plot 7"),
        photos=photos,
        groups=(CameraGroup("test camera", names, INTRINSICS, "camera.toml", True),),
        findings=(),
        priors={name: prior_of(pose) for name, pose in poses.items()} if metric else {},
        metric_source="geo.txt" if metric else None,
        origin=ORIGIN if metric else None,
    )
    sparse = SparseResult(
        capture=capture,
        method="prior" if metric else "incremental",
        model=model,
        model_sizes=(7,),
        images=images,
        poses={name: poses[name] for name in good},
        intrinsics=dict.fromkeys(good, INTRINSICS),
        intrinsics_source={"test camera": "camera.toml"},
        frame=MetricFrame(
            source="geo.txt" if metric else "none",
            plot_from_source=Similarity(1.0, np.eye(3), np.array([0.0, 0.0, -1.2])),
            origin=ORIGIN if metric else None,
            rms_m=0.003 if metric else None,
            bound_m=0.15 if metric else None,
            ground=Plane((0.0, 0.0, 1.0), 0.0, 0.002, 0.8, 0.006) if metric else None,
            notes=(),
        ),
        pairs_tried=28,
        pairs_verified=20,
        findings=(Finding("notes.txt", "not-an-image", "is a text file", True),),
        groups=dict.fromkeys(poses, 0),
    )
    plants = plant_cloud() if cloud is None else cloud
    return Reconstruction(
        sparse=sparse,
        volume=Volume((-0.3, -0.3, 0.0), (0.3, 0.3, 0.5)),
        plants=plants,
        nearby=plants,
        stray=0.002,
        scene=Cloud(np.concatenate([plants.points, model_points(model)])) if scene else None,
        gsd_m=0.0004,
        pixel_m=0.001,
        scatter_px=0.9,
        fusion_rule="2 of 10 views agree",
        times=(
            StageTime(name="Features", wall_s=1.5, cpu_s=1.4, items=8, cached=2),
            StageTime(name="Mapping", wall_s=3.0, cpu_s=2.9, items=1, cached=0),
        ),
    )


def leaves(seed: int, *, lift_m: float = 0.0, noise_m: float = 0.002, points: int = 12_000) -> Cloud:
    """Forty leaves over 1.2 × 0.8 m, the same ones for every seed; points and errors differ.

    Errors of neighbours are alike, as those of a reconstruction: each leaf as a whole is off by as much again.
    """
    rng = np.random.default_rng(100 + seed)
    places = np.random.default_rng(1)
    middle = places.uniform([-0.6, -0.4, 0.1], [0.6, 0.4, 0.6], (40, 3))
    heading = places.uniform(0, 2 * np.pi, 40)
    leaf = rng.integers(0, 40, points)
    along, across = rng.uniform(-0.15, 0.15, points), rng.uniform(-0.02, 0.02, points)
    c, s = np.cos(heading[leaf]), np.sin(heading[leaf])
    surface = np.stack([along * c - across * s, along * s + across * c, -2.0 * along**2], axis=1) + middle[leaf]
    whole = rng.normal(0.0, noise_m, (40, 3))[leaf]
    return Cloud(surface + whole + rng.normal(0.0, noise_m, (points, 3)) + [0.0, 0.0, lift_m])
