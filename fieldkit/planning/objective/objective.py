"""The objective r(z), BOSfM's eq. `r_func`: the result of real structure from motion with a set of cameras.

Photographs come from a source, simulated or recorded, at one of three levels of detail.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

from fieldkit.cache import StageCache, digest
from fieldkit.captures.model import Capture
from fieldkit.clouds.alignment import REFERENCE_REACH_M, icp_onto_reference
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import ReferenceIndex, nearest_distances, score_distances
from fieldkit.clouds.volume import Volume
from fieldkit.errors import ReconstructionError, UsageError
from fieldkit.geometry import Intrinsics
from fieldkit.planning.objective.evaluation import WORST_M, Evaluation, f_score_table, value_m
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.dense import resolution
from fieldkit.reconstruction.pipeline import KnownPlot, reconstruct
from fieldkit.reconstruction.settings import FeatureSettings, PriorMappingSettings, ReconstructionSettings
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.sites.fitted import Stretch
from fieldkit.vocabulary import DISTANCES_M, MappingName, SearchFidelity
from fieldkit.vocabulary import Fidelity as DenseFidelity


@dataclass(frozen=True)
class Fidelity:
    """A level of detail of evaluations."""

    drawn_side: int = 2000
    """Least longer side of rendered photographs, pixels, at most the camera's; recorded ones keep their size."""
    features: FeatureSettings = field(default_factory=FeatureSettings)
    """Detection in rendered photographs; recorded ones always use the defaults of `FeatureSettings`."""
    dense: DenseFidelity = "standard"

    def camera(self, camera: Intrinsics, cameras: Cameras, volume: Volume) -> Intrinsics:
        """The camera that photographs are rendered with: large enough for dense stereo from the farthest one."""
        size = (camera.width, camera.height)
        sides = [max(resolution(size, camera, p, volume, self.dense).size) for p in cameras.poses()]
        scale = max(self.drawn_side, *sides) / max(size)
        return camera if scale >= 1.0 else camera.scaled(round(camera.width * scale), round(camera.height * scale))


FIDELITIES: dict[SearchFidelity, Fidelity] = {
    "draft": Fidelity(1200, features=FeatureSettings(working_side=900, max_features=3000), dense="draft"),
    "standard": Fidelity(1600, features=FeatureSettings(working_side=1400)),
    "fine": Fidelity(dense="fine"),
}
"""Draft and standard render and match fewer pixels than fine, and densify coarser ones."""


@dataclass(frozen=True)
class PhotoSet:
    """The photographs of a set of cameras."""

    capture: Capture
    """With the commanded poses as its priors, in the plot frame."""
    views: tuple[str, ...]
    """The photographs' names in the cameras' order."""
    features: FeatureSettings = field(default_factory=FeatureSettings)
    """Settings of their detection."""


class PhotoSource(Protocol):
    """Takes the commanded photographs, and knows the truth they are scored against.

    A source can be pickled: worker processes get a copy and prepare it once.
    """

    @property
    def plot(self) -> KnownPlot:
        """Frame, volume of interest and ground. The metric source's frame is the plot frame."""
        ...

    @property
    def cache(self) -> StageCache:
        """The cache that evaluations share."""
        ...

    @property
    def reference(self) -> ReferenceIndex:
        """PC_env, indexed."""
        ...

    def prepare(self) -> None:
        """Make what every evaluation needs (a renderer, an index). Further calls do nothing."""
        ...

    def photograph(
        self, cameras: Cameras, fidelity: Fidelity, seed: int, progress: Progress
    ) -> AbstractContextManager[PhotoSet]:
        """The photographs, which exist while the context is open."""
        ...

    def close(self) -> None:
        """Free what `prepare` made."""
        ...


class PlotKind(Protocol):
    """Plots by number, to take photographs of. Picklable."""

    def prepare(self) -> None:
        """Do the one-off work of the first evaluation now. Raises errors that prevent any evaluation here."""
        ...

    def source(self, number: int) -> PhotoSource:
        """The source of a plot's photographs."""
        ...


@dataclass(frozen=True)
class ObjectiveSettings:
    """All settings of r except the plot and the seed."""

    fidelity: SearchFidelity = "standard"
    """``"draft"``, ``"standard"`` or ``"fine"``."""
    mapping: MappingName = "prior"
    """``"prior"`` starts from the commanded poses, as in the field; ``"incremental"`` is the paper's. Either is real
    SfM from the photographs: camera poses are never taken as known.
    """
    bands_px: tuple[float, ...] | None = None
    """Half widths of the bands that prior mapping matches in, round by round, in pixels of a photograph 1600 wide; None
    takes the default of `PriorMappingSettings`. Fewer rounds suit poses known to some millimetres.
    """
    refine: bool = False
    """Align and scale each cloud to the reference by ICP before it is scored. Poses that are off by centimetres move,
    tilt and scale the cloud at random; what remains is the shape, which depends on the cameras' places.
    """

    @property
    def prior(self) -> PriorMappingSettings:
        """Settings of prior mapping."""
        default = PriorMappingSettings()
        return default if self.bands_px is None else replace(default, bands_px=self.bands_px)


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
        self,
        source: PhotoSource,
        settings: ObjectiveSettings | None = None,
        *,
        seed: int = 0,
        stretch: Stretch | None = None,
    ) -> None:
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
        if self.stretch is not None:
            cameras = cameras.stretched(self.stretch)
        spent, detail = Spent.now(), FIDELITIES[fidelity or self.settings.fidelity]
        noise_seed = self.seed if seed is None else seed
        with self.source.photograph(cameras, detail, noise_seed, Silent()) as photos:
            wanted = ReconstructionSettings(
                features=photos.features,
                mapping=self.settings.mapping,
                fidelity=detail.dense,
                # They are commands, or a reference's: never a camera's doubtful records.
                trust_orientations=True,
                prior=self.settings.prior,
                seed=self.seed,
            )
            try:
                made = reconstruct(
                    photos.capture,
                    wanted,
                    Context(self.source.cache),
                    known_plot=self.source.plot,
                    reach_m=REFERENCE_REACH_M if self.settings.refine else 0.0,
                )
            except ReconstructionError as error:
                plants, failure = Cloud.empty(), error.message
                registered, right, models = error.registered, error.right, error.models
            else:
                plants, failure, sparse = made.plants, "", made.sparse
                registered, right, models = sparse.registered, sparse.right, len(sparse.model_sizes)
                if self.settings.refine:
                    motion, _ = icp_onto_reference(plants, self.source.reference, with_scale=True)
                    plants = made.moved_plants(motion)
        scored: dict[str, Any] = {"value_m": WORST_M}
        if len(plants):
            to_reference, to_cloud = nearest_distances(self.source.reference, plants)
            score = score_distances(to_reference, to_cloud, DISTANCES_M)
            scored = asdict(score.chamfer) | {
                "value_m": value_m(to_cloud, to_reference),
                "f_score": f_score_table({d: score.f_scores[d].f_score for d in DISTANCES_M}),
            }
        evaluation = Evaluation(
            registered=registered,
            right=right,
            models=models,
            points=len(plants),
            cloud_digest=digest(plants.points),
            views=photos.views,
            failure=failure,
            cpu_s=max(spent.cpu_seconds, 0.0),
            wall_s=spent.seconds,
            **scored,
        )
        return evaluation, plants


_OPEN = 2
"""Number of plots that a process keeps ready to render; another renderer takes a second to start."""


class PlotsObjective:
    """The objectives of a kind's plots by their numbers; for workers.

    Args:
        stretches: by number, for those that cameras are fitted to.
    """

    def __init__(
        self,
        kind: PlotKind,
        settings: ObjectiveSettings,
        *,
        seed: int = 0,
        stretches: Mapping[int, Stretch] | None = None,
    ) -> None:
        self.kind, self.settings, self.seed, self.stretches = kind, settings, seed, stretches or {}
        self._open: OrderedDict[int, Objective] = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_open": OrderedDict()}

    def prepare(self) -> None:
        """See `PlotKind.prepare`."""
        self.kind.prepare()

    def on(self, plot: int) -> Objective:
        """The plot's objective. Raises SceneError."""
        if plot not in self._open:
            stretch = self.stretches.get(plot)
            self._open[plot] = Objective(self.kind.source(plot), self.settings, seed=self.seed, stretch=stretch)
            if len(self._open) > _OPEN:
                self._open.popitem(last=False)[1].close()
        self._open.move_to_end(plot)
        return self._open[plot]

    def close(self) -> None:
        """Free the renderers."""
        for objective in self._open.values():
            objective.close()
        self._open.clear()
