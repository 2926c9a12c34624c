"""The objective r(z), BOSfM's eq. `r_func`: the result of real structure from motion with a set of cameras."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

from fieldkit.cache import digest
from fieldkit.clouds.alignment import REFERENCE_REACH_M, icp_onto_reference
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import nearest_distances, score_distances
from fieldkit.errors import ReconstructionError, UsageError
from fieldkit.planning.objective.evaluation import Evaluation, Rule, StageCost, value_m
from fieldkit.planning.objective.source import FIDELITIES, PhotoSet, PhotoSource
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.mapping.prior import PriorMappingSettings
from fieldkit.reconstruction.pipeline import reconstruct
from fieldkit.reconstruction.result import Reconstruction
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.stages import StageTimer
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent
from fieldkit.sites.fitted import Stretch
from fieldkit.vocabulary import DISTANCES_M, MappingName, SearchFidelity

_LEAST_CAMERAS = 2


@dataclass(frozen=True)
class ObjectiveSettings:
    """All settings of r except the plot and the seed."""

    fidelity: SearchFidelity = "standard"
    """``"draft"``, ``"standard"`` or ``"fine"``."""
    mapping: MappingName = "prior"
    """``"prior"`` starts from the commanded poses, as in the field; ``"incremental"`` is the paper's. Either is real
    SfM from the photographs: camera poses are never taken as known.
    """
    rule: Rule = field(default_factory=Rule)
    """For the value of poor clouds."""
    min_agreeing_views: int = 2
    """Setting of the fusion."""
    bands_px: tuple[float, ...] | None = None
    """Half widths of the bands that prior mapping matches in, round by round, in pixels of a photograph 1600 wide; None
    takes the default of `PriorMappingSettings`. Fewer rounds suit poses known to some millimetres.
    """
    refine: bool = False
    """Align and scale each cloud to the reference by ICP before it is scored. Poses that are off by centimetres move,
    tilt and scale the cloud at random; what remains is the shape, which depends on the cameras' places.
    """

    def __post_init__(self) -> None:
        if self.fidelity not in FIDELITIES:
            raise UsageError(
                f"there is no fidelity {self.fidelity!r}", remedy=f"Choose one of {', '.join(FIDELITIES)}."
            )
        if self.bands_px is not None and not (self.bands_px and min(self.bands_px) > 0):
            raise UsageError(f"bands_px are widths above 0, not {self.bands_px}")

    @property
    def prior(self) -> PriorMappingSettings:
        """Settings of prior mapping."""
        default = PriorMappingSettings()
        return default if self.bands_px is None else replace(default, bands_px=self.bands_px)


class _Mapped(NamedTuple):
    """Number of registered photographs, of right ones, and of models."""

    registered: int
    right: int
    models: int


class Objective:
    """Evaluates sets of cameras: photographs → features → matches → mapping → dense stereo → chamfer distance.

    The model is placed by the commanded camera centres (the true ones are unknown, as in the field). The cloud is
    cropped to the plot's volume of interest and, with ``refine``, aligned to the reference. On one thread the same
    source, cameras and seed give the same evaluation in every process.

    Args:
        source: simulated or recorded photographs.
        seed: of mapping and dense stereo, and of the photographs' noise unless `evaluate` gets another one.
        stretch: fits cameras to the plot first, if it is one of several that a plan is for.

    Example:
        >>> objective = Objective(SimulatedSource(proxy), ObjectiveSettings("draft"))
        >>> objective.evaluate(Cameras.from_poses(ring(10, 1.4, 1.1))).value_m
    """

    def __init__(
        self, source: PhotoSource, settings: ObjectiveSettings | None = None, *, seed: int = 0,
        stretch: Stretch | None = None,
    ) -> None:  # fmt: skip
        self.source = source
        self.stretch = stretch
        self.settings = settings or ObjectiveSettings()
        self.seed = seed

    def prepare(self) -> None:
        """Do the one-off work of the first evaluation now. Raises the source's errors."""
        self.source.prepare()

    def close(self) -> None:
        """Free the source's renderer."""
        self.source.close()

    def on(self, plot: int) -> Objective:
        """This objective itself; its only plot has the number 0."""
        if plot:
            raise UsageError(f"there is no plot {plot} to evaluate on")
        return self

    def evaluate(
        self, cameras: Cameras, *, seed: int | None = None, fidelity: SearchFidelity | None = None
    ) -> Evaluation:
        """Evaluate a set of cameras.

        Args:
            cameras: as commanded, plot frame.
            seed: of the photographs' noise, for repeats; None takes the objective's.
            fidelity: for this evaluation only; None takes the settings'.

        Returns:
            The evaluation. Photographs that do not reconstruct are a result, not an error: their value follows from the
            rule.
        """
        return self.evaluate_cloud(cameras, seed=seed, fidelity=fidelity)[0]

    def evaluate_cloud(
        self, cameras: Cameras, *, seed: int | None = None, fidelity: SearchFidelity | None = None
    ) -> tuple[Evaluation, Cloud]:
        """As `evaluate`, with the plants' cloud (plot frame); empty if there is none."""
        if len(cameras) < _LEAST_CAMERAS:
            raise UsageError(f"an evaluation needs at least two cameras, not {len(cameras)}")
        if self.stretch is not None:
            cameras = cameras.stretched(self.stretch)
        timer = StageTimer(Silent())
        chosen = FIDELITIES[fidelity or self.settings.fidelity]
        noise_seed = self.seed if seed is None else seed
        with self.source.photograph(cameras, chosen, noise_seed, timer) as photos:
            wanted = ReconstructionSettings(
                features=photos.features,
                mapping=self.settings.mapping,
                fidelity=chosen.dense,
                min_agreeing_views=self.settings.min_agreeing_views,
                # They are commands, or a reference's: never a camera's doubtful records.
                trust_orientations=True,
                prior=self.settings.prior,
                seed=self.seed,
            )
            try:
                found = reconstruct(
                    photos.capture, wanted, Context(self.source.cache, timer), known_plot=self.source.plot,
                    reach_m=REFERENCE_REACH_M if self.settings.refine else 0.0,
                )  # fmt: skip
            except ReconstructionError as error:
                mapped = _Mapped(error.registered, error.right, error.models)
                return self._scored(photos, Cloud.empty(), mapped, error.message, timer), Cloud.empty()
        sparse = found.sparse
        mapped = _Mapped(sparse.registered, sparse.right, len(sparse.model_sizes))
        plants = self._refined(found, timer) if self.settings.refine else found.plants
        return self._scored(photos, plants, mapped, "", timer), plants

    def _refined(self, found: Reconstruction, timer: StageTimer) -> Cloud:
        with timer.stage("Refining"):
            motion, _ = icp_onto_reference(found.plants, self.source.reference, with_scale=True)
            return found.moved_plants(motion)

    def _scored(self, photos: PhotoSet, cloud: Cloud, mapped: _Mapped, failure: str, timer: StageTimer) -> Evaluation:
        value, score = self.settings.rule.worst_m, None
        if len(cloud):
            with timer.stage("Scoring"):
                to_reference, to_cloud = nearest_distances(self.source.reference, cloud)
                score = score_distances(to_reference, to_cloud, DISTANCES_M)
                value = value_m(to_cloud, to_reference, self.settings.rule)
        return Evaluation(
            value_m=value,
            chamfer_m=None if score is None else score.chamfer.chamfer_m,
            accuracy_m=None if score is None else score.chamfer.accuracy_m,
            completeness_m=None if score is None else score.chamfer.completeness_m,
            f_scores={d: 0.0 if score is None else score.f_scores[d].f_score for d in DISTANCES_M},
            images=len(photos.views),
            registered=mapped.registered,
            right=mapped.right,
            models=mapped.models,
            points=len(cloud),
            cloud_digest=digest(cloud.points),
            views=photos.views,
            failure=failure,
            times=tuple(StageCost(t.name, t.cpu_s, t.wall_s) for t in timer.times({})),
        )
