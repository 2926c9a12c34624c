"""A campaign: one plan over many plots and dates, and the table of their scores."""
