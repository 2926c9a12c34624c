"""A campaign: one plan over many plots and dates, and what came of each.

A *visit* is a plot on a date. It is kept once, as visit.json (`fieldkit.results.visit.Visit`) in visits/PLOT/DATE
beside its evaluation; tables, ranks and exports are made of these files.

| Question | File |
| --- | --- |
| How is a campaign's folder made? | create.py |
| What does campaign.toml say? How is it read, with plots, plan and visits? | reading.py |
| Where is a visit kept, and how is it read? | reading.py; names of folders: fieldkit/sites/plot_ids.py |
| What does `fieldkit evaluate` do in a campaign? What is computed again? | run.py |
| Which plot and date is a photograph of? | sorting.py |
| What does a worker do with a visit, in which frame? | evaluate_visit.py |
| Which fieldkit computed a visit? | reading.py; versions of its stages: fieldkit/reconstruction/versions.py |
| Which plot is better, and what changed? | fieldkit/campaign/ranks.py; as `campaign show` says it: overview.py |
| How does it leave for other programs? | export.py (CSV, GeoJSON, GeoPackage, height models) |
"""

from fieldkit.campaign.reading import Campaign, CampaignPlot, read_campaign, visit_plots
from fieldkit.results.visit import CAMPAIGN_FILE, Visit, find_campaign

__all__ = ["CAMPAIGN_FILE", "Campaign", "CampaignPlot", "Visit", "find_campaign", "read_campaign", "visit_plots"]
