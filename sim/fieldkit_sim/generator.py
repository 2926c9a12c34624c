"""New scenes from a few numbers, and the changes that make the paper's test cases from its cases."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.scenes.camera_effects import USUAL_GRAIN, CameraEffects
from fieldkit.scenes.description import Bounds, SceneDescription
from fieldkit.scenes.plot_description import (
    SCALE_RANGE,
    MaizeDescription,
    NeighboursDescription,
    PlotDescription,
    SoilDescription,
    SoilKind,
    WeedsDescription,
)
from fieldkit.scenes.scene import HAZE, Light
from fieldkit.scenes.simulate import CaptureNoise
from fieldkit.vocabulary import Stage

Layout = Literal["rows", "grid", "random"]


FIELD_CAMERA = CameraEffects(
    exposure_s=0.003,
    defocus_px=0.25,
    vignetting=0.2,
    veiling_glare=0.005,
    exposure_ev=0.2,
    white_balance=0.03,
    grain=USUAL_GRAIN,
    jpeg_quality=85,
)
"""A small camera that exposes automatically, under a drone that hovers. Set on the tuning scenes, with `WIND_M` and the
leaves' markings, against the recorded rigs (sim/README.md)."""
WIND_M = 0.010
"""A light air: half a metre out a leaf moves by a centimetre between photographs."""
_REACH_M = 0.55
"""How far leaves reach from the foot of a plant."""
_JITTER_M = 0.015
"""Standard deviation of plants' feet from even places per axis, metres."""
_PURPOSE_PLACES = 21
"""Seed's part for plants' feet."""
_PURPOSE_FORM = 22
"""Seed's part for plants' forms."""
_PURPOSE_VARIATION = 23
"""Seed's part for a plot's variation."""
_PURPOSE_LIGHT = 24
"""Seed's part for the light."""
_PURPOSE_KIND = 25
"""Seed's part for plots of a kind."""
_OTHER_PLANTS = 0.5
"""Share of `plots_of_kind` that have another number of plants."""
_MISSING = 0.25
"""Share of `plots_of_kind` in which a plant is missing."""


def new_scene(
    plants: int,
    seed: int,
    *,
    layout: Layout = "rows",
    spacing_m: float = 0.22,
    row_spacing_m: float = 0.50,
    stages: tuple[Stage, ...] = ("V8", "V9", "V10"),
    soil: SoilKind = "tilled",
    cover_per_m2: float = 15.0,
    weeds_per_m2: float = 2.0,
    neighbour_rows: int = 0,
    name: str = "",
    notes: str = "",
) -> SceneDescription:
    """A plot of ``plants`` different maize plants about the origin, on soil and under a sun of its own.

    Args:
        plants: 1 to 60.
        seed: of everything.
        layout: "rows" along x (one up to 4 plants, then two, three from 13), "grid" as square as it gets,
            "random" with at least 0.8 · ``spacing_m`` between plants.
        spacing_m: between plants, 0.05 to 2.
        row_spacing_m: between rows, 0.05 to 3.
        stages: one of them is drawn for each plant.
        soil: kind of soil.
        cover_per_m2, weeds_per_m2: small and larger weeds.
        neighbour_rows: rows of maize on each side of the plot.
        name: of the scene.
        notes: for people.
    """
    if not 1 <= plants <= 60:
        raise ValueError(f"a scene has 1 to 60 plants, not {plants}")
    if not (0.05 <= spacing_m <= 2.0 and 0.05 <= row_spacing_m <= 3.0):
        raise ValueError("plants stand 0.05 to 2 m apart, rows 0.05 to 3 m")
    rng = np.random.default_rng([seed, _PURPOSE_PLACES])
    places = _places(plants, layout, spacing_m, row_spacing_m, rng)
    form = np.random.default_rng([seed, _PURPOSE_FORM])
    described = tuple(
        MaizeDescription(
            seed=int(form.integers(1 << 30)),
            x_m=_rounded(x),
            y_m=_rounded(y),
            yaw_deg=_rounded(form.uniform(0, 360), 1),
            scale=_rounded(form.uniform(*SCALE_RANGE)),
            stage=stages[int(form.integers(len(stages)))],
        )
        for x, y in places
    )
    bounds = _bounds(described)
    plot = PlotDescription(
        described,
        SoilDescription(seed=seed, kind=soil),
        field_light(seed),
        weeds=WeedsDescription(seed, cover_per_m2, weeds_per_m2),
        neighbours=NeighboursDescription(seed, rows=neighbour_rows),
        extent_m=_rounded(2.0 * max(*bounds.upper_m[:2], *(-v for v in bounds.lower_m[:2])), 2),
    )
    return SceneDescription(
        plot,
        name=name,
        notes=notes,
        bounds=bounds,
        camera_effects=FIELD_CAMERA,
        wind_m=WIND_M,
        noise=CaptureNoise(image_sigma=0.0),  # the camera's grain is all its noise
    )


def varied(description: SceneDescription, seed: int, *, name: str = "", notes: str = "") -> SceneDescription:
    """The same plants in the same places, each with a new random rotation and a new scale within ±10 %.

    This is what BOSfM's test cases 1 to 3 are to its cases 1 to 3.
    """
    rng = np.random.default_rng([seed, _PURPOSE_VARIATION])
    plants = tuple(
        replace(plant, yaw_deg=_rounded(rng.uniform(0, 360), 1), scale=_rounded(rng.uniform(*SCALE_RANGE)))
        for plant in description.plot.plants
    )
    return replace(description, plot=replace(description.plot, plants=plants), name=name, notes=notes)


def without_plant(description: SceneDescription, number: int, *, name: str = "", notes: str = "") -> SceneDescription:
    """The same scene without its plant ``number`` (from 1), as BOSfM's test cases 4 and 5."""
    plants = description.plot.plants
    if not 1 <= number <= len(plants):
        raise ValueError(f"the scene has plants 1 to {len(plants)}, not {number}")
    left = plants[: number - 1] + plants[number:]
    return replace(description, plot=replace(description.plot, plants=left), name=name, notes=notes)


def plots_of_kind(description: SceneDescription, count: int, seed: int) -> tuple[SceneDescription, ...]:
    """Plots that have in common with ``description`` what a trial's plots have: places, stages, the camera.

    On each every plant is turned at random and scaled within ±10 %, about every second plot has other plants of the
    same stages, on about every fourth one plant is missing (of two or more), and sun and soil are its own.

    Args:
        description: of a simulated plot with plants.
        count: how many; plot k is the same however many there are.
        seed: of all draws.
    """
    return tuple(_of_kind(description, np.random.default_rng([seed, _PURPOSE_KIND, k])) for k in range(count))


def _of_kind(description: SceneDescription, rng: np.random.Generator) -> SceneDescription:
    seed = int(rng.integers(1 << 30))
    others, missing = rng.random() < _OTHER_PLANTS, rng.random() < _MISSING
    made = varied(description, seed)
    plants = made.plot.plants
    if others:
        plants = tuple(replace(plant, seed=int(rng.integers(1 << 30))) for plant in plants)
    if missing and len(plants) > 1:
        left_out = int(rng.integers(len(plants)))
        plants = plants[:left_out] + plants[left_out + 1 :]
    plot = replace(made.plot, plants=plants, soil=replace(made.plot.soil, seed=seed), light=field_light(seed))
    return replace(made, plot=plot)


def _places(count: int, layout: Layout, spacing_m: float, row_spacing_m: float, rng: np.random.Generator) -> FloatArray:
    """(count, 2) metres about the origin."""
    if layout == "random":
        places = _random_places(count, 0.8 * spacing_m, rng)
        return np.asarray(places - places.mean(axis=0))
    if layout == "rows":
        rows, across = (1 if count <= 4 else 2 if count <= 12 else 3), row_spacing_m
    else:
        rows, across = int(np.floor(np.sqrt(count))), spacing_m
    parts = np.array_split(np.arange(count), rows)
    places = np.concatenate(
        [
            np.column_stack([(np.arange(len(part)) - (len(part) - 1) / 2) * spacing_m, np.full(len(part), y * across)])
            for y, part in zip(np.arange(rows) - (rows - 1) / 2, parts, strict=True)
        ]
    )
    return np.asarray(places + rng.normal(0.0, _JITTER_M, places.shape))


def _bounds(plants: tuple[MaizeDescription, ...]) -> Bounds:
    xy = np.array([(plant.x_m, plant.y_m) for plant in plants])
    lower, upper = xy.min(axis=0) - _REACH_M, xy.max(axis=0) + _REACH_M
    return Bounds(
        (_rounded(lower[0], 2), _rounded(lower[1], 2), 0.0), (_rounded(upper[0], 2), _rounded(upper[1], 2), 1.4)
    )


def field_light(seed: int) -> Light:
    """A sun 35 to 65° high anywhere between south-east and south-west."""
    rng = np.random.default_rng([seed, _PURPOSE_LIGHT])
    height, azimuth = np.radians(rng.uniform(35, 65)), np.radians(rng.uniform(120, 240))
    sun = (np.cos(height) * np.sin(azimuth), np.cos(height) * np.cos(azimuth), np.sin(height))
    return replace(HAZE, sun=(_rounded(sun[0], 4), _rounded(sun[1], 4), _rounded(sun[2], 4)))


def _rounded(value: float, decimals: int = 3) -> float:
    return round(float(value), decimals)


def _random_places(count: int, distance: float, rng: np.random.Generator) -> FloatArray:
    """(count, 2) places about the origin, no two nearer than ``distance``, in metres."""
    half, places = 0.5 * distance * np.sqrt(count) * 1.3, np.zeros((0, 2))
    while len(places) < count:
        place = rng.uniform(-half, half, (1, 2))
        if not len(places) or np.linalg.norm(places - place, axis=1).min() >= distance:
            places = np.vstack([places, place])
        half *= 1.002  # a full square grows until everything fits
    return places
