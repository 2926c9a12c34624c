"""A planning run: its settings, folder, evaluations and results."""
