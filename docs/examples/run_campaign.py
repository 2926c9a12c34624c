"""Keep a campaign: one plan, many plots, many dates, and a report.

A campaign's folder knows the plan and the plots. Photographs are sorted into plots and dates, and every visit that is
new is scored. On the command line: `fieldkit campaign init`, `fieldkit evaluate --campaign`, `fieldkit report`.
"""

# %%
import tempfile
from pathlib import Path

from small_plot import SETTINGS, photograph, plan

from fieldkit import write_report
from fieldkit.cache import StageCache
from fieldkit.campaign.create import CampaignSources, init_campaign
from fieldkit.campaign.export import export_campaign
from fieldkit.campaign.run import evaluate_campaign
from fieldkit.results.plan_file import save_plan
from fieldkit.runtime.context import Context

# %% [markdown]
# A plan and a site with two plots make a campaign.

# %%
if __name__ == "__main__":  # visits are evaluated in processes that import this file
    folder = Path(tempfile.mkdtemp(prefix="fieldkit-"))
    context = Context(StageCache(folder / "cache"))
    save_plan(folder / "plan.json", plan())
    (folder / "site.toml").write_text(
        """\
format = 1
[home]
latitude_deg = 52.29590
longitude_deg = 10.43690
amsl_m = 81.0
[[plots]]
name = "A"
latitude_deg = 52.29600
longitude_deg = 10.43700
[[plots]]
name = "B"
latitude_deg = 52.29600
longitude_deg = 10.43710
"""
    )
    init_campaign(folder / "season", CampaignSources(folder / "plan.json", folder / "site.toml"), SETTINGS)

# %% [markdown]
# Photographs lie in folders named for the plots, or have geotags that say where they belong. The second time only what
# is new is computed.

# %%
if __name__ == "__main__":
    photograph(folder / "captures" / "A", seed=3)
    run = evaluate_campaign(folder / "season", folder / "captures", context)
    print(f"first: {len(run.evaluated)} evaluated")
    photograph(folder / "captures" / "B", seed=4)
    run = evaluate_campaign(folder / "season", folder / "captures", context)
    print(f"then: {len(run.evaluated)} evaluated, {len(run.kept)} there already")
    for visit in run.campaign.visits:
        height = "of unknown height" if visit.height_m is None else f"{visit.height_m:.2f} m high"
        print(f"{visit.plot} {visit.date}: {visit.right} of {visit.images} photographs, plants {height}")

# %% [markdown]
# The table for a spreadsheet or QGIS, and everything as one HTML file.

# %%
if __name__ == "__main__":
    export_campaign(run.campaign, folder / "season.csv")
    print((folder / "season.csv").read_text().splitlines()[0][:60], "…")
    report = write_report(folder / "season", folder / "season.html", points=50_000)
    print(f"{report.output.name}: {report.bytes / 1e3:.0f} kB")
