"""What is known of a folder of photographs: values only, no I/O."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

from fieldkit.captures.markers_file import MarkersFile
from fieldkit.captures.programs.model import ProgramPoses
from fieldkit.geometry import Intrinsics
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import PosePrior
from fieldkit.results.finding import Finding

_ZONE = timedelta(hours=4)


@dataclass(frozen=True)
class GeoTag:
    """Where the camera says it was (WGS 84)."""

    latitude_deg: float
    longitude_deg: float
    """Degrees, north and east positive."""
    altitude_m: float | None = None
    """Metres above ``datum``, or None."""
    datum: str = "unknown"
    """What the altitude is measured from: ``"ellipsoid"``, ``"sea level"`` or ``"unknown"``."""
    relative_altitude_m: float | None = None
    """Metres above the take-off point (barometric), or None."""
    horizontal_accuracy_m: float | None = None
    vertical_accuracy_m: float | None = None
    """One standard deviation as the camera gives it, or None."""
    rtk: bool = False
    """Whether the position is a fixed RTK solution (DJI's RtkFlag 50), so good to centimetres."""


@dataclass(frozen=True)
class Photo:
    """One photograph as it lies on disk. Sizes are those of the stored pixel grid (see `read_image`)."""

    path: Path
    name: str
    """Path inside the image folder, with ``/``."""
    width: int
    height: int
    format: str
    """``"JPEG"``, ``"PNG"`` or ``"TIFF"``, by content."""
    sha256: str
    """Of the file's bytes, hex."""
    make: str | None = None
    model: str | None = None
    serial: str | None = None
    lens: str | None = None
    """Of the camera, as in the EXIF."""
    sensor: str = ""
    """Which of a payload's lenses or bands (`fieldkit.captures.one_camera`), "" where nothing says."""
    focal_mm: float | None = None
    """Focal length, millimetres."""
    focal_35mm: float | None = None
    """35 mm equivalent, millimetres."""
    digital_zoom: float = 1.0
    """How many times the picture is enlarged from the middle of the sensor's, 1 without."""
    focal_px: float | None = None
    """Focal length in pixels from the EXIF (`fieldkit.captures.exif.focal_in_pixels`), digital zoom included."""
    projection: str = ""
    """Of a panorama, e.g. "equirectangular"; "" of a photograph."""
    calibration: Intrinsics | None = None
    """The maker's (`fieldkit.captures.maker_calibration`), at this size."""
    captured_at: datetime | None = None
    """Time of exposure by the camera's clock, without a time zone; UTC where only the GPS gives one."""
    clock_ahead: timedelta | None = None
    """The camera's clock less UTC, where the EXIF tells."""
    orientation: int = 1
    """The EXIF orientation tag (1–8); it is not applied."""
    geotag: GeoTag | None = None
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None
    """Of the camera (XMP, in DJI's convention): yaw clockwise from north, pitch −90 straight down."""
    flight_yaw_deg: float | None = None
    """Heading of the aircraft."""
    burst: tuple[Photo, ...] = ()
    """Photographs of a burst that this one stands for, the first as well (`fieldkit.captures.bursts`)."""
    sway_px: float | None = None
    """How far leaves moved within the burst, pixels (`fieldkit.reconstruction.steady`); None where it is not known."""

    @property
    def local_time(self) -> datetime | None:
        """`captured_at` where the photograph was taken: of a clock that runs on another zone's time in mean solar time.

        Time zones keep to their longitude's mean solar time within 4 h, summer time included.
        """
        if self.captured_at is None or self.clock_ahead is None or self.geotag is None:
            return self.captured_at
        solar = timedelta(hours=round(self.geotag.longitude_deg / 15.0))
        return (
            self.captured_at if abs(self.clock_ahead - solar) <= _ZONE else self.captured_at - self.clock_ahead + solar
        )


@dataclass(frozen=True)
class CameraGroup:
    """Photographs that share one camera, and what is known of it."""

    key: str
    """Stable text made from make, model, serial, focal length and size."""
    photos: tuple[str, ...]
    intrinsics: Intrinsics | None
    """Start value or calibration at the photographs' size; None when nothing is known."""
    source: str
    """``"camera.toml"``, ``"camera.json"``, another program's name, ``"XMP"`` (of the maker's calibration), ``"EXIF"``
    or ``"self-calibrated"``."""
    fixed: bool
    """Whether the intrinsics are a calibration to be held fixed."""


@dataclass(frozen=True)
class Capture:
    """A folder of photographs, read."""

    folder: Path
    """As given, absolute."""
    image_folder: Path
    """Where the photographs lie (``folder`` or ``folder/images``)."""
    photos: tuple[Photo, ...]
    """In natural order of their names."""
    groups: tuple[CameraGroup, ...]
    """Cameras; every photograph is in exactly one."""
    findings: tuple[Finding, ...]
    """Everything left out or doubtful."""
    priors: Mapping[str, PosePrior]
    """What is known of poses, by photograph name."""
    metric_source: str | None = None
    """``"poses.csv"``, ``"geo.txt"``, ``"EXIF GPS"``, another program's name or None; the frame of ``priors``'
    positions."""
    origin: LocalFrame | None = None
    """Of that frame, when it is georeferenced (then x is east, y north, z up), else None."""
    height_source: str | None = None
    """What the priors' z is made of, e.g. ``"relative altitude"``; None without a georeference."""
    to_take_off_m: Mapping[str, float] = field(default_factory=dict)
    """By photograph, metres to add to the priors' z for heights above take-off, where it is open which of the two fit
    (`fieldkit.captures.heights.Heights`)."""
    markers: MarkersFile | None = None
    """What markers.toml says of printed markers, or None."""
    program: ProgramPoses | None = None
    """Poses that another program found and that are not in ``priors``, since these are in another frame or the
    program's has no scale; None without."""

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
