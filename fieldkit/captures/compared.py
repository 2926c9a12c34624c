"""Facts that have two sources: positions of a file against the photographs' own GPS; one capture, several places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.spatial.distance import cdist, pdist

from fieldkit.arrays import FloatArray
from fieldkit.captures.model import Photo
from fieldkit.documents.mistaken import CENTIMETRES, SWAPPED
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame, geodetic_to_ecef
from fieldkit.geometry.pose import nearest_rotation
from fieldkit.geometry.priors import PosePrior
from fieldkit.results.finding import Finding

_LEAST = 3
"""Least number of photographs with GPS for a comparison."""
_ELSEWHERE_M = 1000.0
"""Distance from their GPS beyond which positions are another field's, metres."""
_APART_M = 30.0
"""Distance from their GPS within which positions are this plot's, whatever their receivers, metres."""
_TELLS_M = 10.0
"""Spread (RMS) below which GPS tells nothing of a layout, metres."""
_LONGER = 2.0
"""Factor between the spread of positions and of their GPS from which the units differ."""
_MISFIT = 0.5
"""Largest misfit of positions that are laid out as their GPS, as a share of its spread."""
_MISFIT_M = 3.0
"""The same of small layouts, metres: what consumer GPS errs by."""
_GAP_M = 5.0
"""Least distance between photographs of two places, metres."""
_GAPS = 2.5
"""Least distance between places in gaps within them, with heights above take-off."""
_GAPS_BLIND = 5.0
"""The same without heights above take-off."""
_A_PLACE = 4
"""Least number of photographs of a place."""


def against_gps(
    photos: Sequence[Photo], priors: Mapping[str, PosePrior], origin: LocalFrame | None, source: str
) -> list[Finding]:
    """What the photographs' own GPS says against positions that ``source`` gives in a frame.

    With an origin the places are compared; without, the layouts, whatever the frame's heading. Raises MetadataError
    where the positions are another field's.
    """
    both = [(p, q.position) for p in photos if (q := priors.get(p.name)) and q.position is not None and p.geotag]
    if len(both) < _LEAST:
        return []
    places = np.array([position[:2] for _, position in both])
    degrees = np.array([(p.geotag.latitude_deg, p.geotag.longitude_deg) for p, _ in both if p.geotag is not None])
    if origin is None:
        frame = LocalFrame(float(degrees[0, 0]), float(degrees[0, 1]))
        gps = frame.to_local(degrees[:, 0], degrees[:, 1], 0.0)[:, :2]
        spread, own, misfit = _misfit(places, gps)
        if own == 0.0 or spread < _TELLS_M:
            return []
        if not 1.0 / _LONGER < own / spread < _LONGER:
            said = f"the positions spread over {own:.3g} m, their GPS over {spread:.3g} m: {CENTIMETRES.looks_like}"
            return [Finding(source, "unit-suspicious", said)]
        said = f"the positions are not laid out as the photographs' own GPS: {misfit:.0f} m off after the best fit"
        ok = misfit < max(_MISFIT * spread, _MISFIT_M)
        return [] if ok else [Finding(source, "positions-apart", f"{said}; are they of these photographs?")]
    latitude, longitude, _ = origin.to_geodetic(np.column_stack([places, np.zeros(len(places))]))
    there = geodetic_to_ecef(degrees[:, 0], degrees[:, 1], 0.0)
    away = float(np.median(np.linalg.norm(geodetic_to_ecef(latitude, longitude, 0.0) - there, axis=1)))
    if away < _APART_M:
        return []
    exchanged = geodetic_to_ecef(np.clip(longitude, -90.0, 90.0), latitude, 0.0) - there
    swapped = float(np.median(np.linalg.norm(exchanged, axis=1))) < _ELSEWHERE_M
    said = f"puts the photographs {_far(away)} from their own GPS"
    if away > _ELSEWHERE_M:
        raise MetadataError(
            f"{said}{': latitude and longitude look swapped' if swapped else ''}",
            remedy=SWAPPED.remedy if swapped else "Give that of these photographs, or move it away: GPS counts then.",
        )
    return [Finding(source, "positions-apart", f"{said}: check its reference system, and that it is of them")]


def _far(metres: float) -> str:
    return f"{metres / 1000:,.0f} km" if metres > 10_000 else f"{metres:,.0f} m"


def _misfit(a: FloatArray, b: FloatArray) -> tuple[float, float, float]:
    """Spread of b and of a (n, 2) about their means, and what is left of b where a is turned and moved onto it."""
    one, other = a - a.mean(axis=0), b - b.mean(axis=0)
    turn = nearest_rotation(one.T @ other)
    first, second, third = (float(np.sqrt((v**2).sum(axis=1).mean())) for v in (other, one, one @ turn - other))
    return first, second, third


def several_places(photos: Sequence[Photo], priors: Mapping[str, PosePrior]) -> list[Finding]:
    """A finding where photographs are of two places or more, as of two plots: no picture shows both.

    Groups of four or more lie farther from each other than two flying heights, and than 2.5 times what lies between
    the members of any; without heights above take-off, 5 times.
    """
    known = [(p, q.position) for p in photos if (q := priors.get(p.name)) and q.position is not None]
    places = np.array([position[:2] for _, position in known])
    heights = [p.geotag.relative_altitude_m for p, _ in known if p.geotag and p.geotag.relative_altitude_m]
    least_m = max(_GAP_M, 2.0 * float(np.median(heights)) if heights else 0.0)
    middles = groups_apart(places.reshape(-1, 2), least_m, _GAPS if heights else _GAPS_BLIND)
    if len(middles) < 2:
        return []
    message = (
        f"the photographs are of {len(middles)} places, {pdist(middles).min():.0f} m apart and more. Evaluate each by "
        "itself, or let `fieldkit campaign init` and `evaluate --campaign` sort them"
    )
    return [Finding(known[0][0].name, "several-places", message)]


def groups_apart(places: FloatArray, least_m: float, times: float = _GAPS) -> FloatArray:
    """The middles (k, 2) of groups of four and more that places (n, 2) fall into; none where they do not.

    What lies between groups is ``least_m`` at least, and so many ``times`` what lies between the members of any.
    """
    if len(places) < 2 * _A_PLACE:
        return places[:0]
    tree = minimum_spanning_tree(cdist(places, places) + 1e-6)  # SciPy takes less for no edge
    gaps = np.sort(tree.data)[::-1]
    steps = np.where(gaps[:-1] >= least_m, gaps[:-1] / gaps[1:], 0.0)
    cut = int(np.argmax(steps))
    tree.data[tree.data >= gaps[cut]] = 0.0
    tree.eliminate_zeros()
    number, of = connected_components(tree, directed=False)
    if steps[cut] < times or np.bincount(of).min() < _A_PLACE:
        return places[:0]
    return np.array([np.median(places[of == k], axis=0) for k in range(number)])
