"""Which photograph belongs to which trigger, by time and place, never by order.

Numbers of photographs and triggers often differ: a shutter does not fire, a test photograph lies in the folder, a
trigger message is lost. A camera's clock is off by an unknown constant (its time zone, and that nobody set it) and
drifts a little, and may count whole seconds only.

The model: a photograph either belongs to a trigger, then its time is the trigger's plus offset plus rate plus noise and
its place the trigger's plus noise; or it is an extra, anywhere in time and place. Every offset that a pair suggests is
weighed by the likelihood of the best assignment under it, noise included in the fit. Another offset that explains the
photographs nearly as well, one photograph missing and one extra not counted, makes the match ambiguous, and nothing
is matched; where every photograph has its trigger and every trigger its photograph, it is only remarked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.errors import UsageError
from fieldkit.flightlogs.likelihood import Fit, Observed, assign, fit_to
from fieldkit.flightlogs.model import FlightLog, Place, Trigger, bursts_of, doubled
from fieldkit.geometry.geodesy import LocalFrame, geodetic_to_ecef
from fieldkit.wording import count

_HYPOTHESES = 12
"""Most clock offsets that are tried."""
_VOTES = 4_000_000
"""Most pairs of a photograph and a trigger from which clock offsets are guessed: 32 MB."""
_ROUNDS = 5
"""Most rounds of assigning and fitting in turn."""
_LEAST_PAIRS = 3
"""Least number of pairs that a clock offset found by itself needs."""
_OFFSET_TOLERANCE_S = 2.0
"""Deviation from a clock offset that people state, seconds."""
_SAME_M = 0.05
"""Between two cameras' triggers: that they fire together or hover makes no difference."""
_DOUBT = 3.0
"""Natural logarithm of how many times likelier an assignment must be than the next one at its clock offset."""
_OFFSET_DOUBT = 5.0
"""Natural logarithm of how many times likelier an assignment must be than that at another clock offset."""


@dataclass(frozen=True)
class Stamp:
    """What a photograph says of when and where it was taken."""

    name: str
    time_s: float | None = None
    """On the camera's clock, seconds from any zero that all photographs share; None where it has none."""
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    """WGS 84, or None."""

    @property
    def located(self) -> bool:
        """Whether it says where."""
        return self.latitude_deg is not None and self.longitude_deg is not None


@dataclass(frozen=True)
class Match:
    """A photograph and its trigger."""

    photograph: str
    trigger: int
    distance_m: float | None
    """Horizontal, between what photograph and trigger say; None where one of them says nothing."""


@dataclass(frozen=True)
class Matches:
    """How photographs and triggers belong together."""

    pairs: tuple[Match, ...]
    """In the triggers' order."""
    photographs: tuple[str, ...]
    """Names of those without a trigger, in the order given."""
    triggers: tuple[int, ...]
    """Indices of those without a photograph."""
    ambiguous: tuple[str, ...] = ()
    """Names of those among ``photographs`` that could belong to more than one trigger."""
    offset_s: float | None = None
    """Camera's clock less the triggers' (UTC where the log knows it, else the log's clock), at the first pair; None
    where no times were compared."""
    cost: float = math.inf
    """Negative log-likelihood of the match by times; infinite without one."""
    drift_ppm: float = 0.0
    """How much faster the camera's clock runs; 0 where the flight is too short to tell."""
    remarks: tuple[str, ...] = ()


def match(photographs: Sequence[Stamp], triggers: Sequence[Trigger], *, offset_s: float | None = None) -> Matches:
    """Match photographs to triggers.

    Args:
        photographs: with distinct names, in any order.
        triggers: of one flight log.
        offset_s: camera's clock less the triggers', where it is known; to within 2 s; it decides between
            offsets that fit alike.
    """
    remarks: list[str] = []
    again = doubled(triggers, len(photographs))
    if again:
        kept = np.setdiff1d(np.arange(len(triggers)), again).tolist()
        firsts = match(photographs, [triggers[k] for k in kept], offset_s=offset_s)
        said = f"{count(len(again), 'trigger repeats', 'triggers repeat')} the one before within 0.3 s; not counted"
        return replace(
            firsts,
            pairs=tuple(replace(pair, trigger=kept[pair.trigger]) for pair in firsts.pairs),
            triggers=tuple(kept[k] for k in firsts.triggers),
            remarks=(said, *firsts.remarks),
        )
    observed = _observed(photographs, triggers)
    pairs: dict[int, int] = {}
    ambiguous: set[int] = set()
    fit: Fit | None = None
    timed = np.isfinite(observed.photo_time)
    if timed.any() and len(triggers):
        window = None if offset_s is None else (offset_s - _OFFSET_TOLERANCE_S, offset_s + _OFFSET_TOLERANCE_S)
        fit, pairs, ambiguous = _by_time(observed, window, remarks)
    left = [i for i in range(len(photographs)) if i not in pairs and i not in ambiguous and not timed[i]]
    if fit is None and not ambiguous:
        left = [i for i in range(len(photographs)) if observed.located[i]]
    if left:
        found, doubtful = _by_place(observed, left, [j for j in range(len(triggers)) if j not in pairs.values()])
        pairs |= found
        ambiguous |= doubtful
    lost = [i for i in range(len(photographs)) if not timed[i] and not observed.located[i]]
    if lost:
        remarks.append(f"{count(len(lost), 'photograph says', 'photographs say')} neither when nor where it was taken")
    if ambiguous and fit is not None:
        remarks.append(f"{count(len(ambiguous), 'photograph')} could belong to more than one trigger")
    return _matches(photographs, observed, pairs, ambiguous, fit, remarks)


def match_log(
    photographs: Sequence[Stamp], flight: FlightLog, *, offset_s: float | None = None, camera: int | None = None
) -> tuple[FlightLog, Matches]:
    """The flight with the triggers of the camera that took the photographs, and how the two belong together.

    Of several cameras it is the one whose triggers fit clearly best. Nothing is matched where those of two fit alike
    and lie apart.

    Args:
        photographs: with distinct names, in any order.
        flight: a log.
        offset_s: as for `match`.
        camera: the log's number of the camera, where it is known.

    Raises:
        UsageError: the log has no triggers of that camera.
    """
    logs = [replace(flight, others=()), *flight.others]
    numbers = " and ".join(str(each.camera) for each in logs if each.camera is not None)
    if camera is not None:
        logs = [each for each in logs if each.camera in (camera, None)]
        if not logs:
            raise UsageError(f"--camera {camera}: the log has triggers of the cameras {numbers}", path=flight.path)
    tried = [(each, match(photographs, each.triggers, offset_s=offset_s)) for each in logs]
    tried.sort(key=lambda entry: (-len(entry[1].pairs), entry[1].cost))
    log, best = tried[0]
    for other, matches in tried[1:]:
        alike = len(matches.pairs) == len(best.pairs) > 0 and not matches.cost - best.cost > _OFFSET_DOUBT
        if alike and _apart_m(log, best, other, matches) > _SAME_M:
            said = (
                f"the photographs fit the triggers of cameras {numbers} alike: {len(best.pairs)} pairs each, at "
                f"{_offset_text(log, best)} and {_offset_text(other, matches)}; the --camera of fieldkit geotag says "
                "whose they are"
            )
            return log, Matches(
                (),
                tuple(p.name for p in photographs),
                tuple(range(len(log.triggers))),
                ambiguous=tuple(p.name for p in photographs),
                remarks=(said,),
            )
    return log, best


def _offset_text(log: FlightLog, matches: Matches) -> str:
    offset = "any clock offset" if matches.offset_s is None else f"a clock offset of {matches.offset_s:.1f} s"
    return f"{offset} (camera {log.camera})"


def _apart_m(log: FlightLog, matches: Matches, other: FlightLog, others: Matches) -> float:
    """How far apart two matches put a photograph at most; infinite where one does not say."""
    theirs = {pair.photograph: other.triggers[pair.trigger].place for pair in others.pairs}
    both = [(log.triggers[pair.trigger].place, theirs.get(pair.photograph)) for pair in matches.pairs]
    apart = [float(np.linalg.norm(_ecef(one) - _ecef(two))) for one, two in both if one and two]
    return max(apart) if len(apart) == len(both) else math.inf


def _ecef(place: Place) -> FloatArray:
    return geodetic_to_ecef(place.latitude_deg, place.longitude_deg, place.amsl_m or 0.0)


def _observed(photographs: Sequence[Stamp], triggers: Sequence[Trigger]) -> Observed:
    """Times and places as arrays; places in metres about the triggers' middle."""
    utc = [t.utc_s for t in triggers]
    zero_free = utc if all(u is not None for u in utc) else [t.time_s for t in triggers]
    places = [(t.place.latitude_deg, t.place.longitude_deg) if t.place else (np.nan, np.nan) for t in triggers]
    trigger_place = np.array(places, dtype=np.float64).reshape(-1, 2)
    stamped = [(p.latitude_deg, p.longitude_deg) if p.located else (np.nan, np.nan) for p in photographs]
    photo_place = np.array(stamped, dtype=np.float64).reshape(-1, 2)
    known = trigger_place[np.isfinite(trigger_place).all(axis=1)]
    if len(known):
        frame = LocalFrame(float(np.median(known[:, 0])), float(np.median(known[:, 1])))
        trigger_place, photo_place = _metres(frame, trigger_place), _metres(frame, photo_place)
    else:
        photo_place = np.full_like(photo_place, np.nan)
    times = np.array([np.nan if p.time_s is None else p.time_s for p in photographs], dtype=np.float64)
    trigger_time = np.array(zero_free, dtype=np.float64).reshape(-1)
    return Observed(times, trigger_time, photo_place, trigger_place, bursts_of(triggers))


def _metres(frame: LocalFrame, degrees: FloatArray) -> FloatArray:
    result = np.full_like(degrees, np.nan)
    good = np.isfinite(degrees).all(axis=1)
    if good.any():
        result[good] = frame.to_local(degrees[good, 0], degrees[good, 1], np.zeros(int(good.sum())))[:, :2]
    return result


def _by_time(
    observed: Observed, window: tuple[float, float] | None, remarks: list[str]
) -> tuple[Fit | None, dict[int, int], set[int]]:
    """The best clock offset's assignment; no fit where none is good enough, ambiguous photographs where two are."""
    best: list[tuple[Fit, dict[int, int], set[int]]] = []
    for offset in _candidate_offsets(observed, window):
        fit = Fit.start(observed, offset)
        fit = _refined(observed, fit)
        pairs, doubtful = assign(observed, fit, _DOUBT)
        if window is not None and not window[0] - 1.0 <= fit.offset_s <= window[1] + 1.0:
            continue
        best.append((fit, pairs, doubtful))
    best.sort(key=lambda entry: entry[0].cost(observed, entry[1]))
    if not best:
        remarks.append("no trigger lies at the clock offset that was given")
        return None, {}, set()
    fit, pairs, doubtful = best[0]
    counted = int(np.isfinite(observed.photo_time).sum())
    known = window is not None or observed.places_agree(pairs)
    by_chance = math.log(counted * len(observed.trigger_time)) + _OFFSET_DOUBT
    if len(pairs) < (1 if known else _LEAST_PAIRS) or not (known or fit.evidence(observed, pairs) > by_chance):
        remarks.append(
            f"at no clock offset do the photographs fall on the log's triggers: at best {len(pairs)} of {counted} do"
        )
        return None, {}, doubtful
    complete, warned = len(pairs) == counted == len(observed.trigger_time), False
    for other, other_pairs, _ in best[1:]:
        shared = sum(observed.burst[j] == observed.burst[other_pairs[i]] for i, j in pairs.items() if i in other_pairs)
        if 2 * shared >= len(pairs):
            continue
        worse = other.cost(observed, other_pairs) - fit.cost(observed, pairs)
        handicap = fit.handicap(observed, pairs, other_pairs)
        if worse < _OFFSET_DOUBT or (worse < _OFFSET_DOUBT + handicap and not complete):
            remarks.append(
                f"the photographs fit the triggers at clock offsets of {fit.offset_s:.1f} s ({len(pairs)} pairs) and "
                f"{other.offset_s:.1f} s ({len(other_pairs)} pairs) alike: give the offset, or photographs with GPS"
            )
            return None, {}, {int(i) for i in np.flatnonzero(np.isfinite(observed.photo_time))}
        if worse < _OFFSET_DOUBT + handicap and not warned:
            warned = True
            remarks.append(
                f"every photograph has its trigger at a clock offset of {fit.offset_s:.1f} s; were one missing and one "
                f"extra, {other.offset_s:.1f} s would fit, too"
            )
    return fit, pairs, doubtful


def _refined(observed: Observed, fit: Fit) -> Fit:
    """Assign and fit in turn until the assignment stays; doubts are for afterwards."""
    pairs, _ = assign(observed, fit, 0.0)
    for _ in range(_ROUNDS):
        fit = fit_to(observed, fit, pairs)
        again, _ = assign(observed, fit, 0.0)
        if again == pairs:
            break
        pairs = again
    return fit


def _candidate_offsets(observed: Observed, window: tuple[float, float] | None) -> list[float]:
    """Offsets at which most photographs have a trigger, most first, each at least half a gate from the others."""
    photos = np.sort(observed.photo_time[np.isfinite(observed.photo_time)])
    triggers = np.sort(observed.trigger_time)
    every = max(1, math.ceil(len(photos) * len(triggers) / _VOTES))
    votes = np.sort((photos[::every, None] - triggers[None, :]).ravel())
    gate = observed.start_gate_s
    if window is not None:
        votes = votes[(votes >= window[0] - gate) & (votes <= window[1] + gate)]
    if not len(votes):
        return []
    counts = np.searchsorted(votes, votes + 2.0 * gate, side="right") - np.arange(len(votes))
    offsets: list[float] = []
    taken = np.zeros(len(votes), dtype=bool)
    while len(offsets) < _HYPOTHESES and not taken.all():
        k = int(np.argmax(np.where(taken, -1, counts)))
        offsets.append(float(np.median(votes[k : k + counts[k]])))
        taken[np.searchsorted(votes, votes[k] - gate) : np.searchsorted(votes, votes[k] + gate, side="right")] = True
    return offsets


def _by_place(
    observed: Observed, photographs: Sequence[int], triggers: Sequence[int]
) -> tuple[dict[int, int], set[int]]:
    """By place alone: these photographs among these triggers."""
    some = observed.only_places(photographs, triggers)
    if some is None:
        return {}, set()
    pairs, doubtful = assign(some, _refined(some, Fit.start(some, None)), _DOUBT)
    return {photographs[i]: triggers[j] for i, j in pairs.items()}, {photographs[i] for i in doubtful}


def _matches(
    photographs: Sequence[Stamp],
    observed: Observed,
    pairs: dict[int, int],
    ambiguous: set[int],
    fit: Fit | None,
    remarks: list[str],
) -> Matches:
    found = []
    for i, j in sorted(pairs.items(), key=lambda pair: pair[1]):
        distance = float(np.linalg.norm(observed.photo_place[i] - observed.trigger_place[j]))
        found.append(Match(photographs[i].name, j, distance if math.isfinite(distance) else None))
    used = set(pairs.values())
    return Matches(
        pairs=tuple(found),
        photographs=tuple(p.name for i, p in enumerate(photographs) if i not in pairs),
        triggers=tuple(j for j in range(len(observed.trigger_time)) if j not in used),
        ambiguous=tuple(photographs[i].name for i in sorted(ambiguous)),
        offset_s=None if fit is None else fit.offset_s,
        cost=math.inf if fit is None else fit.cost(observed, pairs),
        drift_ppm=0.0 if fit is None else fit.rate * 1e6,
        remarks=tuple(remarks),
    )
