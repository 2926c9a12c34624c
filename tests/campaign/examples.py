"""A small field, a plan and photographs' metadata for the tests of campaigns."""

import json
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from fieldkit.campaign.create import CampaignSources, init_campaign
from fieldkit.campaign.reading import CampaignPlot
from fieldkit.campaign.sorting import PhotoToSort
from fieldkit.captures.model import GeoTag, Photo
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.plan import Plan, PlanMethod, PlanPlants
from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit_sim.simulation import ring

FIELD = LocalFrame(52.2960, 10.4370, 81.0, "ellipsoid")
STATIONS = ring(8, 1.4, 1.3, (0.0, 0.0, 0.3))
CAMERA = Intrinsics.pinhole(1000, 750, 850.0)
PLANTS = PlanPlants(points_m=((-0.5, -0.2, 0.1), (0.5, 0.2, 0.7)), cell_m=0.05)
PLAN = plan_from_poses(
    STATIONS, CAMERA, plants=PLANTS, method=PlanMethod(name="ring", chamfer_m=0.01, chamfer_spread_m=0.001, repeats=5)
)
MORNING = datetime(2026, 6, 18, 9, 0)


def field(rows: int, columns: int, *, spacing_m: tuple[float, float] = (3.0, 1.5)) -> tuple[CampaignPlot, ...]:
    """Rectangular plots side by side, named r1c1 …; every second one headed 80°, the others 100°."""
    plots = []
    for row in range(rows):
        for column in range(columns):
            x, y = column * spacing_m[0], row * spacing_m[1]
            corners = [
                (x + a * spacing_m[0] / 2.1, y + b * spacing_m[1] / 2.1)
                for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
            latitude, longitude, _ = FIELD.to_geodetic([(x, y, 0.0), *((*corner, 0.0) for corner in corners)])
            shape = tuple((float(a), float(b)) for a, b in zip(latitude[1:], longitude[1:], strict=True))
            heading = 80.0 if (row + column) % 2 else 100.0
            name = f"r{row + 1}c{column + 1}"
            origin = {"latitude_deg": float(latitude[0]), "longitude_deg": float(longitude[0])}
            plots.append(CampaignPlot(name=name, row_heading_deg=heading, shape=shape, **origin))
    return tuple(plots)


def plots_geojson(plots: tuple[CampaignPlot, ...]) -> str:
    features = []
    for plot in plots:
        ring_ = [[longitude, latitude] for latitude, longitude in plot.shape or ()]
        geometry = (
            {"type": "Polygon", "coordinates": [[*ring_, ring_[0]]]}
            if ring_
            else {"type": "Point", "coordinates": [plot.longitude_deg, plot.latitude_deg]}
        )
        properties = {"name": plot.name, "row_heading_deg": plot.row_heading_deg}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return json.dumps({"type": "FeatureCollection", "features": features})


def photo(name: str, **values: object) -> Photo:
    """A photograph that nobody took."""
    base = Photo(Path("/nowhere") / name, name, 1000, 750, "JPEG", name, make="m", model="c", serial="1")
    return replace(base, **values)


def flown(
    plot: CampaignPlot,
    *,
    start: datetime = MORNING,
    folder: str = "DCIM",
    angles: bool = True,
    accuracy_m: float = 0.015,
) -> list[PhotoToSort]:
    """The plan's photographs of a plot as a vehicle tags them, four seconds apart."""
    heading = np.radians(plot.row_heading_deg)
    s, c = np.sin(heading), np.cos(heading)
    frame = LocalFrame(plot.latitude_deg, plot.longitude_deg, 81.0, "ellipsoid")
    turn = np.array([[s, -c, 0.0], [c, s, 0.0], [0.0, 0.0, 1.0]])
    shots = []
    for k, station in enumerate(PLAN.stations):
        place = turn @ np.array(station.position_m)
        latitude, longitude, altitude = (float(v[0]) for v in frame.to_geodetic(place))
        yaw, pitch, _ = Pose(station.pose.rotation @ turn.T, place).yaw_pitch_roll_deg()
        tag = GeoTag(latitude, longitude, altitude, "ellipsoid", horizontal_accuracy_m=accuracy_m)
        taken = start + timedelta(seconds=4 * k)
        name = f"{folder}/{plot.name}-{start:%m%d%H%M}-{k}.jpg"
        aim = {"yaw_deg": yaw, "pitch_deg": pitch} if angles else {}
        shots.append(PhotoToSort(name, photo(name, geotag=tag, captured_at=taken, **aim), tuple(folder.split("/"))))
    return shots


def campaign_folder(tmp_path: Path, plots: tuple[CampaignPlot, ...], plan: Plan = PLAN, **options: object) -> Path:
    """A campaign made of files in tmp_path/sources."""
    sources = tmp_path / "sources"
    sources.mkdir(exist_ok=True)
    save_plan(sources / "plan.json", plan)
    (sources / "plots.geojson").write_text(plots_geojson(plots))
    (sources / "site.toml").write_text(
        'format = 1\nplots = "plots.geojson"\n[home]\nlatitude_deg = 52.296\nlongitude_deg = 10.437\namsl_m = 40.0\n'
    )
    folder = tmp_path / "season"
    init_campaign(folder, CampaignSources(sources / "plan.json", sources / "site.toml"), **options)
    return folder
