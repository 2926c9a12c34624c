"""What is known of a folder of photographs: values only, no I/O."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from fieldkit.captures.markers_file import MarkersFile
from fieldkit.captures.programs.model import ProgramPoses
from fieldkit.geometry import Intrinsics
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import PosePrior
from fieldkit.results.finding import Finding


@dataclass(frozen=True)
class GeoTag:
    """Where the camera says it was (WGS 84).

    Attributes:
        latitude_deg, longitude_deg: degrees, north and east positive.
        altitude_m: metres above ``datum``, or None.
        datum: what the altitude is measured from: ``"ellipsoid"``, ``"sea level"`` or ``"unknown"``.
        relative_altitude_m: metres above the take-off point (barometric), or None.
        horizontal_accuracy_m, vertical_accuracy_m: one standard deviation as the camera gives it, or None.
        rtk: whether the position is a fixed RTK solution (DJI's RtkFlag 50), so good to centimetres.
        unsigned: which of "latitude" and "longitude" have no hemisphere letter, so that their sign is not known.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None = None
    datum: str = "unknown"
    relative_altitude_m: float | None = None
    horizontal_accuracy_m: float | None = None
    vertical_accuracy_m: float | None = None
    rtk: bool = False
    unsigned: tuple[str, ...] = ()


@dataclass(frozen=True)
class Photo:
    """One photograph as it lies on disk. Sizes are those of the stored pixel grid (see `read_image`).

    Attributes:
        path: the file.
        name: path inside the image folder, with ``/``.
        width, height: pixels.
        format: ``"JPEG"``, ``"PNG"`` or ``"TIFF"``, by content.
        sha256: of the file's bytes, hex.
        make, model, serial, lens: of the camera, as in the EXIF.
        sensor: which of a payload's lenses or bands (`fieldkit.captures.sensors`), "" where nothing says.
        focal_mm: focal length, millimetres.
        focal_35mm: 35 mm equivalent, millimetres.
        digital_zoom: how many times the picture is enlarged from the middle of the sensor's, 1 without.
        focal_px: focal length in pixels from the EXIF (`fieldkit.captures.exif.focal_in_pixels`), digital zoom
            included.
        captured_at: local time of exposure, without a time zone; UTC where only the GPS gives one.
        orientation: the EXIF orientation tag (1–8); it is not applied.
        geotag: position, or None.
        yaw_deg, pitch_deg, roll_deg: of the camera (XMP, in DJI's convention): yaw clockwise from north, pitch −90
            straight down.
        flight_yaw_deg: heading of the aircraft.
    """

    path: Path
    name: str
    width: int
    height: int
    format: str
    sha256: str
    make: str | None = None
    model: str | None = None
    serial: str | None = None
    lens: str | None = None
    sensor: str = ""
    focal_mm: float | None = None
    focal_35mm: float | None = None
    digital_zoom: float = 1.0
    focal_px: float | None = None
    captured_at: datetime | None = None
    orientation: int = 1
    geotag: GeoTag | None = None
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    flight_yaw_deg: float | None = None


@dataclass(frozen=True)
class CameraGroup:
    """Photographs that share one camera, and what is known of it.

    Attributes:
        key: stable text made from make, model, serial, focal length and size.
        photos: names.
        intrinsics: start value or calibration at the photographs' size; None when nothing is known.
        source: ``"camera.toml"``, ``"camera.json"``, another program's name, ``"EXIF"`` or ``"self-calibrated"``.
        fixed: whether the intrinsics are a calibration to be held fixed.
    """

    key: str
    photos: tuple[str, ...]
    intrinsics: Intrinsics | None
    source: str
    fixed: bool


@dataclass(frozen=True)
class Capture:
    """A folder of photographs, read.

    Attributes:
        folder: as given, absolute.
        image_folder: where the photographs lie (``folder`` or ``folder/images``).
        photos: in natural order of their names.
        groups: cameras; every photograph is in exactly one.
        findings: everything left out or doubtful.
        priors: what is known of poses, by photograph name.
        metric_source: ``"poses.csv"``, ``"geo.txt"``, ``"EXIF GPS"``, another program's name or None; the frame of
            ``priors``' positions.
        origin: of that frame, when it is georeferenced (then x is east, y north, z up), else None.
        height_source: what the priors' z is made of, e.g. ``"relative altitude"``; None without a georeference.
        markers: what markers.toml says of printed markers, or None.
        program: poses that another program found and that are not in ``priors``, since these are in another frame or
            the program's has no scale; None without.
    """

    folder: Path
    image_folder: Path
    photos: tuple[Photo, ...]
    groups: tuple[CameraGroup, ...]
    findings: tuple[Finding, ...]
    priors: Mapping[str, PosePrior]
    metric_source: str | None = None
    origin: LocalFrame | None = None
    height_source: str | None = None
    markers: MarkersFile | None = None
    program: ProgramPoses | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The photographs' names, in order."""
        return tuple(photo.name for photo in self.photos)

    def photo(self, name: str) -> Photo:
        """The photograph of that name. Raises KeyError."""
        for photo in self.photos:
            if photo.name == name:
                return photo
        raise KeyError(name)

    def group_of(self, name: str) -> CameraGroup:
        """The camera group of the photograph of that name. Raises KeyError."""
        for group in self.groups:
            if name in group.photos:
                return group
        raise KeyError(name)
