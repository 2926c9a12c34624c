"""Methods that propose sets of cameras: see `fieldkit.planning.problem.Method`."""
