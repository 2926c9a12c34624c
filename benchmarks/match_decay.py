"""The decay of matches with the angle between two views, on the recorded rigs and on rendered scenes."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.result import Cell, ResultTable, StudyResult
from benchmarks.rigs import RIG_FILE, read_rig
from benchmarks.scene_views import CAMERA, SceneUnderStudy, load_scene, photograph, ring_about_plants, study_scenes
from fieldkit.arrays import BoolArray, ByteArray
from fieldkit.captures import read_capture, read_image
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.reconstruction.features import Features, extract_features
from fieldkit.reconstruction.matching import match_features
from fieldkit.reconstruction.settings import FeatureSettings
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import Outdoors
from fieldkit.scenes.sway import Motion

SETTINGS = FeatureSettings(working_side=1600, max_features=8192, contrast_threshold=0.04)
"""OpenCV's own contrast threshold, as in the recorded figures for field maize."""

RATIO, ERROR_PX = 0.8, 1.5
OFFSETS_DEG = (0.0, 6.0, 18.0, 45.0, 54.0)
"""Views with pairs 6, 12, 18, 27, 36 and 48° apart (others, such as 9° and 39°, are left out)."""

ANGLES = {6: (0, 1), 12: (1, 2), 18: (0, 2), 27: (2, 3), 36: (2, 4), 48: (1, 4)}
RIGS = {"basil_rig": (1, 3, 4, 6, 8, 11), "arabidopsis_rig": (1, 2, 3, 5, 6, 8)}
"""Steps around the circle, one per column of the tables: 4.6 to 50° and 6 to 48°."""


@dataclass(frozen=True)
class PairCount:
    """A pair of photographs."""

    angle_deg: float
    """Between the views, about the plants."""
    features: float
    """Of the two, mean."""
    inliers: int
    """RootSIFT matches on one fundamental matrix."""
    on_plants: int
    """Of them, in the first photograph."""


@dataclass(frozen=True)
class Decay:
    """A set's figures by angle, medians over pairs; ``shares`` are relative to the smallest angle."""

    name: str
    angles_deg: tuple[float, ...]
    features: float
    inliers: tuple[float, ...]
    shares: tuple[float, ...]
    plant_shares: tuple[float | None, ...]


def run_match_decay(
    data: Path | None, scenes: Sequence[str] = (), *, bases: int = 3, progress: Progress
) -> StudyResult:
    """Count the matches of the recorded rigs (if ``data`` is given) and of rendered scenes.

    Args:
        data: folder of the recorded sets, or None.
        scenes: as `study_scenes` takes them.
        bases: number of places on the circle where pairs start, per scene; rigs start from every sixth photograph.
    """
    pairs: dict[str, list[PairCount]] = {}
    if data is not None:
        for name, steps in RIGS.items():
            pairs[name] = rig_pairs(data, name, steps, progress)
    for name in study_scenes(scenes):
        study = load_scene(name)
        pairs[study.name] = scene_pairs(study, bases, progress)
    decays = [summarise(name, found) for name, found in pairs.items()]
    real = [decay for decay in decays if decay.name in RIGS]
    return StudyResult(
        name="match-decay",
        title="Matches against the angle between views",
        tables=(count_table(decays), share_table(decays), *([verdict_table(decays, real)] if real else [])),
        notes=(
            "RootSIFT at 1600 px, 8192 features, ratio 0.8, mutual; fundamental matrix by MAGSAC at 1.5 px; medians.",
            "Rendered photographs have the camera effects, noise and wind of their scene files; seen from 1.7 m.",
            "On plants: within 2 px of the reference plants' outline; on the rigs, green enough (ExG above 20).",
            *(() if data is not None else ("Without FIELDKIT_DATA the rigs are left out.",)),
        ),
        figures={
            "sets": [asdict(decay) for decay in decays],
            "pairs": {name: [asdict(pair) for pair in found] for name, found in pairs.items()},
        },
    )


def inliers(a: Features, b: Features, scale: float) -> NDArray[np.uint32]:
    """Matches (k, 2) that agree with one fundamental matrix; ``scale`` turns full-size pixels into working ones."""
    matches = match_features(a, b, ratio=RATIO)
    if len(matches) < 8:
        return matches[:0]
    _, found = cv2.findFundamentalMat(
        a.points[matches[:, 0]] * scale, b.points[matches[:, 1]] * scale, cv2.USAC_MAGSAC, ERROR_PX, 0.9999, 20_000
    )
    kept = np.atleast_1d(np.asarray(found)).ravel()  # None without a matrix, which OpenCV's stubs omit
    return matches[kept > 0] if len(kept) == len(matches) else matches[:0]


def rig_pairs(data: Path, name: str, steps: Sequence[int], progress: Progress) -> list[PairCount]:
    """Pairs of a recorded rig, by steps around its circle."""
    photos = {photo.name: photo for photo in read_capture(data / name / "images").photos}
    names = [n for n in read_rig(data / name / RIG_FILE) if n in photos]
    count = len(names)
    known: dict[int, tuple[Features, BoolArray, float]] = {}

    def view(i: int) -> tuple[Features, BoolArray, float]:
        if i % count not in known:
            color = read_image(photos[names[i % count]])
            gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
            features = extract_features(np.asarray(gray, dtype=np.uint8), SETTINGS)
            known[i % count] = (features, _at(features, green(color)), min(1.0, 1600 / max(gray.shape)))
        return known[i % count]

    pairs = []
    starts = range(0, count, 6)
    with progress.stage(f"Pairs of {name}", len(starts)) as advance:
        for start in starts:
            for step in steps:
                (a, plants, scale), (b, _, _) = view(start), view(start + step)
                pairs.append(_count(360.0 / count * step, a, b, scale, plants))
            advance(1)
    return pairs


def scene_pairs(study: SceneUnderStudy, bases: int, progress: Progress) -> list[PairCount]:
    """Pairs of photographs of a rendered plot, on a ring 1.7 m from its plants."""
    only = replace(study.scene, meshes=tuple(study.scene.plants))
    first = {i for i, _ in ANGLES.values()}
    pairs = []
    with (
        Renderer(study.scene) as renderer,
        Renderer(only) as plants,
        tempfile.TemporaryDirectory(prefix="fieldkit-") as folder,
        progress.stage(f"Rendered pairs of {study.name}", bases) as advance,
    ):
        for base in range(bases):
            poses = [
                ring_about_plants(study.description, 1, start_deg=360.0 * base / bases + offset)[0]
                for offset in OFFSETS_DEG
            ]
            seed, target = 100 + base, Path(folder) / f"{base}"
            true = photograph(target, study, renderer, poses, seed, progress)
            views = []
            for i, (photo, pose) in enumerate(zip(read_capture(target).photos, true, strict=True)):
                features = extract_features(read_image(photo, gray=True), SETTINGS)
                on_plants = np.zeros(len(features), np.bool_)
                if i in first:
                    _take_the_moment(study, renderer, plants, seed, i)
                    on_plants = _at(features, visible_plants(renderer, plants, pose, CAMERA))
                views.append((features, on_plants))
            renderer.rest()
            for angle, (i, j) in ANGLES.items():
                pairs.append(_count(float(angle), views[i][0], views[j][0], 0.8, views[i][1]))
            advance(1)
    return pairs


def _take_the_moment(study: SceneUnderStudy, whole: Renderer, plants: Renderer, seed: int, photograph: int) -> None:
    """Move the leaves to their state in a photograph."""
    outdoors = Outdoors(study.description.wind_m)
    for renderer in (whole, plants):
        renderer.move(Motion(renderer.scene, seed).at(outdoors.time_s(photograph), outdoors.wind_m))


def visible_plants(whole: Renderer, plants: Renderer, pose: Pose, camera: Intrinsics) -> BoolArray:
    """(h, w) mask of the reference's plants where they are the nearest surface, 2 px wider."""
    all_depth, plant_depth = whole.depth(pose, camera), plants.depth(pose, camera)
    seen = (plant_depth > 0) & (np.abs(plant_depth - all_depth) < 0.003)
    return np.asarray(cv2.dilate(seen.astype(np.uint8), np.ones((5, 5), np.uint8))) > 0


def green(color: ByteArray) -> BoolArray:
    """(h, w) mask of excess green 2G − R − B above 20 (Woebbecke et al. 1995), 2 px wider."""
    r, g, b = (color[..., i].astype(np.int16) for i in range(3))
    excess = cv2.blur((2 * g - r - b).astype(np.float32), (5, 5)) > 20
    return np.asarray(cv2.dilate(excess.astype(np.uint8), np.ones((5, 5), np.uint8))) > 0


def summarise(name: str, pairs: Sequence[PairCount]) -> Decay:
    """Medians by angle."""
    angles = sorted({pair.angle_deg for pair in pairs})
    groups = [[pair for pair in pairs if pair.angle_deg == angle] for angle in angles]
    counts = [float(np.median([pair.inliers for pair in group])) for group in groups]
    shares = []
    for group in groups:
        total = sum(pair.inliers for pair in group)
        shares.append(sum(pair.on_plants for pair in group) / total if total else None)
    first = max(counts[0], 1.0)
    return Decay(
        name,
        tuple(angles),
        float(np.median([pair.features for pair in pairs])),
        tuple(counts),
        tuple(count / first for count in counts),
        tuple(shares),
    )


def allowed(real: Sequence[Decay], column: int) -> tuple[float, float]:
    """Least and greatest allowed share at an angle: the span of the real sets, field maize included, widened by 1.5."""
    values = [decay.shares[column] for decay in real]
    if FIELD_MAIZE[column] is not None:
        values.append(float(FIELD_MAIZE[column] or 0.0))
    return min(values) / 1.5, max(values) * 1.5


FIELD_MAIZE: tuple[float | None, ...] = (1.0, 0.126, 0.060, 0.040, None, None)
"""Maize in a leafy field, hand-held: 1657 inliers at 0–5°, 208 at 10–15°, 99 at 15–22°, 66 at 22–32°, as shares."""


def count_table(decays: Sequence[Decay]) -> ResultTable:
    """Inliers by angle, with the share on plants in brackets."""
    rows: list[tuple[Cell, ...]] = [("field maize (recorded figures)", "8192", "1657", "208", "99", "66", None, None)]
    for decay in decays:
        cells = [
            f"{count:.0f}" + ("" if share is None else f" ({100 * share:.0f} %)")
            for count, share in zip(decay.inliers, decay.plant_shares, strict=True)
        ]
        rows.append((decay.name, f"{decay.features:.0f}", *cells))
    return ResultTable("Inlier matches per pair (share on plants)", ("set", "features>", *_COLUMNS), tuple(rows))


def share_table(decays: Sequence[Decay]) -> ResultTable:
    """Inliers relative to the smallest angle."""
    rows: list[tuple[Cell, ...]] = [
        ("field maize (recorded figures)", *(None if v is None else f"{v:.3f}" for v in FIELD_MAIZE))
    ]
    rows += [(decay.name, *(f"{share:.3f}" for share in decay.shares)) for decay in decays]
    return ResultTable("In shares of the smallest angle", ("set", *_COLUMNS), tuple(rows))


def verdict_table(decays: Sequence[Decay], real: Sequence[Decay]) -> ResultTable:
    """Whether each rendered share lies within 1.5 times of the real sets' span."""
    spans = [allowed(real, column) for column in range(len(_COLUMNS))]
    rows: list[tuple[Cell, ...]] = [("allowed", *(f"{low:.3f}–{high:.3f}" for low, high in spans))]
    for decay in decays:
        if decay in real:
            continue
        marks = [
            "within" if low <= share <= high else ("below" if share < low else "above")
            for share, (low, high) in zip(decay.shares, spans, strict=True)
        ]
        rows.append((decay.name, *marks))
    return ResultTable("Against 1.5 times the real sets' span", ("set", *_COLUMNS), tuple(rows))


_COLUMNS = ("5–6°>", "12–14°>", "18°>", "27–30°>", "36°>", "48–50°>")


def _count(angle: float, a: Features, b: Features, scale: float, plants: BoolArray) -> PairCount:
    found = inliers(a, b, scale)
    return PairCount(angle, (len(a) + len(b)) / 2, len(found), int(plants[found[:, 0]].sum()))


def _at(features: Features, mask: BoolArray) -> BoolArray:
    column, row = np.floor(features.points).astype(int).T
    return np.asarray(mask[np.clip(row, 0, mask.shape[0] - 1), np.clip(column, 0, mask.shape[1] - 1)])
