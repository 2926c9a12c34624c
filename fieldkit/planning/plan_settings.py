"""What a person can choose about a plan: what it is made on, how cameras are looked for, and where they may be.

Imports nothing heavy: the command's options are made of it. Units are in the keys: _m metres, _deg degrees, _s seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PositiveFloat,
    ValidationError,
    field_validator,
    model_validator,
)

from fieldkit.errors import UsageError
from fieldkit.results.fields import Count, Length, Ordinal, Pitch, Strict
from fieldkit.vocabulary import WEIGHTS, MappingName, Preset, SearchFidelity, Stage
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.scenes.simulate import Outdoors

Range = tuple[float, float]
Paths = Annotated[
    tuple[Path, ...], BeforeValidator(lambda given: (given,) if isinstance(given, str | Path) else given or ())
]
HIGHEST_M = 50.0
"""Of cameras above the ground: from higher up no few photographs show a plant."""
Above = Annotated[float, Field(le=HIGHEST_M)]


class EnvelopeSettings(Strict):
    """The flight envelope about the plot; see `fieldkit.planning.space.envelope.Envelope.around`."""

    margin_m: Length = 1.5
    """How far beyond the plants' box cameras may stand."""
    height_m: tuple[Above, Above] = (0.5, 2.5)
    """Lowest and highest above the ground, metres."""
    clearance_m: Length = 0.5
    """From cameras to plants, metres."""
    pitch_deg: tuple[Pitch, Pitch] = (-90.0, 0.0)
    """The gimbal's range."""
    separation_m: Length = 0.1
    """Between stations."""
    vehicle_clearance_m: Length | None = None
    """The vehicle's clearance to plants; stations are then not below leaves. Null without a vehicle."""

    @field_validator("height_m", "pitch_deg")
    @classmethod
    def _in_order(cls, ends: Range) -> Range:
        if ends[0] > ends[1]:
            raise ValueError(f"{ends[0]:g} is above {ends[1]:g}")
        return ends


class NoiseSettings(Strict):
    """The noise that a plan must survive; none by default."""

    pose_m: Length = 0.0
    """Standard deviation of each coordinate of a position; the geometric score expects 1 cm at least."""
    pose_deg: Length = 0.0
    """Of yaw and pitch."""
    image_grey: Length = 0.0
    """Of each channel of each pixel; 0 leaves only the scene's own sensor noise."""
    wind_m: Length = 0.0
    """Sway of the leaves between photographs by wind, root mean square half a metre out."""
    vehicle_kg: Length = 0.0
    """Mass of the vehicle whose wash moves leaves, too; 0: none does."""

    @property
    def outdoors(self) -> Outdoors:
        """What moves leaves."""
        from fieldkit.scenes.simulate import Outdoors

        return Outdoors(self.wind_m, self.vehicle_kg)

    @property
    def any(self) -> bool:
        """Whether evaluations at different seeds differ by more than the sensor's noise."""
        return max(self.pose_m, self.pose_deg, self.image_grey) > 0 or not self.outdoors.still


class SearchChoices(Strict):
    """How cameras are looked for: what `PlanSettings` and `SearchSettings` share."""

    cameras: Annotated[int, Field(ge=3)] = 10
    """N, the number of cameras; 10 where not given."""
    method: str = "field"
    """What looks for them: ring where plans are for a kind and nothing of a search is given
    (with the preset paper score), else field."""
    seed: Count = 0
    evaluations: Ordinal = 100
    """Limit of the search, 100 where not given; confirmations of the finalists come on top."""
    fidelity: SearchFidelity = "standard"
    """Of the search, standard where not given. Draft costs two fifths less, but its best of good sets is not the
    best."""
    confirm_fidelity: SearchFidelity = "standard"
    """Of the confirmations."""
    mapping: MappingName = "prior"
    refine: bool = False
    """Align and scale each cloud to the reference by ICP before it is scored."""
    finalists: Ordinal = 3
    """Best sets that are evaluated again before one is chosen."""
    plots: Ordinal = 1
    """Plots that the plan is for: those given, and others drawn of their kind; 8 for a kind where not given."""
    repeats: Count = 2
    """Fresh seeds that each finalist is confirmed at; 0 leaves the confirmation out."""
    weights: tuple[Length, Length, Length] = WEIGHTS
    """Of the geometric score's gap, noise and tie, for methods that use it."""
    envelope: EnvelopeSettings = EnvelopeSettings()
    noise: NoiseSettings = NoiseSettings()

    @model_validator(mode="after")
    def _some_weight_counts(self) -> SearchChoices:
        if not any(self.weights):
            raise ValueError("weights: one of them must be above 0")
        return self


class TrialSettings(Strict):
    """What a person asks of a pattern for a trial."""

    model_config = ConfigDict(strict=False)

    trial: Path | None = None
    """Plan passes over all of these plots (plots.geojson) instead of stations about one."""
    stage: Stage | None = None
    """Of growth; by the plots' plant_height_m where not given."""
    minutes: PositiveFloat | None = None
    """The least errors in so many minutes of flight; one battery's where nothing is given."""
    height_error_m: PositiveFloat | None = None
    """The fewest minutes for such an error of plants' height, such as 4cm."""

    @model_validator(mode="after")
    def _one_goal(self) -> TrialSettings:
        if self.minutes is not None and self.height_error_m is not None:
            raise ValueError("minutes: give them or height_error_m, the other follows")
        return self


class PlanSettings(SearchChoices):
    """What a person asks of a plan; what is not given is chosen by what it is made on, and for whom.

    Paths may be text, one or several. Raises UsageError: a name or a value is none.

    Example:
        >>> PlanSettings(scene="case-1", cameras=10, evaluations=60)
    """

    model_config = ConfigDict(strict=False)

    scene: Paths = ()
    """Plan on a scene: a file, a folder or a name such as case-1. Repeatable."""
    reference: Paths = ()
    """Plan on a proxy of a reference; repeatable. With captures: their truth."""
    captures: Path | None = None
    """Choose of recorded photographs with known poses."""
    images: Paths = ()
    """Photographs of each reference in the same order, for a finer proxy."""
    purpose: Literal["kind", "this-plot"] | None = None
    """kind: plots like this one, which field and score plan for; this-plot: it alone."""
    preset: Preset = "outdoors"
    """What plans for a kind expect: a flight outdoors where not given, or the paper's still air and exact poses."""
    vehicle: str | Path | None = None
    """A profile's name or file: plan what it can fly, with its camera."""
    camera: Path | None = None
    """Calibration (camera.toml) to use instead of the vehicle's or the scene's."""

    def __init__(self, **given: Any) -> None:
        try:
            super().__init__(**given)
        except ValidationError as error:
            from fieldkit.documents.json_file import first_problem
            from fieldkit.documents.mistaken import check_names

            check_names("PlanSettings", given, type(self).model_fields)
            raise UsageError(first_problem(error), remedy="`fieldkit plan --help` explains the options.") from error

    @property
    def sources(self) -> Sequence[Path]:
        """All that it is made on."""
        return (*self.scene, *self.reference, *self.images, *(() if self.captures is None else (self.captures,)))

    @property
    def recorded(self) -> bool:
        """Whether recorded photographs are chosen from."""
        return self.captures is not None and not self.scene

    def check_sources(self) -> None:
        """Raise UsageError where what the plan is made on does not go together."""
        if self.images and (self.recorded or not self.reference):
            raise UsageError("--images are a reference's photographs", remedy="Give --reference, too, or leave it out.")
        if self.recorded and len(self.reference) > 1:
            raise UsageError("recorded photographs have one reference", remedy="Give --reference once.")
        if not self.recorded and bool(self.scene) == bool(self.reference):
            raise UsageError(
                "plan on what?", remedy="Give --scene SCENE, --reference REF or --captures IMAGES [--reference REF]."
            )
        if self.images and len(self.images) != len(self.reference):
            raise UsageError(
                f"--images is given {count(len(self.images), 'time')} for {count(len(self.reference), 'reference')}",
                remedy="Give it once for each --reference, in the same order.",
            )
