"""Findings about a result as a whole: which people are told of, and which say that it must not be taken as it is."""

from __future__ import annotations

OTHER_PLANTS = "other-plants"
"""The cloud is hardly of the reference's plants: its distance says nothing of its quality."""

PLANTS_APART = "plants-apart"
"""Some plants stand far from the others: weeds or neighbours, perhaps."""

NO_RASTERS, COARSE_RASTERS = "no-rasters", "coarse-rasters"
"""Why there are none; that they may lie metres off."""

DOUBTFUL = frozenset({
    OTHER_PLANTS, "few-plant-points", "volume-below-ground", "weak-ground", "cameras-off-level", "steep-ground",
    "volume-cuts-plants", "refinement-not-converged", "weakly-tied",
})  # fmt: skip
"""Codes of findings with which a result must not be taken as it is."""

TOLD = DOUBTFUL | {
    "too-few-positions",
    "several-take-offs",
    "mixed-cameras",
    "altitude-zero",
    "heights-joined",
    "other-camera",
    "scale-uncertain",
}
"""Codes that are told beside a result's figures."""
