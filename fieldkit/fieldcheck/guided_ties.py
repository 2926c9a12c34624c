"""Ties that only show where one looks for them: matches guided by the tags, as mapping with known poses begins with.

Blind matching loses photographs more than 30° apart or so. Where that leaves a photograph without matches, its near
neighbours are matched within the bands that the tags allow. Such a tie agrees with the tags or is none, so it says that
a photograph will register, and that its tags are about right, but never what is wrong with them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fieldkit.fieldcheck.pose_graph import tie_errors_deg
from fieldkit.fieldcheck.ties import Pair, Tie, TieGraph
from fieldkit.geometry import Pose
from fieldkit.reconstruction.guided import IndexedFeatures, PosedFeatures, Region, match_guided
from fieldkit.reconstruction.prior_mapping import PriorMappingSettings, RoughPose, epipolar_sigma_px, region_of_interest
from fieldkit.reconstruction.verification import verify_pair
from fieldkit.runtime.parallel import map_threads

_FEW = 30
_FARTHEST_DEG = 48.0
_NEIGHBOURS = 4
_LEAST = 12
_SIGMA_M, _SIGMA_DEG = 0.05, 2.0
_TURN_DEG, _DIRECTION_DEG = 10.0, 20.0


def with_guided_ties(graph: TieGraph, poses: Mapping[int, Pose], *, workers: int, seed: int) -> TieGraph:
    """The graph, and what guided matching adds for photographs with few matches.

    Args:
        graph: of blind matches.
        poses: believed, by photograph; nothing is added where there is none.
    """
    region = region_of_interest(list(poses.values()))
    if region is None:
        return graph
    pairs = _pairs(graph, poses, region)
    settings = PriorMappingSettings()
    posed: dict[int, PosedFeatures] = {}
    for k in sorted({k for pair in pairs for k in pair}):
        features = graph.keyed[k].features
        chosen = features.subset(features.largest(settings.first_features))
        camera = graph.cameras.cameras[graph.cameras.camera_of[k]]
        posed[k] = PosedFeatures(IndexedFeatures.of(chosen, camera), poses[k])

    def tie(pair: Pair) -> Tie | None:
        a, b = posed[pair[0]], posed[pair[1]]
        rough = [RoughPose(p.pose, np.full(3, _SIGMA_M), _SIGMA_DEG) for p in (a, b)]
        distance = float(np.linalg.norm(a.pose.center - np.array(region.center)))
        band = settings.first_band_sigmas * epipolar_sigma_px(rough[0], rough[1], a.camera.fx, distance)
        matches = match_guided(a, b, max(4.0, band), settings.guided, region=region)
        cameras = [graph.cameras.cameras[graph.cameras.camera_of[k]] for k in pair]
        two = verify_pair(
            a.features, b.features, cameras[0], cameras[1], matches, settings.verification, calibrated=True, seed=seed
        )
        length = float(np.linalg.norm(two.translation))
        if len(two.inliers) < _LEAST or length == 0.0:
            return None
        direction = two.translation / length
        turn, off = tie_errors_deg(a.pose, b.pose, two.rotation, direction)
        if turn > _TURN_DEG or off > _DIRECTION_DEG:
            return None
        return Tie(len(two.inliers), two.rotation, direction, {})

    found = zip(pairs, map_threads(tie, pairs, workers=workers), strict=True)
    return replace(graph, ties={**graph.ties, **{pair: each for pair, each in found if each is not None}})


def _pairs(graph: TieGraph, poses: Mapping[int, Pose], region: Region) -> list[Pair]:
    """Near neighbours, without a tie, of photographs that have few matches."""
    rays = {k: pose.center - np.array(region.center) for k, pose in poses.items()}
    rays = {k: ray / max(float(np.linalg.norm(ray)), 1e-9) for k, ray in rays.items()}
    chosen: set[Pair] = set()
    for k in poses:
        if sum(tie.matches for pair, tie in graph.ties.items() if k in pair) >= _FEW:
            continue
        angles = {other: float(np.degrees(np.arccos(np.clip(rays[k] @ rays[other], -1.0, 1.0))))
                  for other in poses if other != k}  # fmt: skip
        near = sorted((other for other in angles if angles[other] <= _FARTHEST_DEG), key=lambda other: angles[other])
        chosen.update((min(k, other), max(k, other)) for other in near[:_NEIGHBOURS])
    return sorted(pair for pair in chosen if pair not in graph.ties)
