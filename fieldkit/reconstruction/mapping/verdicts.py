"""Which poses count as right: the one place that says so, of every photograph.

A photograph is registered where the mapper gave it a pose (with known poses: with clearly more matches than chance
gives, `prior`). Its pose is verified where it agrees with what is known of it (`judge`); it is wrong where it does not,
where nothing but its known position holds it, or where the model as a whole does not fit the known positions; and
neither where nothing is known. `ImageReport.counts` is what everything else asks.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from fieldkit.reconstruction.agreement import judge
from fieldkit.reconstruction.cameras import PARALLEL_DEG, spread_deg
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.mapping.groups import find_groups, held_by_positions, place_groups, weakly_tied
from fieldkit.reconstruction.mapping.state import Belief, Inputs, Mapped
from fieldkit.reconstruction.mapping.view_graph import Pair
from fieldkit.results.evaluation import ImageReport
from fieldkit.results.fields import finite
from fieldkit.runtime.colmap import pycolmap


def judged(
    inputs: Inputs,
    belief: Belief,
    method: str,
    model: pycolmap.Reconstruction,
    sizes: tuple[int, ...],
    reasons: Mapping[str, str],
    edges: Collection[Pair],
    *,
    metric: bool,
    pairs_tried: int,
    pairs_verified: int,
) -> Mapped:
    """A model with the verdict on every photograph's pose.

    Args:
        belief: by which it was mapped.
        model: groups of its photographs are moved, in place, where known poses want them.
        sizes: registered images of every model.
        reasons: why a photograph is not registered.
        edges: of the view graph, by indices of photographs.
        metric: whether the model is in the known poses' frame.
    """
    known = belief.priors.by_name
    groups = find_groups(model, inputs.names, edges)
    placed = method == "prior" and len(groups) > 1 and place_groups(model, groups, known)
    loose = held_by_positions(groups)
    points = {str(model.image(i).name): int(model.image(i).num_points3D) for i in model.reg_image_ids()}
    errors = _reprojection_errors(model)
    poses = model_poses(model)
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
        if right and name in loose:
            right, reason = False, "only its known position holds it: too few matches"
        if not trusted:
            right, reason = False, "wrong pose: the model does not fit the known positions"
        reports.append(
            ImageReport(
                name=name, features=features, registered=True, right=None if right is None else bool(right),
                reason=reason, observations=points[name], reprojection_px=finite(errors.get(name)),
                position_residual_m=finite(agreement.position_residual_m),
                angle_residual_deg=finite(agreement.angle_residual_deg),
            )
        )  # fmt: skip
    parallel = spread_deg(poses.values()) < PARALLEL_DEG
    return Mapped(
        method, model, sizes, metric, tuple(reports),
        dict(zip(belief.cameras.keys, belief.cameras.sources, strict=True)), pairs_tried, pairs_verified, belief.notes,
        parallel and not (method == "prior" and belief.heights_tell(poses.values())),
        weakly_tied(inputs.capture.folder.name, groups, placed=placed),
    )  # fmt: skip


def _reprojection_errors(model: pycolmap.Reconstruction) -> dict[str, float]:
    """Mean reprojection error per image, pixels."""
    total: dict[int, float] = {}
    count: dict[int, int] = {}
    for point in model.points3D.values():
        for element in point.track.elements:
            image = model.image(element.image_id)
            projected = image.project_point(point.xyz)
            if projected is None:
                continue
            error = float(np.linalg.norm(projected - image.point2D(element.point2D_idx).xy))
            total[element.image_id] = total.get(element.image_id, 0.0) + error
            count[element.image_id] = count.get(element.image_id, 0) + 1
    return {model.image(i).name: total[i] / count[i] for i in total}
