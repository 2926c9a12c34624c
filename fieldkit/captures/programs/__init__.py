"""Poses and cameras that other programs found: COLMAP, OpenDroneMap and Metashape."""

from fieldkit.captures.programs.model import METRES, PosesFile, ProgramCamera, ProgramPoses
from fieldkit.captures.programs.reading import find_results, read_cameras_json, read_result

__all__ = ["METRES", "PosesFile", "ProgramCamera", "ProgramPoses", "find_results", "read_cameras_json", "read_result"]
