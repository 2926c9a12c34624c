"""Procedural maize plants."""

from fieldkit.scenes.maize.description import STAGES, MaizeDescription, Stage
from fieldkit.scenes.maize.plant import build_maize

__all__ = ["STAGES", "MaizeDescription", "Stage", "build_maize"]
