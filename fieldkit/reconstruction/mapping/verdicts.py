"""Which poses count as right: the one place that says so, of every photograph.

A photograph is registered where the mapper gave it a pose (with known poses: with clearly more matches than chance
gives, `prior`). Its pose is verified where it agrees with what is known of it (`judge`); it is wrong where it does not,
where nothing but its known position holds it, or where the model as a whole does not fit the known positions; and
neither where nothing is known. A photograph without a pose by matches whose record is good to centimetres is loose:
nothing speaks against its record. `ImageReport.counts` is what everything else asks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.agreement import judge
from fieldkit.reconstruction.cameras import PARALLEL_DEG, spread_deg
from fieldkit.reconstruction.colmap_model import model_poses
from fieldkit.reconstruction.mapping.bundle import COARSE_POSITIONS_M
from fieldkit.reconstruction.mapping.state import Belief, Inputs, Mapped
from fieldkit.reconstruction.mapping.uncertainty import Uncertainty, pose_uncertainty
from fieldkit.reconstruction.mapping.view_graph import Pair, connected_parts
from fieldkit.results.evaluation import ImageReport, WeakestMode
from fieldkit.results.fields import finite, vector
from fieldkit.results.finding import WEAKLY_TIED, Finding
from fieldkit.runtime.colmap import pycolmap
from fieldkit.wording import count, listed

_FIXED_BY = 3
"""Photographs whose known positions fix a group's place, scale and rotation: two turn about the line between them."""
_NAMED = 6
"""Most photographs that a finding names."""
_FIRST_METRE = 0.5
"""Standard deviation from which it is told in metres, metres."""
KNOWN_TO_M = 0.010
"""Two standard deviations of a pose that is as good as wanted, metres."""
_KNOWN_TO = 0.0075
"""The same as a share of the distance to what is seen, where that is more."""


def wanted_m(distance: float, *, metric: bool = True) -> float:
    """Two standard deviations of a pose that counts as right, in the unit of the distance to what is seen."""
    return max(KNOWN_TO_M * metric, _KNOWN_TO * distance)


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
    return (Finding(name, WEAKLY_TIED, message),)


def _loose(known: PosePrior | None, reason: str) -> str:
    """Why a photograph has no pose by matches; where its record knows it well, how well that is."""
    if known is None or known.position is None or known.rotation is None or known.position_sigma_m > COARSE_POSITIONS_M:
        return reason
    place, angle = 200.0 * known.position_sigma_m, 2.0 * known.angle_sigma_deg
    return f"loose: {reason}; its record tells its place to {place:.2g} cm and its angles to {angle:.2g}° (two sigma)"


def judged(
    inputs: Inputs,
    belief: Belief,
    method: str,
    model: pycolmap.Reconstruction,
    sizes: tuple[int, ...],
    reasons: Mapping[str, str],
    pair_values: Mapping[Pair, float],
    *,
    metric: bool,
    refined: bool,
    pairs_tried: int,
    pairs_verified: int,
) -> Mapped:
    """A model with the verdict on every photograph's pose.

    Args:
        model: at the optimum of its bundle adjustment.
        sizes: registered images of every model.
        pair_values: what pairs say (`pair_information`), by indices of photographs.
        metric: whether the model is in the known poses' frame.
        refined: whether mapping adjusted the cameras' lenses.
    """
    known = belief.priors.by_name
    points = {str(model.image(i).name): int(model.image(i).num_points3D) for i in model.reg_image_ids()}
    poses = model_poses(model)
    uncertainty = pose_uncertainty(
        model,
        known if method == "prior" else {},
        pair_values,
        inputs.names,
        loss_px=inputs.settings.prior.loss_px,
        refined=refined,
    )
    row = {inputs.names.index(name): name for name in uncertainty.names}
    groups = {row[k]: number for number, part in enumerate(connected_parts(sorted(row), pair_values)) for k in part}
    members = Counter(groups.values())
    anchored = {name for name, group in groups.items() if members[group] < _FIXED_BY}
    sigmas = dict(zip(uncertainty.names, uncertainty.sigma.tolist(), strict=True))
    errors = dict(zip(uncertainty.names, uncertainty.reprojection_px.tolist(), strict=True))
    bound = wanted_m(uncertainty.distance, metric=metric)
    loose = []
    together, sigma, moves = uncertainty.weakest()
    trusted = metric or not belief.priors.positioned
    reports = []
    for keyed, name in zip(inputs.keyed, inputs.names, strict=True):
        features = len(keyed.features)
        if name not in poses:
            reason = _loose(known.get(name), reasons.get(name, "no matches"))
            reports.append(ImageReport(name=name, features=features, registered=False, reason=reason))
            continue
        agreement = judge(poses[name], known.get(name) if metric else None)
        right, reason = agreement.right, agreement.reason
        if right and name in anchored:
            right, reason = False, "only known positions hold it, and fewer than three place no model: too few matches"
        if not trusted:
            right, reason = False, "wrong pose: the model does not fit the known positions"
        if right is not False and 2.0 * sigmas[name] > bound:
            loose.append(name)
            right, reason = None, "loose: too few matches above chance tell its place"
        reports.append(
            ImageReport(
                name=name,
                features=features,
                registered=True,
                right=None if right is None else bool(right),
                reason=reason,
                observations=points[name],
                reprojection_px=finite(errors.get(name)),
                position_residual_m=finite(agreement.position_residual_m),
                angle_residual_deg=finite(agreement.angle_residual_deg),
                sigma_m=finite(sigmas[name]) if metric else None,
            )
        )
    parallel = spread_deg(poses.values()) < PARALLEL_DEG
    return Mapped(
        method,
        model,
        sizes,
        metric,
        tuple(reports),
        dict(zip(belief.cameras.keys, belief.cameras.sources, strict=True)),
        pairs_tried,
        pairs_verified,
        belief.notes,
        parallel and not (method == "prior" and belief.heights_tell(poses.values())),
        weakly_tied(inputs.capture.folder.name, uncertainty, loose, together, sigma, metric=metric),
        WeakestMode(photographs=tuple(together), sigma_m=sigma, moves_m=tuple(map(vector, 2.0 * moves)))
        if metric and together
        else None,
        groups,
    )
