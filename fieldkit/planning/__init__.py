"""Planning: sets of cameras, their value, and the search for the best."""
