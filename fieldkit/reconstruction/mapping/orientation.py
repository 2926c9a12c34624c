"""What prior mapping starts from: known positions with orientations from the records, a blind model, or pairs.

Orientations of cameras whose positions alone are known come from verified pairs.

The relative rotations of verified pairs, joined over a maximum spanning tree, orient the images of a component
against each other. The pairs' translation directions must then be the known directions between the positions, which
fixes the component's rotation in the world (Wahba's problem, solved by SVD inside RANSAC). A wrong pair in the tree
turns all images beyond it, whose own pairs then contradict positions: they are left out, or taken to look where the
others look (`looking_alike`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.geometry.pose import nearest_rotation, rotation_angle_deg
from fieldkit.geometry.priors import PosePrior, Priors
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS, align_to_positions, judge
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.matching import TwoView
from fieldkit.runtime.colmap import pycolmap
from fieldkit.vocabulary import LEAST_POSITIONS

_AGREE_DEG = 8.0
"""Angle between a pair's direction and its positions' within which they agree, degrees, for exact positions."""
_MAX_AGREE_DEG = 40.0
"""Largest such angle, degrees, whatever the positions' accuracy."""
_ROUNDS = 3
"""Most rounds in which pairs that disagree are left out."""
_TRIALS = 500
"""Number of random pairs of directions that are tried for a component's rotation."""
_MIN_SHARE = 0.4  # of the pairs' matches must agree with the positions

_ALIKE_DEG = 20.0
"""Largest turn between the mounts of cameras that look at a place alike, degrees."""
_MOST_ALIKE = 0.5
"""Least share of cameras that look alike for the others to be taken to."""
FOUND_SIGMA_DEG = 6.0
"""What orientations found from positions and pairs are good to (measured 0.3–6° on the recorded rigs)."""


def rough_from_records(priors: Priors) -> dict[str, PosePrior]:
    """By name, the images whose position and orientation are recorded."""
    return {n: priors.by_name[n] for n in priors.positioned if priors.by_name[n].rotation is not None}


def rough_from_model(model: pycolmap.Reconstruction, priors: Priors, *, seed: int) -> dict[str, PosePrior]:
    """Known positions with the orientations of a blind model, of the images that it has right."""
    poses = model_poses(model)
    similarity = align_to_positions(poses, priors.by_name, seed=seed)
    if similarity is None:
        return {}
    found = {}
    for name in (n for n in priors.positioned if n in poses):
        pose = similarity.apply_pose(poses[name])
        if judge(pose, priors.by_name[name]).right:
            found[name] = _found(priors.by_name[name], pose.rotation)
    return found


def rough_from_pairs(
    names: Sequence[str], priors: Priors, pairs: Mapping[tuple[int, int], TwoView], *, seed: int
) -> dict[str, PosePrior]:
    """Known positions with the orientations that verified pairs (by indices into ``names``) give."""
    records = [priors.by_name.get(name, PosePrior(position_sigma_m=0.0)) for name in names]
    found = orient_cameras([r.position for r in records], [r.position_sigma_m for r in records], pairs, seed=seed)
    return {names[k]: _found(records[k], rotation) for k, rotation in sorted(found.items())}


def _found(record: PosePrior, rotation: FloatArray) -> PosePrior:
    return PosePrior(record.position, record.position_sigma_m, rotation, FOUND_SIGMA_DEG)


def looking_alike(found: Mapping[str, PosePrior], priors: Priors, unknown: Sequence[str]) -> dict[str, PosePrior]:
    """Orientations for photographs without one, or with one that differs, where most look at one place alike.

    Cameras about a plant look at it and are held the same way up: what turns one camera into another turns the
    direction to the place, about the mean of the cameras' own vertical axes. ``unknown`` are those whose orientations
    are not recorded.
    """
    region = region_of_interest([prior.pose for prior in found.values()])
    if region is None or len(found) < LEAST_POSITIONS:
        return {}
    up = -np.mean([prior.pose.rotation[1] for prior in found.values()], axis=0)
    frames = {name: _looking(region.center, priors.by_name[name], up) for name in priors.positioned}
    mounts = np.array([prior.pose.rotation @ frames[name].T for name, prior in found.items()])
    away = np.array([[rotation_angle_deg(one, other) for other in mounts] for one in mounts])
    best = mounts[int(np.argmin(np.median(away, axis=1)))]
    alike = {n: rotation_angle_deg(mount, best) <= _ALIKE_DEG for n, mount in zip(found, mounts, strict=True)}
    if sum(alike.values()) < max(LEAST_POSITIONS, _MOST_ALIKE * len(found)):
        return {}
    mount = nearest_rotation(mounts[list(alike.values())].sum(axis=0))
    return {name: _found(priors.by_name[name], mount @ frames[name]) for name in unknown if not alike.get(name)}


def _looking(center: Sequence[float], prior: PosePrior, up: FloatArray) -> FloatArray:
    """(3, 3) from the world to axes to the right, down and towards a place."""
    assert prior.position is not None
    towards = np.asarray(center) - prior.position
    towards = towards / max(float(np.linalg.norm(towards)), 1e-9)
    right = np.cross(towards, up)
    right = right / max(float(np.linalg.norm(right)), 1e-9)
    return np.stack([right, np.cross(towards, right), towards])


def contradict(found: PosePrior, recorded: PosePrior) -> bool:
    """Whether an orientation that was found lies outside a recorded one's bound.

    Seen on real flights: photographs that were turned by 180° after the camera had written its yaw.
    """
    turn = rotation_angle_deg(found.pose.rotation, recorded.pose.rotation)
    return turn > ANGLE_SIGMAS * float(np.hypot(recorded.angle_sigma_deg, found.angle_sigma_deg))


@dataclass(frozen=True, eq=False)
class _Edge:
    i: int
    j: int
    weight: int
    rotation: FloatArray  # camera j from camera i
    direction: FloatArray  # unit vector from camera i to camera j, in camera i
    world: FloatArray  # the same, in the world
    limit_deg: float  # how far the two may differ


def orient_cameras(
    positions: Sequence[FloatArray | None],
    sigmas_m: Sequence[float],
    pairs: Mapping[tuple[int, int], TwoView],
    *,
    seed: int,
) -> dict[int, FloatArray]:
    """Camera-from-world rotations (3, 3) by image index, for the images that pairs connect without contradiction.

    ``positions`` are (3,) metres per image, or None; ``pairs`` are verified, with relative poses.

    Images that no agreeing pair reaches, and components whose baselines are all parallel, are missing.
    """
    candidates = [_edge(i, j, pair, positions, sigmas_m) for (i, j), pair in sorted(pairs.items())]
    edges = [edge for edge in candidates if edge is not None]
    found: dict[int, FloatArray] = {}
    for _ in range(_ROUNDS):
        found = {}
        for rotations in _components(edges):
            found.update(_align(rotations, edges, seed))
        within = [e for e in edges if e.i in found and e.j in found]
        agreeing = [e for e, good in zip(within, _agree(within, found), strict=True) if good]
        connected = {k for e in agreeing for k in (e.i, e.j)}
        found = {k: r for k, r in found.items() if k in connected}
        if len(agreeing) == len(edges):
            break
        edges = agreeing
    return found


def _edge(
    i: int, j: int, pair: TwoView, positions: Sequence[FloatArray | None], sigmas_m: Sequence[float]
) -> _Edge | None:
    length = float(np.linalg.norm(pair.translation))
    a, b = positions[i], positions[j]
    if length == 0 or a is None or b is None or np.linalg.norm(b - a) == 0:
        return None
    baseline = float(np.linalg.norm(b - a))
    blur = np.degrees(np.arctan2(float(np.hypot(sigmas_m[i], sigmas_m[j])), baseline))
    limit = min(_AGREE_DEG + 2.5 * float(blur), _MAX_AGREE_DEG)
    inside = -pair.rotation.T @ pair.translation / length
    return _Edge(i, j, len(pair.inliers), pair.rotation, inside, (b - a) / baseline, limit)


def _components(edges: Sequence[_Edge]) -> list[dict[int, FloatArray]]:
    """Rotations of every image against its component's first, along the maximum spanning tree."""
    images = sorted({k for e in edges for k in (e.i, e.j)})
    ends = np.searchsorted(images, np.array([(e.i, e.j) for e in edges], dtype=np.int64).reshape(-1, 2)).T
    # Ranks as weights, so that equal ones fall the same way everywhere.
    rank = np.empty(len(edges))
    rank[sorted(range(len(edges)), key=lambda n: (-edges[n].weight, edges[n].i, edges[n].j))] = (
        np.arange(len(edges)) + 1
    )
    tree = minimum_spanning_tree(coo_array((rank, tuple(ends)), shape=(len(images),) * 2))
    turns = {(e.i, e.j): e.rotation for e in edges} | {(e.j, e.i): e.rotation.T for e in edges}
    components: list[dict[int, FloatArray]] = []
    seen: set[int] = set()
    for start, image in enumerate(images):
        if image in seen:
            continue
        rotations = {image: np.eye(3)}
        order, before = breadth_first_order(tree, start, directed=False)
        for k in order[1:]:
            one, other = images[before[k]], images[k]
            rotations[other] = turns[one, other] @ rotations[one]
        seen.update(rotations)
        components.append(rotations)
    return components


def _align(rotations: Mapping[int, FloatArray], edges: Sequence[_Edge], seed: int) -> dict[int, FloatArray]:
    """The component's rotations in the world, or nothing."""
    mine = [e for e in edges if e.i in rotations and e.j in rotations]
    if len(mine) < 2:
        return {}
    inside = np.array([rotations[e.i].T @ e.direction for e in mine])
    world = np.array([e.world for e in mine])
    weights = np.array([e.weight for e in mine], dtype=np.float64)
    rng = np.random.default_rng(seed)
    limit = np.cos(np.radians([e.limit_deg for e in mine]))
    best, best_score = None, 0.0
    for _ in range(_TRIALS):
        sample = rng.choice(len(mine), size=2, replace=False)
        candidate = _wahba(inside[sample], world[sample], np.ones(2))
        if candidate is None:
            continue
        good = ((inside @ candidate.T) * world).sum(axis=1) >= limit
        score = float(weights[good].sum())
        if score > best_score:
            best, best_score = good, score
    if best is None or best_score < _MIN_SHARE * weights.sum():
        return {}
    rotation = _wahba(inside[best], world[best], weights[best])
    return {} if rotation is None else {k: r @ rotation.T for k, r in rotations.items()}


def _wahba(inside: FloatArray, world: FloatArray, weights: FloatArray) -> FloatArray | None:
    """The rotation that best turns ``inside`` (n, 3) into ``world`` (n, 3); None when the directions are parallel."""
    correlation = (world * weights[:, None]).T @ inside
    singular = np.linalg.svd(correlation, compute_uv=False)
    return None if singular[1] < 0.02 * singular[0] else nearest_rotation(correlation)


def _agree(edges: Sequence[_Edge], found: Mapping[int, FloatArray]) -> BoolArray:
    """(n,) whether each pair's direction and rotation agree with the images' rotations in the world."""
    if not edges:
        return np.zeros(0, dtype=np.bool_)
    first, second = (np.array([found[k] for k in ends]) for ends in zip(*((e.i, e.j) for e in edges), strict=True))
    turned = np.einsum("nji,nj->ni", first, np.array([e.direction for e in edges]))
    along = (turned * np.array([e.world for e in edges])).sum(axis=1)
    relative = np.einsum("nij,nkj->nik", second, first)
    # The trace of a rotation is 1 + 2 cos of its angle.
    trace = np.einsum("nij,nij->n", relative, np.array([e.rotation for e in edges]))
    close = trace >= 1.0 + 2.0 * np.cos(np.radians(1.5 * _AGREE_DEG))
    good: BoolArray = (along >= np.cos(np.radians([e.limit_deg for e in edges]))) & close
    return good
