"""fieldkit: reference clouds and capture scores of field plots from photographs."""

__version__ = "0.1.0"
