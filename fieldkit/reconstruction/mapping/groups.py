"""Groups of photographs that edges of the view graph join, and what holds the groups to one another.

A group is accurate in itself. Between two groups single matches, none of which another contradicts, and known positions
decide: a model can bend there by as much as the positions allow, and every pose is within its bound.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.priors import PosePrior
from fieldkit.reconstruction.agreement import judge
from fieldkit.reconstruction.colmap_model import model_poses, to_rigid
from fieldkit.reconstruction.mapping.bundle import COARSE_M
from fieldkit.reconstruction.mapping.submodels import place_submodel
from fieldkit.reconstruction.mapping.view_graph import EDGE_MATCHES, Pair, connected_parts
from fieldkit.results.finding import Finding
from fieldkit.runtime.colmap import pycolmap

_FIXED_BY = 3
"""Photographs whose known positions fix a group's place, scale and rotation."""
_PLACED = 2
_LOOSE_DEG = 1.0
_FREE_DEG = 1000.0  # an orientation that is not known
_NAMED = 6


@dataclass(frozen=True)
class Group:
    """Photographs that edges of the view graph join."""

    names: tuple[str, ...]
    shared: int
    """Sparse points that they and other groups see."""

    def __str__(self) -> str:
        named = ", ".join(self.names[:_NAMED])
        return named if len(self.names) <= _NAMED else f"{named} and {len(self.names) - _NAMED} more"


def find_groups(model: pycolmap.Reconstruction, names: Sequence[str], edges: Collection[Pair]) -> list[Group]:
    """The groups of a model's photographs, the largest first.

    Args:
        edges: of the view graph, pairs of them by indices.
    """
    index = {name: k for k, name in enumerate(names)}
    image_of = {index[model.image(i).name]: i for i in model.reg_image_ids()}
    parts = sorted(connected_parts(sorted(image_of), edges), key=lambda part: (-len(part), part))
    shared = dict.fromkeys(range(len(parts)), 0)
    if len(parts) > 1:
        part_of = {image_of[k]: number for number, part in enumerate(parts) for k in part}
        for point in model.points3D.values():
            seeing = {part_of[element.image_id] for element in point.track.elements if element.image_id in part_of}
            for number in seeing if len(seeing) > 1 else ():
                shared[number] += 1
    return [Group(tuple(names[k] for k in part), shared[number]) for number, part in enumerate(parts)]


def held_by_positions(groups: Sequence[Group]) -> set[str]:
    """Photographs that only a known position holds: one or two, with fewer shared points than an edge has matches.

    Two turn freely about the line between them.
    """
    loose = [group for group in groups[1:] if len(group.names) < _FIXED_BY and group.shared < EDGE_MATCHES]
    return {name for group in loose for name in group.names}


def place_groups(model: pycolmap.Reconstruction, groups: Sequence[Group], known: Mapping[str, PosePrior]) -> bool:
    """Move each group of two photographs or more, in place, where its known positions and orientations want it.

    Poses out of their bounds do not take part. Points that several groups see go. Nothing moves where what is known
    leaves a group's rotation loose, as positions on an arc do: the plants' surfaces are then better joined by matches.

    Args:
        model: in the known poses' frame.
        known: by name; positions as coarse as GPS say less than single matches.

    Returns:
        Whether they are moved.
    """
    poses, image_of = model_poses(model), {str(model.image(i).name): i for i in model.reg_image_ids()}
    moves: dict[int, Similarity] = {}
    for group in groups:
        right = [name for name in group.names if name in known and judge(poses[name], known[name]).right]
        records = {name: known[name] for name in right if known[name].position is not None}
        if len(records) >= _PLACED:
            move = _own_place({name: poses[name] for name in records}, records)
            if move is None:
                return False
            moves |= {image_of[name]: move for name in group.names}
    of_group = {image_of[name]: number for number, group in enumerate(groups) for name in group.names}
    for key in list(model.point3D_ids()):
        point = model.points3D[key]
        seeing = [element.image_id for element in point.track.elements if element.image_id in of_group]
        if len({of_group[i] for i in seeing}) > 1:
            model.delete_point3D(key)
        elif seeing and seeing[0] in moves:
            move = moves[seeing[0]]
            point.xyz = move.apply(np.asarray(point.xyz)[None])[0]
    for name, i in image_of.items():
        if i in moves:
            model.frame(model.image(i).frame_id).rig_from_world = to_rigid(moves[i].apply_pose(poses[name]))
    return bool(moves)


def _own_place(poses: Mapping[str, Pose], records: Mapping[str, PosePrior]) -> Similarity | None:
    """The similarity that least squares of known positions and orientations give; None where they tell too little."""
    if np.median([record.position_sigma_m for record in records.values()]) > COARSE_M:
        return None
    here = [poses[name] for name in records]
    there = [
        replace(record, rotation=pose.rotation, angle_sigma_deg=_FREE_DEG) if record.rotation is None else record
        for pose, record in zip(here, records.values(), strict=True)
    ]
    placed = place_submodel(here, range(len(here)), there)
    before, after = (np.array([pose.center for pose in each]) for each in (here, placed.poses))
    spread = np.linalg.norm(before - before.mean(axis=0))
    if spread <= 0.0 or np.sqrt(np.linalg.eigvalsh(placed.covariance[:3, :3])[-1]) > np.radians(_LOOSE_DEG):
        return None
    scale = float(np.linalg.norm(after - after.mean(axis=0)) / spread)
    turn = placed.poses[0].rotation.T @ here[0].rotation
    return Similarity(scale, turn, after.mean(axis=0) - scale * turn @ before.mean(axis=0))


def weakly_tied(name: str, groups: Sequence[Group], *, placed: bool) -> tuple[Finding, ...]:
    """That groups of a capture's photographs hang together by single matches only."""
    if len(groups) < 2:
        return ()
    told = "; ".join(map(str, groups))
    held = "the known poses" if placed else "single matches and known positions"
    message = (
        f"weakly tied: the photographs fall into {len(groups)} groups, and no pair across them has enough matches: "
        f"{told}. Within a group poses are good; only {held} tell how the groups lie to one another; take "
        "photographs between the groups, at most 20° apart"
    )
    return (Finding(name, "weakly-tied", message),)
