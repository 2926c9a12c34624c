"""Which height of a geotagged photograph counts: decided here, for all of them together, by stated accuracy.

Three kinds of height stand beside one another. An absolute altitude of RTK or post-processing is good to centimetres.
One of a plain receiver wanders by metres. The height above take-off is barometric: good to decimetres within a flight,
but it drifts, and it knows no datum.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fieldkit.captures.model import GeoTag
from fieldkit.results.finding import Finding
from fieldkit.wording import count

GPS_ACCURACY_M = 3.0
"""A consumer GNSS receiver with open sky: 95 % within about 5 m horizontally, so σ ≈ 2–3 m."""
RTK_ACCURACY_M = 0.03
"""A fixed RTK solution whose deviations the camera does not give; also the least that RtkStd is believed, since
DJI's deviations are the solution's and leave out antenna-to-lens offset and shutter delay."""
BAROMETER_ACCURACY_M = 0.3
"""A height above take-off within one flight; an absolute altitude that states less is better."""

_TAKE_OFF_SPREAD_M = 3.0
"""Range of altitudes less heights above take-off within one take-off, metres: barometers drift."""
_ZERO_AMONG_M = 5.0
"""Median altitude below which a zero among others may be measured, metres."""
_MIRRORED_SPREAD_M = 20.0
"""Range below which altitudes of both signs are believed, metres."""


@dataclass(frozen=True)
class Heights:
    """Heights that agree with one another."""

    heights: dict[str, float]
    """Metres above ``datum``, by name; photographs whose height cannot be told are missing."""
    accuracies_m: dict[str, float]
    """One standard deviation, by the same names."""
    source: str
    """What they are, in words."""
    datum: str
    """"ellipsoid", "sea level" or "unknown"."""
    findings: tuple[Finding, ...] = ()
    """What is odd, and what was joined."""
    to_take_off_m: Mapping[str, float] = field(default_factory=dict)
    """What absolute altitudes lack to be the heights above take-off, where the two fall apart by several take-off
    places or by a receiver whose height jumped between flights, which tags alone do not tell."""


def choose_heights(tags: Mapping[str, GeoTag]) -> Heights:
    """The heights of geotagged photographs, by name in the order of their taking.

    Absolute altitudes that state at least the barometer's accuracy are used as they are. The other photographs, where
    RTK dropped, get their height above take-off, shifted to the datum of those. Without any such altitude, heights
    above take-off are used where every photograph has one, shifted by the median difference to the absolute altitudes;
    else absolute altitudes of one datum.
    """
    findings: list[Finding] = []
    absolute = _signed_alike(_without_zeros(tags, findings), findings)
    relative = _relative(tags)
    if len(absolute) > 1 and not any(absolute.values()):
        return Heights(
            absolute, dict.fromkeys(absolute, GPS_ACCURACY_M), "one height for all", "unknown", tuple(findings)
        )
    good = _of_one_datum({n: absolute[n] for n in absolute if _believed(tags[n])}, tags)
    if tags and len(good) == len(tags):
        return _absolute(tags, good, findings)
    if good:
        return _joined(tags, absolute, relative, good, findings)
    if tags and len(relative) == len(tags):
        return _above_take_off(tags, absolute, relative, findings)
    return _absolute(tags, absolute, findings)


def vertical_accuracy_m(tag: GeoTag) -> float:
    """What an absolute altitude is good to; a stated accuracy of the position counts for its height, too."""
    return accuracy_m(tag, tag.vertical_accuracy_m, tag.horizontal_accuracy_m)


def accuracy_m(tag: GeoTag, *stated: float | None) -> float:
    """What the first of some accuracies says that is stated; else what such a receiver is good to."""
    known = next((each for each in stated if each is not None), 0.0 if tag.rtk else GPS_ACCURACY_M)
    return max(known, RTK_ACCURACY_M)


def _believed(tag: GeoTag) -> bool:
    return tag.rtk or vertical_accuracy_m(tag) <= BAROMETER_ACCURACY_M


def _without_zeros(tags: Mapping[str, GeoTag], findings: list[Finding]) -> dict[str, float]:
    """Absolute altitudes; an exact zero far below the others, or in all photographs, is what nobody measured."""
    altitudes = {n: t.altitude_m for n, t in tags.items() if t.altitude_m is not None}
    zeros = [n for n, a in altitudes.items() if a == 0.0]
    others = [a for a in altitudes.values() if a != 0.0]
    if not zeros or (others and abs(float(np.median(others))) < _ZERO_AMONG_M) or len(altitudes) < 2:
        return altitudes
    if others or len(_relative(tags)) == len(tags):
        message = f"{_photos_have(zeros)} the altitude 0, which was not measured; not used"
        findings.append(Finding(zeros[0], "altitude-zero", message))
        return {n: a for n, a in altitudes.items() if a != 0.0}
    message = "every altitude is 0, so none was measured; all photographs are taken to be at one height"
    findings.append(Finding(zeros[0], "altitude-zero", message))
    return altitudes


def _signed_alike(altitudes: dict[str, float], findings: list[Finding]) -> dict[str, float]:
    """Altitudes; none where their signs alone set some apart, for then nothing tells which are right."""
    below = [n for n, a in altitudes.items() if a < 0]
    if not 0 < len(below) < len(altitudes):
        return altitudes
    values = np.array(list(altitudes.values()))
    if np.ptp(values) < max(_MIRRORED_SPREAD_M, 4.0 * np.ptp(np.abs(values))):
        return altitudes
    message = f"{_photos_have(below)} the altitude of the others with the other sign; none is used"
    findings.append(Finding(below[0], "altitude-sign", message))
    return {}


def _relative(tags: Mapping[str, GeoTag]) -> dict[str, float]:
    """Heights above take-off; zero in every photograph is none."""
    found = {n: t.relative_altitude_m for n, t in tags.items() if t.relative_altitude_m is not None}
    return found if any(found.values()) else {}


def _of_one_datum(heights: dict[str, float], tags: Mapping[str, GeoTag]) -> dict[str, float]:
    """Those of the datum that most have, where an ellipsoidal height is among others: the two differ by up to 110 m."""
    datums = [tags[n].datum for n in heights]
    if len(set(datums)) < 2 or "ellipsoid" not in datums:
        return heights
    most = max(sorted(set(datums)), key=datums.count)
    return {n: h for n, h in heights.items() if tags[n].datum == most}


def _absolute(tags: Mapping[str, GeoTag], absolute: dict[str, float], findings: list[Finding]) -> Heights:
    kept = _of_one_datum(absolute, tags)
    findings += _mixed(tags, absolute)
    accuracies = {n: vertical_accuracy_m(tags[n]) for n in kept}
    return _told(tags, absolute, kept, kept, accuracies, "its altitude is above {}", findings)


def _told(
    tags: Mapping[str, GeoTag],
    absolute: Mapping[str, float],
    good: Mapping[str, float],
    heights: Mapping[str, float],
    accuracies_m: dict[str, float],
    other: str,
    findings: list[Finding],
    more: str = "",
) -> Heights:
    """Heights on the datum of the ``good`` ones, and a finding for each photograph that has none."""
    for name, tag in tags.items():
        if name not in heights:
            why = "no altitude" if name not in absolute else other.format(tag.datum)
            findings.append(Finding(name, "no-altitude", f"{why}, so no position prior"))
    rtk = 2 * sum(tags[n].rtk for n in good) > len(good)
    source = ("RTK altitude" if rtk else "absolute altitude") + more
    ordered = {n: heights[n] for n in tags if n in heights}
    return Heights(ordered, accuracies_m, source, _datum(tags, good), tuple(findings))


def _joined(
    tags: Mapping[str, GeoTag],
    absolute: dict[str, float],
    relative: dict[str, float],
    good: dict[str, float],
    findings: list[Finding],
) -> Heights:
    """Believed altitudes, and the other photographs by their height above take-off on the datum of those."""
    order = {name: k for k, name in enumerate(tags)}
    linked = [n for n in good if n in relative]
    known = np.array([order[n] for n in linked], dtype=float)
    offsets = np.array([good[n] - relative[n] for n in linked])
    heights = dict(good)
    accuracies = {n: vertical_accuracy_m(tags[n]) for n in good}
    joined: list[str] = []
    for name in tags:
        if name in good or name not in relative or not linked:
            continue
        # Between two photographs that show another take-off, its own is not known.
        beside = np.searchsorted(known, order[name])
        around = offsets[max(beside - 1, 0) : beside + 1]
        if np.ptp(around) <= _TAKE_OFF_SPREAD_M:
            heights[name] = relative[name] + float(np.interp(order[name], known, offsets))
            accuracies[name] = BAROMETER_ACCURACY_M
            joined.append(name)
    rest = [n for n in absolute if n not in heights]
    datum = _datum(tags, good)
    alike = [n for n in rest if tags[n].datum == datum]
    if not joined and len(rest) - len(alike) > len(good):
        return _absolute(tags, absolute, findings)
    for name in alike:
        heights[name], accuracies[name] = absolute[name], vertical_accuracy_m(tags[name])
    if joined:
        message = (
            f"{_photos_have(joined)} no altitude as good as the others'; their heights are those above take-off, put "
            "on the others' datum"
        )
        findings.append(Finding(joined[0], "heights-joined", message))
    other, more = "its altitude is not above what the others' are", ", else relative altitude" if joined else ""
    return _told(tags, absolute, good, heights, accuracies, other, findings, more)


def _above_take_off(
    tags: Mapping[str, GeoTag], absolute: dict[str, float], relative: dict[str, float], findings: list[Finding]
) -> Heights:
    accuracies = dict.fromkeys(relative, BAROMETER_ACCURACY_M)
    if not absolute:
        return Heights(dict(relative), accuracies, "relative altitude", "unknown", tuple(findings))
    alike = _of_one_datum(absolute, tags)
    offsets = np.array([alike[n] - relative[n] for n in alike])
    if np.ptp(offsets) <= _TAKE_OFF_SPREAD_M:
        if len(alike) < len(absolute):
            other = [n for n in absolute if n not in alike]
            message = f"{_photos_have(other)} an altitude above another datum; heights above take-off hold all together"
            findings.append(Finding(other[0], "heights-joined", message))
        else:
            findings += _mixed(tags, absolute)
        shift = float(np.median(offsets))
        heights = {n: r + shift for n, r in relative.items()}
        return Heights(heights, accuracies, "relative altitude", _datum(tags, alike), tuple(findings))
    message = (
        f"take-off heights differ by {np.ptp(offsets):.1f} m: of several places, or of a receiver whose height jumped; "
        "absolute altitudes are used unless the photographs' matches fit heights above take-off better"
    )
    findings.append(Finding(next(iter(tags)), "several-take-offs", message))
    shift = float(np.median(offsets))
    to_take_off = {n: relative[n] + shift - a for n, a in alike.items()} if len(alike) == len(tags) else {}
    return replace(_absolute(tags, absolute, findings), to_take_off_m=to_take_off)


def _datum(tags: Mapping[str, GeoTag], names: Mapping[str, float]) -> str:
    datums = {tags[n].datum for n in names}
    return datums.pop() if len(datums) == 1 else "unknown"


def _mixed(tags: Mapping[str, GeoTag], absolute: Mapping[str, float]) -> list[Finding]:
    datums = sorted({tags[n].datum for n in absolute})
    if len(datums) < 2:
        return []
    return [Finding(next(iter(absolute)), "mixed-datums", f"altitudes are above {' and '.join(datums)}")]


def _photos_have(names: list[str]) -> str:
    """``3 photographs have``."""
    return count(len(names), "photograph has", "photographs have")
