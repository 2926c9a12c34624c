"""Other plots of a recorded plot's kind: its plants turned, scaled and left out, drawn from a seed.

Where the plants were told apart each is changed about its own foot, as in BOSfM's test cases. Where they were not,
the whole plot is turned and mirrored. The same seed and number give the same plants, as a cloud and as a scene.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from fieldkit.arrays import FloatArray, IntArray
from fieldkit.clouds import Cloud, concatenate, write_ply
from fieldkit.clouds.plants_apart import PlantsApart
from fieldkit.files import atomic_folder, storage_errors
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.results.fields import vector
from fieldkit.scenes.description import Bounds, SceneDescription
from fieldkit.scenes.from_reference import ATLAS_FILES, GROUND_FILE, PLANTS_FILE, SCENE_FILE
from fieldkit.scenes.plot_description import SCALE_RANGE
from fieldkit.scenes.recorded import pack_atlas, read_atlas, recorded_plants, surfel_axes, surfel_turns, unpack_atlas
from fieldkit.scenes.scene_file import write_scene

LEFT_OUT_EVERY = 4
"""One in so many variations lacks a plant."""
LONGER = 1.3
"""A plot this many times as long as it is wide has rows, whose direction is kept."""
_PURPOSE_CHANGE = 41
"""Seed's part for how a plot's plants are turned."""
_PURPOSE_LEFT_OUT = 42
"""Seed's part for which views are left out."""
_PURPOSE_ORDER = 43
"""Seed's part for the order of rehearsals."""
_MARGIN_M = 0.01
"""Room about plants in their bounds, metres."""


@dataclass(frozen=True)
class Change:
    """What is done to a plant, or to a whole plot, about a place."""

    about_m: tuple[float, float, float]
    """x, y, z of the place, plot frame; it stays where it is."""
    turn_deg: float
    """About the vertical, anticlockwise seen from above."""
    scale: float = 1.0
    """About the place."""
    mirror_deg: float | None = None
    """Before that, mirrored across the vertical plane through the place in this direction, anticlockwise from x; None
    where not mirrored."""

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) orthogonal: the turn and the mirror, without the scale."""
        turn = rotation_about_z(np.radians(self.turn_deg))
        if self.mirror_deg is None:
            return turn
        double = 2.0 * np.radians(self.mirror_deg)
        mirror = np.array([[np.cos(double), np.sin(double), 0.0], [np.sin(double), -np.cos(double), 0.0], [0, 0, 1.0]])
        return np.asarray(turn @ mirror)

    def apply(self, cloud: Cloud) -> Cloud:
        """The changed cloud; its normals are turned and mirrored with it."""
        about, rotation = np.array(self.about_m), self.rotation
        normals = None if cloud.normals is None else (cloud.normals @ rotation.T).astype(np.float32)
        return Cloud(about + self.scale * (cloud.points - about) @ rotation.T, cloud.colors, normals)


@dataclass(frozen=True)
class Variation:
    """How another plot of the kind comes from the recorded one."""

    plants: tuple[Change, ...] = ()
    """Per plant, in the order of their numbers; empty where plants could not be told apart."""
    left_out: int = 0
    """Number of the plant that is left out; 0 where none is."""
    whole: Change | None = None
    """Of the whole plot, where plants could not be told apart."""


def draw_variation(cloud: Cloud, apart: PlantsApart, seed: int, number: int) -> Variation:
    """Variation ``number`` of the kind; any number can be drawn without those before it.

    Plants told apart: each is turned by any angle and scaled within `SCALE_RANGE`. In one of each four numbers in a row
    one plant is left out, where there are two or more.

    Not told apart: the whole plot is mirrored or not and turned about its middle by any angle. If it is at least
    `LONGER` times as long as wide, it is mirrored across its long axis, turned by 180° or both. There are only three
    such plots; the fourth number is the plot itself, and then they come again.
    """
    rng = np.random.default_rng([seed, _PURPOSE_CHANGE, number])
    if not apart.count:
        return Variation(whole=_whole(cloud, seed, number, rng))
    plants = tuple(
        Change(
            vector(foot),
            turn_deg=round(float(rng.uniform(0.0, 360.0)), 1),
            scale=round(float(rng.uniform(*SCALE_RANGE)), 3),
        )
        for foot in apart.feet_m
    )
    left_out = 0
    if apart.count >= 2:
        among = np.random.default_rng([seed, _PURPOSE_LEFT_OUT, number // LEFT_OUT_EVERY])
        if number % LEFT_OUT_EVERY == int(among.integers(LEFT_OUT_EVERY)):
            left_out = 1 + int(among.integers(apart.count))
    return Variation(plants, left_out)


def varied_cloud(cloud: Cloud, apart: PlantsApart, variation: Variation) -> Cloud:
    """The plants of a variation; points are in the order of ``cloud``, without those of a plant left out.

    What belongs to no plant stays where it is.
    """
    return _varied(cloud, apart, variation)[0]


def write_varied_scene(description: SceneDescription, apart: PlantsApart, variation: Variation, output: Path) -> Path:
    """Write ``output``/scene.toml of a variation, with its files beside it, and return its path.

    Each surfel keeps its patch of the photographs, turned with its plant. The patches stay as sharp as they were: a
    surfel's place in the file says how it is turned in its plane (`surfel_axes`), so the points are put in the order
    that gives each the turn it needs. Without patches the points keep their order.

    The ground stays as it is. With it stay the shadows of the plants as they were photographed, and the gaps under
    their feet. The ground's files are linked to the recorded scene's where the file system can, else copied. ``apart``
    is of the points of its plants (`recorded_plants`).
    """
    surface = description.recorded
    if surface is None:
        raise ValueError("only a scene made from a reference has recorded plants")
    recorded = recorded_plants(surface)
    plants, origin = _varied(recorded, apart, variation)
    patches = None
    if surface.plant_atlas is not None:
        patches = unpack_atlas(read_atlas(surface.plant_atlas, len(recorded), surface.texels), len(recorded))
        order, flipped = _turned_order(recorded, plants, origin, apart, variation)
        plants, origin = plants.select(order), origin[order]
        patches = patches[origin]
        if flipped:
            patches = patches[:, :, ::-1]
    with atomic_folder(output, overwrite=False, marker=SCENE_FILE) as partial, storage_errors(output):
        write_ply(partial / PLANTS_FILE, plants)
        _link(surface.ground, partial / GROUND_FILE)
        varied = replace(surface, plants=partial / PLANTS_FILE, ground=partial / GROUND_FILE)
        if patches is not None:
            Image.fromarray(pack_atlas(patches)).save(partial / ATLAS_FILES[0], compress_level=3)
            varied = replace(varied, plant_atlas=partial / ATLAS_FILES[0])
        if surface.ground_atlas is not None:
            _link(surface.ground_atlas, partial / ATLAS_FILES[1])
            varied = replace(varied, ground_atlas=partial / ATLAS_FILES[1])
        written = replace(
            description,
            notes=f"A plot of the kind of {description.name}.",
            recorded=varied,
            bounds=bounds_around(description.bounds, plants),
        )
        write_scene(partial / SCENE_FILE, written)
    return output / SCENE_FILE


def _whole(cloud: Cloud, seed: int, number: int, rng: np.random.Generator) -> Change:
    """What is done to a plot whose plants were not told apart."""
    (x, y), axis_deg, longer = _plan(cloud)
    about = (x, y, 0.0)
    if longer < LONGER:
        mirror_deg = 0.0 if rng.random() < 0.5 else None
        return Change(about, round(float(rng.uniform(0.0, 360.0)), 1), mirror_deg=mirror_deg)
    ways: list[tuple[float, float | None]] = [(180.0, None), (0.0, axis_deg), (180.0, axis_deg)]
    order = [*np.random.default_rng([seed, _PURPOSE_ORDER]).permutation(len(ways)), None]
    chosen = order[number % len(order)]
    turn_deg, mirror = (0.0, None) if chosen is None else ways[chosen]
    return Change(about, turn_deg, mirror_deg=mirror)


def _plan(cloud: Cloud) -> tuple[tuple[float, float], float, float]:
    """Middle of the plot, direction of its long axis (degrees from x), and how many times as long as wide it is."""
    plan = cloud.points[:, :2]
    mean = plan.mean(axis=0)
    axes = np.linalg.eigh((plan - mean).T @ (plan - mean))[1]
    low, high = np.quantile((plan - mean) @ axes, (0.02, 0.98), axis=0)
    x, y = mean + axes @ (0.5 * (low + high))
    width, length = high - low
    direction = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))) % 180.0
    return (round(float(x), 4), round(float(y), 4)), round(direction, 2), float(length / max(width, 1e-9))


def _changes(apart: PlantsApart, variation: Variation) -> list[tuple[IntArray, Change | None]]:
    """Which points are changed and how; None where they stay. Those of a plant left out are not there."""
    everything = np.arange(len(apart.numbers))
    if variation.whole is not None:
        return [(everything, variation.whole)]
    changes: list[tuple[IntArray, Change | None]] = [(everything[apart.numbers == 0], None)]
    for number, change in enumerate(variation.plants, 1):
        if number != variation.left_out:
            changes.append((everything[apart.numbers == number], change))
    return changes


def _varied(cloud: Cloud, apart: PlantsApart, variation: Variation) -> tuple[Cloud, IntArray]:
    """The plants of a variation, and which of the cloud's points each of theirs was."""
    changes = _changes(apart, variation)
    parts = [(cloud.select(chosen), change) for chosen, change in changes]
    varied = concatenate([part if change is None else change.apply(part) for part, change in parts])
    origin = np.concatenate([chosen for chosen, _ in changes])
    order = np.argsort(origin)
    return varied.select(order), origin[order]


def _turned_order(
    recorded: Cloud, plants: Cloud, origin: IntArray, apart: PlantsApart, variation: Variation
) -> tuple[IntArray, bool]:
    """The order of the points of ``plants`` in which surfels are turned as they were on the recorded plants.

    The turns of the places in a file are spread evenly over the circle, and so are those that the points need. Matched
    by size they differ by about a degree for a thousand points, less for more. The order is (n,); also whether patches
    are to be flipped from left to right because the plot is mirrored.
    """
    flipped = variation.whole is not None and variation.whole.mirror_deg is not None
    wanted = surfel_axes(recorded)[1]
    for chosen, change in _changes(apart, variation):
        if change is not None:
            wanted[chosen] = wanted[chosen] @ change.rotation.T
    wanted = -wanted[origin] if flipped else wanted[origin]
    _, a, b = surfel_axes(plants)
    turns = surfel_turns(len(plants))
    needed = turns + np.arctan2(np.einsum("nk,nk->n", wanted, b), np.einsum("nk,nk->n", wanted, a))
    full = 2.0 * np.pi
    order = np.empty(len(plants), np.int64)
    order[np.argsort(turns % full, kind="stable")] = np.argsort(needed % full, kind="stable")
    return order, flipped


def bounds_around(bounds: Bounds, plants: Cloud) -> Bounds:
    """The bounds, widened to whole centimetres about the plants."""
    low, high = plants.bounds()
    lower = np.minimum(bounds.lower_m, np.floor(100.0 * (low - _MARGIN_M)) / 100.0)
    upper = np.maximum(bounds.upper_m, np.ceil(100.0 * (high + _MARGIN_M)) / 100.0)
    # The ground is where it was: what lies below it is no plant's.
    lower[2] = bounds.lower_m[2]
    return Bounds(vector(round(float(v), 6) for v in lower), vector(round(float(v), 6) for v in upper))


def _link(source: Path, target: Path) -> None:
    """The same file in a second place; a copy where file systems differ or have no links."""
    try:
        os.link(source.resolve(), target)
    except OSError:
        shutil.copyfile(source, target)
