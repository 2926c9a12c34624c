"""The plots of the campaign's benchmark: their scenes, photographs and campaign folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.campaign.create import CampaignSources, init_campaign
from fieldkit.clouds import write_ply
from fieldkit.files import write_atomic
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan import PlanPlants
from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit.scenes.description import SceneDescription, build, sample_reference
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.simulate import CaptureNoise, Outdoors, Sidecars, Site, simulate_capture
from fieldkit_sim.generator import new_scene
from fieldkit_sim.simulation import ring_about

STATIONS = 13
DATES = (datetime(2026, 6, 11, 9, 0), datetime(2026, 6, 25, 9, 0))
_STAGES: tuple[tuple[Any, ...], ...] = (("V5", "V6"), ("V7", "V8"))
_NOISE = CaptureNoise(position_m=0.05, angle_deg=1.2, image_sigma=2.0)
"""Noise of a small multicopter with RTK in light wind. Geotags have RTK's noise."""
_WIND_M = 0.003
_FIELD = LocalFrame(52.2960, 10.4370, 81.0, "ellipsoid")
_APART_M = (6.0, 4.0)
_COLUMNS = 8


@dataclass(frozen=True)
class Flown:
    """A plot on a date."""

    plot: int
    """Number from 0."""
    date: int
    """Index into `DATES`."""
    width_px: int
    """Of the photographs, 4:3."""
    folder: Path
    """Of the season."""
    seed: int
    """Of plants and noise."""

    @property
    def name(self) -> str:
        return f"P{self.plot + 1:02d}"

    @property
    def photographs(self) -> Path:
        """The folder's name as on a memory card, without the plot's name."""
        return self.folder / "card" / f"{100 + self.date * 400 + self.plot}MEDIA"

    @property
    def truth(self) -> Path:
        return self.folder / "truth" / f"{self.name}-{self.date}.ply"


def _description(each: Flown) -> SceneDescription:
    """The plot's plants on a date; the camera is the same on all."""
    scene = new_scene(
        3,
        7000 + 100 * each.seed + each.plot,
        spacing_m=0.22,
        stages=_STAGES[each.date],
        soil="crumb",
        name=f"{each.name}-{each.date}",
    )
    soil = replace(scene.plot.soil, spacing_m=0.008)
    heading = float(np.random.default_rng([each.seed, each.plot]).uniform(0.0, 360.0))
    camera = _camera(each.width_px)
    effects = replace(scene.camera_effects, grain=scene.camera_effects.grain * each.width_px / 2000.0)
    plot = replace(scene.plot, soil=soil)
    return replace(scene, plot=plot, camera=camera, camera_effects=effects, row_heading_deg=round(heading, 1))


def _camera(width_px: int) -> Intrinsics:
    return Intrinsics.pinhole(width_px, width_px * 3 // 4, 0.85 * width_px)


def _origin(plot: int) -> LocalFrame:
    place = (plot % _COLUMNS * _APART_M[0], plot // _COLUMNS * _APART_M[1], 0.0)
    latitude, longitude, altitude = _FIELD.to_geodetic(place)
    return LocalFrame(float(latitude[0]), float(longitude[0]), float(altitude[0]), "ellipsoid")


def photograph(each: Flown) -> None:
    """Take the plan's photographs of a plot on a date, and write its plants' true surfaces last."""
    description = _description(each)
    scene = build(description)
    plan = _stations(each.width_px, each.seed)
    with Renderer(scene) as renderer:
        simulate_capture(
            each.photographs,
            renderer,
            plan,
            description.camera,
            noise=_NOISE,
            seed=each.plot * 10 + each.date,
            effects=description.camera_effects,
            outdoors=Outdoors(_WIND_M),
            site=Site(_origin(each.plot)),
            row_heading_deg=description.row_heading_deg,
            sidecars=Sidecars(camera=True),
            economy=True,
            overwrite=True,
            started_at=DATES[each.date].replace(hour=9 + each.plot // 20, minute=each.plot % 20 * 3),
        )
    each.truth.parent.mkdir(exist_ok=True)
    write_ply(each.truth, sample_reference(description, scene))


@cache
def _stations(width_px: int, seed: int) -> Sequence[Pose]:
    """A ring about the first plot on the first date: the plan of all plots."""
    first = _description(Flown(0, 0, width_px, Path(), seed))
    return ring_about(STATIONS, 1.4, 1.3)(build(first), first.camera)


def make_campaign(campaign: Path, work: Path, plots: int, width_px: int, seed: int) -> None:
    """Make a campaign of a ring of 13 stations over plots of known place and heading."""
    plants = PlanPlants(points_m=((-0.6, -0.4, 0.1), (0.6, 0.4, 0.9)), cell_m=0.05)
    save_plan(work / "plan.json", plan_from_poses(_stations(width_px, seed), _camera(width_px), plants=plants))
    features = []
    for plot in range(plots):
        origin = _origin(plot)
        heading = _description(Flown(plot, 0, width_px, work, seed)).row_heading_deg
        features.append(
            {
                "type": "Feature",
                "properties": {"name": f"P{plot + 1:02d}", "row_heading_deg": heading},
                "geometry": {"type": "Point", "coordinates": [origin.longitude_deg, origin.latitude_deg]},
            }
        )
    write_atomic(work / "plots.geojson", json.dumps({"type": "FeatureCollection", "features": features}))
    site = f"""\
format = 1
name = "season"
plots = "plots.geojson"

[home]
latitude_deg = {_FIELD.latitude_deg}
longitude_deg = {_FIELD.longitude_deg}
ellipsoid_m = {_FIELD.altitude_m}
"""
    write_atomic(work / "site.toml", site)
    init_campaign(campaign, CampaignSources(work / "plan.json", work / "site.toml"))
