"""fieldkit evaluate --plots: a flight over many plots, mapped once; a photograph counts for every plot it shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
import shapely.affinity

from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache, digest
from fieldkit.captures import Capture
from fieldkit.captures.bursts import by_station
from fieldkit.captures.selection import capture_of, find_photographs
from fieldkit.clouds.canopy import Outline
from fieldkit.clouds.volume import Volume
from fieldkit.errors import CaptureError, FieldkitError, MetadataError, ReconstructionError, StorageError
from fieldkit.evaluation.conversion import evaluation_report, failed_plot, flight_entry
from fieldkit.evaluation.evaluate import AllFailedError
from fieldkit.evaluation.evaluate_plot import (
    RESERVED,
    PlacedPlot,
    PlotCapture,
    Scoring,
    evaluate_plot,
    unforeseen,
    write_evaluation,
)
from fieldkit.evaluation.field import write_field
from fieldkit.evaluation.rasters import Rasters, coarse_place
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.evaluation.traits import PlotOutline
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.geometry import Similarity
from fieldkit.geometry.geodesy import plot_from_enu
from fieldkit.geometry.priors import SourceFrame
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.agreement import POSITION_SIGMAS
from fieldkit.reconstruction.colmap_model import model_points, track_lengths
from fieldkit.reconstruction.dense.views import views_of
from fieldkit.reconstruction.field_ground import FieldGround, grounds_under
from fieldkit.reconstruction.gaps import covers_by_gaps
from fieldkit.reconstruction.pipeline import WELL_SEEN, place_photographs
from fieldkit.reconstruction.result import SparseResult
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.steady import steady_capture
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.evaluation import EvaluationReport, FlightEntry, PlotEvaluation
from fieldkit.results.fields import clean_text
from fieldkit.results.finding import OUTLINE_UNSURE, Finding
from fieldkit.results.frame import Plane
from fieldkit.results.report_files import EVALUATION_FILE, REFERENCE_FILE
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Silent
from fieldkit.runtime.threads import limit_threads
from fieldkit.runtime.worker import NoWorkersError
from fieldkit.sites.plot_ids import plot_file_name
from fieldkit.sites.plots_file import drawn_outline, read_plots
from fieldkit.sites.site import SitePlot
from fieldkit.sites.vector_files import Ring
from fieldkit.vocabulary import LEAST_POSITIONS
from fieldkit.wording import count, listed

DrawnPlot = tuple[SitePlot, Ring | None]
"""A plot and its polygon (latitude, longitude), or None."""
MOST_VIEWS = 12
"""Number of photographs that a plot is reconstructed from, those that show it best, where each shows all of it."""
_MOST_NEAR_VIEWS = 40
"""The most where they show parts of it."""
_VIEWS_OF_PLACE = 9
"""Number of these that have nine in ten places of the plot in the picture: as many as of twelve from 8 m."""
_PLACES = 8
"""Number of places along each side of a plot."""
LEAST_VIEWS = 2
"""Least number of photographs that show a plot."""
_BESIDE_M = 0.3
"""Width of what is reconstructed about a plot's outline: leaves hang over it, metres."""
_BELOW_M = 0.1
"""Depth of a plot's volume below the ground, metres."""
_ABOVE_M = 0.4
"""Least room above the highest sparse points, metres: few lie on the tips of leaves."""
_ABOVE = 0.25
"""The same as a share of their height."""
_STANDING_M = 0.1
"""Height from which points are plants', metres: soil has most of them."""
_HIGHEST = 0.98
"""Quantile of the plants' points' heights which is theirs and not that of points amiss."""
_LEAST_POINTS = 20
"""Number of sparse points above a plot that tell its plants' height; else all of the flight do."""
_FARTHEST_M = 500.0
"""Distance from all photographs at which no plot of the file can be in one of them, metres."""
_SAME = 0.5
"""Share of a plot that another one covers from which both are hardly two plots."""
_UNSURE = "outlines may lie over neighbours' plants, unless they were drawn on this flight's own orthophoto"
"""What coarse positions mean for plots."""
_EVALUATION = "evaluation"
"""What a cached plot's figures are kept under, beside its files."""


@dataclass(frozen=True, eq=False)
class _Job:
    """A plot to be evaluated."""

    name: str
    outline: PlotOutline
    placed: PlacedPlot
    settings: ReconstructionSettings
    folder: Path
    """Of the result."""

    @property
    def place(self) -> str:
        """The plot's folder in it."""
        return plot_file_name(self.name, RESERVED)

    @property
    def key(self) -> str:
        """Digest of all that its evaluation depends on."""
        sparse = self.placed.sparse
        return digest(
            "plot of a flight",
            dict(STAGES),
            self.name,
            self.outline,
            self.placed.volume,
            self.placed.rows,
            self.settings,
            [photo.sha256 for photo in sparse.capture.photos],
            [image.model_dump_json() for image in sparse.images],
            sparse.poses,
            sparse.intrinsics,
            sparse.frame,
            [finding.stored() for finding in sparse.findings],
        )


def evaluate_flight(
    captures: Path | str,
    plots: Path | str,
    output: Path | str,
    settings: EvaluationSettings | None = None,
    context: Context | None = None,
    *,
    plot_id: str | None = None,
    ground: Path | str | None = None,
    overwrite: bool = False,
) -> EvaluationReport:
    """Map a flight once and evaluate every plot that it shows.

    Args:
        captures: folder of georeferenced photographs, also of several flights in subfolders, which become one model.
        plots: file of the plots as polygons, or as points with length and width.
        output: folder of the result: evaluation.json, plots.csv, traits.csv and, per plot, a folder with cloud.ply,
            cloud.laz (UTM) and photo.jpg; with rasters what `write_field` makes of the whole field.
        settings: choices; neither bounds nor refinement.
        context: None takes the usual cache and one process, and says nothing.
        plot_id: field of the plots' ids.
        ground: folder of an earlier flight over the bare soil, whose ground is that below closed canopies.
        overwrite: replace an earlier evaluation in ``output``.

    Returns:
        The report. Plots that failed or are not in the pictures are in it with their error.

    Raises:
        UsageError: ``output`` exists.
        InputError: there are no photographs, they have no place on Earth, or the plots lie elsewhere, twice or without
            an outline.
        ReconstructionError: the flight does not map.
        AllFailedError: every plot failed; the report is written all the same.
    """
    asked = settings or EvaluationSettings()
    chosen, rasters, spent = asked.reconstruction, asked.wanted_rasters, Spent.now()
    limit_threads()
    captures, plots, output = Path(captures), Path(plots), Path(output)
    context = replace(context or Context.usual(), seed=chosen.seed)
    with atomic_folder(output, overwrite=overwrite, marker=EVALUATION_FILE) as folder:
        file = read_plots(plots, plot_id)
        for line in file.told:
            context.progress.note(line)
        drawn = list(zip(file.plots, file.shapes, strict=True))
        results, flight = evaluate_plots(
            captures, plots, drawn, folder, chosen, context, ground=ground, rasters=rasters
        )
        report = evaluation_report(
            clean_text(captures.absolute().name),
            results,
            chosen,
            reference_sha256=None,
            refine=False,
            distances_m=asked.distances_m,
            spent=spent,
        )
        report = write_evaluation(folder, report.model_copy(update={"flight": flight}))
    if report.failed == len(report.plots):
        raise AllFailedError(report)
    return report


def evaluate_plots(
    captures: Path,
    file: Path,
    plots: Sequence[DrawnPlot],
    folder: Path,
    settings: ReconstructionSettings,
    context: Context,
    *,
    ground: Path | str | None = None,
    rasters: Rasters | None = None,
) -> tuple[list[PlotEvaluation], FlightEntry]:
    """The plots of a flight, each in a folder of its own below ``folder``, and what became of all photographs.

    Args:
        file: that the plots are from, for people.
        ground: as of `evaluate_flight`.
        rasters: of the whole field, to be written into ``folder``.
    """
    flights = [_read(Path(folder), settings, context) for folder in (captures, ground) if folder is not None]
    _check_plots(file, plots, flights[0])
    with ExitStack() as bursts:
        steady = [bursts.enter_context(steady_capture(flight, context)) for flight in flights]
        sparse, *bare = (_placed(flight, settings, context) for flight in steady)
        heading_deg = plots[0][0].row_heading_deg
        sparse = sparse.moved(Similarity(1.0, plot_from_enu(heading_deg), np.zeros(3)))
        frame = sparse.frame
        outlines = _outlines(plots, SourceFrame(frame.source, frame.origin, frame.plot_from_source))
        flight = flight_entry(sparse)
        reasons = "".join(f"; {number} {reason}" for reason, number in flight.unregistered.items())
        counted = count(flight.right, "photograph counts", "photographs count", of=flight.images)
        context.progress.note(f"{counted}, {flight.loose} of them loosely{reasons}")
        rows = {plot.name: row_outlines(outlines[plot.name], plot, heading_deg) for plot, _ in plots}
        results = _evaluated(sparse, next(iter(bare), None), outlines, rows, settings, folder.absolute(), context)
        if rasters is not None:
            picture = write_field(folder, sparse, outlines, results, rasters, context)
            flight = flight.model_copy(update={"picture": picture})
        return results, flight


def _read(folder: Path, settings: ReconstructionSettings, context: Context) -> Capture:
    """The photographs of a flight or of several, bursts by station, in a frame that has a place on Earth."""

    def skip(place: Path) -> bool:
        return any((place / name).is_file() for name in (EVALUATION_FILE, REFERENCE_FILE))

    found = find_photographs(folder, skip=skip, progress=context.progress)
    dates = sorted({taken.date().isoformat() for each in found.photos if (taken := each.photo.local_time) is not None})
    if len(dates) > 1:
        raise CaptureError(
            f"the photographs are of {len(dates)} dates, {dates[0]} to {dates[-1]}, and plants grow",
            path=folder,
            remedy="Give the flights of one date.",
        )
    capture = capture_of(found.photos)
    if capture.origin is None and sum(each.photo.geotag is not None for each in found.photos) >= LEAST_POSITIONS:
        capture = capture_of(found.photos, without=("poses.csv",))
    if capture.origin is None:
        raise MetadataError(
            "the photographs have no place on Earth, and so none among the plots",
            path=folder,
            remedy="Give photographs with GPS tags, a geo.txt beside them, or positions by `fieldkit geotag`.",
        )
    return by_station(replace(capture, findings=(*found.findings, *capture.findings)), settings.mask)


def _check_plots(path: Path, plots: Sequence[DrawnPlot], capture: Capture) -> None:
    """Refuse plots without an outline, twice the same, and such as are all elsewhere."""
    rings = _outlines(plots, SourceFrame(capture.metric_source or "", capture.origin, Similarity.identity()))
    bare = [plot.name for plot, _ in plots if plot.name not in rings]
    if bare:
        raise MetadataError(
            f"points without length_m and width_m: {listed(bare)}",
            path=path,
            remedy="Draw plots as polygons, or give both.",
        )
    names, shapes = list(rings), np.array([shapely.Polygon(ring) for ring in rings.values()])
    for one, other in shapely.STRtree(shapes).query(shapes, predicate="intersects").T:
        shared = shapely.area(shapely.intersection(shapes[one], shapes[other]))
        if one < other and shared > _SAME * min(shapes[one].area, shapes[other].area):
            raise MetadataError(
                f"{names[one]} and {names[other]} lie on one another",
                path=path,
                remedy="Give every plot a polygon of its own, and each only once.",
            )
    known = np.array([p.position[:2] for p in capture.priors.values() if p.position is not None])
    away_m = float(shapely.distance(shapely.MultiPoint(known), shapes).min())
    if away_m > _FARTHEST_M:
        raise MetadataError(
            f"the plots lie {away_m / 1000:,.1f} km and more from where the photographs were taken",
            path=path,
            remedy="Give the plots of this flight, and check their coordinate system.",
        )


def _placed(capture: Capture, settings: ReconstructionSettings, context: Context) -> SparseResult:
    sparse, times = place_photographs(capture, settings, context)
    if known := sum(time.cached for time in times):
        context.progress.note(f"features of {count(known, 'photograph')} are kept from an earlier run")
    if sparse.frame.origin is None:
        raise ReconstructionError(
            "the model contradicts the photographs' GPS, so it has no place among the plots",
            path=capture.folder,
            registered=sparse.registered,
            right=sparse.right,
            remedy="Check the photographs' positions, and that all are of one flight.",
        )
    return sparse


def _outlines(plots: Sequence[DrawnPlot], source: SourceFrame) -> dict[str, Outline]:
    """The corners of those with an outline, in the plot frame that a source frame leads into."""
    corners = {plot.name: drawn_outline(plot, shape, source) for plot, shape in plots}
    return {name: ring for name, ring in corners.items() if ring is not None}


def row_outlines(corners: Outline, plot: SitePlot, heading_deg: float) -> tuple[Outline, ...]:
    """A plot's outline cut along its rows, one part for each, from right to left as one looks along them; empty where
    the plot has one row, or does not say how far apart they are.

    Args:
        corners: of the plot, plot frame.
        heading_deg: compass heading of that frame's x axis.
    """
    rows = 0 if plot.size_m is None or not plot.row_spacing_m else round(plot.size_m[1] / plot.row_spacing_m)
    if rows < 2:
        return ()
    turn, whole = heading_deg - plot.row_heading_deg, shapely.Polygon(corners)
    along = shapely.affinity.rotate(whole, -turn, origin=(0.0, 0.0))
    left, low, right, high = along.bounds
    parts = (shapely.box(left, a, right, b) for a, b in pairwise(np.linspace(low, high, rows + 1)))
    turned = (shapely.affinity.rotate(part.intersection(along).convex_hull, turn, origin=(0.0, 0.0)) for part in parts)
    return tuple(tuple((float(x), float(y)) for x, y in part.exterior.coords[:-1]) for part in turned)


def plot_volume(corners: Outline, points: FloatArray, ground: Plane | None) -> Volume:
    """The volume of a plot of a flight: its outline's box and what hangs over it, from below the ground to above the
    highest plants that the sparse points (n, 3) show there.
    """
    low, high = np.min(corners, axis=0) - _BESIDE_M, np.max(corners, axis=0) + _BESIDE_M
    feet = np.quantile(points[:, 2:], 0.0, axis=0) if ground is None else ground.above(np.array(corners))[:, 2]
    heights = points[:, 2] - feet.min() if ground is None else ground.heights(points)
    standing = heights > _STANDING_M
    own = standing & ((points[:, :2] >= low) & (points[:, :2] <= high)).all(axis=1)
    plants = own if own.sum() >= _LEAST_POINTS else standing
    above = float(np.quantile(heights[plants], _HIGHEST)) if plants.any() else 0.0
    top = float(feet.max()) + above + max(_ABOVE_M, _ABOVE * above)
    return Volume((*low.tolist(), float(feet.min()) - _BELOW_M), (*high.tolist(), top))


def plot_views(sparse: SparseResult, volume: Volume) -> tuple[str, ...]:
    """The photographs that a plot is reconstructed from, best first: more from near, where each shows a part of it."""
    names = views_of(sparse.poses, sparse.intrinsics, volume, _MOST_NEAR_VIEWS)
    if len(names) <= MOST_VIEWS:
        return names
    x, y = (np.linspace(low, high, _PLACES) for low, high in zip(volume.lower[:2], volume.upper[:2], strict=True))
    places = np.stack(np.meshgrid(x, y, volume.center[2]), axis=-1).reshape(-1, 3)
    seen = [sparse.intrinsics[name].sees(places, sparse.poses[name]) for name in names]
    of_place = np.quantile(np.cumsum(seen, axis=0).reshape(len(names), -1), 0.1, axis=1)
    return names[: max(MOST_VIEWS, int((of_place < _VIEWS_OF_PLACE).sum()) + 1)]


def _ground(sparse: SparseResult, points: FloatArray, settings: ReconstructionSettings) -> FieldGround | None:
    return FieldGround.of(points, sparse.poses, track_lengths(sparse.model) >= WELL_SEEN, seed=settings.seed)


def _grounds(
    sparse: SparseResult,
    own: FieldGround | None,
    bare: SparseResult | None,
    outlines: Sequence[Outline],
    settings: ReconstructionSettings,
) -> list[tuple[Plane, float] | None]:
    """The ground below each plot and the standard deviation of its height, by a flight and an earlier one, ``bare``."""
    corners = [np.array(outline) for outline in outlines]
    if bare is None:
        return grounds_under(corners, own, None)
    bound_m = [flight.frame.bound_m or 0.0 for flight in (sparse, bare)]
    there = bare.moved(motion_onto(bare, sparse))
    earlier = _ground(there, model_points(there.model), settings)
    return grounds_under(corners, own, earlier, math.hypot(*bound_m) / POSITION_SIGMAS)


def motion_onto(bare: SparseResult, sparse: SparseResult) -> Similarity:
    """The rigid motion from the plot frame of one flight into that of another, by their places on Earth."""
    assert bare.frame.origin is not None
    assert sparse.frame.origin is not None
    places = 100.0 * np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
    latitude, longitude, altitude = bare.frame.origin.to_geodetic(bare.frame.plot_from_source.inverse().apply(places))
    there = sparse.frame.plot_from_source.apply(sparse.frame.origin.to_local(latitude, longitude, altitude))
    fitted = fit_similarity(places, there)
    return Similarity(1.0, fitted.rotation, fitted.translation)


def _evaluated(
    sparse: SparseResult,
    bare: SparseResult | None,
    outlines: dict[str, Outline],
    rows: dict[str, tuple[Outline, ...]],
    settings: ReconstructionSettings,
    folder: Path,
    context: Context,
) -> list[PlotEvaluation]:
    """The plots in order; parallel by plots where there are workers."""
    points = model_points(sparse.model)
    own = _ground(sparse, points, settings)
    grounds = _grounds(sparse, own, bare, list(outlines.values()), settings)
    points = own.points if own is not None and len(own.points) >= _LEAST_POINTS else points
    if unsure := coarse_place(sparse.frame, _UNSURE):
        context.progress.note(unsure)
    known = {name: ground or (None, 0.0) for name, ground in zip(outlines, grounds, strict=True)}
    below = {name: (known[name][0], (corners, *rows[name])) for name, corners in outlines.items()}
    with context.progress.stage("Gaps between leaves", len(sparse.poses)) as advance:
        covers = covers_by_gaps(sparse, below, settings.mask, advance)
    jobs: list[_Job] = []
    results: dict[str, PlotEvaluation] = {}
    for name, corners in outlines.items():
        ground, sigma_m = known[name]
        volume = plot_volume(corners, points, ground)
        views = plot_views(sparse, volume)
        if len(views) < LEAST_VIEWS:
            error = CaptureError("is not in the pictures", remedy="Fly over it, or leave it out of the plots.")
            results[name] = failed_plot(name, error, photographs=len(views))
        else:
            part = sparse.of(views)
            told = (*part.findings, *([Finding(name, OUTLINE_UNSURE, unsure)] if unsure else []))
            part = replace(part, frame=replace(part.frame, ground=ground, ground_sigma_m=sigma_m), findings=told)
            whole, *parts = (
                PlotOutline(ring, of_flight=True, cover=cover)
                for ring, cover in zip(below[name][1], covers[name], strict=True)
            )
            jobs.append(_Job(name, whole, PlacedPlot(part, volume, tuple(parts)), settings, folder))
    if results:
        context.progress.note(f"not in the pictures: {', '.join(results)}")
    weights = [float(len(job.placed.sparse.poses) * np.prod(job.placed.volume.size[:2])) for job in jobs]
    alone = Context(context.cache, Silent(), seed=context.seed)
    with context.progress.stage("Plots", len(jobs), weights=weights) as advance:
        for job, wait in _started(jobs, alone, context):
            results[job.name] = result = _result(job, wait)
            said = result.error.message if result.error is not None else count(result.points, "point")
            context.progress.note(f"{job.name}: {count(result.images, 'photograph')}, {said}")
            advance(1)
    return [results[name].model_copy(update={"outline": corners}) for name, corners in outlines.items()]


def _started(
    jobs: Sequence[_Job], alone: Context, context: Context
) -> Iterator[tuple[_Job, Callable[[], PlotEvaluation]]]:
    """The jobs, as they are done where there are workers, and what gives their results."""
    if context.workers == 1 and not context.scheduler:
        yield from ((job, partial(_plot, job, alone)) for job in jobs)
        return
    with context.executor() as executor:
        futures = {executor.submit(_plot, job, alone): job for job in jobs}
        yield from ((futures[future], future.result) for future in as_completed(futures))


def _result(job: _Job, wait: Callable[[], PlotEvaluation]) -> PlotEvaluation:
    """A plot's evaluation; one plot must not stop the others."""
    try:
        return wait()
    except (StorageError, NoWorkersError):
        raise
    except Exception as error:
        known = error if isinstance(error, FieldkitError) else unforeseen(error)
        return failed_plot(job.name, known, photographs=len(job.placed.sparse.poses))


def _plot(job: _Job, context: Context) -> PlotEvaluation:
    """Evaluate a plot and write its folder; both from the cache where they are there."""
    key, place = job.key, job.folder / job.place
    kept = context.cache.get("plots", key)
    if kept is not None:
        result = PlotEvaluation.model_validate_json(kept.pop(_EVALUATION).tobytes())
        place.mkdir()
        for name, data in kept.items():
            write_atomic(place / name, data.tobytes())
        return result
    sparse = job.placed.sparse
    plot = PlotCapture(
        sparse.capture,
        Scoring(None, None, refine=False, distances_m=()),
        outline=job.outline,
        placed=job.placed,
    )
    read, photographs = (lambda: plot), len(sparse.poses)
    # The whole plot is kept, so its depth maps, a gigabyte for every few plots, are not.
    apart = replace(context, cache=StageCache(None))
    result = evaluate_plot(job.name, read, job.folder, job.place, job.settings, apart, photographs=photographs)
    if result.error is None:
        files = {path.name: path.read_bytes() for path in sorted(place.iterdir())}
        files[_EVALUATION] = result.model_dump_json().encode()
        context.cache.put("plots", key, {name: np.frombuffer(data, dtype=np.uint8) for name, data in files.items()})
    return result
