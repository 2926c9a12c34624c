"""Choose the views that matter from a recorded set.

Photographs that are there already, with known poses: which few of them reconstruct the plot best? Nothing is rendered.
On the command line: `fieldkit plan --captures plot_7/ -n 6 -o plot_7-views`.
"""

# %%
import json
import tempfile
from pathlib import Path

from small_plot import SETTINGS, photograph

from fieldkit import Context, PlanSettings, build_reference, load_plan, plan
from fieldkit.cache import StageCache

# %% [markdown]
# Without `reference` one of all photographs is built first. `uniform` takes every k-th view; `field`, the default,
# searches.

# %%
if __name__ == "__main__":  # evaluations run in processes that import this file
    folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
    context = Context(StageCache(folder / "cache"))
    captures = photograph(folder / "plot_7")
    build_reference(captures, folder / "reference", SETTINGS, context)
    settings = PlanSettings(
        captures=captures,
        reference=folder / "reference",
        cameras=6,
        method="uniform",
        evaluations=2,
        finalists=1,
        fidelity="draft",
        confirm_fidelity="draft",
    )
    outcome = plan(folder / "plot_7-views", settings, context)

# %% [markdown]
# The plan's stations are the chosen photographs' poses; the run's log names the photographs.

# %%
if __name__ == "__main__":
    trials = [json.loads(line) for line in (folder / "plot_7-views" / "evaluations.jsonl").read_text().splitlines()]
    for trial in (trial for trial in trials if trial["stage"] == "search"):
        print(f"{1000 * trial['value_m']:6.1f} mm  {' '.join(trial['views'])}")
    print(f"chosen: {len(load_plan(folder / 'plot_7-views').stations)} views, {1000 * outcome.chamfer_m:.1f} mm")
