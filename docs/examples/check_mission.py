"""Check a mission file, whoever wrote it.

The items are carried out as the vehicle's autopilot does: which photographs would really be taken, and what speaks
against flying. On the command line: `fieldkit check-mission mission.plan --vehicle ardupilot-pitch`.
"""

# %%
import tempfile
from pathlib import Path

from small_plot import plan

from fieldkit import MissionSettings, export_mission
from fieldkit.missions.check import check_mission, check_on_ground
from fieldkit.missions.files.formats import read_mission
from fieldkit.missions.ground import ground_of
from fieldkit.vehicles.vehicle_file import load_vehicle

folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
(folder / "field.toml").write_text(
    """\
format = 1
[home]
latitude_deg = 52.2960
longitude_deg = 10.4370
amsl_m = 81.0
[[plots]]
name = "plot 7"
latitude_deg = 52.2961
longitude_deg = 10.4371
length_m = 0.3
width_m = 0.3
plant_height_m = 0.4
"""
)
settings = MissionSettings(adjust=True)
export_mission(plan(), "ardupilot-pitch", folder / "field.toml", folder / "mission.plan", settings, picture=False)

# %%
vehicle = load_vehicle("ardupilot-pitch")
ground = ground_of(folder / "mission.plan", None, vehicle.clearance_m)  # from the mission.json beside the file
report = check_on_ground(read_mission(folder / "mission.plan"), vehicle, ground)
print("may be flown" if report.may_be_flown else "must not be flown, or is not checked against plants")
for shot in report.taken[:3]:
    print(f"heading {shot.heading_deg:.0f}°, pitch {shot.pitch_deg:.0f}°, {shot.settled_s:.1f} s after standing still")

# %% [markdown]
# The same file for a vehicle that cannot turn its camera: the check says so.

# %%
other = check_mission(read_mission(folder / "mission.plan"), load_vehicle("fixed-gimbal"))
print(f"its camera would look at {other.taken[0].pitch_deg:.0f}°")
for severity, message in sorted({(finding.severity, finding.message) for finding in other.findings})[:3]:
    print(f"{severity}: {message}")
