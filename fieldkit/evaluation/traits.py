"""Traits of a reconstructed plot and its plants one by one, with errors, or why they cannot be had. Pure functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
import shapely

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.clouds.canopy import (
    FITTED_PIXELS_M,
    Canopy,
    Outline,
    canopy,
    floats_from_m,
    highest_leaf_m,
    inside_outline,
    outline_area_m2,
    rectangle,
    seam_cells,
    stands_in,
    with_room_m,
)
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.leaf_area import leaf_area_m2, shown_share
from fieldkit.clouds.plants_apart import LEAST_PLANTS, everywhere, find_rows, tell_apart
from fieldkit.reconstruction import silhouettes
from fieldkit.reconstruction.gaps import Cover
from fieldkit.reconstruction.result import MetricFrame, Reconstruction, SparseResult
from fieldkit.reconstruction.scale import scale_error
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.finding import PLOTS_TOGETHER
from fieldkit.results.frame import Plane
from fieldkit.results.traits import TRAITS, PlantEntry, Trait, TraitsEntry, error_column
from fieldkit.vocabulary import LEAST_POSITIONS, NINE_IN_TEN
from fieldkit.wording import count

HEIGHT_ERROR_M = 0.03
"""Error of a height that nine in ten plots of the benchmark were within, metres (docs/traits.md)."""
_QUANTILE_ERROR_M = 0.035
"""The same of a quantile of height: of 24 on plots of rings and flights, V4 to V10, 21 were within."""
AREA_ERROR = 0.11
"""Error of an area that nine in ten plots of the benchmark were within, as a share (docs/traits.md)."""
VOLUME_ERROR = 0.14
"""The same of a volume."""
LAI_ERROR = 0.17
"""The same of a leaf area index; of clouds whose leaves sway, too."""
_GAPS_ERROR = 0.10
"""The same of covers by gaps between leaves, as a share of the root of what is and what is not covered, in pixels up to
the next one; more in coarser ones: from 12 m, in 3.6 mm, a cover of one half was up to 8 % off."""
_GAPS_PIXEL_M = 0.0025
"""What a pixel of the photographs covers at the plants there, metres."""
MOST_LAI_ERROR = 0.20
"""Error of a leaf area index, as a share, beyond which there is none."""
LEAST_PHOTOGRAPHS = 9
"""With fewer the errors above do not hold: of a plot of seven photographs the height was off by 0.33 m."""
MOST_SCALE_DOUBT = 0.10
"""Relative standard error of a scale beyond which there are no traits."""
MOST_GROUND_SHARE = 0.15
"""Error of the ground below the plot, as a share of the highest leaf's height, beyond which there are no heights."""
STILL_SCATTER_PX = 1.05
"""How far depths of still leaves scatter between views (`Reconstruction.scatter_px`). More is sway."""
SCATTER_OF_HEIGHT_M = 0.002
"""Sway from which errors of heights by the cloud grow with it, metres (docs/traits.md says on what it was fitted)."""
SCATTER_OF_TIPS_M = 0.005
"""Sway from which errors of heights that outlines show grow with it, metres."""
_OF_FILLING = 2.0
"""How many cells the seam is wider for every cell that outlines could be filled with less. Fitted on a real sorghum in
4 mm of wind: depths of its fine leaves scatter as if they swayed, but its edges are all there (docs/traits.md)."""
_SEAM_OF_FLIGHTS = 1.93
"""Width of the seam about still leaves where photographs of a flight overlap closely, in cells: they add up what each
has beyond a leaf's edge. Fitted with the next one on blocks at V6, V8 and V10 from 8 m (docs/traits.md)."""
_SEAM_SWAYED_OF_FLIGHTS = 0.155
"""What a metre of sway takes off it, metres."""
_MOST_SWAY_M = 0.020
"""Largest sway that it was fitted with, metres."""
NO_OUTLINE = "the plot's outline is not known: give --bounds, or draw the plot as a polygon"
_SEEN_BY = 2
"""Number of photographs that have to show a place."""
_SEEN_SHARE = 0.95
"""Least share of a plot's places that they show."""
_STEP_M = 0.05
"""Step between places of a plot, metres."""
_MOST_STEPS = 40
"""Most places along a side."""
_MATCH_DEG = (3.0, 36.0)
"""Angles beside it at which a photograph's partners stand for dense stereo to be right, degrees."""
_MATCH_FARTHER = 1.6
"""Largest ratio of their distances."""
_PARTNERS = 2
"""Least number of partners."""
_MOST_ANGLES = 2_000_000
"""Angles between rays that are held at once: 16 MB an array, for 9,600 places and 150 photographs had 1.7 GB."""
_MATCH_AT = (0.3, 0.8)
"""Heights at which places are looked at, as shares of the highest leaf's."""
_MATCH_SHARE = 0.9
"""Least share of places with partners."""
_QUANTILES: Mapping[Trait, float] = {"height_p95_m": 0.95, "height_p99_m": 0.99}
"""Shares of the canopy's upper surface that lie below a height."""
_OF_HEIGHT: tuple[Trait, ...] = ("height_m", *_QUANTILES, "canopy_volume_m3")
_OF_AREA: tuple[Trait, ...] = tuple(trait for trait in TRAITS if trait != "height_m")
_LOWER = 0.5
"""Mean height of leaves of such plants that a cloud lacks, by gaps between leaves, as a share of the others': they are
lower ones. Fitted on blocks at V14 and R1 (docs/traits.md)."""
_MOST_LACKED = 2.0
"""Ground below plants by gaps, in that of the cloud, up to which the cloud tells of it: on these blocks up to 1.7."""
_OF_LACKED = 0.5
"""Error of what is added or taken off for leaves that a cloud lacks, as a share of it."""
_NOT_OF_TALL: tuple[Trait, ...] = ("height_m", "lai")
"""Traits that clouds of such plants do not tell. The others they tell with gaps between leaves."""
_CODES: Mapping[str, tuple[Trait, ...]] = {
    "few-plant-points": TRAITS,
    PLOTS_TOGETHER: TRAITS,
    "height-undetermined": _OF_HEIGHT,
    "volume-cuts-plants": _OF_HEIGHT,
    "volume-below-ground": _OF_HEIGHT,
    "steep-ground": _OF_HEIGHT,
    "cameras-off-level": _OF_HEIGHT,
}
"""Traits that a finding of the reconstruction forbids."""


@dataclass(frozen=True)
class Calibration:
    """What traits of plots that are photographed alike were fitted with; as it is here, of photographs about a plot."""

    scatter_of_area_m: float = 0.005
    """Sway from which errors of areas, volumes and quantiles of height grow with it, metres."""
    finest_m: float = 0.0
    """Pixel of the depth maps below which errors of areas and volumes grow, metres: finer clouds, from near, have gaps.
    """
    pixel_of_tips_m: float = math.inf
    """Pixel from which errors of heights grow with it, metres."""
    adds_tips: bool = False
    """Whether clouds have false tips as well as lack some, so that the highest leaf may be as far below as above."""
    gaps_swayed: float = 1.0
    """Share of the sway by which wider gaps in leaves are closed."""
    widest_seam: float = math.inf
    """The widest seam that quantiles of height have, cells: a wider one takes tops off leaves."""
    of_slant: float = 0.0
    """What the error of the 99th percentile of height is larger by where all photographs look aside, as a share of it
    times the steepest one's squared cosine."""
    tallest_m: float = math.inf
    """99th percentile of height above which clouds lack leaves of lower layers and have false points above, metres."""


ABOUT_A_PLOT = Calibration()
OF_FLIGHTS = Calibration(
    scatter_of_area_m=0.010,
    finest_m=0.004,
    pixel_of_tips_m=0.0012,
    adds_tips=True,
    gaps_swayed=0.0,
    widest_seam=1.5,
    of_slant=0.08,
    tallest_m=1.8,
)
"""Photographs overlap closely. Of a block at V10 from 8 m, in 3.3 mm and still air, the cloud lacks 65 to 87 mm of the
highest leaf; at R1, 2.5 m high, a quarter of the cover, at V10, 1.4 m high, nothing of it. Looking 60° down the 99th
percentile was 3 to 6 cm too low on tuning blocks at V10."""


@dataclass(frozen=True)
class PlotOutline:
    """What is known of a plot's outline."""

    corners: Outline | None = None
    """Plot frame, metres; None where it is not known."""
    reason: str = NO_OUTLINE
    """Why it is not known."""
    of_flight: bool = False
    """Whether its photographs are of a flight over many plots: they overlap closely, and show neighbours, too."""
    cover: Cover | None = None
    """By gaps between leaves, where photographs of a flight show them."""


def outline_of(settings: ReconstructionSettings, reference: Mapping[str, Any] | None = None) -> PlotOutline:
    """The footprint of --bounds: of this run, else of the reference.

    ``reference`` is the ``settings`` of its reference.json, None without one.
    """
    bounds = settings.bounds
    if bounds is not None:
        return PlotOutline(rectangle(bounds.lower, bounds.upper))
    given = None if reference is None else reference.get("bounds")
    if isinstance(given, Mapping):
        return PlotOutline(rectangle(given["lower"], given["upper"]))
    return PlotOutline()


def plot_traits(
    found: Reconstruction, plants: Cloud, outline: PlotOutline, shown: Sequence[silhouettes.Outline] = ()
) -> tuple[TraitsEntry, tuple[PlantEntry, ...]]:
    """The traits of a plot, and its plants one by one.

    Args:
        plants: its plants, moved onto a reference where that was asked for.
        outline: of the plot; what lies beyond it is another plot's.
        shown: the plants' outlines in the photographs; empty where there are no masks.
    """
    corners, fitted = outline.corners, OF_FLIGHTS if outline.of_flight else ABOUT_A_PLOT
    own = plants if corners is None else plants.select(inside_outline(plants.points, corners))
    leaves, ground = own, found.sparse.frame.ground
    if outline.of_flight and corners is not None and ground is not None and len(own):
        sound = ground.heights(plants.points) <= floats_from_m(ground.heights(own.points))
        own, leaves = (plants.select(sound & of(plants.points, corners)) for of in (inside_outline, stands_in))
    points = own.points
    area = None if corners is None else outline_area_m2(corners)
    unknown = _unknown(found, points, outline)
    if ground is None or len(unknown) == len(TRAITS):
        return TraitsEntry(plot_area_m2=area, unknown=unknown), ()
    # By how much depths of leaves scatter beyond those of still ones.
    swayed_m = found.pixel_m * float(np.sqrt(max(0.0, found.scatter_px**2 - STILL_SCATTER_PX**2)))
    heights = ground.heights(points)
    upper = leaves.points if len(leaves) else points
    height = highest_leaf_m(upper, ground.heights(upper), found.pixel_m, swayed_m)
    shown_m, maybe_m = silhouettes.highest_shown_m(shown, ground, points, swayed_m)
    height = height if shown_m is None else max(height, shown_m)
    seam = _seam_of_flight(found, swayed_m) if outline.of_flight else _seam(found, shown, swayed_m)
    cells = found.pixel_m, fitted.gaps_swayed * swayed_m, seam

    @cache
    def from_above(seam: float) -> Canopy:
        whole = canopy(points, heights, *cells[:2], seam)
        return whole if corners is None else whole.within(corners)

    by_gaps = area * outline.cover.share if area and outline.cover else 0.0
    seen, upper_seen = from_above(seam), from_above(min(seam, fitted.widest_seam))
    tops_shown = upper_seen.heights_m(*_QUANTILES.values())
    tall = tops_shown[-1] > fitted.tallest_m
    more, more_above = (max(1.0, by_gaps / max(of.covered_m2, 1e-9)) if tall else 1.0 for of in (seen, upper_seen))
    # What a cloud lacks is lower than the highest hundredth and twentieth of all leaves.
    tops = upper_seen.heights_m(*(max(0.0, 1.0 - (1.0 - share) * more_above) for share in _QUANTILES.values()))
    of_height = SCATTER_OF_HEIGHT_M if shown_m is None else SCATTER_OF_TIPS_M
    of_height = max(1.0, swayed_m / of_height, found.pixel_m / fitted.pixel_of_tips_m)
    of_sway, of_leaves = (max(1.0, swayed_m / of.scatter_of_area_m) for of in (fitted, ABOUT_A_PLOT))
    of_pixel = max(1.0, found.pixel_m / FITTED_PIXELS_M[1], fitted.finest_m / found.pixel_m)
    lacked_m3 = _LOWER * (more - 1.0) * seen.volume_m3
    covered, volume = seen.covered_m2, seen.volume_m3 + lacked_m3
    cover = None if area is None else min(100.0, 100.0 * covered / area)
    lai = None if area is None else leaf_area_m2(own, seen, found.pixel_m) / area
    hidden = 1.0 - shown_share(lai or 0.0, found.sparse.right)
    doubt, ground_m = (NINE_IN_TEN * of for of in (scale_doubt(found.sparse), found.sparse.frame.ground_sigma_m))

    def off_m(error_m: float) -> float:
        return float(np.linalg.norm((error_m, doubt * height, ground_m)))

    def off(share: float, scales: float, of_sway: float = of_sway) -> float:
        return float(np.hypot(of_sway * of_pixel * share, scales * doubt))

    of_quantiles = np.hypot(off_m(of_sway * _QUANTILE_ERROR_M), _OF_LACKED * (tops_shown - tops))
    if not tall:
        steepest = min(pose.forward[2] for pose in found.sparse.poses.values())
        of_quantiles[-1] += fitted.of_slant * tops[-1] * (1.0 - steepest**2)
    values: dict[Trait, tuple[float | None, float]] = {
        "height_m": (max(0.0, height), off_m(of_height * HEIGHT_ERROR_M)),
        **{
            trait: (max(0.0, float(top)), float(error))
            for trait, top, error in zip(_QUANTILES, tops, of_quantiles, strict=True)
        },
        # The plot's area has the scale's error only where its outline is measured in the photographs, too.
        "cover_percent": (cover, off(AREA_ERROR, 2.0) * (cover or 0.0)),
        "covered_area_m2": (covered, off(AREA_ERROR, 2.0) * covered),
        "canopy_volume_m3": (
            volume,
            math.hypot(off(VOLUME_ERROR, 3.0) * volume, ground_m * covered, _OF_LACKED * lacked_m3),
        ),
        "lai": (lai, float(np.hypot(off(LAI_ERROR, 2.0, of_leaves), hidden)) * (lai or 0.0)),
    }
    if outline.cover and area:
        of_edges = _GAPS_ERROR * math.sqrt(by_gaps * (area - by_gaps))
        of_lines = max(max(1.0, found.gsd_m / _GAPS_PIXEL_M) * of_edges, area * outline.cover.error)
        off_m2 = math.hypot(of_lines, 2.0 * doubt * by_gaps)
        if tall or off_m2 < values["covered_area_m2"][1]:
            values["covered_area_m2"] = by_gaps, off_m2
            values["cover_percent"] = 100.0 * outline.cover.share, 100.0 * off_m2 / area
    if tall:
        reason = f"plants are higher than {fitted.tallest_m:g} m: leaves are missed from above, false ones float above"
        lost = (*_OF_HEIGHT, "lai") if more > _MOST_LACKED else _NOT_OF_TALL
        unknown = dict.fromkeys(lost if outline.cover else values, reason) | unknown
    known: dict[str, Any] = {}
    each: tuple[PlantEntry, ...] = ()
    if "plants" not in unknown:
        sure = not any("height_m" in _CODES.get(finding.code, ()) for finding in found.sparse.findings)

        def top_seen(points: FloatArray, top: float) -> bool:
            return sure and not any(_tops_missed(found.sparse, ground, _columns(points), top))

        each, counts, refused = plants_one_by_one(plants, ground, found.sparse.frame, corners, cells, top_seen)
        known, unknown = {**counts}, unknown | refused
    for trait, (value, error) in values.items():
        most = MOST_LAI_ERROR if trait == "lai" else 1.0  # of shares of what is there no lower limit is left
        if not trait.startswith("height") and value and error >= most * value:
            share = f"its error would be {100 * error / value:.0f} % of it"
            why = "hide one another, swayed" if trait == "lai" else "swayed"
            unknown.setdefault(trait, f"{share}, since leaves {why} or pixels are coarse")
        if trait not in unknown:
            known |= {trait: value, error_column(trait): error}
    if "height_m" in known:
        below = of_height if fitted.adds_tips or shown_m is not None else 1.0
        known["height_error_below_m"] = off_m(below * HEIGHT_ERROR_M)
        known["height_error_m"] = max(known["height_error_m"], (maybe_m or 0.0) - height)
    return TraitsEntry(**known, plot_area_m2=area, unknown=unknown), each


def _seam(found: Reconstruction, shown: Sequence[silhouettes.Outline], swayed_m: float) -> float:
    """Width of the seam about leaves, in cells: of swaying ones, more where the cloud fills their outlines, up to that
    of still ones.
    """
    swaying, still = seam_cells(found.pixel_m, swayed_m), seam_cells(found.pixel_m)
    if swaying == still or not shown:
        return swaying
    filling = silhouettes.filling_seam(shown, found.plants.measured().points, found.pixel_m)
    return min(still, swaying + _OF_FILLING * max(0.0, filling - swaying))


def _seam_of_flight(found: Reconstruction, swayed_m: float) -> float:
    """The same of photographs that overlap closely: the cloud has all that any of them shows."""
    return _SEAM_OF_FLIGHTS - _SEAM_SWAYED_OF_FLIGHTS * min(swayed_m, _MOST_SWAY_M) / found.pixel_m


def sways_m(found: Reconstruction) -> dict[str, float]:
    """How far leaves moved within each burst (`fieldkit.reconstruction.steady`), metres at the volume's centre."""
    sparse, sways = found.sparse, {}
    for photo in sparse.capture.photos:
        pose = sparse.poses.get(photo.name)
        if photo.sway_px is not None and pose is not None and sparse.frame.metric:
            away = float(np.linalg.norm(pose.center - found.volume.center))
            sways[photo.name] = photo.sway_px * away / sparse.intrinsics[photo.name].fx
    return sways


def scale_doubt(sparse: SparseResult) -> float:
    """By which share a model's scale may be off: `scale_error` of the cameras' places, with the RMS of the positions'
    residuals; else that of printed markers. 0 where nothing is known.

    Residuals are distances, so it is up to √3 times a standard error, which is per axis. That is on the safe side, and
    what the limits and the errors of traits were set by.
    """
    if sparse.frame.scale_error is not None:
        return sparse.frame.scale_error
    centers = sparse.centers if sparse.placed_by is None else sparse.placed_by
    if sparse.frame.rms_m is None or len(centers) < LEAST_POSITIONS:
        return 0.0
    return scale_error(centers, sparse.frame.rms_m, with_errors=False)


def _unknown(found: Reconstruction, points: FloatArray, outline: PlotOutline) -> dict[Trait, str]:
    """Why traits cannot be had; the first reason of each counts."""
    unknown: dict[Trait, str] = {}

    def without(traits: tuple[Trait, ...], reason: str) -> None:
        unknown.update({trait: reason for trait in traits if trait not in unknown})

    sparse = found.sparse
    frame, ground, right = sparse.frame, sparse.frame.ground, sparse.right
    if not frame.metric:
        without(TRAITS, "nothing gives the photographs' scale")
    elif (doubt := scale_doubt(sparse)) > MOST_SCALE_DOUBT:
        without(TRAITS, f"the scale is known to {100 * doubt:.0f} % only: the positions contradict one another")
    if right < LEAST_PHOTOGRAPHS:
        without(
            TRAITS,
            f"only {count(right, 'photograph counts', 'photographs count')}, and traits need {LEAST_PHOTOGRAPHS}",
        )
    if not len(points):
        without(TRAITS, "no plant was reconstructed within the plot's outline")
    if ground is None:
        without(TRAITS, "no ground was found, so plants and soil cannot be told apart")
    if unknown or ground is None:
        return unknown
    for finding in sparse.findings:
        without(_CODES.get(finding.code, ()), finding.message)
    seen = 1.0 if outline.corners is None else seen_share(sparse, _grid(outline.corners, ground))
    if seen < _SEEN_SHARE:
        reason = f"only {100 * seen:.0f} % of the plot is in the picture of {_SEEN_BY} photographs or more"
        without(_OF_AREA, reason)
    columns, top = _columns(points), float(ground.heights(points).max())
    if (ground_m := NINE_IN_TEN * frame.ground_sigma_m) > MOST_GROUND_SHARE * top:
        reason = f"the ground under the canopy is known to ± {ground_m:.2f} m only: fly the bare soil, or give --ground"
        without(_OF_HEIGHT, reason)
    for reason in _tops_missed(sparse, ground, columns, top):
        without(_OF_HEIGHT, reason)
    matched = matched_share(sparse, np.concatenate([ground.above(columns, z * top) for z in _MATCH_AT]))
    if matched < _MATCH_SHARE:
        reason = (
            f"over {100 * (1 - matched):.0f} % of the plants no photograph has two others near enough beside it "
            f"(within {_MATCH_DEG[1]:.0f}°), so leaves are missed"
        )
        without(TRAITS, reason)
    if outline.corners is None:
        without(("cover_percent", "lai"), outline.reason)
    return unknown


def _tops_missed(sparse: SparseResult, ground: Plane, columns: FloatArray, top: float) -> Iterator[str]:
    """Why leaves over ``columns`` (n, 2) may be higher than ``top``, the highest one that was found."""
    above = seen_share(sparse, ground.above(columns, with_room_m(top)))
    if above < _SEEN_SHARE:
        yield (
            f"above {100 * (1 - above):.0f} % of the plants the pictures end: higher leaves would not be seen "
            "(`fieldkit plan` leaves room)"
        )
    matched = matched_share(sparse, ground.above(columns, top))
    if matched < _MATCH_SHARE:
        yield (
            f"at the height of the highest leaf, over {100 * (1 - matched):.0f} % of the plants, no photograph has "
            f"two others near enough beside it (within {_MATCH_DEG[1]:.0f}°), so tips are missed"
        )


def seen_share(sparse: SparseResult, points: FloatArray) -> float:
    """Share of points (n, 3), plot frame, that at least two photographs that count have in the picture."""
    return float(np.mean(_in_pictures(sparse, points).sum(axis=1) >= _SEEN_BY))


def matched_share(sparse: SparseResult, points: FloatArray) -> float:
    """Share of points (n, 3), plot frame, that dense stereo can be right at: a photograph that has one in the picture
    has two others from 3 to 36 degrees beside it, about as far away, that have it, too.
    """
    centers = sparse.centers
    matched = 0
    for block in np.array_split(points, math.ceil(len(points) * len(centers) ** 2 / _MOST_ANGLES)):
        seen = _in_pictures(sparse, block)
        rays = block[:, None] - centers
        away = np.linalg.norm(rays, axis=2)
        rays /= away[:, :, None]
        angles = np.degrees(np.arccos(np.clip(np.einsum("nid,njd->nij", rays, rays), -1.0, 1.0)))
        farther = np.maximum(away[:, :, None] / away[:, None, :], away[:, None, :] / away[:, :, None])
        partners = (angles >= _MATCH_DEG[0]) & (angles <= _MATCH_DEG[1]) & (farther <= _MATCH_FARTHER)
        partners &= seen[:, :, None] & seen[:, None, :]
        matched += int((partners.sum(axis=2) >= _PARTNERS).any(axis=1).sum())
    return matched / len(points)


def _in_pictures(sparse: SparseResult, points: FloatArray) -> BoolArray:
    """Which of the photographs that count has a point in the picture: (n, photographs), in the order of the poses."""
    return np.stack([sparse.intrinsics[name].sees(points, pose) for name, pose in sparse.poses.items()], axis=1)


def _grid(outline: Outline, ground: Plane) -> FloatArray:
    """Places on the ground within an outline."""
    ring = np.array(outline)
    low, high = ring.min(axis=0), ring.max(axis=0)
    steps = np.clip(np.ceil((high - low) / _STEP_M), 2, _MOST_STEPS).astype(int)
    x, y = (a + (np.arange(n) + 0.5) / n * (b - a) for a, b, n in zip(low, high, steps, strict=True))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    inside = places[inside_outline(places, outline)]
    places = inside if len(inside) else ring.mean(axis=0, keepdims=True)
    return ground.above(places)


def _columns(points: FloatArray) -> FloatArray:
    """Places (m, 2) of the columns that plants stand in."""
    columns: FloatArray = (np.unique(np.floor(points[:, :2] / _STEP_M), axis=0) + 0.5) * _STEP_M
    return columns


_BEYOND_M = 0.75
"""Leaves of plants that stand no farther outside the outline are told from the plot's own: leaves reach as far."""
_TOP_M = 0.05
"""Height below a plant's highest point that is its top, metres."""
_OWN = 0.8
"""Least share of a top's points that are clearly nearest to the plant for it to be its own."""
_NO_ROWS = (
    f"the plants stand in no rows: there are fewer than {LEAST_PLANTS}, or no direction in which all stand in evenly "
    "spaced lines"
)


def plants_one_by_one(
    plants: Cloud,
    ground: Plane,
    frame: MetricFrame,
    outline: Outline | None,
    cells: tuple[float, float, float],
    top_seen: Callable[[FloatArray, float], bool],
) -> tuple[tuple[PlantEntry, ...], dict[str, int], dict[Trait, str]]:
    """The plants that stand on a plot, their counts, and why counts cannot be had.

    Args:
        plants: of the plot and its surroundings, plot frame.
        frame: the plot frame's place.
        outline: of the plot; None counts all plants.
        cells: of the canopy: what a pixel covers, and how far leaves swayed, metres; the seam, in cells.
        top_seen: whether photographs show what stands over places (n, 2) up to a height, with room above it.
    """
    if outline is not None:
        around = shapely.Polygon(outline).buffer(_BEYOND_M).exterior.coords[:-1]
        plants = plants.select(inside_outline(plants.points, tuple(around)))
    heights = ground.heights(plants.points)
    upright = np.column_stack([plants.points[:, :2], heights])  # on slopes, too, all feet are at one height
    on_plot = everywhere if outline is None else partial(inside_outline, outline=outline)
    apart = tell_apart(replace(plants, points=upright), on_plot)
    if apart.refused or apart.sure is None:
        why = f"the plants cannot be told apart: {apart.refused}"
        return (), {}, {"plants": why, "row_gaps": why}
    feet = apart.feet_m[:, :2]
    places = [dict[str, float]()] * len(feet)
    if frame.origin is not None:
        latitude, longitude, _ = frame.origin.to_geodetic(frame.plot_from_source.inverse().apply(ground.above(feet)))
        places = [
            {"latitude_deg": float(a), "longitude_deg": float(b)} for a, b in zip(latitude, longitude, strict=True)
        ]
    own = np.flatnonzero(on_plot(feet))
    rows = find_rows(feet[own])
    crowns = [canopy(upright[of], heights[of], *cells) for of in (apart.numbers == k + 1 for k in range(len(feet)))]
    touching = _touching(crowns)
    found = []
    order = np.lexsort((feet[own, 1], feet[own, 0]) if rows is None else (rows.in_row, rows.row))
    for number, i in enumerate(order, 1):
        k = int(own[i])
        row, in_row = (None, None) if rows is None else (int(rows.row[i]), int(rows.in_row[i]))
        of = apart.numbers == k + 1
        height = max(0.0, highest_leaf_m(upright[of], heights[of], *cells[:2]))
        top = of & (heights > height - _TOP_M)
        certain = top_seen(upright[of], height) and float(apart.sure[top].mean()) >= _OWN
        x, y = (float(v) for v in feet[k])
        found.append(
            PlantEntry(
                plant=number,
                row=row,
                in_row=in_row,
                x_m=x,
                y_m=y,
                **places[k],
                height_m=height,
                height_certain=certain,
                area_m2=crowns[k].covered_m2,
                touching=touching[k],
            )
        )
    counts = {"plants": len(found)} | ({} if rows is None else {"row_gaps": rows.gaps})
    return tuple(found), counts, {"row_gaps": _NO_ROWS} if rows is None else {}


def _touching(crowns: list[Canopy]) -> list[float]:
    """The share of each crown, seen from above, where another is in the same cell or in one of the eight about it."""
    import cv2

    cell = crowns[0].cell_m
    at = np.array([np.rint(np.divide(each.low, cell)) for each in crowns], dtype=np.int64)
    size = np.array([each.cover.shape[::-1] for each in crowns])
    at -= at.min(axis=0)
    columns, rows = (at + size).max(axis=0)
    masks = np.zeros((len(crowns), rows, columns), dtype=np.uint8)
    for mask, each, (left, low) in zip(masks, crowns, at, strict=True):
        mask[low : low + each.cover.shape[0], left : left + each.cover.shape[1]] = each.cover > 0
    wide = np.array([cv2.dilate(mask, np.ones((3, 3), np.uint8)) for mask in masks])
    beside = wide.sum(axis=0, dtype=np.int64)
    return [float(np.mean((beside - own > 0)[mask > 0])) for mask, own in zip(masks, wide, strict=True)]
