"""Folders of photographs: what is in them, and what is known of cameras and poses."""

from fieldkit.captures.capture import MAX_PIXELS, read_capture
from fieldkit.captures.decode import read_image
from fieldkit.captures.folder import find_mask
from fieldkit.captures.markers_file import MarkerDistance, MarkersFile
from fieldkit.captures.model import CameraGroup, Capture, GeoTag, Photo

__all__ = [
    "MAX_PIXELS",
    "CameraGroup",
    "Capture",
    "GeoTag",
    "MarkerDistance",
    "MarkersFile",
    "Photo",
    "find_mask",
    "read_capture",
    "read_image",
]
