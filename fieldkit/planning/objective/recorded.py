"""The recorded back end: cameras are matched to recorded photographs, of the plot or of others like it.

Other plots are its plants turned in front of the recorded cameras, with only a share of their matches.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.cache import StageCache, digest
from fieldkit.captures.model import Capture
from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.metrics import ReferenceIndex
from fieldkit.errors import MetadataError, UsageError
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.pose import rotation_from_vector
from fieldkit.geometry.priors import PosePrior, SourceFrame
from fieldkit.planning.objective.objective import Fidelity, PhotoSet
from fieldkit.planning.space.cameras import Cameras, assign, view_angles_deg
from fieldkit.planning.space.plots import Plot
from fieldkit.reconstruction.cameras import cameras_of
from fieldkit.reconstruction.guided import (
    Band,
    IndexedFeatures,
    PosedFeatures,
    Region,
    match_guided,
    region_of_interest,
)
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.reconstruction.mapping.view_graph import null_model_matches
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.reconstruction.settings import FeatureSettings
from fieldkit.reconstruction.stages import load_features
from fieldkit.reconstruction.versions import BESIDE
from fieldkit.runtime.context import Context
from fieldkit.runtime.executor import map_threads
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.simulate import CaptureNoise, perturbed
from fieldkit.wording import count

_SAME_PLACE_SIGMAS = 5.0
"""Distance from a stated position within which a reconstructed pose lends its angles, in standard deviations."""
_LENT_SIGMA_DEG = 1.0
"""Standard deviation of lent angles, degrees."""
EXACT = CaptureNoise(position_m=0.0, angle_deg=0.0, image_sigma=0.0)


@dataclass(frozen=True, eq=False)
class RecordedView:
    """A recorded photograph with its commanded pose in the plot frame and that pose's accuracy."""

    name: str
    pose: Pose
    position_sigma_m: float
    angle_sigma_deg: float


@dataclass(frozen=True)
class Rehearsal:
    """How a recorded plot is changed to stand for another one of its kind."""

    turn_deg: float = 0.0
    """Turn of the plants, counterclockwise from above; cameras are turned the other way."""
    kept: float = 1.0
    """Share of the matches that are not withheld."""
    draw: int = 0
    """Number of the draw of withheld matches."""


def recorded_views(
    capture: Capture, plot: KnownPlot, reconstructed: Mapping[str, Pose] | None = None
) -> tuple[RecordedView, ...]:
    """The photographs of a capture whose positions and orientations are known, in the plot frame.

    Args:
        reconstructed: poses that the reference found for photographs of these names, in the plot frame. They give their
            orientation to photographs of the same place whose orientation is unknown.
    """
    known = known_poses(capture, plot.source)
    views = []
    for name, k in known.by_name.items():
        lent = (reconstructed or {}).get(name)
        if k.position is None:
            continue
        if k.rotation is not None:
            views.append(RecordedView(name, Pose(k.rotation, k.position), k.position_sigma_m, k.angle_sigma_deg))
        elif lent is not None and np.linalg.norm(lent.center - k.position) <= _SAME_PLACE_SIGMAS * k.position_sigma_m:
            views.append(RecordedView(name, Pose(lent.rotation, k.position), k.position_sigma_m, _LENT_SIGMA_DEG))
    if len(views) < 3:
        raise MetadataError(
            f"positions and orientations are known of {count(len(views), 'photograph')} only",
            path=capture.folder,
            remedy="Put a poses.csv with x_m, y_m, z_m, yaw_deg and pitch_deg beside the photographs. The angles may "
            "be missing where --reference is built of the same photographs.",
        )
    order = {name: k for k, name in enumerate(capture.names)}
    return tuple(sorted(views, key=lambda view: order[view.name]))


class InputsCache(StageCache):
    """A cache of what evaluations share: features, matches of pairs and undistorted views.

    Models and depth maps are not kept: other sets cannot use them, and a search would fill the disk.
    """

    KEPT_STAGES = frozenset({"features", "guided", "match-graph", "matches", "pairs", "quality", "views"})

    def get(self, stage: str, key: str) -> dict[str, np.ndarray] | None:
        return super().get(stage, key) if stage in self.KEPT_STAGES else None

    def put(self, stage: str, key: str, arrays: dict[str, np.ndarray]) -> None:
        if stage in self.KEPT_STAGES:
            super().put(stage, key, arrays)


class RecordedSource:
    """Answers cameras with photographs of a recorded set; see `PhotoSource`.

    Features, matches and undistorted views are kept in the cache, so that an evaluation costs mapping and dense stereo
    only. The region that the cameras look at is found once, from all views, so that a pair's first matches, made at the
    known poses, are the same in every set.

    Args:
        capture: with known poses (poses.csv).
        plot: of a reference of the same plot.
        reference: PC_env, plot frame.
        noise: added to the known poses, as a less exact flight would; images stay as they are.
        reconstructed: poses to take missing orientations from; see `recorded_views`.
    """

    def __init__(
        self,
        capture: Capture,
        plot: KnownPlot,
        reference: Cloud,
        *,
        cache: StageCache,
        noise: CaptureNoise = EXACT,
        reconstructed: Mapping[str, Pose] | None = None,
    ) -> None:
        if noise.image_sigma > 0:
            raise UsageError("recorded photographs are taken as they are: image noise is for simulated ones")
        self.capture, self.cloud, self.noise = capture, reference, noise
        self.views = recorded_views(capture, plot, reconstructed)
        # Positions in any frame of the capture are transformed to the plot frame here.
        region = region_of_interest([view.pose for view in self.views])
        self._rehearsal = Rehearsal()
        self.plot = replace(plot, source=SourceFrame("poses.csv", None, Similarity.identity()), region=region)
        self.cache = InputsCache(cache.root)
        self._reference: ReferenceIndex | None = None
        centers = np.array([view.pose.center for view in self.views])
        self.distance_m = float(np.median(np.linalg.norm(centers - plot.volume.center, axis=1)))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_reference": None}

    def rehearsing(self, rehearsal: Rehearsal) -> RecordedSource:
        """The same photographs as another plot."""
        other = copy(self)
        other._rehearsal, other._reference = rehearsal, self._reference  # not copied
        return other

    @property
    def middle(self) -> FloatArray:
        """(3,) centre about which cameras are turned: what they look at, else the middle of the plot."""
        region = self.plot.region
        return np.array(self.plot.volume.center if region is None else region.center)

    @property
    def reference(self) -> ReferenceIndex:
        if self._reference is None:
            self._reference = ReferenceIndex(self.cloud)
        return self._reference

    def prepare(self) -> None:
        assert self.reference is not None

    def close(self) -> None:
        """Nothing to free."""

    def cameras(self, index: Sequence[int] | IntArray | None = None) -> Cameras:
        """The recorded cameras of the given indices (all by default); they project onto themselves."""
        chosen = range(len(self.views)) if index is None else index
        return Cameras.from_poses(self.views[int(k)].pose for k in chosen)

    def project(self, cameras: Cameras) -> IntArray:
        """The distinct recorded views (n,) that stand for the cameras; see `assign`."""
        return assign(cameras, self.cameras(), self.distance_m)

    @contextmanager
    def photograph(self, cameras: Cameras, fidelity: Fidelity, seed: int, progress: Progress) -> Iterator[PhotoSet]:
        """The recorded photographs that stand for the cameras, each with its own commanded pose."""
        rehearsal = self._rehearsal
        chosen = self.project(cameras.turned(self.middle, -rehearsal.turn_deg) if rehearsal.turn_deg else cameras)
        # A match needs both of its features.
        features = FeatureSettings(kept=float(np.sqrt(rehearsal.kept)), draw=rehearsal.draw)
        yield PhotoSet(self._subset(chosen, seed), tuple(self.views[int(k)].name for k in chosen), features)

    def _subset(self, chosen: FloatArray | IntArray, seed: int) -> Capture:
        # In the set's order, with noise by the view's own number: the order of the cameras does not matter.
        noisy = perturbed([view.pose for view in self.views], self.noise, seed)
        picked = {self.views[int(k)].name: _prior(self.views[int(k)], noisy[int(k)], self.noise) for k in chosen}
        groups = [replace(g, photos=tuple(n for n in g.photos if n in picked)) for g in self.capture.groups]
        return replace(
            self.capture,
            photos=tuple(photo for photo in self.capture.photos if photo.name in picked),
            groups=tuple(group for group in groups if group.photos),
            findings=(),
            priors=picked,
            metric_source="poses.csv",
            origin=None,
            height_source=None,
            markers=None,
            program=None,
        )


def _prior(view: RecordedView, pose: Pose, noise: CaptureNoise) -> PosePrior:
    sigma_m = float(np.hypot(view.position_sigma_m, noise.position_m))
    sigma_deg = float(np.hypot(view.angle_sigma_deg, noise.angle_deg))
    prior = PosePrior(pose.center, sigma_m, angle_sigma_deg=sigma_deg, source="poses.csv")
    return prior.with_angles(pose.yaw_pitch_roll_deg())


LEAST_KEPT = 0.3
"""Least share of matches kept: the recorded rigs' matches differ by up to three times."""
_STREAM = 53
"""Seed's part for rehearsals."""
_GOLDEN = (5**0.5 - 1) / 2
"""Step of evenly spread shares: the golden ratio's."""
_ALL_ROUND = 1.5
"""Largest mean distance of turned views from their recorded ones, in spacings of the recorded views."""


@dataclass(frozen=True, eq=False)
class RecordedKind:
    """Plots of a recorded plot's kind, by number; 0 is the plot as it was recorded.

    Turning the plants is the same as turning the cameras, which have photographs if the views go all round. Else plots
    differ only in the share of matches.
    """

    recorded: RecordedSource
    seed: int

    def prepare(self) -> None:
        """See `PlotKind.prepare`."""
        self.recorded.prepare()

    def source(self, number: int) -> RecordedSource:
        """The source of a plot's photographs."""
        return self.recorded.rehearsing(self.rehearsal(number))

    def rehearsal(self, number: int) -> Rehearsal:
        """The changes of a plot."""
        if not number:
            return Rehearsal()
        turn_deg = float(np.random.default_rng([self.seed, _STREAM, number]).uniform(0.0, 360.0))
        # Spread evenly over the range, so that any few plots in a row have high shares and low ones.
        start = float(np.random.default_rng([self.seed, _STREAM]).random())
        kept = LEAST_KEPT + (1.0 - LEAST_KEPT) * ((start + number * _GOLDEN) % 1.0)
        return Rehearsal(turn_deg if self._all_round(turn_deg) else 0.0, kept, number)

    def plot(self, number: int, matches: FloatArray | None) -> Plot:
        """The plot as planning knows it. ``matches`` (m, m) are between the recorded views on the plot as recorded."""
        rehearsal, cloud = self.rehearsal(number), self.recorded.cloud
        middle = self.recorded.middle
        turn = rotation_from_vector(np.array([0.0, 0.0, np.radians(rehearsal.turn_deg)]))
        turned = cloud.transformed(Similarity(1.0, turn, middle - turn @ middle))
        if matches is not None:
            index = self.recorded.project(self.recorded.cameras().turned(middle, -rehearsal.turn_deg))
            matches = rehearsal.kept * matches[np.ix_(index, index)]
        return Plot(turned, matches=matches)

    def _all_round(self, turn_deg: float) -> bool:
        cameras = self.recorded.cameras()
        turned = cameras.turned(self.recorded.middle, -turn_deg)
        nearest = cameras.select(self.recorded.project(turned))
        apart = np.linalg.norm(cameras.positions[:, None] - cameras.positions[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        away = np.linalg.norm(nearest.positions - turned.positions, axis=1)
        return bool(away.mean() <= _ALL_ROUND * np.median(apart.min(axis=1)))


_WIDEST_DEG = 60.0
"""Leaves hardly match beyond: sim/README.md has 9 of 309 matches left at 48°."""
_BAND_PX = 10.0
"""In a photograph 1600 pixels wide; commanded poses are good enough for it."""


def match_graph(source: RecordedSource, features: FeatureSettings, context: Context) -> FloatArray:
    """(m, m) matches above chance of each pair of recorded views, symmetric, 0 on the diagonal.

    Matches are guided by the known poses; those found in a displaced band are chance and are subtracted. Pairs more
    than 60° apart about the plot count as without matches. The result is kept in the source's cache. ``features`` are
    detected as in evaluations, which then find them in the cache; workers are processes that detect, then threads that
    match.
    """
    workers, progress = context.workers, context.progress
    names = [view.name for view in source.views]
    cameras = cameras_of(source.capture, source.plot.calibrated)
    photos = {photo.name: photo for photo in source.capture.photos}
    with progress.stage("Features", len(names)) as advance:
        keyed = load_features([photos[name] for name in names], features, replace(context, cache=source.cache), advance)
    camera_of = dict(zip(source.capture.names, cameras.camera_of, strict=True))
    intrinsics = [cameras.cameras[camera_of[name]] for name in names]
    poses = [view.pose for view in source.views]
    region = source.plot.region
    version = BESIDE["match-graph"]
    key = digest("match-graph", version, [f.key for f in keyed], intrinsics, poses, region, _BAND_PX, _WIDEST_DEG)
    kept = source.cache.get("match-graph", key)
    if kept is not None:
        return kept["matches"]
    posed = [
        PosedFeatures(IndexedFeatures.of(f.features, camera), pose)
        for f, camera, pose in zip(keyed, intrinsics, poses, strict=True)
    ]
    centers = np.array([pose.center for pose in poses])
    near = np.argwhere(np.triu(view_angles_deg(centers, np.array(source.plot.volume.center)) <= _WIDEST_DEG, 1))
    matches = np.zeros((len(names), len(names)))
    with progress.stage("Match graph", len(near)) as advance:
        counts = map_threads(
            lambda pair: _above_chance(posed[pair[0]], posed[pair[1]], region),
            near.tolist(),
            workers=workers,
            advance=advance,
        )
    matches[near[:, 0], near[:, 1]] = matches[near[:, 1], near[:, 0]] = counts
    source.cache.put("match-graph", key, {"matches": matches})
    return matches


def _above_chance(a: PosedFeatures, b: PosedFeatures, region: Region | None) -> float:
    band = Band(_BAND_PX * a.camera.width / 1600.0, region)
    return max(0.0, len(match_guided(a, b, band)) - null_model_matches(a, b, band))
