"""The settings of a planning run: search.json, written before the run starts and read to resume it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from fieldkit.geometry import Intrinsics
from fieldkit.planning.plan_settings import NoiseSettings, SearchChoices
from fieldkit.results.fields import Count, Sha256, Strict
from fieldkit.results.plan import PlanSource

CHANGEABLE = ("evaluations", "at_least", "finalists", "repeats")
"""Settings that may change when a run is resumed: none changes an earlier proposal."""


class SearchVehicle(Strict):
    """The vehicle profile that the envelope's limits come from."""

    name: str
    """Of fieldkit's profile, or of the file."""
    title: str
    sha256: Sha256
    """Of the file."""


def unchanging(source: PlanSource, noise: NoiseSettings) -> bool:
    """Whether a set has the same value at every seed: photographs are recorded, without added noise."""
    return source.kind == "captures" and not noise.any


class GivenPlot(Strict):
    """A plot that a plan is made on."""

    source: PlanSource
    path: str
    """Where that was; the name of a scene that comes with fieldkit."""
    images_path: str | None = None
    """Where the photographs of a reference's proxy were."""
    reference_path: str | None = None
    """Where the reference of a recorded set was."""


class SearchSettings(SearchChoices):
    """search.json: everything that a run's outcome depends on, except the photographs or the scene themselves."""

    model_config = ConfigDict(protected_namespaces=())

    kind: Literal["search"] = "search"
    version: Literal[2] = 2
    fieldkit: str
    """Version that started the run."""
    given: Annotated[tuple[GivenPlot, ...], Field(min_length=1)]
    """The given plots, all of the same kind of source."""
    camera: Intrinsics | None = None
    """The plan's camera at full size; null takes the scene's or the reference's."""
    vehicle: SearchVehicle | None = None
    """The plan's vehicle; its limits are in ``envelope``."""
    at_least: Count = 0
    """Evaluations before the search may end by convergence."""
    lag: Count = 0
    """A proposal for trial k knows the results up to k − lag − 1."""

    @model_validator(mode="after")
    def _for_all_that_are_given(self) -> SearchSettings:
        if self.plots < len(self.given):
            raise ValueError(f"plots: {len(self.given)} are given, but the plan is for {self.plots}")
        return self

    @property
    def source(self) -> PlanSource:
        """The first given plot."""
        return self.given[0].source

    @property
    def all_plots(self) -> int:
        """Number of plots: those that the plan is for, and with several one for each repeat that no trial has met."""
        return self.plots + (self.repeats if self.plots > 1 else 0)


def lag_for(workers: int) -> int:
    """The number of trials by which proposals run ahead of results.

    0 with one worker: every proposal knows all results. 2(W − 1) with W workers, so that a worker that finishes early
    finds a trial ready, as long as no evaluation takes twice as long as another. Proposals depend on this number and
    not on when evaluations end, so a run is repeatable for each W.
    """
    return 2 * (workers - 1)
