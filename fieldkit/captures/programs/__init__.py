"""Poses and cameras that other programs found: COLMAP, OpenDroneMap and Metashape (XML)."""

from fieldkit.captures.programs.model import METRES, PosesFile, ProgramPoses
from fieldkit.captures.programs.results import program_of, read_result

__all__ = ["METRES", "PosesFile", "ProgramPoses", "program_of", "read_result"]
