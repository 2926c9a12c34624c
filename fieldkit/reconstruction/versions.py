"""Which results a change of the engine invalidates: the version of every stage from a photograph to a score.

A stage's version is raised when its code changes its results. It is part of the stage's keys in the cache, so that
nothing computed before is taken for the new result, and of every visit's inputs in a campaign, so that its scores are
computed again. Stages after the cloud are listed here, too, since a visit depends on them.

Constants of a stage are no part of its keys: whoever changes one that changes results raises the version by hand.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

STAGES: Mapping[str, int] = MappingProxyType(
    {
        "bursts": 1,  # their steady photographs and their sway
        "quality": 3,  # sharpness and exposure of a photograph
        "features": 3,
        "learned": 1,  # features and matches of networks, where ties are weak
        "pairs": 1,  # blind matches and their verification
        "guided": 2,  # matches between known poses
        "mapping": 18,  # poses, intrinsics, sparse points, what pairs say
        "frame": 2,  # plot frame, ground, volume of interest
        "views": 5,  # undistorted photographs and masks
        "depth": 7,  # dense stereo
        "fusion": 8,  # depth maps into one cloud
        "plants": 2,  # what of the cloud is plant: above the ground, without strays, in the volume
        "scores": 1,  # refinement onto the reference, distances to it
        "figures": 22,  # traits of plants, and what predictions are made from
        "adherence": 1,  # of a flight to its plan
        "visit": 1,  # where a campaign's visit is placed, and what is noted of it
    }
)
"""Version by stage, in the order in which they run."""

BESIDE: Mapping[str, int] = MappingProxyType({"match-graph": 1, "check-pair": 1})
"""The same of what is kept in the cache and no score depends on."""
