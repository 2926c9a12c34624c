"""Read a plan, change it, write it again.

A plan is one JSON file of stations: position in the plot frame (metres), heading and gimbal pitch (degrees).
"""

# %%
import tempfile
from pathlib import Path

from small_plot import plan

from fieldkit import load_plan
from fieldkit.results.plan_file import save_plan

folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
save_plan(folder / "plan.json", plan())

# %%
read = load_plan(folder / "plan.json")
for number, station in enumerate(read.stations, 1):
    x, y, z = station.position_m
    print(f"{number}: {x:6.2f} {y:6.2f} {z:6.2f} m, heading {station.yaw_deg:4.0f}°, pitch {station.pitch_deg:4.0f}°")

# %% [markdown]
# Plans and stations are values: a changed one is a new one. `model_validate_json` checks it as reading a file does.
# What says where the plan came from (`method`, `source`) is no longer true of it.

# %%
higher = tuple(
    station.model_copy(update={"position_m": (*station.position_m[:2], station.position_m[2] + 0.5)})
    for station in read.stations[::2]
)
changed = read.model_copy(update={"stations": higher, "method": None, "source": None})
changed = type(read).model_validate_json(changed.model_dump_json())
save_plan(folder / "higher.json", changed)
print(f"{len(changed.stations)} stations, all at {changed.stations[0].position_m[2]:.2f} m")
