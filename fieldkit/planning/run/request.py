"""From a person's request to a run's settings: defaults of the presets, and what may change when a run is resumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fieldkit import wording
from fieldkit.captures.camera_file import read_camera_file
from fieldkit.documents.json_file import first_problem
from fieldkit.errors import MetadataError, UsageError
from fieldkit.geometry import Intrinsics
from fieldkit.planning.methods.registry import METHODS
from fieldkit.planning.run.flyable import flight_noise, read_vehicle, vehicle_envelope
from fieldkit.planning.run.run_setup import describe_sources
from fieldkit.planning.settings import (
    CHANGEABLE,
    EnvelopeSettings,
    GivenPlot,
    NoiseSettings,
    SearchSettings,
    lag_for,
    unchanging,
)
from fieldkit.results.plan import PlanSource
from fieldkit.version import __version__

_PRESETS: dict[str, dict[str, Any]] = {
    "field": {"method": "field"},
    "paper": {"method": "bosfm", "mapping": "incremental"},
}
KIND_METHOD = "score"
KIND_CONFIRMED: dict[str, Any] = {"finalists": 6, "repeats": 3}
"""Plots differ by more than good sets do, so several optima are confirmed on several plots."""
RECORDED_CONFIRMED: dict[str, Any] = {"finalists": 6, "repeats": 6}
"""The withheld matches change a value by more than sets differ; evaluations are cheap."""
_OF_SEARCHES = ("evaluations", "at_least", "initial", "time_budget_s", "fidelity")
Paths = Path | Sequence[Path]
_DEFAULT_CAMERAS, KIND_PLOTS = 10, 8
_LIMITS = {
    "margin_m": "--margin", "height_m": "--height", "clearance_m": "--clearance", "pitch_deg": "--pitch",
    "separation_m": "--separation",
}  # fmt: skip


@dataclass(frozen=True)
class PlanRequest:
    """The options that were given; None for the others.

    Attributes:
        settings: by the keys of `SearchSettings`.
        noise: by the keys of `NoiseSettings`. If nothing is given, plans for a kind take the flight's noise of poses.
        envelope: by the keys of `EnvelopeSettings`.
        scenes, references, captures: what to plan on; see `describe_sources`.
        images: folders of the references' photographs, in the same order; none, or one for each.
        vehicle: a profile's name or file.
        camera: a camera.toml or camera.json.
        purpose: "kind" or "this-plot": the plots that the plan is for.
    """

    settings: Mapping[str, Any]
    noise: Mapping[str, Any]
    envelope: Mapping[str, Any]
    scenes: tuple[Path, ...] = ()
    references: tuple[Path, ...] = ()
    captures: Path | None = None
    images: tuple[Path, ...] = ()
    vehicle: str | Path | None = None
    camera: Path | None = None
    purpose: str | None = None


def search_settings(
    *, scene: Paths = (), reference: Paths = (), captures: Path | None = None, images: Paths = (),
    vehicle: str | Path | None = None, camera: Path | None = None, purpose: str | None = None,
    noise: Mapping[str, Any] | None = None, envelope: Mapping[str, Any] | None = None,
    workers: int = 1, **more: Any,
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
        noise: fields of `NoiseSettings`; without them plans for the kind take the flight's noise of poses.
        envelope: fields of `EnvelopeSettings`.
        workers: that will evaluate; see `lag_for`.
        more: fields of `SearchSettings`: cameras, evaluations, method, seed and others.

    Raises:
        UsageError: they contradict themselves, or leave the vehicle's limits.
        InputError: the source, the vehicle or the camera cannot be used.

    Example:
        >>> settings = search_settings(scene=Path("case-1"), cameras=10, evaluations=60)
    """
    request = PlanRequest(
        more, noise or {}, envelope or {}, _paths(scene), _paths(reference), captures, _paths(images), vehicle, camera,
        purpose,
    )  # fmt: skip
    return new_settings(request, workers)


def new_settings(request: PlanRequest, workers: int) -> SearchSettings:
    """The settings of a new run.

    Args:
        request: the given options.
        workers: that will evaluate; see `lag_for`.

    Raises:
        UsageError: they contradict themselves, or leave the vehicle's limits.
        InputError: the source, the vehicle or the camera cannot be used.
    """
    (source, path), *others = describe_sources(request.scenes, request.references, request.captures)
    given = _given(request.settings)
    envelope = _given(request.envelope)
    method = given.get("method") or _PRESETS[given.get("preset", "field")]["method"]
    if _chooses(request, given, source.kind):
        given |= {"method": (method := KIND_METHOD)}
    plots = _plots(request.purpose, given.get("plots"), method, 1 + len(others))
    vehicle = None if request.vehicle is None else read_vehicle(request.vehicle)
    # Recorded photographs have fixed places.
    missed = {} if plots == 1 or source.kind == "captures" else flight_noise(None if vehicle is None else vehicle[0])
    try:
        noise = NoiseSettings(**(missed | _given(request.noise)))
    except ValidationError as error:
        raise _refused(error) from error
    values: dict[str, Any] = {
        "fieldkit": __version__,
        "source": source,
        "path": str(path),
        "cameras": _DEFAULT_CAMERAS,
        "lag": lag_for(workers),
    }
    if source.kind == "captures":
        if request.vehicle is None:  # with one they limit the views
            _refuse_limits(envelope)
        if request.references:
            values["reference_path"] = str(request.references[0].resolve())
        if plots == 1 and unchanging(source, noise):
            values["repeats"] = 1
    images = _images(request, source)
    values["images_path"] = images[0]
    values["others"] = tuple(
        GivenPlot(source=each, path=str(place), images_path=its)
        for (each, place), its in zip(others, images[1:], strict=True)
    )
    if vehicle is not None:
        profile, values["vehicle"] = vehicle
        envelope = vehicle_envelope(profile, envelope)
        if source.kind != "captures":
            values["camera"] = profile.camera
    if request.camera is not None:
        if source.kind == "captures":
            raise UsageError("recorded photographs have their camera", remedy="Leave --camera-file out.")
        values["camera"] = _camera(request.camera)
    if plots > 1 and noise.pose_m:
        values["refine"] = True  # else the cloud's random shift would outweigh the cameras' places
    if plots > 1 and source.kind == "captures":
        values |= RECORDED_CONFIRMED
    elif plots > 1 and method == KIND_METHOD:
        values |= KIND_CONFIRMED
    values |= _PRESETS[given.get("preset", "field")] | given | {"plots": plots}
    for key in ("weights", "heights"):
        if key in given and not METHODS[values["method"]].weights:
            raise UsageError(
                f"--{key} would change nothing: {values['method']} does not go by the geometric score",
                remedy=f"Leave it out, or choose one of {', '.join(n for n in METHODS if METHODS[n].weights)}.",
            )
    try:
        return SearchSettings(**values, noise=noise, envelope=EnvelopeSettings(**envelope))
    except ValidationError as error:
        raise _refused(error) from error


def _chooses(request: PlanRequest, given: Mapping[str, Any], source: str) -> bool:
    """Whether a plan for a kind is made without a search: neither a method nor settings of a search are given."""
    searched = {"method", "preset", *_OF_SEARCHES} & given.keys()
    return source != "captures" and request.purpose != "this-plot" and given.get("plots", 2) > 1 and not searched


def _images(request: PlanRequest, source: PlanSource) -> tuple[str | None, ...]:
    """Folder of the photographs of each given plot; None if its proxy is made without photographs."""
    count = max(1, len(request.scenes), len(request.references) if source.kind == "reference" else 1)
    if not request.images:
        return (None,) * count
    if source.kind != "reference":
        raise UsageError("--images are a reference's photographs", remedy="Give --reference, too, or leave it out.")
    if len(request.images) != count:
        raise UsageError(
            f"--images is given {wording.count(len(request.images), 'time')} for {wording.count(count, 'reference')}",
            remedy="Give it once for each --reference, in the same order.",
        )
    return tuple(str(images.resolve()) for images in request.images)


def _plots(purpose: str | None, plots: int | None, method: str, given: int) -> int:
    """Number of plots that a plan is for."""
    if purpose == "this-plot":
        if given > 1:
            raise UsageError(f"--for this-plot, and {given} are given", remedy="Give one, or leave --for out.")
        if (plots or 1) > 1:
            raise UsageError(f"--vary {plots} plans for more than this plot", remedy="Give --for or --vary.")
        return 1
    if given > 1 and not METHODS[method].for_a_kind:
        raise UsageError(
            f"{method} plans for one plot, and {given} are given",
            remedy=f"Give one, or choose one of {', '.join(name for name in METHODS if METHODS[name].for_a_kind)}.",
        )
    if plots is not None:
        return plots
    return max(given, KIND_PLOTS if purpose == "kind" or METHODS[method].for_a_kind else 1)


def _refused(error: ValidationError) -> UsageError:
    return UsageError(first_problem(error), remedy="`fieldkit plan --help` explains the options.")


def resumed_settings(settings: SearchSettings, request: PlanRequest) -> SearchSettings:
    """The settings to resume with: the run's own, with changes where they are allowed.

    Raises:
        UsageError: a setting that must not change differs from the run's.
    """
    given = _given(request.settings)
    if request.purpose is not None and (request.purpose == "kind") != (settings.plots > 1):
        given["plots"] = 1 if request.purpose == "this-plot" else KIND_PLOTS
    fixed = {key: value for key, value in given.items() if key not in CHANGEABLE and getattr(settings, key) != value}
    for own, wished in ((settings.noise, request.noise), (settings.envelope, request.envelope)):
        fixed |= {key: value for key, value in _given(wished).items() if getattr(own, key) != value}
    if request.vehicle is not None:
        _, vehicle = read_vehicle(request.vehicle)
        if settings.vehicle is None or settings.vehicle.sha256 != vehicle.sha256:
            fixed["vehicle"] = vehicle.name if settings.vehicle is None else f"{vehicle.name} as it is now"
    if request.camera is not None and _camera(request.camera) != settings.camera:
        fixed["camera"] = request.camera.name
    if fixed:
        key, value = next(iter(fixed.items()))
        raise UsageError(
            f"this run did not begin with {key} = {value}",
            remedy="Leave it out to go on with this run, or start another one in another folder.",
        )
    if any((request.scenes, request.references, request.captures, request.images)):
        settings = _moved(settings, describe_sources(request.scenes, request.references, request.captures))
    changed = {key: value for key, value in given.items() if key in CHANGEABLE}
    if "evaluations" in changed:  # a converged run goes on
        changed.setdefault("at_least", changed["evaluations"])
    return settings.model_copy(update=changed)


def _moved(settings: SearchSettings, found: Sequence[tuple[PlanSource, Path]]) -> SearchSettings:
    """The settings with the present paths of the run's source."""
    given = settings.given
    for k, (source, path) in enumerate(found):
        if k >= len(given) or (source.kind, source.sha256) != (given[k].source.kind, given[k].source.sha256):
            raise UsageError(f"this run was not planned on {path.name}", remedy="Leave it out to go on with this run.")
    if len(found) < len(given):
        raise UsageError(
            f"this run was planned on {len(given)} plots, not {len(found)}",
            remedy="Give all of them in their order, or none, to go on with this run.",
        )
    others = tuple(
        each.model_copy(update={"path": str(path)}) for each, (_, path) in zip(given[1:], found[1:], strict=True)
    )
    return settings.model_copy(update={"path": str(found[0][1]), "others": others})


def _paths(given: Paths) -> tuple[Path, ...]:
    return (given,) if isinstance(given, Path) else tuple(given)


def _refuse_limits(envelope: Mapping[str, Any]) -> None:
    """Refuse limits of cameras for recorded views, whose places are fixed."""
    for key, option in _LIMITS.items():
        if key in envelope:
            raise UsageError(
                f"recorded photographs have their places: {option} would not change the choice among them",
                remedy="Leave it out, or plan on --reference or --scene.",
            )


def _camera(file: Path) -> Intrinsics:
    cameras = read_camera_file(file)
    if len(cameras) != 1:
        raise MetadataError(
            f"holds {len(cameras)} cameras; a plan is made for one", path=file, remedy="Give a file of one camera."
        )
    return cameras[0].intrinsics


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}
