"""Planning: where the cameras go, and what a set of them is worth."""
