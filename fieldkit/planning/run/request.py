"""From what a person asks to a run's settings: its defaults, and what may change when a run is resumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fieldkit.captures import read_capture
from fieldkit.captures.camera_file import read_camera_file
from fieldkit.documents.json_file import first_problem
from fieldkit.errors import MetadataError, UsageError
from fieldkit.evaluation.reference import Reference
from fieldkit.geometry import Intrinsics
from fieldkit.planning.methods.registry import METHODS, MethodEntry, method_entry
from fieldkit.planning.plan_settings import EnvelopeSettings, NoiseSettings, PlanSettings, SearchChoices
from fieldkit.planning.run.flyable import OUTDOORS_ENVELOPE, filled, flight_noise, read_vehicle, vehicle_envelope
from fieldkit.planning.settings import CHANGEABLE, GivenPlot, SearchSettings, lag_for, unchanging
from fieldkit.results.plan import PlanSource
from fieldkit.results.report_files import REFERENCE_FILE, file_sha256
from fieldkit.scenes.library import find_scene, scene_reference
from fieldkit.version import __version__

KIND_CONFIRMED: dict[str, dict[str, int]] = {
    "ring": {"finalists": 1, "repeats": 3},
    "score": {"finalists": 3, "repeats": 3},
}
"""Plots differ by more than good sets do, so sets are confirmed on several plots."""
RECORDED_CONFIRMED: dict[str, int] = {"finalists": 6, "repeats": 6}
"""The withheld matches change a value by more than sets differ; evaluations are cheap."""
_OF_SEARCHES = {"method", "evaluations", "fidelity"}
KIND_PLOTS = 8
"""Plots of a kind that a plan is for where nobody says how many."""


def describe_sources(asked: PlanSettings) -> tuple[GivenPlot, ...]:
    """The plots that a plan is asked for. Raises UsageError: they do not go together."""
    asked.check_sources()
    if asked.captures is not None and asked.recorded:
        folder = asked.captures.resolve()
        read_capture(folder)
        source = PlanSource(kind="captures", name=folder.name)
        reference_path = str(asked.reference[0].resolve()) if asked.reference else None
        return (GivenPlot(source=source, path=str(folder), reference_path=reference_path),)
    plots: list[GivenPlot] = []
    for scene in asked.scene:
        file = find_scene(scene)
        source = PlanSource(kind="scene", name=file.name, sha256=file_sha256(file))
        plots.append(GivenPlot(source=source, path=str(scene_reference(file))))
    for reference, images in zip_longest(asked.reference, asked.images):
        folder = (reference.parent if reference.is_file() else reference).resolve()
        Reference(folder)
        source = PlanSource(kind="reference", name=folder.name, sha256=file_sha256(folder / REFERENCE_FILE))
        own = None if images is None else str(images.resolve())
        plots.append(GivenPlot(source=source, path=str(folder), images_path=own))
    return tuple(plots)


def search_settings(
    asked: PlanSettings, *, methods: Mapping[str, MethodEntry] = METHODS, workers: int = 1
) -> SearchSettings:
    """The settings of a new run.

    Plans for a kind expect a flight's noise of poses, wind and the vehicle's wash, and stations as a vehicle can keep
    them, or with the preset "paper" exact poses, still air and nearer stations. A vehicle's limits and camera hold
    where nothing is asked. Without a method and without settings of a search, the method is `ring`, with the preset
    "paper" `score`; among recorded photographs it is `field`.

    Args:
        asked: by a person.
        methods: by name, as `plan` takes them.
        workers: number of processes, by which proposals run ahead of results.

    Raises:
        UsageError: it contradicts itself, or leaves the vehicle's limits.
        InputError: the source, the vehicle or the camera cannot be used.
    """
    plots_given, given = describe_sources(asked), asked.model_fields_set
    recorded = asked.recorded
    method = asked.method if recorded or _searches(asked) else "ring" if asked.preset == "outdoors" else "score"
    by_score = method_entry(method, methods).by_score
    plots = _plots(asked, method, len(plots_given), for_a_kind=by_score)
    if recorded and (asked.envelope.model_fields_set or asked.vehicle or asked.camera):
        raise UsageError(
            "recorded photographs have their places and their camera: limits, a vehicle and a camera change nothing",
            remedy="Leave them out, or plan on --reference or --scene.",
        )
    flyer, record = (None, None) if asked.vehicle is None else read_vehicle(asked.vehicle)
    camera = None if flyer is None else flyer.camera
    if asked.camera is not None:
        camera = _camera(asked.camera)
    # Recorded photographs have fixed places.
    flown = plots > 1 and not recorded and asked.preset == "outdoors"
    noise = filled(asked.noise, flight_noise(flyer) if flown else NoiseSettings())
    confirmed = _confirmations(plots, method, recorded=recorded, exact=unchanging(plots_given[0].source, noise))
    own = {name: getattr(asked, name) for name in given & SearchChoices.model_fields.keys()}
    try:
        usual = SearchSettings(
            fieldkit=__version__,
            given=plots_given,
            camera=camera,
            vehicle=record,
            plots=plots,
            # Else the cloud's random shift would outweigh the cameras' places.
            refine=plots > 1 and noise.pose_m > 0,
            lag=lag_for(workers),
        )
        limits = (
            filled(asked.envelope, OUTDOORS_ENVELOPE if flown else EnvelopeSettings())
            if flyer is None
            else vehicle_envelope(flyer, asked.envelope)
        )
        settled = {"method": method, "plots": plots, "noise": noise, "envelope": limits}
        return SearchSettings.model_validate(dict(usual) | confirmed | own | settled)
    except ValidationError as error:
        raise UsageError(first_problem(error), remedy="`fieldkit plan --help` explains the options.") from error


def _confirmations(plots: int, method: str, *, recorded: bool, exact: bool) -> dict[str, int]:
    """Numbers of finalists and of repeats, where nobody gives them and they are not the usual ones."""
    if plots == 1:
        return {"repeats": 1} if exact else {}
    return RECORDED_CONFIRMED if recorded else KIND_CONFIRMED.get(method, {})


def _searches(asked: PlanSettings) -> bool:
    """Whether a plan is searched for: it is for one plot, or a method or settings of a search are given."""
    given = asked.model_fields_set
    return asked.purpose == "this-plot" or ("plots" in given and asked.plots < 2) or not given.isdisjoint(_OF_SEARCHES)


def _plots(asked: PlanSettings, method: str, given: int, *, for_a_kind: bool) -> int:
    """Number of plots that a plan is for."""
    if asked.purpose == "this-plot":
        if given > 1:
            raise UsageError(f"--for this-plot, and {given} are given", remedy="Give one, or leave --for out.")
        if asked.plots > 1:
            raise UsageError(f"--vary {asked.plots} plans for more than this plot", remedy="Give --for or --vary.")
        return 1
    if given > 1 and not for_a_kind:
        raise UsageError(
            f"{method} plans for one plot, and {given} are given",
            remedy=f"Give one, or choose one of {', '.join(name for name in METHODS if METHODS[name].by_score)}.",
        )
    if "plots" in asked.model_fields_set:
        return asked.plots
    return max(given, KIND_PLOTS if asked.purpose == "kind" or for_a_kind else 1)


def resumed_settings(settings: SearchSettings, asked: PlanSettings) -> SearchSettings:
    """The settings to resume with: the run's own, with what is asked where it may change; its preset changes nothing.

    Raises UsageError: the run did not begin with what is asked.
    """
    began = dict(settings) | dict(settings.noise) | dict(settings.envelope)
    wanted: dict[str, Any] = {}
    for part in (asked, asked.noise, asked.envelope):
        wanted |= {key: getattr(part, key) for key in type(part).model_fields if key in part.model_fields_set}
    if asked.purpose is not None and (asked.purpose == "kind") != (settings.plots > 1):
        wanted["plots"] = 1 if asked.purpose == "this-plot" else KIND_PLOTS
    if asked.vehicle is not None:
        record = read_vehicle(asked.vehicle)[1]
        same = settings.vehicle is not None and settings.vehicle.sha256 == record.sha256
        wanted["vehicle"] = settings.vehicle if same else record
    if asked.camera is not None:
        wanted["camera"] = _camera(asked.camera)
    files = {"vehicle": asked.vehicle, "camera": asked.camera}
    for key, value in wanted.items():
        if key in began and key not in {*CHANGEABLE, "noise", "envelope"} and value != began[key]:
            raise UsageError(
                f"this run did not begin with {key} = {files.get(key, value)}",
                remedy="Leave it out to go on with this run, or start another one in another folder.",
            )
    if asked.sources:
        settings = _moved(settings, describe_sources(asked))
    changed = {key: getattr(asked, key) for key in asked.model_fields_set.intersection(CHANGEABLE)}
    if "evaluations" in changed:  # a converged run goes on
        changed.setdefault("at_least", asked.evaluations)
    return settings.model_copy(update=changed)


def _moved(settings: SearchSettings, present: Sequence[GivenPlot]) -> SearchSettings:
    """The settings with the present paths of the run's source."""
    given = settings.given
    if [(p.source.kind, p.source.sha256) for p in present] != [(p.source.kind, p.source.sha256) for p in given]:
        names = ", ".join(plot.source.name for plot in given)
        raise UsageError(
            f"this run was planned on {names}", remedy="Give all of them in their order, or none, to go on with it."
        )
    moved = tuple(own.model_copy(update={"path": now.path}) for own, now in zip(given, present, strict=True))
    return settings.model_copy(update={"given": moved})


def _camera(file: Path) -> Intrinsics:
    cameras = read_camera_file(file)
    if len(cameras) != 1:
        raise MetadataError(
            f"holds {len(cameras)} cameras; a plan is made for one", path=file, remedy="Give a file of one camera."
        )
    return cameras[0].intrinsics
