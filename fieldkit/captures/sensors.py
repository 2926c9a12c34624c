"""Which of a payload's cameras took a picture: its lenses and bands write into one folder, place by place.

After DJI's manuals (H20, M30, Mavic 3M: XMP ImageSource and BandName, names of files), Pix4D's specification of
BandName (MicaSense, Sequoia, Sentera, senseFly) and FLIR's Duo Pro R manual.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import PurePosixPath

COLOUR = ("", "visible", "wide", "zoom")
"""Sensors whose pictures show colours as people see them; "" is a picture that says nothing, as most cameras write."""

_BANDS = (
    ("red edge", r"red\W?edge.*|reg|re"),
    ("near infrared", r"nir.*|near\W?infrared.*"),
    ("thermal", r"lwir|thermal.*|tir|ir|infrared.*"),
    ("panchromatic", r"pan.*"),
    ("green", r"green.*|gre|grn|g"),
    ("red", r"red.*|r"),
    ("blue", r"blue.*|coastal\W?blue.*|blu|b"),
    ("visible", r"rgb|visible"),
)
_DJI_LENSES = {
    "W": "wide", "Z": "zoom", "V": "visible", "D": "visible", "T": "thermal", "R": "thermal", "IR": "thermal",
    "S": "split screen",
}  # fmt: skip
_SOURCES = {
    "ndvi": "NDVI", "infrared": "thermal", "thermal": "thermal", "wide": "wide", "zoom": "zoom", "tele": "zoom",
    "visible": "visible", "rgb": "visible",
}  # fmt: skip
"""What DJI's ImageSource (InfraredCamera, MS_NIR_CAMERA) contains; that of its bands is told before."""
_DJI_NAME = re.compile(r"DJI_[0-9][0-9_]*_(?:MS_(NIR|RE|R|G|B)|(IR|[WZVDTRS]))(?:[_ .(-].*)?", re.IGNORECASE)
_BAND_NAME = re.compile(r".*[0-9]_(NIR|REG|GRE|GRN|RED|BLU|RGB|LWIR|THERMAL|IR)", re.IGNORECASE)
"""Parrot's Sequoia (IMG_160917_131713_0003_GRE.TIF) and AeroVironment's Quantix."""
_THERMAL_NAME = re.compile(r"IRX_[0-9]+|.*[0-9]_8b", re.IGNORECASE)
"""Autel's EVO II Dual, beside MAX_0001, and FLIR's Duo Pro R."""
_MICASENSE_NAME = re.compile(r"IMG_[0-9]{4}_([0-9]{1,2})", re.IGNORECASE)
_MICASENSE_BANDS = ("blue", "green", "red", "near infrared", "red edge")
_ONE_CHANNEL = ("1", "L", "LA", "La", "I", "F")


def sensor_of(name: str, image_source: str | None, bands: Sequence[str], mode: str) -> str:
    """The sensor of a picture: "thermal", "near infrared", "wide" and so on, "grey" of one channel; "" if not known.

    Args:
        name: of the file.
        image_source: XMP ImageSource.
        bands: XMP BandName.
        mode: of the pixels (Pillow's).
    """
    path = PurePosixPath(name)
    one_channel = mode in _ONE_CHANNEL or mode.startswith("I;")
    return (
        _of_bands(bands)
        or _of_source(image_source or "")
        or _of_name(path.stem, tiff=one_channel and path.suffix.lower() in (".tif", ".tiff"))
        or ("grey" if one_channel else "")
    )


def _of_bands(bands: Sequence[str]) -> str:
    found = [_band(band) for band in bands if band.strip()]
    if {"red", "green", "blue"} <= set(found):
        return "visible"
    return " and ".join(dict.fromkeys(found))


def _band(text: str) -> str:
    own = text.strip().lower()
    return next((name for name, pattern in _BANDS if re.fullmatch(pattern, own)), own)


def _of_source(source: str) -> str:
    text = re.sub(r"[^a-z]", "", source.lower())
    multispectral = re.fullmatch(r"ms(nir|re|r|g|b)(camera)?", text)
    if multispectral:
        return _band(multispectral[1])
    return next((sensor for word, sensor in _SOURCES.items() if word in text), "")


def _of_name(stem: str, *, tiff: bool) -> str:
    dji = _DJI_NAME.fullmatch(stem)
    if dji:
        return _band(dji[1]) if dji[1] else _DJI_LENSES[dji[2].upper()]
    if _THERMAL_NAME.fullmatch(stem):
        return "thermal"
    band = _BAND_NAME.fullmatch(stem)
    if band:
        return _band(band[1])
    micasense = _MICASENSE_NAME.fullmatch(stem)
    if micasense and tiff:
        number = int(micasense[1])
        return _MICASENSE_BANDS[number - 1] if 1 <= number <= len(_MICASENSE_BANDS) else f"band {number}"
    return ""
