"""What a pattern is worth: photographs of a rendered plot, evaluated as any flight is, against the plot's truth."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fieldkit.clouds.alignment import REFERENCE_REACH_M, icp
from fieldkit.clouds.canopy import inside_outline
from fieldkit.clouds.metrics import ReferenceIndex, nearest_distances
from fieldkit.clouds.ply import read_cloud
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.flight import evaluate_plots
from fieldkit.geometry import Intrinsics
from fieldkit.planning.objective.evaluation import WORST_M, value_m
from fieldkit.planning.patterns.block import ROWS_DEG, Block
from fieldkit.planning.patterns.photographs import plot_volume, poses_about, showing
from fieldkit.planning.plan_settings import NoiseSettings
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import CLOUD_FILE
from fieldkit.results.pattern import Pattern
from fieldkit.runtime.context import Context
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, simulate_capture
from fieldkit.sites.site import SitePlot

_MOST = 14
"""Photographs that are taken of a pattern, those that show the plot best; twelve of them are its depths."""
_WITHIN_M = 0.020
"""Distance within which surface counts as reconstructed, metres."""
_PLOT = "plot"
_STREAM = 63
"""Seed's part for where lines lie."""


@dataclass(frozen=True)
class PatternEvaluation:
    """A pattern measured on a plot."""

    photographs: int
    """Taken of it."""
    right: int = 0
    value_m: float = WORST_M
    """−r(z), by the rule of all evaluations."""
    within: float = 0.0
    """Share of the plot's surface within `_WITHIN_M` of the cloud."""
    errors: dict[str, float] | None = None
    """By trait, measured less true, of those that the evaluation gives, of the volume as a share; None: it has none."""
    failure: str = ""


def evaluate(
    pattern: Pattern, block: Block, renderer: Renderer, camera: Intrinsics, noise: NoiseSettings, seed: int = 0
) -> PatternEvaluation:
    """Photograph a block by a pattern and evaluate its plot.

    Args:
        renderer: of the block's scene.
        camera: without distortion.
        noise: by how far the vehicle misses places and angles, which its records do, too; wind and wash.
        seed: of all that is random: where lines lie beside the plot, noise, mapping.
    """
    phase = np.random.default_rng([seed, _STREAM]).random(2).tolist()
    poses = showing(poses_about(pattern, block, camera, phase), camera, plot_volume(block), _MOST)
    made = PatternEvaluation(len(poses))
    site = replace(block.description.site, accuracy_m=(noise.pose_m, 1.5 * noise.pose_m))
    corners = np.array([(x, y, 0.0) for x, y in block.outline])
    latitude, longitude, _ = site.origin.to_geodetic(corners)
    ring = tuple(zip(latitude.tolist(), longitude.tolist(), strict=True))
    middle = np.mean(ring, axis=0)
    plot = SitePlot(name=_PLOT, latitude_deg=middle[0], longitude_deg=middle[1], row_heading_deg=ROWS_DEG)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        simulate_capture(
            folder / "photos",
            renderer,
            poses,
            camera,
            noise=CaptureNoise(noise.pose_m, noise.pose_deg, *site.accuracy_m, noise.pose_deg),
            seed=seed,
            # Motion blur, which patterns keep to a pixel, takes as long as drawing.
            effects=replace(block.description.camera_effects, exposure_s=0.0),
            outdoors=noise.outdoors,
            site=site,
            row_heading_deg=ROWS_DEG,
            sidecars=Sidecars(camera=True),
            economy=True,
        )
        try:
            (found,), flight = evaluate_plots(
                folder / "photos", folder, [(plot, ring)], folder, ReconstructionSettings(seed=seed), Context(seed=seed)
            )
        except ReconstructionError as error:
            return replace(made, failure=error.message)
        made = replace(made, right=flight.right)
        if found.error is not None or found.frame is None or found.frame.origin is None:
            return replace(made, failure="" if found.error is None else found.error.message)
        cloud = read_cloud(folder / found.name / CLOUD_FILE)
    cloud = replace(cloud, points=found.frame.about(site.origin, cloud.points))
    reference = ReferenceIndex(block.reference)
    own = cloud.select(inside_outline(cloud.points, block.outline))
    # So few photographs leave the model shifted and turned, which a flight's do not.
    motion, _ = icp(own, reference, max_distance_m=REFERENCE_REACH_M)
    to_reference, to_cloud = nearest_distances(reference, own.transformed(motion))
    traits = {} if found.traits is None else found.traits.model_dump()
    errors = {
        name: (traits[name] - true) / (true if name == "canopy_volume_m3" else 1.0)
        for name, true in block.truth.items()
        if traits.get(name) is not None
    }
    within = float((to_cloud <= _WITHIN_M).mean())
    return replace(made, value_m=value_m(to_cloud, to_reference), within=within, errors=errors or None)
