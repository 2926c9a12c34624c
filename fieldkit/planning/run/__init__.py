"""A planning run: its settings, its folder, its evaluations and what it ends with."""
