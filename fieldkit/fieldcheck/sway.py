"""Bursts: how many photographs stations have, and how far leaves move between them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from fieldkit.captures import Photo
from fieldkit.fieldcheck.model import CheckReport, finding_of
from fieldkit.fieldcheck.ties import TieGraph
from fieldkit.reconstruction.guided import region_of_interest
from fieldkit.reconstruction.steady import quick_sway_px
from fieldkit.results.finding import Finding
from fieldkit.results.plan import Plan
from fieldkit.runtime.executor import map_threads

_STATIONS, _PHOTOGRAPHS, _SIDE_PX = 4, 3, 500
"""That are looked at, and how large: half a second of CPU a station."""
_HALF_METRE_OUT = 4.0
"""Motion half a metre out along leaves, as traits' errors are by, is 3 to 5 times the mean over plants (simulated)."""


def leaves_move_m(
    photos: Sequence[Photo], graph: TieGraph, plan: Plan, station_of: Mapping[int, int], workers: int
) -> float | None:
    """How far leaves move, half a metre out: RMS per axis, the median of some stations; None where nothing tells."""
    middle = region_of_interest([station.pose for station in plan.stations])
    bursts = {k: photos[k].burst for k in station_of if len(photos[k].burst) > 1}
    chosen = list(bursts)[:: -(-len(bursts) // _STATIONS) or 1]
    if middle is None or not chosen:
        return None
    some = [bursts[k][:: -(-len(bursts[k]) // _PHOTOGRAPHS)] for k in chosen]
    sway_px = np.array(map_threads(partial(quick_sway_px, side=_SIDE_PX), some, workers=workers))
    away_m = [float(np.linalg.norm(plan.stations[station_of[k]].pose.center - middle.center)) for k in chosen]
    moved_m = sway_px * away_m / [graph.cameras.cameras[graph.cameras.camera_of[k]].fx for k in chosen]
    return _HALF_METRE_OUT * float(np.nanmedian(moved_m)) if np.isfinite(moved_m).any() else None


def burst_findings(report: CheckReport, photos: Sequence[Photo], station_of: Mapping[int, int]) -> Iterator[Finding]:
    """Leaves that move too far, and stations with fewer photographs than most."""
    if report.too_windy:
        yield finding_of(
            "too-windy", None, "",
            f"{report.leaves_move} between the photographs of a station; from 10 mm on heights are off by 3 to 13 cm "
            "and areas by 6 to 27 %, of which bursts take a third away",
            "Wait for calmer air and fly again.",
        )  # fmt: skip
    for k, station in sorted(station_of.items(), key=lambda each: each[1]):
        if (number := max(1, len(photos[k].burst))) < report.burst:
            message = f"it has {number} of {report.burst} photographs"
            yield finding_of("short-burst", station, photos[k].name, message, "None needed: it counts as photographed.")
