"""Pictures (PNG) of results."""
