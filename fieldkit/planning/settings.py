"""The settings of a planning run: search.json, written before the run starts and read to resume it.

Units are in the keys: _m metres, _deg degrees, _s seconds.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, field_validator, model_validator

from fieldkit.documents.mistaken import as_centimetres
from fieldkit.geometry import Intrinsics
from fieldkit.planning.score.cost_model import WEIGHTS
from fieldkit.results.fields import Count, Length, Strict
from fieldkit.results.plan import PlanSource
from fieldkit.scenes.simulate import Outdoors
from fieldkit.vocabulary import MappingName, SearchFidelity

Range = tuple[float, float]

HIGHEST_M = 50.0
"""Of cameras above the ground: from higher up no few photographs show a plant."""
CHANGEABLE = ("evaluations", "at_least", "time_budget_s", "finalists", "repeats")
"""Settings that may change when a run is resumed: none changes an earlier proposal."""


class EnvelopeSettings(Strict):
    """The flight envelope about the plot; see `fieldkit.planning.space.envelope.Envelope.around`."""

    margin_m: Length = 1.5
    """How far beyond the plants' box cameras may stand."""
    height_m: Range = (0.5, 2.5)
    """Band above the ground."""
    clearance_m: Length = 0.5
    """From cameras to plants."""
    pitch_deg: Range = (-90.0, 0.0)
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

    @field_validator("height_m")
    @classmethod
    def _in_metres(cls, heights: Range) -> Range:
        if heights[1] > HIGHEST_M:
            slip = as_centimetres(heights[1], HIGHEST_M)
            raise ValueError(f"metres above the ground, at most {HIGHEST_M:g}, and not {heights[1]:g}{slip}")
        return heights


class SearchVehicle(Strict):
    """The vehicle profile that the envelope's limits come from."""

    name: str
    """Of fieldkit's profile, or of the file."""
    title: str
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """Of the file."""


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
        return Outdoors(self.wind_m, self.vehicle_kg)

    @property
    def any(self) -> bool:
        """Whether evaluations at different seeds differ by more than the sensor's noise."""
        return max(self.pose_m, self.pose_deg, self.image_grey) > 0 or not self.outdoors.still


def unchanging(source: PlanSource, noise: NoiseSettings) -> bool:
    """Whether a set has the same value at every seed: photographs are recorded, without added noise."""
    return source.kind == "captures" and not noise.any


class GivenPlot(Strict):
    """One of several plots that a plan is made on."""

    source: PlanSource
    path: str
    """Where that was; the name of a scene that comes with fieldkit."""
    images_path: str | None = None
    """Where the photographs of a reference's proxy were."""


class SearchSettings(Strict):
    """search.json: everything that a run's outcome depends on, except the photographs or the scene themselves."""

    model_config = ConfigDict(**Strict.model_config, protected_namespaces=())

    kind: Literal["search"] = "search"
    version: Literal[1] = 1
    fieldkit: str
    """Version that started the run."""
    source: PlanSource
    """The given plot."""
    path: str
    """Where that was; the name of a scene that comes with fieldkit."""
    reference_path: str | None = None
    """Where the reference of a recorded set was."""
    images_path: str | None = None
    """Where the photographs of a reference's proxy were."""
    others: tuple[GivenPlot, ...] = ()
    """Further given plots, of the same kind of source."""
    cameras: Annotated[int, Field(ge=3)]
    """N, the number of cameras."""
    camera: Intrinsics | None = None
    """The plan's camera at full size; null takes the scene's or the reference's."""
    vehicle: SearchVehicle | None = None
    """The plan's vehicle; its limits are in ``envelope``."""
    method: str
    seed: Count = 0
    evaluations: Annotated[int, Field(ge=1)] = 100
    """Limit of the search; confirmations of the finalists come on top."""
    at_least: Count = 0
    """Evaluations before the search may end by convergence."""
    initial: Annotated[int, Field(ge=1)] | None = None
    """Trials before the surrogate is used; None takes the method's own."""
    time_budget_s: Annotated[float, Field(gt=0)] | None = None
    """No trial starts later; finalists are still confirmed."""
    fidelity: SearchFidelity = "standard"
    """Of the search. Draft costs two fifths less, but its best of good sets is not the best."""
    confirm_fidelity: SearchFidelity = "standard"
    """Of the confirmations."""
    mapping: MappingName = "prior"
    refine: bool = False
    """Align and scale each cloud to the reference by ICP before it is scored."""
    finalists: Annotated[int, Field(ge=1)] = 3
    """Best sets that are evaluated again before one is chosen; of plots of a kind those that are not clearly behind."""
    plots: Annotated[int, Field(ge=1)] = 1
    """Number of plots that the plan is for: the given ones, and others drawn of their kind."""
    repeats: Count = 2
    """Fresh seeds for each of them; 0 leaves the confirmation out."""
    weights: tuple[Length, Length, Length] = WEIGHTS
    """Of the geometric score's gap, noise and tie, for methods that use it."""
    lag: Count = 0
    """A proposal for trial k knows the results up to k − lag − 1."""
    envelope: EnvelopeSettings = EnvelopeSettings()
    noise: NoiseSettings = NoiseSettings()

    @model_validator(mode="after")
    def _some_weight_counts(self) -> SearchSettings:
        if not any(self.weights):
            raise ValueError("weights: one of them must be above 0")
        return self

    @model_validator(mode="after")
    def _for_all_that_are_given(self) -> SearchSettings:
        if self.plots < len(self.given):
            raise ValueError(f"plots: {len(self.given)} are given, but the plan is for {self.plots}")
        return self

    @property
    def given(self) -> tuple[GivenPlot, ...]:
        """The given plots."""
        return (GivenPlot(source=self.source, path=self.path, images_path=self.images_path), *self.others)

    @property
    def all_plots(self) -> int:
        """Number of plots: those that the plan is for, and with several one for each repeat that no trial has met."""
        return self.plots + (self.repeats if self.plots > 1 else 0)

    @property
    def blind(self) -> bool:
        """Whether mapping works without the commanded poses."""
        return self.mapping != "prior"


def lag_for(workers: int) -> int:
    """The number of trials by which proposals run ahead of results.

    0 with one worker: every proposal knows all results. 2(W − 1) with W workers, so that a worker that finishes early
    finds a trial ready, as long as no evaluation takes twice as long as another. Proposals depend on this number and
    not on when evaluations end, so a run is repeatable for each W.
    """
    return 2 * (workers - 1)
