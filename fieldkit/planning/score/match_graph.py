"""The match graph of a recorded set: the counted right matches of each pair of photographs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.cache import digest
from fieldkit.planning.objective.recorded import RecordedSource
from fieldkit.planning.score.geometric import view_angles_deg
from fieldkit.reconstruction.cameras import cameras_of
from fieldkit.reconstruction.guided import Band, IndexedFeatures, PosedFeatures, Region, match_guided
from fieldkit.reconstruction.mapping.view_graph import null_model_matches
from fieldkit.reconstruction.settings import FeatureSettings
from fieldkit.reconstruction.stages import load_features
from fieldkit.reconstruction.versions import BESIDE
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import map_threads

_WIDEST_DEG = 60.0
"""Leaves hardly match beyond: sim/README.md has 9 of 309 matches left at 48°."""
_BAND_PX = 10.0
"""In a photograph 1600 pixels wide; commanded poses are good enough for it."""


def match_graph(source: RecordedSource, features: FeatureSettings, context: Context) -> FloatArray:
    """(m, m) matches above chance of each pair of recorded views, symmetric, 0 on the diagonal.

    Matches are guided by the known poses; those found in a displaced band are chance and are subtracted. Pairs more
    than 60° apart about the plot count as without matches. The result is kept in the source's cache. ``features`` are
    detected as in evaluations, which then find them in the cache; workers are processes that detect, then threads that
    match.
    """
    workers, progress = context.workers, context.progress
    names = [view.name for view in source.views]
    cameras = cameras_of(source.capture, source.plot.calibrated)
    photos = {photo.name: photo for photo in source.capture.photos}
    with progress.stage("Features", len(names)) as advance:
        keyed = load_features([photos[name] for name in names], features, replace(context, cache=source.cache), advance)
    camera_of = dict(zip(source.capture.names, cameras.camera_of, strict=True))
    intrinsics = [cameras.cameras[camera_of[name]] for name in names]
    poses = [view.pose for view in source.views]
    region = source.plot.region
    version = BESIDE["match-graph"]
    key = digest("match-graph", version, [f.key for f in keyed], intrinsics, poses, region, _BAND_PX, _WIDEST_DEG)
    kept = source.cache.get("match-graph", key)
    if kept is not None:
        return kept["matches"]
    posed = [
        PosedFeatures(IndexedFeatures.of(f.features, camera), pose)
        for f, camera, pose in zip(keyed, intrinsics, poses, strict=True)
    ]
    centers = np.array([pose.center for pose in poses])
    near = np.argwhere(np.triu(view_angles_deg(centers, np.array(source.plot.volume.center)) <= _WIDEST_DEG, 1))
    matches = np.zeros((len(names), len(names)))
    with progress.stage("Match graph", len(near)) as advance:
        counts = map_threads(
            lambda pair: _above_chance(posed[pair[0]], posed[pair[1]], region),
            near.tolist(),
            workers=workers,
            advance=advance,
        )
    matches[near[:, 0], near[:, 1]] = matches[near[:, 1], near[:, 0]] = counts
    source.cache.put("match-graph", key, {"matches": matches})
    return matches


def _above_chance(a: PosedFeatures, b: PosedFeatures, region: Region | None) -> float:
    band = Band(_BAND_PX * a.camera.width / 1600.0, region)
    return max(0.0, len(match_guided(a, b, band)) - null_model_matches(a, b, band))
