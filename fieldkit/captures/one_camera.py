"""One capture is made of one camera: which, where a folder holds pictures of several."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from pathlib import PurePosixPath

from fieldkit.captures.model import Photo
from fieldkit.results.finding import Finding
from fieldkit.wording import count

_SAME_FOCAL = 1.25
"""Ratio of focal lengths up to which a lens is the same, as cameras round them."""
_SAME_SIZE = 2.0
"""Ratio of longer sides up to which pictures are one camera's; beyond, one is a preview."""
_TINY = 4.0
"""Ratio of longer sides from which the smaller pictures are taken for a thermal camera's that nothing names."""
_ENOUGH = 0.5
"""Least share of the places that the main camera photographed."""
_BANDS_AT_A_PLACE = 5
"""Number of bands of a multispectral camera, which nothing tells apart."""
_PREFERRED = (
    ("", "visible", "wide"),
    ("zoom",),
    ("panchromatic",),
    ("green",),
    ("red",),
    ("red edge",),
    ("near infrared",),
    ("blue",),
    ("grey",),
)
"""Sensors, those first that show most of a plant."""


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
    "W": "wide",
    "Z": "zoom",
    "V": "visible",
    "D": "visible",
    "T": "thermal",
    "R": "thermal",
    "IR": "thermal",
    "S": "split screen",
}
_SOURCES = {
    "ndvi": "NDVI",
    "infrared": "thermal",
    "thermal": "thermal",
    "wide": "wide",
    "zoom": "zoom",
    "tele": "zoom",
    "visible": "visible",
    "rgb": "visible",
}
"""What DJI's ImageSource (InfraredCamera, MS_NIR_CAMERA) contains; that of its bands is told before."""
_DJI_NAME = re.compile(r"DJI_[0-9][0-9_]*_(?:MS_(NIR|RE|R|G|B)|(IR|[WZVDTRS]))(?:[_ .(-].*)?", re.IGNORECASE)
_ONE_CHANNEL = ("1", "L", "LA", "La", "I", "F")


def one_camera(
    photos: Sequence[Photo], *, located: Collection[str] = (), calibrated: Collection[str] = ()
) -> tuple[list[Photo], list[Finding]]:
    """The photographs of one camera, and a finding for each other camera, whose photographs are left out.

    Cameras differ in sensor (lens or band of a payload), model or lens. Two drones of one model are one camera here,
    and so are sizes and digital zooms of one lens; `group_cameras` calibrates them apart. Taken is the camera that the
    camera file names, else one that poses.csv or geo.txt names, else of those with at least half as many photographs as
    any the one that shows colours and all of the plot (no zoom), else the one with most. Pictures of no camera are left
    out before.

    Args:
        located: names that poses.csv or geo.txt gives a position.
        calibrated: names that the camera file gives a camera of their own: all of these are kept that show colours.
    """
    cameras = _cameras(photos)
    if len(cameras) < 2:
        return list(photos), _without_colours(photos)
    findings: list[Finding] = []
    most = max(_places(camera) for camera in cameras)

    longest = max(max(photo.width, photo.height) for photo in photos)

    def worth(camera: Sequence[Photo]) -> tuple[bool, bool, bool, int, bool, int]:
        names, sensor = {photo.name for photo in camera}, _sensor(camera)
        rank = next((k for k, sensors in enumerate(_PREFERRED) if sensor in sensors), len(_PREFERRED))
        tiny = _TINY * max(camera[0].width, camera[0].height) <= longest
        listed = (not names.isdisjoint(calibrated), not names.isdisjoint(located))
        return (*listed, _places(camera) >= _ENOUGH * most, -rank, not tiny, len(camera))

    main = max(cameras, key=worth)
    colours = _sensor(main) in COLOUR
    kept: set[str] = {photo.name for photo in main}
    for camera in cameras:
        if colours and _sensor(camera) in COLOUR:
            kept |= {photo.name for photo in camera if photo.name in calibrated}
        rest = [photo for photo in camera if photo.name not in kept]
        if rest:
            findings.append(_finding(rest, main))
    photos = [photo for photo in photos if photo.name in kept]
    return photos, findings + _without_colours(photos)


def _without_colours(photos: Sequence[Photo]) -> list[Finding]:
    """That a capture is made of a sensor's pictures that show no colours as people see them."""
    sensor = _sensor(photos)
    if not photos or sensor in (*COLOUR, "grey"):
        return []
    message = (
        f"{count(len(photos), 'photograph is', 'photographs are')} of {_described(photos)}, which shows no colours: "
        "--mask exg finds no plants in such pictures, and in thermal ones little matches"
    )
    return [Finding(photos[0].name, "no-colours", message)]


def _cameras(photos: Sequence[Photo]) -> list[list[Photo]]:
    """Photographs by camera; each goes to the first camera it fits, those that say most of theirs beginning."""
    cameras: list[list[Photo]] = []
    for photo in sorted(photos, key=lambda p: (p.model is None, _focal(p) is None, -max(p.width, p.height))):
        fitting = [camera for camera in cameras if _same(camera[0], photo)]
        if fitting:
            max(fitting, key=len).append(photo)
        else:
            cameras.append([photo])
    order = {photo.name: k for k, photo in enumerate(photos)}
    cameras = [sorted(camera, key=lambda photo: order[photo.name]) for camera in cameras]
    return sorted(cameras, key=lambda camera: order[camera[0].name])


def _same(a: Photo, b: Photo) -> bool:
    if _class(a) != _class(b):
        return False
    if a.model and b.model and _model(a) != _model(b):
        return False
    longer = sorted((max(a.width, a.height), max(b.width, b.height)))
    if longer[1] > _SAME_SIZE * longer[0]:
        return False
    if a.sensor == "zoom" or (a.lens and a.lens == b.lens):
        return True  # a zoom lens has many focal lengths
    focal = sorted(f for f in (_focal(a), _focal(b)) if f is not None)
    unlike = (a.focal_mm is None) != (b.focal_mm is None)
    return len(focal) < 2 or unlike or focal[1] <= _SAME_FOCAL * focal[0]


def _class(photo: Photo) -> str:
    """What tells sensors apart before optics do: lenses that show colours are told apart by these, but for zooms."""
    return "" if photo.sensor in COLOUR and photo.sensor != "zoom" else photo.sensor


def _model(photo: Photo) -> str:
    """Without its maker's name, which programs put before it."""
    return (photo.model or "").casefold().removeprefix((photo.make or "").casefold()).strip()


def _focal(photo: Photo) -> float | None:
    return photo.focal_35mm if photo.focal_mm is None else photo.focal_mm


def _sensor(camera: Sequence[Photo]) -> str:
    return next((photo.sensor for photo in camera if photo.sensor), "")


def _places(camera: Sequence[Photo]) -> float:
    """Photographs at places of their own: of bands that nothing tells apart there are several of each."""
    return len(camera) / (_BANDS_AT_A_PLACE if _sensor(camera) == "grey" else 1)


def _finding(rest: Sequence[Photo], main: Sequence[Photo]) -> Finding:
    those = count(len(rest), "photograph", f"photographs, up to {rest[-1].name},")
    message = (
        f"{those} of {_described(rest)}; a capture is made of one camera, here of {_described(main)}. "
        "To use them, put them into a folder of their own"
    )
    return Finding(rest[0].name, "other-camera", message, True)


def _described(camera: Sequence[Photo]) -> str:
    first, sensor = camera[0], _sensor(camera)
    if sensor in ("visible", "wide", "zoom", "thermal"):
        what = f"the {sensor} camera"
    elif sensor == "grey":
        what = "one channel"
    else:
        what = f"the band {sensor}" if sensor else "a camera"
    model = first.model or ""
    if first.make and model and not model.startswith(first.make):
        model = f"{first.make} {model}"
    focal = _focal(first)
    details = [model, "" if focal is None else f"{focal:g} mm", f"{first.width}×{first.height}"]
    return f"{what} ({', '.join(part for part in details if part)})"


def sensor_of(name: str, image_source: str | None, bands: Sequence[str], mode: str) -> str:
    """The sensor of a picture: "thermal", "near infrared", "wide" and so on, "grey" of one channel; "" if not known."""
    one_channel = mode in _ONE_CHANNEL or mode.startswith("I;")
    return (
        _of_bands(bands)
        or _of_source(image_source or "")
        or _of_name(PurePosixPath(name).stem)
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


def _of_name(stem: str) -> str:
    """As DJI names its files; other makers' say it in their XMP."""
    dji = _DJI_NAME.fullmatch(stem)
    if dji is None:
        return ""
    return _band(dji[1]) if dji[1] else _DJI_LENSES[dji[2].upper()]
