"""What a trial's folder holds: its scene file, its plots as a GIS draws them, and the truth about each."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from fieldkit.documents.csv_text import csv_text
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.geometry.pose import rotation_about_z
from fieldkit.runtime.progress import Progress, Silent
from fieldkit.scenes.description import Bounds, SceneDescription, build
from fieldkit.scenes.plot_description import PlotDescription, SoilDescription, TrialDescription, WeedsDescription
from fieldkit.scenes.scene_file import write_scene
from fieldkit_sim.generator import FIELD_CAMERA, WIND_M, field_light
from fieldkit_sim.trial.layout import TrialPlot, plots_of
from fieldkit_sim.trial.truth import PlotTruth, trial_truth

SCENE_FILE = "scene.toml"
PLOTS_FILE = "plots.geojson"
TRUTH_FILE = "truth.csv"
_COVER = 7.5
"""Small weeds for each larger one, as many as other plots have."""
_HIGHEST_M = 3.6
"""Upper end of a trial's box above the ground, metres: above the tallest tassel."""


def new_trial(
    trial: TrialDescription, *, weeds_per_m2: float = 0.0, name: str = "", notes: str = ""
) -> SceneDescription:
    """A trial under a sun of its own, with the camera and the wind of the other simulated plots.

    Where there are larger weeds, so many a square metre, there are small ones in the other plots' ratio.
    """
    x, y = (0.5 * side for side in trial.size_m)
    return SceneDescription(
        PlotDescription(
            (),
            SoilDescription(seed=trial.seed),
            field_light(trial.seed),
            weeds=WeedsDescription(trial.seed, _COVER * weeds_per_m2, weeds_per_m2),
            trial=trial,
        ),
        name=name,
        notes=notes,
        bounds=Bounds((-x, -y, 0.0), (x, y, _HIGHEST_M)),
        camera_effects=FIELD_CAMERA,
        wind_m=WIND_M,
    )


def write_trial(
    folder: Path, description: SceneDescription, *, overwrite: bool = False, progress: Progress | None = None
) -> tuple[PlotTruth, ...]:
    """Write a trial's folder: scene.toml, plots.geojson (WGS 84, id under "plot_id") and truth.csv; gives the truth."""
    trial = description.plot.trial
    assert trial is not None
    with atomic_folder(folder, overwrite=overwrite, marker=SCENE_FILE) as partial:
        write_scene(partial / SCENE_FILE, description)
        features = [_feature(plot, trial, description) for plot in plots_of(trial)]
        text = json.dumps({"type": "FeatureCollection", "features": features}, indent=1)
        write_atomic(partial / PLOTS_FILE, text + "\n")
        with (progress or Silent()).stage("Growing the plots", len(features)) as advance:
            truth = trial_truth(description.plot, build(description, advance))
        rows = [[*asdict(plot).values(), plot.lai] for plot in truth]
        write_atomic(partial / TRUTH_FILE, csv_text([*(field.name for field in fields(PlotTruth)), "lai"], rows))
    return truth


def _feature(plot: TrialPlot, trial: TrialDescription, description: SceneDescription) -> dict[str, object]:
    (x0, y0), (x1, y1) = plot.lower_m, plot.upper_m
    corners = np.array([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0), (x0, y0, 0.0)])
    turned = corners @ rotation_about_z(np.radians(90.0 - description.row_heading_deg)).T
    latitude, longitude, _ = description.site.origin.to_geodetic(turned)
    ring = [[round(float(e), 9), round(float(n), 9)] for e, n in zip(longitude, latitude, strict=True)]
    heading = description.row_heading_deg % 360.0
    return {
        "type": "Feature",
        "properties": {"plot_id": plot.id, "row_spacing_m": trial.row_spacing_m, "row_heading_deg": heading},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
