"""A campaign: one plan over many plots and dates, and the table of their scores."""

from fieldkit.campaign.campaign_file import CAMPAIGN_FILE
from fieldkit.campaign.folder import Campaign, CampaignPlot, find_campaign, read_campaign, visit_plots
from fieldkit.campaign.visit import Visit

__all__ = ["CAMPAIGN_FILE", "Campaign", "CampaignPlot", "Visit", "find_campaign", "read_campaign", "visit_plots"]
