"""Sets of cameras: the feasible set, structured families, and codes."""
