"""Simulated plots: maize on soil, rendered photographs with metadata, and the truth about them."""
