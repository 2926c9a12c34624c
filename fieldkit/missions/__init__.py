"""Flying a plan: what plan.json holds."""
