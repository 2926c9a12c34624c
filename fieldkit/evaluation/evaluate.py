"""fieldkit evaluate: new captures, reconstructed in a reference's frame and scored against it."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

from fieldkit.captures import read_capture
from fieldkit.captures.bursts import by_station
from fieldkit.captures.folder import list_capture, natural_key
from fieldkit.captures.programs import PosesFile
from fieldkit.errors import CaptureError, ReconstructionError, StorageError, UsageError
from fieldkit.evaluation.adherence import ComparedPlan, LoggedFlight
from fieldkit.evaluation.cloud_reference import (
    AnyReference,
    CloudReference,
    known_plot_of,
    open_reference,
    reference_file,
)
from fieldkit.evaluation.conversion import evaluation_report, failed_plot
from fieldkit.evaluation.evaluate_plot import (
    RESERVED,
    PlotCapture,
    Scoring,
    evaluate_plot,
    unforeseen,
    write_evaluation,
)
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.files import atomic_folder
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import EvaluationReport, PlotEvaluation
from fieldkit.results.fields import clean_text
from fieldkit.results.plan_file import load_plan
from fieldkit.results.report_files import EVALUATION_FILE, file_sha256
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.threads import limit_threads
from fieldkit.runtime.worker import NoWorkersError
from fieldkit.sites.plot_ids import plot_file_name


class AllFailedError(ReconstructionError):
    """None of several plots was reconstructed.

    Args:
        report: as it was written.
    """

    def __init__(self, report: EvaluationReport) -> None:
        first = report.plots[0]
        assert first.error is not None
        super().__init__(
            f"none of {len(report.plots)} plots was reconstructed; {first.name}: {first.error.message}",
            remedy=first.error.remedy,
        )
        self.report = report


def evaluate(
    captures: Path | str,
    output: Path | str,
    settings: EvaluationSettings | None = None,
    context: Context | None = None,
    *,
    reference: Path | str | None = None,
    reference_frame: str = "",
    log: Path | str | None = None,
    plan: Path | str | None = None,
    poses: PosesFile | None = None,
    reconstruction: ReconstructionSettings | None = None,
    overwrite: bool = False,
) -> EvaluationReport:
    """Reconstruct and score captures of one plot or of many.

    Args:
        captures: a folder of photographs, or a folder of such folders (one per plot); never written to.
        output: folder of the result: evaluation.json, plots.csv, traits.csv and, per plot, a folder with cloud.ply.
        settings: choices; None takes the defaults. Bounds default to the reference's volume.
        context: None takes the usual cache and one process, and says nothing.
        reference: folder that `build_reference` wrote, or a cloud (PLY, LAS, LAZ); None gives figures that need none.
        reference_frame: of a cloud, as `open_reference` takes it.
        log: flight log; the photographs' poses are then those of the triggers they match, and not those of poses.csv,
            geo.txt or GPS.
        plan: that was flown, on the reference's plot: the report says how the photographs kept to it.
        poses: that another program found, of all plots; None takes what lies beside each one's photographs.
        reconstruction: all that a reconstruction can be told, in place of what ``settings`` say of it.
        overwrite: replace an earlier evaluation in ``output``.

    Returns:
        The report; plots that failed are in it with their error, and do not stop the others.

    Raises:
        UsageError: ``output`` exists, or ``plan`` is given with a log, but no georeferenced reference, or
            ``poses`` with a log.
        InputError: there are no captures, or the log or the reference cannot be used. With a single plot its own error
            is raised.
        AllFailedError: every plot failed; the report is written all the same.

    Example:
        >>> evaluate("flight_7", "scores", EvaluationSettings(fidelity="draft")).plots[0].traits
    """
    asked = settings or EvaluationSettings()
    chosen, rasters = reconstruction or asked.reconstruction, asked.wanted_rasters
    limit_threads()
    captures, output = Path(captures), Path(output)
    reference, log, plan = (None if each is None else Path(each) for each in (reference, log, plan))
    context, spent = replace(context or Context.usual(), seed=chosen.seed), Spent.now()
    progress = context.progress
    if poses is not None and log is not None:
        raise UsageError("poses come from a flight log or from another program", remedy="Give --log or --poses.")
    with atomic_folder(output, overwrite=overwrite, marker=EVALUATION_FILE) as folder:
        plots, empty = find_plots(captures)
        if empty:
            progress.note(f"passed over, for there are no photographs in them: {', '.join(empty)}")
        read = None if reference is None else open_reference(reference, reference_frame, chosen.bounds)
        for finding in read.findings if isinstance(read, CloudReference) else ():
            progress.note(finding.message)
        flight = None if log is None else LoggedFlight.read(log, plots)
        flown = None if plan is None else ComparedPlan(load_plan(plan), _place(read), flight)
        scoring = Scoring.against(read, refine=asked.refine, distances_m=asked.distances_m)

        def given(name: str, path: Path) -> PlotCapture:
            by_log = None if flight is None else flight.capture(name)
            read_alone = read_capture(path, poses=poses) if by_log is None else by_log
            capture = by_station(read_alone, chosen.mask)
            return PlotCapture(capture, scoring, known_plot_of(read, capture), rasters=rasters, flown=flown)

        def evaluated(name: str, path: Path) -> PlotEvaluation:
            alone, begun = len(plots) == 1, Spent.now()
            try:
                return evaluate_plot(
                    name,
                    partial(given, name, path),
                    folder,
                    plot_file_name(name, RESERVED),
                    chosen,
                    context,
                    alone=alone,
                )
            except Exception as error:
                if alone or isinstance(error, StorageError | NoWorkersError):
                    raise
                failure = unforeseen(error)
                progress.note(f"{name}: {failure}")
                return failed_plot(name, failure, spent=begun)

        results = []
        with progress.stage("Plots", len(plots)) if len(plots) > 1 else nullcontext(lambda _: None) as advance:
            for name, path in plots:
                results.append(evaluated(name, path))
                advance(1)
        report = evaluation_report(
            Path(captures).absolute().name,
            results,
            chosen,
            reference_sha256=None if reference is None else file_sha256(reference_file(reference)),
            reference_frame=reference_frame if isinstance(read, CloudReference) else None,
            refine=asked.refine,
            distances_m=asked.distances_m,
            spent=spent,
        )
        report = write_evaluation(folder, report)
    if report.failed == len(report.plots):
        raise AllFailedError(report)
    return report


def _place(reference: AnyReference | None) -> SourceFrame | None:
    """The frame of a plan that was made on a reference."""
    if isinstance(reference, CloudReference):
        return SourceFrame("poses.csv", reference.origin, reference.from_source)
    return None if reference is None else reference.known_plot().source


def find_plots(captures: Path) -> tuple[list[tuple[str, Path]], list[str]]:
    """Names and folders of the plots, and the names of the subfolders that were passed over; names as text.

    A folder that holds photographs is one plot; else its subfolders are the plots.

    Photographs in ``captures/images``, or in a card's 100MEDIA and 101MEDIA, make ``captures`` one plot. Subfolders
    without any image file are passed over; one that cannot be read, or whose images cannot be used, still counts, so
    that it is reported. So does the folder itself where no subfolder counts.
    """
    captures = Path(captures)
    itself = [(clean_text(captures.absolute().name), captures)]
    contents = list_capture(captures)
    if contents.candidates:
        return itself, []
    folders = sorted(
        (p for p in captures.iterdir() if p.is_dir() and not p.name.startswith(".")), key=lambda p: natural_key(p.name)
    )
    plots = [(clean_text(folder.name), folder) for folder in folders if _holds_images(folder)]
    if not plots and any(finding.left_out for finding in contents.findings):
        return itself, []  # reading it says what is wrong with each file
    if not plots:
        raise CaptureError(
            "there are no photographs in this folder, nor in its subfolders",
            path=captures,
            remedy="Give a folder of photographs, or a folder with one folder of photographs per plot.",
        )
    counted = {folder for _, folder in plots}
    return plots, [clean_text(folder.name) for folder in folders if folder not in counted]


def _holds_images(folder: Path) -> bool:
    try:
        contents = list_capture(folder)
    except CaptureError:
        return True  # reading it says what is wrong
    return bool(contents.candidates) or any(finding.left_out for finding in contents.findings)
