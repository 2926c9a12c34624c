"""Which poses count as right: the one place that says so, of every photograph.

A photograph is registered where the mapper gave it a pose (with known poses: with clearly more matches than chance
gives, `prior`). Its pose is verified where it agrees with what is known of it (`judge`); it is wrong where it does not,
where nothing but its known position holds it, or where the model as a whole does not fit the known positions; and
neither where nothing is known. `ImageReport.counts` is what everything else asks.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.agreement import judge
from fieldkit.reconstruction.cameras import PARALLEL_DEG, spread_deg
from fieldkit.reconstruction.colmap_model import model_poses, to_rigid
from fieldkit.reconstruction.mapping.bundle import COARSE_M
from fieldkit.reconstruction.mapping.state import Belief, Inputs, Mapped
from fieldkit.reconstruction.mapping.submodels import place_submodel
from fieldkit.reconstruction.mapping.uncertainty import Uncertainty, pose_uncertainty
from fieldkit.reconstruction.mapping.view_graph import EDGE_MATCHES, Pair, connected_parts
from fieldkit.results.evaluation import ImageReport, WeakestMode
from fieldkit.results.fields import finite
from fieldkit.results.finding import Finding
from fieldkit.runtime.colmap import pycolmap
from fieldkit.wording import count, listed

_FIXED_BY = 3
"""Photographs whose known positions fix a group's place, scale and rotation."""
_PLACED = 2
_LOOSE_DEG = 1.0
_FREE_DEG = 1000.0  # an orientation that is not known
_NAMED = 6
_FIRST_METRE = 0.5
_KNOWN_TO_M, _KNOWN_TO = 0.010, 0.0075
"""A pose is right that two standard deviations tell to 10 mm, or to this share of the distance to what is seen."""


@dataclass(frozen=True)
class Group:
    """Photographs that edges of the view graph join."""

    names: tuple[str, ...]
    shared: int
    """Sparse points that they and other groups see."""


def find_groups(model: pycolmap.Reconstruction, names: Sequence[str], edges: Collection[Pair]) -> list[Group]:
    """The groups of a model's photographs, the largest first.

    Args:
        edges: of the view graph, pairs of them by indices.
    """
    index = {name: k for k, name in enumerate(names)}
    image_of = {index[model.image(i).name]: i for i in model.reg_image_ids()}
    parts = sorted(connected_parts(sorted(image_of), edges), key=lambda part: (-len(part), part))
    shared = dict.fromkeys(range(len(parts)), 0)
    if len(parts) > 1:
        part_of = {image_of[k]: number for number, part in enumerate(parts) for k in part}
        for point in model.points3D.values():
            seeing = {part_of[element.image_id] for element in point.track.elements if element.image_id in part_of}
            for number in seeing if len(seeing) > 1 else ():
                shared[number] += 1
    return [Group(tuple(names[k] for k in part), shared[number]) for number, part in enumerate(parts)]


def held_by_positions(groups: Sequence[Group]) -> set[str]:
    """Photographs that only a known position holds: one or two, with fewer shared points than an edge has matches.

    Two turn freely about the line between them.
    """
    loose = [group for group in groups[1:] if len(group.names) < _FIXED_BY and group.shared < EDGE_MATCHES]
    return {name for group in loose for name in group.names}


def place_groups(model: pycolmap.Reconstruction, groups: Sequence[Group], known: Mapping[str, PosePrior]) -> bool:
    """Move each group of two photographs or more, in place, where its known positions and orientations want it.

    Poses out of their bounds do not take part. Points that several groups see go. Nothing moves where what is known
    leaves a group's rotation loose, as positions on an arc do: the plants' surfaces are then better joined by matches.

    Args:
        model: in the known poses' frame.
        known: by name; positions as coarse as GPS say less than single matches.

    Returns:
        Whether they are moved.
    """
    poses, image_of = model_poses(model), {str(model.image(i).name): i for i in model.reg_image_ids()}
    moves: dict[int, Similarity] = {}
    for group in groups:
        right = [name for name in group.names if name in known and judge(poses[name], known[name]).right]
        records = {name: known[name] for name in right if known[name].position is not None}
        if len(records) >= _PLACED:
            move = _own_place({name: poses[name] for name in records}, records)
            if move is None:
                return False
            moves |= {image_of[name]: move for name in group.names}
    of_group = {image_of[name]: number for number, group in enumerate(groups) for name in group.names}
    for key in list(model.point3D_ids()):
        point = model.points3D[key]
        seeing = [element.image_id for element in point.track.elements if element.image_id in of_group]
        if len({of_group[i] for i in seeing}) > 1:
            model.delete_point3D(key)
        elif seeing and seeing[0] in moves:
            move = moves[seeing[0]]
            point.xyz = move.apply(np.asarray(point.xyz)[None])[0]
    for name, i in image_of.items():
        if i in moves:
            model.frame(model.image(i).frame_id).rig_from_world = to_rigid(moves[i].apply_pose(poses[name]))
    return bool(moves)


def _own_place(poses: Mapping[str, Pose], records: Mapping[str, PosePrior]) -> Similarity | None:
    """The similarity that least squares of known positions and orientations give; None where they tell too little."""
    if np.median([record.position_sigma_m for record in records.values()]) > COARSE_M:
        return None
    here = [poses[name] for name in records]
    there = [
        replace(record, rotation=pose.rotation, angle_sigma_deg=_FREE_DEG) if record.rotation is None else record
        for pose, record in zip(here, records.values(), strict=True)
    ]
    placed = place_submodel(here, range(len(here)), there)
    before, after = (np.array([pose.center for pose in each]) for each in (here, placed.poses))
    spread = np.linalg.norm(before - before.mean(axis=0))
    if spread <= 0.0 or np.sqrt(np.linalg.eigvalsh(placed.covariance[:3, :3])[-1]) > np.radians(_LOOSE_DEG):
        return None
    scale = float(np.linalg.norm(after - after.mean(axis=0)) / spread)
    turn = placed.poses[0].rotation.T @ here[0].rotation
    return Similarity(scale, turn, after.mean(axis=0) - scale * turn @ before.mean(axis=0))


def weakly_tied(
    name: str, known: Uncertainty, loose: list[str], together: list[str], sigma: float, *, metric: bool
) -> tuple[Finding, ...]:
    """How far photographs may be off that are known too poorly, and which of them together."""
    if not loose:
        return ()

    def within(sigma: float) -> str:
        if not metric:
            return f"{min(100.0, 200.0 * sigma / known.distance):.2g} % of their distance"
        return f"{2000.0 * sigma:.0f} mm" if sigma < _FIRST_METRE else f"{2.0 * sigma:.1f} m"

    most = float(max(known.sigma[known.names.index(each)] for each in loose))
    poor = count(len(loose), "photographs is", "photographs are", of=len(known.names))
    message = (
        f"weakly tied: {poor} known to {within(most)} only (two standard deviations): {listed(loose, _NAMED)}. Most "
        f"easily {listed(together, _NAMED)} could lie {within(sigma)} off the others together: too few matches above "
        "chance join them; take photographs between them and the others, at most 20° apart"
    )
    return (Finding(name, "weakly-tied", message),)


def judged(
    inputs: Inputs,
    belief: Belief,
    method: str,
    model: pycolmap.Reconstruction,
    sizes: tuple[int, ...],
    reasons: Mapping[str, str],
    ties: Mapping[Pair, float],
    *,
    metric: bool,
    refined: bool,
    pairs_tried: int,
    pairs_verified: int,
) -> Mapped:
    """A model with the verdict on every photograph's pose.

    Args:
        belief: by which it was mapped.
        model: groups of its photographs are moved, in place, where known poses want them.
        sizes: registered images of every model.
        reasons: why a photograph is not registered.
        ties: the view graph's edges, by indices of photographs, and what they say (`pair_information`).
        metric: whether the model is in the known poses' frame.
        refined: whether mapping adjusted the cameras' lenses.
    """
    known = belief.priors.by_name
    groups = find_groups(model, inputs.names, ties)
    placed = method == "prior" and len(groups) > 1 and place_groups(model, groups, known)
    held = held_by_positions(groups)
    points = {str(model.image(i).name): int(model.image(i).num_points3D) for i in model.reg_image_ids()}
    poses = model_poses(model)
    uncertainty = pose_uncertainty(
        model, known if method == "prior" else {}, ties, inputs.names, loss_px=inputs.settings.prior.loss_px,
        refined=refined, oriented=placed,
    )  # fmt: skip
    sigmas = dict(zip(uncertainty.names, uncertainty.sigma.tolist(), strict=True))
    errors = dict(zip(uncertainty.names, uncertainty.reprojection_px.tolist(), strict=True))
    bound = max(_KNOWN_TO_M * metric, _KNOWN_TO * uncertainty.distance)
    loose = []
    together, sigma = uncertainty.weakest()
    trusted = metric or not belief.priors.positioned
    reports = []
    for keyed, name in zip(inputs.keyed, inputs.names, strict=True):
        features = len(keyed.features)
        if name not in poses:
            reason = reasons.get(name, "no matches")
            reports.append(ImageReport(name=name, features=features, registered=False, reason=reason))
            continue
        agreement = judge(poses[name], known.get(name) if metric else None)
        right, reason = agreement.right, agreement.reason
        if right and name in held:
            right, reason = False, "only its known position holds it: too few matches"
        if not trusted:
            right, reason = False, "wrong pose: the model does not fit the known positions"
        if right is not False and 2.0 * sigmas[name] > bound:
            loose.append(name)
            right, reason = None, "loose: too few matches above chance tell its place"
        reports.append(
            ImageReport(
                name=name, features=features, registered=True, right=None if right is None else bool(right),
                reason=reason, observations=points[name], reprojection_px=finite(errors.get(name)),
                position_residual_m=finite(agreement.position_residual_m),
                angle_residual_deg=finite(agreement.angle_residual_deg),
                sigma_m=finite(sigmas[name]) if metric else None,
            )
        )  # fmt: skip
    parallel = spread_deg(poses.values()) < PARALLEL_DEG
    return Mapped(
        method, model, sizes, metric, tuple(reports),
        dict(zip(belief.cameras.keys, belief.cameras.sources, strict=True)), pairs_tried, pairs_verified, belief.notes,
        parallel and not (method == "prior" and belief.heights_tell(poses.values())),
        weakly_tied(inputs.capture.folder.name, uncertainty, loose, together, sigma, metric=metric),
        WeakestMode(photographs=tuple(together), sigma_m=sigma) if metric and together else None,
        len(groups),
    )  # fmt: skip
