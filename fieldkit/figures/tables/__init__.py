"""The tables of results as values to show: one function each, for all media."""
