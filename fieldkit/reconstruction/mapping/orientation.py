"""What prior mapping starts from: known positions with orientations from the records, a blind model, or pairs.

Orientations of cameras whose positions alone are known come from verified pairs.

The relative rotations of verified pairs, joined over a maximum spanning tree, orient the images of a component
against each other. The pairs' translation directions must then be the known directions between the positions, which
fixes the component's rotation in the world (Wahba's problem, solved by SVD inside RANSAC). A wrong pair in the tree
turns all images beyond it: it is exchanged for a pair that contradicts it if then more matches agree.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from fieldkit.geometry.pose import rotation_angle_deg
from fieldkit.geometry.priors import PosePrior, Priors
from fieldkit.reconstruction.agreement import ANGLE_SIGMAS, align_to_positions, judge
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.verification import TwoView
from fieldkit.runtime.colmap import pycolmap

Matrix = NDArray[np.float64]
_AGREE_DEG = 8.0
_MAX_AGREE_DEG = 40.0
_ROUNDS = 3
_TRIALS = 500
_MIN_SHARE = 0.4  # of the pairs' matches must agree with the positions
_EXCHANGES, _WRONG = 10, 30

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


def _found(record: PosePrior, rotation: Matrix) -> PosePrior:
    return PosePrior(record.position, record.position_sigma_m, rotation, FOUND_SIGMA_DEG)


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
    rotation: Matrix  # camera j from camera i
    direction: Matrix  # unit vector from camera i to camera j, in camera i
    world: Matrix  # the same, in the world
    limit_deg: float  # how far the two may differ


def orient_cameras(
    positions: Sequence[NDArray[np.float64] | None],
    sigmas_m: Sequence[float],
    pairs: Mapping[tuple[int, int], TwoView],
    *,
    seed: int,
) -> dict[int, Matrix]:
    """Camera-from-world rotations (3, 3) by image index, for the images that pairs connect without contradiction.

    Args:
        positions: (3,) metres per image, or None.
        pairs: verified pairs with relative poses, by image indices.

    Images that no agreeing pair reaches, and components whose baselines are all parallel, are missing.
    """
    candidates = [_edge(i, j, pair, positions, sigmas_m) for (i, j), pair in sorted(pairs.items())]
    edges = [edge for edge in candidates if edge is not None]
    found: dict[int, Matrix] = {}
    for _ in range(_ROUNDS):
        found = {}
        for rotations, tree in _components(edges):
            aligned = _align(rotations, edges, seed)
            found.update(_exchanged(aligned, tree, edges) if aligned else {})
        within = [e for e in edges if e.i in found and e.j in found]
        agreeing = [e for e, good in zip(within, _agree(within, found), strict=True) if good]
        connected = {k for e in agreeing for k in (e.i, e.j)}
        found = {k: r for k, r in found.items() if k in connected}
        if len(agreeing) == len(edges):
            break
        edges = agreeing
    return found


def _edge(
    i: int, j: int, pair: TwoView, positions: Sequence[NDArray[np.float64] | None], sigmas_m: Sequence[float]
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


def _components(edges: Sequence[_Edge]) -> list[tuple[dict[int, Matrix], dict[int, int]]]:
    """Rotations of every image against its component's first, along the maximum spanning tree; and the image before
    each of the others in that tree.
    """
    images = sorted({k for e in edges for k in (e.i, e.j)})
    ends = np.searchsorted(images, np.array([(e.i, e.j) for e in edges], dtype=np.int64).reshape(-1, 2)).T
    # Ranks as weights, so that equal ones fall the same way everywhere.
    rank = np.empty(len(edges))
    rank[sorted(range(len(edges)), key=lambda n: (-edges[n].weight, edges[n].i, edges[n].j))] = (
        np.arange(len(edges)) + 1
    )
    tree = minimum_spanning_tree(coo_array((rank, tuple(ends)), shape=(len(images),) * 2))
    turns = {(e.i, e.j): e.rotation for e in edges} | {(e.j, e.i): e.rotation.T for e in edges}
    components: list[tuple[dict[int, Matrix], dict[int, int]]] = []
    seen: set[int] = set()
    for start, image in enumerate(images):
        if image in seen:
            continue
        rotations, parents = {image: np.eye(3)}, {}
        order, before = breadth_first_order(tree, start, directed=False)
        for k in order[1:]:
            one, other = images[before[k]], images[k]
            rotations[other] = turns[one, other] @ rotations[one]
            parents[other] = one
        seen.update(rotations)
        components.append((rotations, parents))
    return components


def _exchanged(rotations: dict[int, Matrix], parents: Mapping[int, int], edges: Sequence[_Edge]) -> dict[int, Matrix]:
    """A component's rotations in the world after exchanges of pairs in its tree, while they raise the matches of the
    pairs that agree.
    """
    mine = [e for e in edges if e.i in rotations and e.j in rotations]
    weights = np.array([e.weight for e in mine])
    tree = {frozenset(link) for link in parents.items()}
    agree = _agree(mine, rotations)
    best = int(weights[agree].sum())
    for _ in range(_EXCHANGES):
        wrong = sorted((e for e, good in zip(mine, agree, strict=True) if not good), key=lambda e: -e.weight)
        options = [
            (_turned(rotations, _beyond(tree - {link}, e), e), (tree - {link}) | {frozenset((e.i, e.j))})
            for e in wrong[:_WRONG]
            for link in _path(tree, e.i, e.j)
        ]
        scores = [int(weights[_agree(mine, found)].sum()) for found, _ in options]
        if not scores or max(scores) <= best:
            break
        best = max(scores)
        rotations, tree = options[scores.index(best)]
        agree = _agree(mine, rotations)
    return rotations


def _path(tree: set[frozenset[int]], start: int, end: int) -> list[frozenset[int]]:
    """The tree's links between two images."""
    return sorted((link for link in tree if end not in _reached(tree - {link}, start)), key=sorted)


def _reached(links: Iterable[frozenset[int]], start: int) -> set[int]:
    neighbors: dict[int, list[int]] = {}
    for a, b in links:
        neighbors.setdefault(a, []).append(b)
        neighbors.setdefault(b, []).append(a)
    found, waiting = {start}, [start]
    while waiting:
        new = [k for k in neighbors.get(waiting.pop(), []) if k not in found]
        found.update(new)
        waiting += new
    return found


def _beyond(links: Iterable[frozenset[int]], edge: _Edge) -> set[int]:
    """The smaller of the two parts that a pair connects."""
    return min(_reached(links, edge.i), _reached(links, edge.j), key=len)


def _turned(rotations: Mapping[int, Matrix], part: set[int], edge: _Edge) -> dict[int, Matrix]:
    """The rotations with a part turned as a whole, so that the pair that connects it with the rest holds."""
    if edge.j in part:
        turn = rotations[edge.j].T @ edge.rotation @ rotations[edge.i]
    else:
        turn = rotations[edge.i].T @ edge.rotation.T @ rotations[edge.j]
    return {k: rotation @ turn if k in part else rotation for k, rotation in rotations.items()}


def _align(rotations: Mapping[int, Matrix], edges: Sequence[_Edge], seed: int) -> dict[int, Matrix]:
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


def _wahba(inside: Matrix, world: Matrix, weights: NDArray[np.float64]) -> Matrix | None:
    """The rotation that best turns ``inside`` (n, 3) into ``world`` (n, 3); None when the directions are parallel."""
    u, singular, vt = np.linalg.svd((world * weights[:, None]).T @ inside)
    if singular[1] < 0.02 * singular[0]:
        return None
    rotation: Matrix = u @ np.diag([1.0, 1.0, np.linalg.det(u) * np.linalg.det(vt)]) @ vt
    return rotation


def _agree(edges: Sequence[_Edge], found: Mapping[int, Matrix]) -> NDArray[np.bool_]:
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
    good: NDArray[np.bool_] = (along >= np.cos(np.radians([e.limit_deg for e in edges]))) & close
    return good
