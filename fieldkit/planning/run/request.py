"""From a person's request to a run's settings: its defaults, and what may change when a run is resumed."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from fieldkit.captures.camera_file import read_camera_file
from fieldkit.documents.json_file import first_problem
from fieldkit.documents.mistaken import check_names
from fieldkit.errors import MetadataError, UsageError
from fieldkit.geometry import Intrinsics
from fieldkit.planning.methods.registry import METHODS, MethodEntry, method_entry
from fieldkit.planning.run.flyable import OUTDOORS_ENVELOPE, flight_noise, read_vehicle, vehicle_envelope
from fieldkit.planning.run.sources import describe_sources
from fieldkit.planning.settings import (
    CHANGEABLE,
    EnvelopeSettings,
    GivenPlot,
    NoiseSettings,
    SearchSettings,
    lag_for,
    unchanging,
)
from fieldkit.vehicles.vehicle import Vehicle
from fieldkit.version import __version__
from fieldkit.vocabulary import Preset

_METHOD = "field"
KIND_METHOD = "score"
KIND_CONFIRMED: dict[str, int] = {"finalists": 4, "repeats": 3}
"""Plots differ by more than good sets do, so several optima are confirmed on several plots."""
RECORDED_CONFIRMED: dict[str, int] = {"finalists": 6, "repeats": 6}
"""The withheld matches change a value by more than sets differ; evaluations are cheap."""
_OF_SEARCHES = ("method", "evaluations", "at_least", "initial", "time_budget_s", "fidelity")
Paths = Path | str | Sequence[Path | str]
Settings = TypeVar("Settings", bound=BaseModel)
_DEFAULT_CAMERAS, KIND_PLOTS = 10, 8
_LIMITS = {
    "margin_m": "a margin", "height_m": "--height", "clearance_m": "--clearance", "pitch_deg": "a range of pitch",
    "separation_m": "a separation",
}  # fmt: skip


def search_settings(
    *, scene: Paths = (), reference: Paths = (), captures: Path | str | None = None, images: Paths = (),
    vehicle: str | Path | None = None, camera: Path | str | None = None, purpose: str | None = None,
    noise: Mapping[str, Any] | None = None, envelope: Mapping[str, Any] | None = None,
    preset: Preset = "outdoors", methods: Mapping[str, MethodEntry] | None = None, workers: int = 1, **more: Any,
) -> SearchSettings:  # fmt: skip
    """The settings of a new run, for `plan_views`.

    Args:
        scene, reference, captures: the source of the plan, as `fieldkit plan` takes it: one or several scenes or
            references, or captures.
        images: the references' photographs, in the same order.
        vehicle: a profile's name or file: its camera, and its limits where ``envelope`` says nothing.
        camera: calibration (camera.toml) to use instead of the vehicle's or the scene's.
        purpose: "kind" (plots like this one) or "this-plot"; None takes the method's: `field` and `score` plan for the
            kind. Without a method and without settings of a search, the method is `score`, except for recorded
            photographs.
        noise: fields of `NoiseSettings`.
        envelope: fields of `EnvelopeSettings`.
        preset: what plans for a kind take where these say nothing: "outdoors" (a flight's noise of poses, wind and the
            vehicle's wash; stations as a vehicle can keep them) or "paper" (exact poses, still air, nearer stations).
        methods: by name, as `plan_views` takes them.
        more: fields of `SearchSettings`: cameras, evaluations, method, seed and others.

    Raises:
        UsageError: they contradict themselves, or leave the vehicle's limits.
        InputError: the source, the vehicle or the camera cannot be used.

    Example:
        >>> settings = search_settings(scene="case-1", cameras=10, evaluations=60)
    """
    known = [*SearchSettings.model_fields, *inspect.signature(search_settings).parameters]
    check_names("search_settings", more, known)
    check_names("noise", noise or {}, NoiseSettings.model_fields)
    check_names("envelope", envelope or {}, EnvelopeSettings.model_fields)
    plots_given = describe_sources(_paths(scene), _paths(reference), captures, _paths(images))
    first, *others = plots_given
    recorded, given = first.source.kind == "captures", _given(more)
    method = given.get("method", _METHOD) if recorded or _searches(purpose, given) else KIND_METHOD
    entry = method_entry(method, methods)
    plots = _plots(purpose, given.get("plots"), method, len(plots_given), for_a_kind=entry.for_a_kind)
    if "weights" in given and not entry.weights:
        raise UsageError(
            f"weights would change nothing: {method} does not go by the geometric score",
            remedy=f"Leave them out, or choose one of {', '.join(n for n in METHODS if METHODS[n].weights)}.",
        )
    flyer, record = (None, None) if vehicle is None else read_vehicle(vehicle)
    limits = _given(envelope)
    if recorded and flyer is None:  # with one they limit the views
        _refuse_limits(limits)
    try:
        # Recorded photographs have fixed places.
        flown = plots > 1 and not recorded and preset == "outdoors"
        expected = _changed(flight_noise(flyer) if flown else NoiseSettings(), _given(noise))
        limits = limits if flyer is None else vehicle_envelope(flyer, limits)
        usual = SearchSettings(
            fieldkit=__version__,
            source=first.source,
            path=first.path,
            reference_path=str(_paths(reference)[0].resolve()) if recorded and reference else None,
            images_path=first.images_path,
            others=tuple(others),
            cameras=_DEFAULT_CAMERAS,
            camera=_planned_camera(camera, flyer, recorded=recorded),
            vehicle=record,
            method=method,
            plots=plots,
            # Else the cloud's random shift would outweigh the cameras' places.
            refine=plots > 1 and expected.pose_m > 0,
            lag=lag_for(workers),
            noise=expected,
            envelope=EnvelopeSettings(**(OUTDOORS_ENVELOPE | limits if flown else limits)),
        )
        confirmed = _confirmations(plots, method, recorded=recorded, exact=unchanging(first.source, expected))
        return _changed(usual, confirmed | given | {"method": method, "plots": plots})
    except ValidationError as error:
        raise UsageError(first_problem(error), remedy="`fieldkit plan --help` explains the options.") from error


def _changed(settings: Settings, given: Mapping[str, Any]) -> Settings:
    """Settings with what was given instead, validated."""
    return type(settings).model_validate(dict(settings) | dict(given))


def _confirmations(plots: int, method: str, *, recorded: bool, exact: bool) -> dict[str, int]:
    """Numbers of finalists and of repeats, where nobody gives them and they are not the usual ones."""
    if plots == 1:
        return {"repeats": 1} if exact else {}
    return RECORDED_CONFIRMED if recorded else KIND_CONFIRMED if method == KIND_METHOD else {}


def _planned_camera(file: Path | str | None, vehicle: Vehicle | None, *, recorded: bool) -> Intrinsics | None:
    """The camera of a file, else the vehicle's; None for the source's own."""
    if file is None:
        return None if recorded or vehicle is None else vehicle.camera
    if recorded:
        raise UsageError("recorded photographs have their camera", remedy="Leave camera out.")
    return _camera(file)


def _searches(purpose: str | None, given: Mapping[str, Any]) -> bool:
    """Whether a plan is searched for: it is for one plot, or a method or settings of a search are given."""
    return purpose == "this-plot" or given.get("plots", 2) < 2 or not given.keys().isdisjoint(_OF_SEARCHES)


def _plots(purpose: str | None, plots: int | None, method: str, given: int, *, for_a_kind: bool) -> int:
    """Number of plots that a plan is for."""
    if purpose == "this-plot":
        if given > 1:
            raise UsageError(f"--for this-plot, and {given} are given", remedy="Give one, or leave --for out.")
        if (plots or 1) > 1:
            raise UsageError(f"--vary {plots} plans for more than this plot", remedy="Give --for or --vary.")
        return 1
    if given > 1 and not for_a_kind:
        raise UsageError(
            f"{method} plans for one plot, and {given} are given",
            remedy=f"Give one, or choose one of {', '.join(name for name in METHODS if METHODS[name].for_a_kind)}.",
        )
    if plots is not None:
        return plots
    return max(given, KIND_PLOTS if purpose == "kind" or for_a_kind else 1)


def resumed_settings(
    settings: SearchSettings, *, scene: Paths = (), reference: Paths = (), captures: Path | str | None = None,
    images: Paths = (), vehicle: str | Path | None = None, camera: Path | str | None = None,
    purpose: str | None = None, noise: Mapping[str, Any] | None = None, envelope: Mapping[str, Any] | None = None,
    **more: Any,
) -> SearchSettings:  # fmt: skip
    """The settings to resume with: the run's own, with changes where they are allowed.

    The arguments are those of `search_settings`, whose ``preset`` changes nothing of a run that has begun.
    """
    given = _given(more)
    if purpose is not None and (purpose == "kind") != (settings.plots > 1):
        given["plots"] = 1 if purpose == "this-plot" else KIND_PLOTS
    fixed = {key: value for key, value in given.items() if key not in CHANGEABLE and getattr(settings, key) != value}
    for own, wished in ((settings.noise, noise), (settings.envelope, envelope)):
        fixed |= {key: value for key, value in _given(wished).items() if getattr(own, key) != value}
    if vehicle is not None:
        _, record = read_vehicle(vehicle)
        if settings.vehicle is None or settings.vehicle.sha256 != record.sha256:
            fixed["vehicle"] = record.name if settings.vehicle is None else f"{record.name} as it is now"
    if camera is not None and _camera(camera) != settings.camera:
        fixed["camera"] = Path(camera).name
    if fixed:
        key, value = next(iter(fixed.items()))
        raise UsageError(
            f"this run did not begin with {key} = {value}",
            remedy="Leave it out to go on with this run, or start another one in another folder.",
        )
    if any((scene, reference, captures, images)):
        settings = _moved(settings, describe_sources(_paths(scene), _paths(reference), captures, _paths(images)))
    changed = {key: value for key, value in given.items() if key in CHANGEABLE}
    if "evaluations" in changed:  # a converged run goes on
        changed.setdefault("at_least", changed["evaluations"])
    return settings.model_copy(update=changed)


def _moved(settings: SearchSettings, found: Sequence[GivenPlot]) -> SearchSettings:
    """The settings with the present paths of the run's source."""
    given = settings.given
    for k, plot in enumerate(found):
        if k >= len(given) or (plot.source.kind, plot.source.sha256) != (given[k].source.kind, given[k].source.sha256):
            name = Path(plot.path).name
            raise UsageError(f"this run was not planned on {name}", remedy="Leave it out to go on with this run.")
    if len(found) < len(given):
        raise UsageError(
            f"this run was planned on {len(given)} plots, not {len(found)}",
            remedy="Give all of them in their order, or none, to go on with this run.",
        )
    others = tuple(own.model_copy(update={"path": plot.path}) for own, plot in zip(given[1:], found[1:], strict=True))
    return settings.model_copy(update={"path": found[0].path, "others": others})


def _paths(given: Paths) -> tuple[Path, ...]:
    return tuple(map(Path, [given] if isinstance(given, Path | str) else given))


def _refuse_limits(envelope: Mapping[str, Any]) -> None:
    """Refuse limits of cameras for recorded views, whose places are fixed."""
    for key, option in _LIMITS.items():
        if key in envelope:
            raise UsageError(
                f"recorded photographs have their places: {option} would not change the choice among them",
                remedy="Leave it out, or plan on --reference or --scene.",
            )


def _camera(file: Path | str) -> Intrinsics:
    cameras = read_camera_file(Path(file))
    if len(cameras) != 1:
        raise MetadataError(
            f"holds {len(cameras)} cameras; a plan is made for one",
            path=Path(file),
            remedy="Give a file of one camera.",
        )
    return cameras[0].intrinsics


def _given(values: Mapping[str, Any] | None) -> dict[str, Any]:
    return {key: value for key, value in (values or {}).items() if value is not None}
