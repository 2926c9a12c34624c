"""From what a person asked for to a run's settings: the presets' defaults, and what may change when a run goes on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fieldkit import __version__
from fieldkit.captures.camera_file import read_camera_file
from fieldkit.documents import first_problem
from fieldkit.errors import MetadataError, UsageError
from fieldkit.missions.plan import PlanCamera
from fieldkit.planning.flyable import read_vehicle, vehicle_envelope
from fieldkit.planning.methods.registry import FOR_A_KIND, USING_WEIGHTS
from fieldkit.planning.problems import describe_source
from fieldkit.planning.run_settings import (
    CHANGEABLE,
    EnvelopeSettings,
    NoiseSettings,
    SearchSettings,
    lag_for,
    unchanging,
)

_PRESETS: dict[str, dict[str, Any]] = {
    "field": {"method": "field"},
    "paper": {"method": "bosfm", "mapping": "incremental"},
}
_DEFAULT_CAMERAS, KIND_PLOTS = 10, 8
_LIMITS = {
    "margin_m": "--margin", "height_m": "--height", "clearance_m": "--clearance", "pitch_deg": "--pitch",
    "separation_m": "--separation",
}  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """What was given, None for what was not.

    Attributes:
        settings: by `SearchSettings`' keys.
        noise: by `NoiseSettings`' keys.
        envelope: by `EnvelopeSettings`' keys.
        scene, reference, captures: what to plan on; see `describe_source`.
        images: the reference's photographs.
        vehicle: a profile's name or file.
        camera: a camera.toml or camera.json.
        purpose: "kind" or "this-plot": which plots the plan is for.
    """

    settings: Mapping[str, Any]
    noise: Mapping[str, Any]
    envelope: Mapping[str, Any]
    scene: Path | None = None
    reference: Path | None = None
    captures: Path | None = None
    images: Path | None = None
    vehicle: str | Path | None = None
    camera: Path | None = None
    purpose: str | None = None


def search_settings(
    *, scene: Path | None = None, reference: Path | None = None, captures: Path | None = None,
    images: Path | None = None, vehicle: str | Path | None = None, camera: Path | None = None,
    purpose: str | None = None, noise: Mapping[str, Any] | None = None, envelope: Mapping[str, Any] | None = None,
    workers: int = 1, deterministic: bool = False, **more: Any,
) -> SearchSettings:  # fmt: skip
    """The settings of a new run, for `plan_views`.

    Args:
        scene, reference, captures: what to plan on, as `fieldkit plan` takes them.
        images: the reference's photographs.
        vehicle: a profile's name or file: its camera, and its limits where ``envelope`` says nothing.
        camera: calibration (camera.toml) to use instead of the vehicle's or the scene's.
        purpose: "kind" (plots like this one) or "this-plot"; None is the method's own: `field` and `score` plan for
            the kind, but of recorded photographs.
        noise: fields of `NoiseSettings`.
        envelope: fields of `EnvelopeSettings`.
        workers: that will evaluate.
        deterministic: see `lag_for`.
        more: fields of `SearchSettings`: cameras, evaluations, method, seed and others.

    Raises:
        UsageError: they contradict themselves, or leave the vehicle's limits.
        InputError: what is to be planned on, the vehicle or the camera cannot be used.

    Example:
        >>> settings = search_settings(scene=Path("case-1"), cameras=10, evaluations=60)
    """
    asked = Asked(more, noise or {}, envelope or {}, scene, reference, captures, images, vehicle, camera, purpose)
    return new_settings(asked, workers, deterministic=deterministic)


def new_settings(asked: Asked, workers: int, *, deterministic: bool) -> SearchSettings:
    """The settings of a new run.

    Args:
        asked: what was given.
        workers: that will evaluate.
        deterministic: see `lag_for`.

    Raises:
        UsageError: they contradict themselves, or leave the vehicle's limits.
        InputError: what is to be planned on, the vehicle or the camera cannot be used.
    """
    source, path = describe_source(asked.scene, asked.reference, asked.captures)
    given = _given(asked.settings)
    envelope = _given(asked.envelope)
    try:
        noise = NoiseSettings(**_given(asked.noise))
    except ValidationError as error:
        raise _refused(error) from error
    values: dict[str, Any] = {
        "fieldkit": __version__,
        "source": source,
        "path": str(path),
        "cameras": _DEFAULT_CAMERAS,
        "lag": lag_for(workers, deterministic=deterministic),
    }
    if source.kind == "captures":
        if asked.vehicle is None:  # with one they say which views count as its own
            _refuse_limits(envelope)
        if asked.reference is not None:
            values["reference_path"] = str(asked.reference.resolve())
        if unchanging(source, noise):
            values["repeats"] = 1
    if asked.images is not None:
        if source.kind != "reference":
            raise UsageError("--images are a reference's photographs", remedy="Give --reference, too, or leave it out.")
        values["images_path"] = str(asked.images.resolve())
    if asked.vehicle is not None:
        vehicle, values["vehicle"] = read_vehicle(asked.vehicle)
        envelope = vehicle_envelope(vehicle, envelope)
        if source.kind != "captures":
            values["camera"] = vehicle.camera
    if asked.camera is not None:
        if source.kind == "captures":
            raise UsageError("recorded photographs have their camera", remedy="Leave --camera-file out.")
        values["camera"] = _camera(asked.camera)
    values |= _PRESETS[given.get("preset", "field")] | given
    values["plots"] = _plots(asked.purpose, given.get("plots"), values["method"], source.kind)
    if "weights" in given and values["method"] not in USING_WEIGHTS:
        raise UsageError(
            f"--weights would change nothing: {values['method']} does not go by the geometric score",
            remedy=f"Leave them out, or choose one of {', '.join(sorted(USING_WEIGHTS))}.",
        )
    try:
        return SearchSettings(**values, noise=noise, envelope=EnvelopeSettings(**envelope))
    except ValidationError as error:
        raise _refused(error) from error


def _plots(purpose: str | None, plots: int | None, method: str, source: str) -> int:
    """How many plots a plan is for."""
    if source == "captures":
        if purpose == "kind" or (plots or 1) > 1:
            raise UsageError(
                "recorded photographs are of one plot: no others of its kind can be drawn",
                remedy="Leave --for and --vary out.",
            )
        return 1
    if purpose == "this-plot":
        if (plots or 1) > 1:
            raise UsageError(f"--vary {plots} plans for more than this plot", remedy="Give --for or --vary.")
        return 1
    if plots is not None:
        return plots
    return KIND_PLOTS if purpose == "kind" or method in FOR_A_KIND else 1


def _refused(error: ValidationError) -> UsageError:
    return UsageError(first_problem(error), remedy="`fieldkit plan --help` explains the options.")


def resumed_settings(settings: SearchSettings, asked: Asked) -> SearchSettings:
    """The settings to go on with: the run's own, with what may change.

    Raises:
        UsageError: something else was asked for than what the run began with.
    """
    given = _given(asked.settings)
    if asked.purpose is not None and (asked.purpose == "kind") != (settings.plots > 1):
        given["plots"] = 1 if asked.purpose == "this-plot" else KIND_PLOTS
    fixed = {key: value for key, value in given.items() if key not in CHANGEABLE and getattr(settings, key) != value}
    for own, wished in ((settings.noise, asked.noise), (settings.envelope, asked.envelope)):
        fixed |= {key: value for key, value in _given(wished).items() if getattr(own, key) != value}
    if asked.vehicle is not None:
        _, vehicle = read_vehicle(asked.vehicle)
        if settings.vehicle is None or settings.vehicle.sha256 != vehicle.sha256:
            fixed["vehicle"] = vehicle.name if settings.vehicle is None else f"{vehicle.name} as it is now"
    if asked.camera is not None and _camera(asked.camera) != settings.camera:
        fixed["camera"] = asked.camera.name
    if fixed:
        key, value = next(iter(fixed.items()))
        raise UsageError(
            f"this run did not begin with {key} = {value}",
            remedy="Leave it out to go on with this run, or start another one in another folder.",
        )
    if any((asked.scene, asked.reference, asked.captures, asked.images)):
        source, path = describe_source(asked.scene, asked.reference, asked.captures)
        if source.kind != settings.source.kind or source.sha256 != settings.source.sha256:
            raise UsageError(f"this run was not planned on {path.name}", remedy="Leave it out to go on with this run.")
        settings = settings.model_copy(update={"path": str(path)})
    changed = {key: value for key, value in given.items() if key in CHANGEABLE}
    if "evaluations" in changed:  # a run that had converged goes on
        changed.setdefault("at_least", changed["evaluations"])
    return settings.model_copy(update=changed)


def _refuse_limits(envelope: Mapping[str, Any]) -> None:
    """Recorded views are where they are: limits of cameras would change nothing."""
    for key, option in _LIMITS.items():
        if key in envelope:
            raise UsageError(
                f"recorded photographs have their places: {option} would not change the choice among them",
                remedy="Leave it out, or plan on --reference or --scene.",
            )


def _camera(file: Path) -> PlanCamera:
    cameras = read_camera_file(file)
    if len(cameras) != 1:
        raise MetadataError(
            f"holds {len(cameras)} cameras; a plan is made for one", path=file, remedy="Give a file of one camera."
        )
    camera = cameras[0].intrinsics
    return PlanCamera(model=camera.model, width=camera.width, height=camera.height, params=camera.params)


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}
