"""Groups of photographs that pairs tie together, and what holds them to one another.

A group is accurate in itself. Between two groups single matches, none of which another contradicts, and known positions
decide: a model can bend there by as much as the positions allow, and every pose is within its bound.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri

from fieldkit.geometry import Pose
from fieldkit.geometry.similarity import fit_similarity
from fieldkit.reconstruction.agreement import SIMILARITY, KnownPose, sigma_apart
from fieldkit.reconstruction.colmap import pycolmap
from fieldkit.reconstruction.ties import Pair, TieSettings, connected_parts

_FIXED_BY = 3
"""Photographs whose known positions fix a group's place, scale and rotation."""
_CHANCE = 0.001
_NAMED = 6


@dataclass(frozen=True)
class Group:
    """Photographs that pairs tie together.

    Attributes:
        names: of them.
        shared: sparse points that they and other groups see.
    """

    names: tuple[str, ...]
    shared: int

    def __str__(self) -> str:
        named = ", ".join(self.names[:_NAMED])
        return named if len(self.names) <= _NAMED else f"{named} and {len(self.names) - _NAMED} more"


def find_groups(model: pycolmap.Reconstruction, names: Sequence[str], ties: Collection[Pair]) -> list[Group]:
    """The groups of a model's photographs, the largest first.

    Args:
        model: with points.
        names: of the capture's photographs.
        ties: pairs of them, by indices, that have matches far above chance.
    """
    index = {name: k for k, name in enumerate(names)}
    image_of = {index[model.image(i).name]: i for i in model.reg_image_ids()}
    parts = sorted(connected_parts(sorted(image_of), ties), key=lambda part: (-len(part), part))
    shared = dict.fromkeys(range(len(parts)), 0)
    if len(parts) > 1:
        part_of = {image_of[k]: number for number, part in enumerate(parts) for k in part}
        for point in model.points3D.values():
            seeing = {part_of[element.image_id] for element in point.track.elements if element.image_id in part_of}
            for number in seeing if len(seeing) > 1 else ():
                shared[number] += 1
    return [Group(tuple(names[k] for k in part), shared[number]) for number, part in enumerate(parts)]


def held_by_positions(groups: Sequence[Group]) -> set[str]:
    """Photographs that nothing but a known position holds: one or two with fewer shared points than a tie has matches.

    Two turn freely about the line between them.
    """
    least = TieSettings().min_matches
    loose = [group for group in groups[1:] if len(group.names) < _FIXED_BY and group.shared < least]
    return {name for group in loose for name in group.names}


def contradict_positions(groups: Sequence[Group], poses: Mapping[str, Pose], known: Mapping[str, KnownPose]) -> bool:
    """Whether the groups, each moved on its own, fit the known positions better than together by more than chance.

    An F-test: the squares that similarities of their own save, 7 degrees of freedom for each group beyond the first,
    against what positions are good to, as stated and as what is left within the groups tells.

    Args:
        groups: of the model; those with three known positions are compared.
        poses: in the known positions' frame.
        known: by name.
    """
    found, expected, own, sigmas = [], [], [], []
    for group in groups:
        names = [n for n in group.names if n in poses and n in known and known[n].position is not None]
        if len(names) < _FIXED_BY:
            continue
        source = np.array([poses[name].center for name in names])
        target = np.array([known[name].position for name in names])
        try:
            own.append(_residuals(source, target))
        except ValueError:  # on one line, they leave a rotation free
            continue
        found.append(source)
        expected.append(target)
        sigmas += [known[name].position_sigma_m for name in names]
    if len(found) < 2:
        return False
    together = _residuals(np.concatenate(found), np.concatenate(expected))
    apart = np.concatenate(own)
    saved = float(np.square(together).sum() - np.square(apart).sum())
    sigma = sigma_apart(float(np.median(sigmas)), apart, models=len(found))
    more, left = SIMILARITY * (len(found) - 1), 3 * (1 + len(apart)) - SIMILARITY * len(found)
    return saved > more * float(fdtri(more, max(3, left), 1.0 - _CHANCE)) * sigma**2


def _residuals(source: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) what the best similarity leaves between points (n, 3).

    Raises:
        ValueError: as `fit_similarity`.
    """
    left: NDArray[np.float64] = np.linalg.norm(fit_similarity(source, target).apply(source) - target, axis=1)
    return left
