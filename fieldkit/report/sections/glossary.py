"""The glossary of a report, for readers who do not know its terms."""

from __future__ import annotations

from collections.abc import Iterable

MEANINGS = {
    "registered": "A photograph whose position and direction reconstruction found, from what it shows alone or "
    "together with what was known beforehand.",
    "used": "Registered, and not in contradiction to where the photograph is known to have been taken. Only these make "
    "the cloud.",
    "reference": "The cloud of a plot from many photographs, which later captures are compared with. It is a "
    "reconstruction, too, and not the truth.",
    "accuracy": "Mean distance from the points of a capture to the reference: what is there but should not be, or "
    "lies in the wrong place.",
    "completeness": "Mean distance from the points of the reference to what was reconstructed: what should be there "
    "but is not. Low is good, for both.",
    "chamfer distance": "Accuracy plus completeness. Low is good.",
    "precision, recall": "Share of the capture's points that lie within a distance of the reference; share of the "
    "reference's points that lie within it of the capture's.",
    "F-score": "Precision and recall at one distance as one number (their harmonic mean), from 0 to 1. High is good.",
    "RMS": "Root mean square: like a mean of sizes, in which large values weigh more.",
    "residual": "How far a reconstructed camera position lies from the known one.",
    "reprojection error": "How far the reconstructed points fall from where the photographs show them, in pixels. "
    "Below 1 is good.",
    "track length": "How many photographs see one point, on average. Above 3 is good.",
    "ground sampling distance": "How much of the plot one pixel covers. Details smaller than two of these are not in a "
    "cloud.",
    "plot frame": "Metres from the plot's centre on the ground: x east (or along the row), y north, z up.",
    "station": "A place and direction from which the plan takes one photograph.",
    "yaw, pitch": "Where a camera looks: yaw clockwise from north, pitch 0° at the horizon and −90° straight down.",
    "trial": "One set of camera poses that the search tried: photographed, reconstructed and compared with the "
    "reference.",
    "confirmation": "A further evaluation of one of the best sets, with random numbers the search had not seen: the "
    "lowest of many noisy values is partly luck.",
    "adherence": "How a flight kept to its plan: where each photograph was taken, less where it should have been.",
    "predicted": "Where a plot has no reference: how far its cloud is likely to be from its true plants (chamfer "
    "distance), from figures that need none. Nine in ten plots like those it was made on lie in the interval.",
    "cover": "Share of the plot that lies below plants, seen from straight above.",
    "height": "Of the highest leaf above the ground, as a person measures it with a ruler.",
    "canopy volume": "Volume between the ground and the upper surface of the plants.",
}
"""Meanings by term."""


def meanings(names: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """The meanings of terms, in the order of `MEANINGS`.

    Raises:
        KeyError: an unknown term.
    """
    wanted = set(names)
    unknown = wanted - MEANINGS.keys()
    if unknown:
        raise KeyError(min(unknown))
    return tuple((name, meaning) for name, meaning in MEANINGS.items() if name in wanted)
