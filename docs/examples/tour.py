"""A tour: five verbs, and the types that they give.

Check photographs, evaluate them, plan others, export the plan as a mission, and keep a campaign. On the command line:
`fieldkit check`, `evaluate`, `plan`, `export-mission` and `campaign`.
"""

# %%
import tempfile
from pathlib import Path

from small_plot import SETTINGS, photograph, scene

from fieldkit import Context, PlanSettings, check, evaluate, export_mission, load_plan, plan
from fieldkit.cache import StageCache
from fieldkit.campaign.create import CampaignSources, init_campaign
from fieldkit.campaign.run import evaluate_campaign
from fieldkit.captures import read_capture
from fieldkit.planning.space.cameras import Cameras
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.scenes.scene_file import write_scene
from fieldkit.sites.site_file import load_site

SITE = """\
format = 1
transit_m = 5.0
[home]
latitude_deg = 52.29590
longitude_deg = 10.43690
amsl_m = 81.0
[[plots]]
name = "A"
latitude_deg = 52.29600
longitude_deg = 10.43700
plant_height_m = 0.4
"""


def show(value: object, text: str) -> None:
    """Print a value's type, and what it says."""
    print(f"{type(value).__name__:14} {text}")


# %% [markdown]
# `check`: will the photographs do? A capture is a folder of them with what lies beside.

# %%
if __name__ == "__main__":  # what starts processes stands behind this line, for they import this file
    folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
    context = Context(StageCache(folder / "cache"))
    photographs = photograph(folder / "card" / "A")
    capture = read_capture(photographs)
    show(capture.photos[0], capture.photos[0].name)
    show(capture, f"{len(capture.photos)} photographs, scale from {capture.metric_source}")
    show(known_poses(capture), f"{len(known_poses(capture).positioned)} known positions")
    (checked,) = check(photographs, context=context)
    show(checked, f"{checked.photographs} looked at, {len(checked.findings)} findings")

# %% [markdown]
# `evaluate`: what do they reconstruct?

# %%
if __name__ == "__main__":
    plot = evaluate(photographs, folder / "scores", SETTINGS, context).plots[0]
    show(plot, f"{plot.right} of {plot.images} photographs count, {plot.points:,} points")
    show(plot.findings[0], plot.findings[0].message)

# %% [markdown]
# `plan`: where should they be taken? With `repeats=0` nothing is photographed to confirm it.

# %%
if __name__ == "__main__":
    write_scene(folder / "plot.toml", scene())
    settings = PlanSettings(scene=folder / "plot.toml", vehicle="ardupilot-pitch", cameras=6, plots=2, repeats=0)
    plan(folder / "plan", settings, context)
    planned = load_plan(folder / "plan")
    cameras = Cameras.from_poses(station.pose for station in planned.stations)
    show(cameras, f"looking down by {-cameras.pitch_deg.mean():.0f}°")
    show(planned, f"{len(planned.stations)} stations for plants {planned.plant_height_m:.2f} m high")

# %% [markdown]
# `export`: how does a vehicle fly there?

# %%
if __name__ == "__main__":
    (folder / "site.toml").write_text(SITE)
    site = load_site(folder / "site.toml")
    show(site, f"{len(site.plots)} plot")
    exported = export_mission(planned, "ardupilot-pitch", site, folder / "mission.plan", picture=False)
    mission = exported.routed.flights[0].mission
    show(mission, f"{len(mission.stops)} stops at {mission.speed_mps:.0f} m/s")

# %% [markdown]
# `campaign`: the same over many plots and dates.

# %%
if __name__ == "__main__":
    init_campaign(folder / "season", CampaignSources(folder / "plan", folder / "site.toml"), SETTINGS)
    (visit,) = evaluate_campaign(folder / "season", folder / "card", context).campaign.visits
    show(visit, f"{visit.plot} on {visit.date}, {visit.right} of {visit.images} photographs")
