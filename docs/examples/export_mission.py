"""Export a mission for many plots.

One plan, flown over every plot of a GeoJSON file: split into flights that a battery carries, in a short order. On the
command line: `fieldkit export-mission plan/ --vehicle ardupilot-pitch --site field.toml --plots plots.geojson -o out`.
"""

# %%
import json
import tempfile
from pathlib import Path

from small_plot import plan

from fieldkit import MissionSettings, export_mission

folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))

# %% [markdown]
# A site file says where home is and how high to fly on the way. Twelve plots, 3 m apart in each direction; QGIS writes
# such a file, too.

# %%
(folder / "field.toml").write_text(
    """\
format = 1
name = "north field"
transit_m = 5.0

[home]
latitude_deg = 52.2960
longitude_deg = 10.4370
amsl_m = 81.0
"""
)
METRE = 1 / 111_320  # of latitude, in degrees
plots = [
    {
        "type": "Feature",
        "properties": {"id": f"r{row}c{column}", "row_heading_deg": 90.0, "plant_height_m": 0.4},
        "geometry": {
            "type": "Point",
            "coordinates": [10.4371 + 3 * column * METRE / 0.612, 52.2961 + 3 * row * METRE],
        },
    }
    for row in range(1, 4)
    for column in range(1, 5)
]
(folder / "plots.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": plots}))

# %% [markdown]
# `adjust=True` takes the nearest poses that the vehicle can fly: the small plot's stations are lower than it may go.

# %%
exported = export_mission(
    plan(),
    "ardupilot-pitch",
    folder / "field.toml",
    folder / "mission.plan",
    MissionSettings(adjust=True),
    plots=folder / "plots.geojson",
    picture=False,
)
for file in exported.files:
    print(f"{file.name}: {file.stat().st_size:,} bytes")
print(f"{len(exported.routed.flights)} flights over {len(plots)} plots")
