"""Folders of photographs: what is in them, what is known of cameras and poses, how good the images are."""

from fieldkit.captures.capture import MAX_PIXELS, read_capture
from fieldkit.captures.decode import read_image
from fieldkit.captures.folder import find_mask
from fieldkit.captures.markers_file import MarkerDistance, MarkersFile
from fieldkit.captures.model import CameraGroup, Capture, GeoTag, Photo
from fieldkit.captures.quality import (
    Quality,
    assess_quality,
    flag_set,
    measure_photo,
    measure_quality,
    quality_findings,
)

__all__ = [
    "MAX_PIXELS",
    "CameraGroup",
    "Capture",
    "GeoTag",
    "MarkerDistance",
    "MarkersFile",
    "Photo",
    "Quality",
    "assess_quality",
    "find_mask",
    "flag_set",
    "measure_photo",
    "measure_quality",
    "quality_findings",
    "read_capture",
    "read_image",
]
