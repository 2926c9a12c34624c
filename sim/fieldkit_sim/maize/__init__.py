"""Procedural maize plants."""

from fieldkit_sim.maize.plant import build_maize

__all__ = ["build_maize"]
