"""`weak-ties`: few views with few matches, with sub-models merged and left apart."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.few_views import GOAL, Outcome, assess, map_with_noise
from benchmarks.result import Cell, ResultTable, StudyResult, spread
from benchmarks.rigs import RigSet, load_rig, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.reconstruction.settings import FeatureSettings, PriorMappingSettings, ReconstructionSettings
from fieldkit.reconstruction.stages import load_features
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Progress

SETS: Mapping[str, Sequence[int]] = {"basil_rig": (10, 13), "arabidopsis_rig": (10, 13)}
KEPT = (1.0, 0.4)
"""Shares of all matches that are kept."""
_GAP_DEG = 55.0
_PHASES = 4
_WAYS = {"put together": PriorMappingSettings(), "left apart": PriorMappingSettings(min_agreeing=sys.maxsize)}


def run_weak_ties(data: Path, *, cache: StageCache, progress: Progress) -> StudyResult:
    """Map even subsets and subsets with two gaps, with all matches and with a random share withheld.

    A match is withheld with one of its features: each photograph keeps a random share of them, the root of the matches'
    share.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    rows: list[tuple[Cell, ...]] = []
    for name, sizes in SETS.items():
        rig = load_rig(data, name, cache=cache, progress=progress)
        with progress.stage(name, len(sizes) * 2 * len(KEPT)) as advance:
            for size in sizes:
                for layout, subset in (("even", uniform_subset), ("two gaps of 55°", with_gaps)):
                    for kept in KEPT:
                        chosen = [subset(rig.names, size, phase) for phase in range(_PHASES)]
                        of_ways = [_outcomes(rig, chosen, kept, way, cache) for way in _WAYS.values()]
                        rows.append((name, size, layout, f"{kept:.0%}", *(c for each in of_ways for c in _cells(each))))
                        advance(1)
    columns = ["set", "views>", "ring", "matches kept>"]
    for way in _WAYS:
        columns += [f"{way}: right>", "RMS, mm>"]
    return StudyResult(
        name="weak-ties",
        title="Few views that are weakly tied",
        tables=(ResultTable("Sub-models put together and left apart", tuple(columns), tuple(rows)),),
        notes=(
            f"{_PHASES} sets each, beginning with other photographs; poses off by {GOAL}. Medians (least–most).",
            "Right: within the rig's bound. RMS: centres against the model of all photographs, after the best fit.",
        ),
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def with_gaps(names: Sequence[str], count: int, phase: int = 0) -> tuple[str, ...]:
    """``count`` of a circle's photographs, evenly except for two opposite gaps of 55°.

    Args:
        names: once around, evenly.
        count: of photographs.
        phase: index of the photograph in the middle of the first gap.
    """
    halves = ((0.0, count - count // 2), (180.0, count // 2))
    wanted = np.concatenate([s + _GAP_DEG / 2 + np.linspace(0.0, 180.0 - _GAP_DEG, n) for s, n in halves])
    index = np.round(wanted * len(names) / 360.0).astype(int) + phase
    return tuple(names[k % len(names)] for k in index)


def _outcomes(
    rig: RigSet, chosen: Sequence[Sequence[str]], kept: float, settings: PriorMappingSettings, cache: StageCache
) -> list[Outcome]:
    found = []
    for phase, names in enumerate(chosen):
        wanted = ReconstructionSettings(features=FeatureSettings(kept=float(np.sqrt(kept)), draw=phase), prior=settings)
        photos = [rig.capture.photo(name) for name in names]
        keyed = load_features(photos, wanted.features, context=Context(cache))
        left = [each.features for each in keyed]
        found.append(assess(map_with_noise(rig, names, left, GOAL, phase, wanted)[0], rig))
    return found


def _cells(found: Sequence[Outcome]) -> tuple[str, str]:
    errors = [None if each.dense_rms_m is None else 1000 * each.dense_rms_m for each in found]
    return spread([each.right for each in found], 0), spread(errors)
