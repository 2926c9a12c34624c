"""pycolmap as `fieldkit.runtime.colmap` imports it."""

from fieldkit.runtime.colmap import pycolmap as pycolmap
