"""Bursts: photographs that a hovering vehicle took of one station within seconds, which count as one photograph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from fieldkit.captures.model import Capture, Photo
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.geometry.priors import PosePrior
from fieldkit.results.finding import Finding
from fieldkit.vocabulary import Mask
from fieldkit.wording import count

_GAP_S = 3.0
"""Between photographs of a burst: cameras that write large files take one every 2 s."""
_WHOLE_S = 1.0
"""What a clock without fractions of a second may hide."""
_HOVER_M = 0.15
"""Extent of a burst's positions at most, metres: a vehicle keeps its place to centimetres over seconds."""
_COARSE_HOVER_M = 0.6
"""The same of a receiver without corrections, metres: it wanders by decimetres."""
_UNCORRECTED_M = 0.3
"""Accuracy beyond which a receiver counts as one without corrections, metres."""
_HOVER_DEG = 5.0
"""Range of a burst's angles at most, degrees."""


def by_station(capture: Capture, mask: Mask = "none") -> Capture:
    """A capture whose bursts are one photograph each: the first, at the mean of what is known of their poses.

    `fieldkit.reconstruction.steady` makes its picture. Photographs stay single where masks are files, for these are
    of single photographs, too.
    """
    bursts = [] if mask == "file" else find_bursts(capture)
    if not bursts:
        return capture
    merged = {burst[0].name: burst for burst in bursts}
    gone = {photo.name for burst in bursts for photo in burst[1:]}
    photos = [replace(p, burst=merged.get(p.name, ())) for p in capture.photos if p.name not in gone]
    groups = [replace(g, photos=tuple(name for name in g.photos if name not in gone)) for g in capture.groups]
    priors = {
        name: _mean([capture.priors[photo.name] for photo in merged[name]]) if name in merged else prior
        for name, prior in capture.priors.items()
        if name not in gone
    }
    many = count(len(gone) + len(bursts), "photograph")
    message = f"{many} taken within seconds from one place make {count(len(bursts), 'burst')}; each counts as one"
    finding = Finding(bursts[0][0].name, "bursts", message)
    return replace(
        capture, photos=tuple(photos), groups=tuple(groups), priors=priors, findings=(*capture.findings, finding)
    )


def find_bursts(capture: Capture) -> list[tuple[Photo, ...]]:
    """Photographs of one camera from one place, each within seconds of the one before, in order of time.

    Times come first. Of photographs in a row the positions tell hovering from flying past: a row that is wider than
    hovering is no burst, for a slow flight moves little from one to the next. Photographs without a time or a known
    position are in none. Where most stations have none there is none: a shutter was pressed twice.
    """
    times = [photo.captured_at for photo in capture.photos if photo.captured_at is not None]
    gap_s = _GAP_S + (0.0 if any(time.microsecond for time in times) else _WHOLE_S)
    bursts = []
    for group in capture.groups:
        row: list[tuple[datetime, Photo]] = []
        for taken in [*_timed(capture, group.photos), None]:
            near = taken is not None and bool(row) and (taken[0] - row[-1][0]).total_seconds() <= gap_s
            if taken is not None and near and _hovering(capture, [row[-1][1], taken[1]]):
                row.append(taken)
                continue
            photos = [photo for _, photo in row]
            if len(photos) > 1 and _hovering(capture, photos):
                bursts.append(tuple(photos))
            row = [] if taken is None else [taken]
    single = len(capture.photos) - sum(map(len, bursts))
    return bursts if len(bursts) >= single else []


def _timed(capture: Capture, names: Sequence[str]) -> list[tuple[datetime, Photo]]:
    """Photographs with a time and a position, in order of time; of one time in the order of their names."""
    timed = []
    for photo in capture.photos:
        prior = capture.priors.get(photo.name)
        if photo.captured_at is not None and prior is not None and prior.position is not None and photo.name in names:
            timed.append((photo.captured_at, photo))
    return sorted(timed, key=lambda each: each[0])


def _hovering(capture: Capture, photos: Sequence[Photo]) -> bool:
    """Whether photographs lie no farther apart than one that hovers, and look the same way."""
    priors = [capture.priors[photo.name] for photo in photos]
    coarse = max(prior.position_sigma_m for prior in priors) > _UNCORRECTED_M
    extent = np.ptp([prior.position for prior in priors if prior.position is not None], axis=0)
    if float(np.linalg.norm(extent)) > (_COARSE_HOVER_M if coarse else _HOVER_M):
        return False
    for angle in ("yaw_deg", "pitch_deg"):
        known = np.array([value for prior in priors if (value := getattr(prior, angle)) is not None])
        if len(known) and float(np.ptp(wrapped_deg(known - known[0]))) > _HOVER_DEG:
            return False
    return True


def _mean(priors: Sequence[PosePrior]) -> PosePrior:
    """Of a burst's; the accuracy stays, for within seconds a receiver errs alike."""
    position = np.mean([prior.position for prior in priors if prior.position is not None], axis=0)
    known = [np.array(p.angles, dtype=float) for p in priors if p.angles is not None]  # None becomes NaN
    if len(known) < len(priors):
        return replace(priors[0], position=position)
    angles = known[0] + np.mean([wrapped_deg(each - known[0]) for each in known], axis=0)
    yaw, pitch, roll = (None if np.isnan(angle) else float(angle) for angle in angles)
    return replace(priors[0], position=position).with_angles((yaw, pitch, roll))
