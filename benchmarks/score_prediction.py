"""Fit of the prediction of chamfer distances to simulated plots, and its check on others and on recorded plants."""

from __future__ import annotations

import itertools
import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.stats import spearmanr

from benchmarks.captures import rig_capture
from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.rigs import load_rig, perturb, uniform_subset
from benchmarks.scored_captures import FITTED, designs, make_captures, read_captures, stored_cloud
from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds import ReferenceIndex, crop, score
from fieldkit.errors import ReconstructionError, UsageError
from fieldkit.evaluation.conversion import plot_evaluation, reconstruction_features
from fieldkit.evaluation.prediction import (
    FLOORS,
    MODEL_FILE,
    RESTING_M,
    FeatureFit,
    Guard,
    PredictionModel,
    extrapolated,
    logarithm,
    plot_features,
    predict,
)
from fieldkit.evaluation.reference import Reference, build_reference
from fieldkit.files import write_atomic
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.evidence import evidence
from fieldkit.reconstruction.mapping.view_graph import EDGE_MATCHES
from fieldkit.reconstruction.pipeline import reconstruct
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import ReconstructionEntry
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

MODEL_VERSION = 2
"""Version of the package's prediction.json; raise it for a new fit."""
COVERAGE = 0.9
CANDIDATES = ("spread_m", "pose_rms_m", "noise_m", "cameras")
GUARDS = ("noise_m", "cameras")
"""Figures whose range limits predictions, even if the model does not use them."""
MOST_FEATURES, PLOTS_PER_FEATURE = 4, 10
BETTER = 0.95
"""A set with more figures must lower the error to this share of the best set with fewer."""
PENALTY = 1.0
"""Penalty of the ridge for a squared coefficient, in plots."""
RIGS = {"basil_rig": (10, 13), "arabidopsis_rig": (10, 13)}
_NOISE_M, _NOISE_DEG = 0.010, 1.0
_LEAST_SCENES = 3


@dataclass(frozen=True)
class Plot:
    """A plot with figures and truth."""

    name: str
    """Of the capture."""
    scene: str
    """Name; plots of one scene are left out together."""
    chamfer_m: float
    """Chamfer distance to the truth."""
    features: dict[str, float]
    """From `plot_features`."""


def run_score_prediction(
    folder: Path,
    *,
    data: Path | None = None,
    fitted: int = 6,
    held_out: int = 2,
    cache: StageCache,
    progress: Progress,
) -> StudyResult:
    """Fit to the tuning scenes; check on the cases and, if given, on the recorded rigs.

    Args:
        folder: of captures; missing ones are made and kept. Its fit/prediction.json is the model to ship.
        data: folder of the recorded sets, or None.
        fitted, held_out: captures of each scene; see `designs`.
    """
    make_captures(folder, designs(fitted, held_out), progress=progress)
    plots, refused = stored_plots(folder)
    known = [plot for plot in plots if plot.scene in FITTED]
    others = [plot for plot in plots if plot.scene not in FITTED]
    model, tried = fit(known)
    (folder / "fit").mkdir(exist_ok=True)
    write_atomic(folder / "fit" / MODEL_FILE, json.dumps(model.model_dump(mode="json"), indent=1) + "\n")
    real = [] if data is None else rig_plots(data, RIGS, cache=cache, progress=progress)
    groups = {"fitted scenes, each left out in turn": None, "held-out scenes": others, "recorded rigs": real}
    checks = {
        name: left_out(known, names(model)) if chosen is None else checked(chosen, model)
        for name, chosen in groups.items()
    }
    return StudyResult(
        name="score-prediction",
        title="Chamfer distance predicted without a reference",
        tables=(check_table(checks), model_table(model), plot_table([c for each in checks.values() for c in each])),
        notes=(
            f"{len(known)} plots of {len(FITTED)} scenes, {len(others)} of others; {refused} gave no cloud or figure.",
            "Truth: chamfer distance to the plants' true surface within the plot. Interval: nine in ten plots.",
            f"Figures chosen among {len(tried)} sets of up to {MOST_FEATURES} by the error of scenes left out.",
            *(() if data is not None else ("Without FIELDKIT_DATA the rigs are left out.",)),
        ),
        figures={
            "model": model.model_dump(mode="json"),
            "plots": [asdict(plot) for plot in (*plots, *real)],
            "checks": {name: [asdict(c) for c in each] for name, each in checks.items()},
            "refused": refused,
        },
    )


def stored_plots(folder: Path) -> tuple[list[Plot], int]:
    """Plots of stored captures with figures and truth, and the number of captures without."""
    plots, refused = [], 0
    for record, arrays in read_captures(folder):
        features = stored_features(record["plot"], arrays)
        if record["truth"] is None or isinstance(features, str):
            refused += 1
            continue
        plots.append(Plot(record["plot"]["name"], record["design"]["scene"], record["truth"]["chamfer_m"], features))
    return plots, refused


def stored_features(plot: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> dict[str, float] | str:
    """`plot_features` of a stored capture."""
    found = None
    if arrays and plot["plant_voxel_m"] is not None:
        poses = [Pose(r, c) for r, c in zip(arrays["rotations"], arrays["centers"], strict=True)]
        cameras = [
            Intrinsics.pinhole(int(width), int(height), float(focal))
            for focal, (width, height) in zip(arrays["focal_px"], arrays["size_px"], strict=True)
        ]
        seen = np.zeros((len(poses), len(arrays["sparse"])), dtype=np.int64)
        seen[arrays["tracks"][:, 1], arrays["tracks"][:, 0]] = 1
        groups = connected_components(seen @ seen.T >= EDGE_MATCHES, directed=False)[1].tolist()
        found = evidence(stored_cloud(arrays), poses, cameras, groups, plot["plant_voxel_m"])
    own = {name: plot[name] for name in ReconstructionEntry.model_fields if name in plot}
    return plot_features(ReconstructionEntry.model_construct(**own), found)


def fit(plots: Sequence[Plot]) -> tuple[PredictionModel, dict[tuple[str, ...], float]]:
    """Fit the model; its figures are chosen by leaving out one scene at a time.

    There are at most `MOST_FEATURES`, and one per `PLOTS_PER_FEATURE` plots; more figures must lower the error
    (`BETTER`).

    Returns:
        The model, and the root mean square error in log(chamfer_m) of every set of figures.
    """
    scenes = {plot.scene for plot in plots}
    if len(scenes) < _LEAST_SCENES:
        raise UsageError(f"a fit needs plots of {_LEAST_SCENES} scenes, not of {len(scenes)}")
    tried: dict[tuple[str, ...], float] = {}
    best: tuple[str, ...] = ()
    for count in range(1, max(1, min(MOST_FEATURES, len(plots) // PLOTS_PER_FEATURE)) + 1):
        sets = list(itertools.combinations(CANDIDATES, count))
        for chosen in sets:
            errors = [np.log(c.predicted_m / c.plot.chamfer_m) for c in _each_left_out(plots, chosen)]
            tried[chosen] = float(np.sqrt(np.mean(np.square(errors))))
        first = min(sets, key=lambda chosen: tried[chosen])
        if not best or tried[first] < BETTER * tried[best]:
            best = first
    return _fitted(plots, best, _half_width(plots, best)), tried


@dataclass(frozen=True)
class Check:
    """A plot's prediction and truth; with a ``reason`` if the prediction is refused."""

    plot: Plot
    predicted_m: float
    low_m: float
    high_m: float
    reason: str = ""

    @property
    def held(self) -> bool:
        """Whether the truth lies in the interval."""
        return self.low_m <= self.plot.chamfer_m <= self.high_m


def left_out(plots: Sequence[Plot], chosen: Sequence[str]) -> list[Check]:
    """Each scene's plots by a fit to the others, with the interval of the fit to all."""
    return _each_left_out(plots, chosen, _half_width(plots, chosen))


def checked(plots: Sequence[Plot], model: PredictionModel) -> list[Check]:
    """Plots by a fit without them; plots outside its range are refused."""
    found = []
    for plot in plots:
        prediction = predict(plot.features, model)
        if prediction.chamfer_m is None:
            found.append(_check(plot, model, prediction.reason))
        else:
            found.append(_check(plot, model))
    return found


def names(model: PredictionModel) -> tuple[str, ...]:
    """Names of its figures."""
    return tuple(feature.name for feature in model.features)


def _each_left_out(plots: Sequence[Plot], chosen: Sequence[str], half_width: float = 1.0) -> list[Check]:
    found = []
    for scene in dict.fromkeys(plot.scene for plot in plots):
        model = _fitted([plot for plot in plots if plot.scene != scene], chosen, half_width)
        found += [_check(plot, model) for plot in plots if plot.scene == scene]
    return found


def _half_width(plots: Sequence[Plot], chosen: Sequence[str]) -> float:
    """The ⌈(n + 1) · 0.9⌉-th smallest of the n errors of scenes left out, or the largest (Lei et al. 2018)."""
    errors = sorted(abs(np.log(c.predicted_m / c.plot.chamfer_m)) for c in _each_left_out(plots, chosen))
    rank = int(np.ceil((len(errors) + 1) * COVERAGE))
    return float(max(errors[min(rank, len(errors)) - 1], 1e-6))


def _fitted(plots: Sequence[Plot], chosen: Sequence[str], half_width: float) -> PredictionModel:
    x = np.array([[logarithm(name, plot.features[name]) for name in chosen] for plot in plots])
    y = np.log([plot.chamfer_m for plot in plots])
    mean, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-6)
    z = (x - mean) / scale
    coefficients = np.linalg.solve(z.T @ z + PENALTY * np.eye(len(chosen)), z.T @ (y - y.mean()))
    raw = [np.maximum([plot.features[name] for plot in plots], FLOORS[name]) for name in chosen]
    return PredictionModel(
        version=MODEL_VERSION,
        intercept=float(y.mean()),
        features=tuple(
            FeatureFit(
                name=name,
                coefficient=float(coefficients[k]),
                mean=float(mean[k]),
                scale=float(scale[k]),
                low=_lowest(name, raw[k]),
                high=float(raw[k].max()),
            )
            for k, name in enumerate(chosen)
        ),
        guards=tuple(_guard(plots, name) for name in GUARDS if name not in chosen),
        half_width=half_width,
        coverage=COVERAGE,
        plots=len(plots),
        scenes=tuple(dict.fromkeys(plot.scene for plot in plots)),
        chamfer_range_m=(float(np.exp(y.min())), float(np.exp(y.max()))),
    )


def _lowest(name: str, values: FloatArray) -> float:
    """Lower end of a figure's range; ``spread_m`` may be as small as possible: small place errors change nothing."""
    return RESTING_M if name == "spread_m" else float(values.min())


def _guard(plots: Sequence[Plot], name: str) -> Guard:
    values = [max(plot.features[name], FLOORS[name]) for plot in plots]
    return Guard(name=name, low=min(values), high=max(values))


def _check(plot: Plot, model: PredictionModel, reason: str = "") -> Check:
    """A prediction regardless of the range."""
    found = extrapolated(plot.features, model)
    assert found.chamfer_m is not None
    assert found.low_m is not None
    assert found.high_m is not None
    return Check(plot, found.chamfer_m, found.low_m, found.high_m, reason)


def check_table(checks: dict[str, list[Check]]) -> ResultTable:
    """Errors, coverage and order of each group."""
    rows: list[tuple[Cell, ...]] = []
    for name, each in checks.items():
        told = [check for check in each if not check.reason]
        if not told:
            rows.append((name, len(each), len(each), None, None, None, None, None))
            continue
        errors = np.array([abs(c.predicted_m - c.plot.chamfer_m) for c in told])
        ratios = np.array([c.predicted_m / c.plot.chamfer_m for c in told])
        order = None
        if len(told) > 2:
            ranked = spearmanr([c.predicted_m for c in told], [c.plot.chamfer_m for c in told]).statistic
            order = f"{ranked:.2f}" if np.isfinite(ranked) else None
        rows.append(
            (
                name,
                len(each),
                len(each) - len(told),
                f"{1000 * np.median(errors):.1f}",
                f"{100 * (np.exp(np.median(np.abs(np.log(ratios)))) - 1):.0f} %",
                f"{np.median(ratios):.2f}",
                f"{sum(c.held for c in told)} of {len(told)}",
                order,
            )
        )
    columns = (
        "plots",
        "number>",
        "refused>",
        "median error, mm>",
        "median factor off>",
        "predicted / true>",
        "in the interval>",
        "Spearman>",
    )
    return ResultTable("Predicted against true chamfer distance", columns, tuple(rows))


def model_table(model: PredictionModel) -> ResultTable:
    """The fit's figures."""
    rows: list[tuple[Cell, ...]] = [
        (f.name, f"{f.coefficient:+.2f}", f"{f.low:.3g}", f"{f.high:.3g}") for f in model.features
    ]
    wide = float(np.exp(model.half_width))
    title = f"The fit: interval ÷ and × {wide:.2f}, {model.plots} plots"
    return ResultTable(title, ("figure", "coefficient>", "least>", "greatest>"), tuple(rows))


def plot_table(checks: Sequence[Check]) -> ResultTable:
    """A row per plot."""
    rows: list[tuple[Cell, ...]] = [
        (
            c.plot.name,
            f"{1000 * c.plot.chamfer_m:.1f}",
            f"{1000 * c.predicted_m:.1f}",
            f"{1000 * c.low_m:.1f}–{1000 * c.high_m:.1f}",
            c.reason or ("yes" if c.held else "no"),
        )
        for c in sorted(checks, key=lambda c: c.plot.chamfer_m)
    ]
    return ResultTable(
        "Every plot, mm", ("plot", "true>", "predicted>", "nine in ten>", "inside, or why refused"), tuple(rows)
    )


def rig_plots(data: Path, sizes: Mapping[str, Sequence[int]], *, cache: StageCache, progress: Progress) -> list[Plot]:
    """Rings and arcs of few photographs of the recorded rigs, scored against the reference of all photographs."""
    plots = []
    for name, counts in sizes.items():
        rig = load_rig(data, name, cache=cache, progress=progress)
        with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
            place = Path(temporary) / "reference"
            build_reference(data / name / "images", place, context=Context(cache, progress), scene=False)
            reference = Reference(place)
            accuracy = float(np.hypot(_NOISE_M, rig.accuracy_m))
            for count in counts:
                ring, arc = uniform_subset(rig.names, count), rig.names[: 2 * count : 2]
                for kind, chosen in (("ring", ring), ("arc", arc)):
                    folder = Path(temporary) / f"{kind}-{count}"
                    rig_capture(folder, rig, chosen, perturb(rig.nominal, _NOISE_M, _NOISE_DEG, count), accuracy)
                    plot = recorded_plot(f"{name}, {kind} of {count}", name, folder, reference, cache)
                    if plot is None:
                        progress.note(f"{name}, {kind} of {count}: gives no prediction")
                    else:
                        plots.append(plot)
    return plots


def recorded_plot(name: str, scene: str, folder: Path, reference: Reference, cache: StageCache) -> Plot | None:
    """A capture reconstructed without the reference and scored against it; None without figures."""
    settings = ReconstructionSettings()
    try:
        found = reconstruct(read_capture(folder), settings, context=Context(cache))
    except ReconstructionError:
        return None
    entry = plot_evaluation(name, found, settings, score=None)
    features = reconstruction_features(found, entry)
    known = reference.known_plot()
    moved = known.source.from_source.after(found.sparse.frame.plot_from_source.inverse())
    own = crop(found.plants.transformed(moved), known.volume)
    if isinstance(features, str) or not len(own):
        return None
    return Plot(name, scene, score(ReferenceIndex(reference.cloud), own).chamfer.chamfer_m, features)
