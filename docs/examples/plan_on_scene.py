"""Plan on a scene, for a vehicle.

Every trial is photographed by rendering, reconstructed by real structure from motion and scored. The vehicle's profile
says which poses it can take and what its camera sees. On the command line:
`fieldkit plan --scene plot.toml --vehicle ardupilot-pitch -n 4 -o maize-plan`.
"""

# %%
import tempfile
from pathlib import Path

from small_plot import scene

from fieldkit import Context, PlanSettings, load_plan, plan
from fieldkit.cache import StageCache
from fieldkit.scenes.scene_file import write_scene

# %% [markdown]
# Evaluations run in processes of their own, and those import this file: what must run once stands behind the check of
# `__name__`. In a notebook it is not needed.
#
# Four cameras and three evaluations only show how it is done. Ten cameras and a hundred evaluations are a plan.

# %%
if __name__ == "__main__":
    folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
    context = Context(StageCache(folder / "cache"))
    write_scene(folder / "plot.toml", scene())
    settings = PlanSettings(
        scene=folder / "plot.toml",
        vehicle="ardupilot-pitch",
        cameras=4,
        method="circle",
        evaluations=3,
        finalists=1,
        repeats=1,
        fidelity="draft",
        confirm_fidelity="draft",
    )
    outcome = plan(folder / "maize-plan", settings, context)
    print(f"{outcome.evaluations} evaluations; the best is {1000 * outcome.chamfer_m:.1f} mm from the plants")

# %% [markdown]
# A finished run can be given more evaluations; those it has are not done again.

# %%
if __name__ == "__main__":
    outcome = plan(folder / "maize-plan", PlanSettings(evaluations=4), context, resume=True)
    stations = load_plan(folder / "maize-plan").stations
    print(f"{outcome.evaluations} evaluations; {len(stations)} stations, the lowest at "
          f"{min(station.position_m[2] for station in stations):.2f} m")  # fmt: skip
