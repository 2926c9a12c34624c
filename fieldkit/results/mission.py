"""What mission.json holds: an export before any autopilot's dialect. Units are in the keys: _m, _deg, _s, _mps.

Places are WGS 84. Heights are above home along the plumb line, as autopilots count them; only home and the origins of
plots say theirs above a datum.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from fieldkit.documents.json_file import read_model
from fieldkit.geometry import Intrinsics
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.results.evaluation import FileEntry
from fieldkit.results.fields import STRICT, Count, Heading, Latitude, Length, Longitude, Pitch, Sha256, Strict
from fieldkit.results.pattern import Pattern
from fieldkit.results.plan import station_number

MISSION_FILE = "mission.json"
_MAX_BYTES = 128 << 20
"""Largest mission.json that is read, bytes."""
_AGAIN = "Give the mission.json that `fieldkit export-mission` wrote beside the mission, or export it again."

Height = Annotated[float, Field(ge=-20_000, le=20_000)]
Slope = Annotated[float, Field(ge=-10, le=10)]
Ring = Annotated[tuple[tuple[Latitude, Longitude], ...], Field(min_length=3)]
"""Corners (latitude, longitude), the last not the first again."""


@dataclass(frozen=True)
class Home:
    """Where the vehicle takes off; the zero of all heights."""

    __pydantic_config__ = STRICT  # of files; of a mission that others wrote it may be anywhere
    latitude_deg: Latitude
    longitude_deg: Longitude
    amsl_m: Annotated[float, Field(ge=-1000, le=10_000)] | None = None
    """Above mean sea level, as autopilots take it; null where nobody said."""
    ellipsoid_m: Annotated[float, Field(ge=-1000, le=10_000)] | None = None
    """Above the WGS 84 ellipsoid; null where nobody said."""


class MissionVehicle(Strict):
    """What flies, as its profile says."""

    profile: str | None = None
    """Its name, or that of its file."""
    title: str
    dialect: str
    autopilot: str
    camera: Intrinsics


class FlownPlan(Strict):
    """A plan.json by the SHA-256 of its bytes."""

    name: str | None = None
    """Of the file; null where the plan was not given as one."""
    sha256: Sha256


class MissionPlants(Strict):
    """What a mission keeps clear of on a plot."""

    height_m: Length
    """Of the highest plants, as it was given at the export."""
    clear_m: Length | None = None
    """Height of plants that everything flown keeps clear of; null where nobody said where they stand."""
    clearance_m: Length
    """Distance kept from them."""


class MissionOutline(Strict):
    """A plot's frame and plants: x along the row, y to its left, z upright above the plot's ground."""

    name: str
    origin: LocalFrame
    """Of the frame, on the ground; where home says no height, it is above home and of unknown datum."""
    ground_m: Height
    """Of the origin above home."""
    row_heading_deg: Heading
    """Compass heading of x."""
    gradient: tuple[Slope, Slope]
    """Rise of the ground per metre along x and y."""
    length_m: Length | None = None
    """Of the plot, along x and about the origin; null where nobody said."""
    width_m: Length | None = None
    """Across."""
    row_spacing_m: Length | None = None
    """From row to row; null where nobody said."""
    plants: MissionPlants | None = None


class MissionPlot(MissionOutline):
    """A plot that is flown."""

    plan: FlownPlan
    """Whose stations are flown here."""


class MissionObstacle(Strict):
    """An upright cylinder that is kept clear of: a mast, a tree, a hut."""

    name: str = "obstacle"
    latitude_deg: Latitude
    longitude_deg: Longitude
    radius_m: Length
    top_m: Length
    """Above home."""


@dataclass(frozen=True)
class GeoPoint:
    """A place, height above home."""

    __pydantic_config__ = STRICT  # of files; made by the program it may have a height that nobody knows, NaN
    latitude_deg: Latitude
    longitude_deg: Longitude
    height_m: Height

    @property
    def place(self) -> GeoPoint:
        """The place alone."""
        return GeoPoint(self.latitude_deg, self.longitude_deg, self.height_m)


@dataclass(frozen=True)
class Shot(GeoPoint):
    """A stop for one photograph or a burst; the place is the camera's."""

    kind: Literal["station"] = field(default="station", kw_only=True)
    plot: str
    station: Annotated[int, Field(ge=0, alias="index")]
    """In the plot's plan, from 0; people's station number is one more."""
    yaw_deg: Heading
    """True heading of the optical axis, clockwise from north."""
    pitch_deg: Pitch
    """Of the gimbal: 0 at the horizon, −90 straight down."""

    @classmethod
    def at(cls, place: GeoPoint, yaw_deg: float, pitch_deg: float, plot: str, station: int) -> Shot:
        """Of a camera at a place."""
        return cls(place.latitude_deg, place.longitude_deg, place.height_m, plot, station, yaw_deg, pitch_deg)

    @property
    def name(self) -> str:
        """For people: "station 4 of plot-7", of the index 3."""
        return f"station {station_number(self.station)} of {self.plot}"


@dataclass(frozen=True)
class Via(GeoPoint):
    """A place that is flown through so that a leg stays clear."""

    kind: Literal["via"] = field(default="via", kw_only=True)


@dataclass(frozen=True)
class Passing(GeoPoint):
    """A photograph taken in passing, on a line of a pattern; the place is the camera's, as foreseen."""

    kind: Literal["passing"] = field(default="passing", kw_only=True)
    line: Count
    """Of all flights, in the order they are flown, from 0; people's number is one more."""
    yaw_deg: Heading
    """True heading of the optical axis, clockwise from north."""
    pitch_deg: Pitch
    """Of the gimbal."""
    plots: tuple[str, ...] = ()
    """That it shows by half at least."""
    time_s: Length | None = None
    """After arming, as foreseen."""

    @property
    def name(self) -> str:
        """For people: "line 7", of the line 6."""
        return f"line {station_number(self.line)}"


class MissionPasses(Strict):
    """What lines are laid by: the same pattern over the same outline gives the same lines."""

    pattern: Pattern
    outline: Ring
    """Of the field."""
    rows_deg: Heading
    """Compass heading of the rows, to which the pattern's headings are relative."""
    speed_mps: Length
    """Along lines: the pattern's, or less where motion would blur photographs or the camera could not follow."""


class MissionBurst(Strict):
    """Several photographs at each station, so that what wind moves can be averaged."""

    photographs: Annotated[int, Field(ge=2)]
    """At each station, one after the other: the second station's follow the first one's."""
    interval_s: Length
    """From one to the next."""


class Stops:
    """What has stops."""

    if TYPE_CHECKING:  # no field of the model's
        stops: tuple[Any, ...]

    @property
    def shots(self) -> tuple[Shot, ...]:
        """The stops with photographs."""
        return tuple(stop for stop in self.stops if isinstance(stop, Shot))

    @property
    def passings(self) -> tuple[Passing, ...]:
        """Photographs taken in passing."""
        return tuple(stop for stop in self.stops if isinstance(stop, Passing))


class MissionFlight(Stops, Strict):
    """From take-off to landing. Legs lead from above home to every stop in turn and to the landing place."""

    name: str
    """For people."""
    file: Annotated[str, Field(pattern=r"^[^/\\\x00]+$")]
    """Of ``files``: what the vehicle is given."""
    takeoff_m: Height
    """Height above home at which the first leg begins."""
    stops: tuple[Annotated[Shot | Via | Passing, Field(discriminator="kind")], ...]
    """In the order they are flown. A line leads from the `Via` before its first `Passing` to the one behind its last;
    none of these is a waypoint."""
    landing: GeoPoint
    """Where it lands, at the height from which it descends."""
    length_m: Length
    """From take-off to landing."""
    time_s: Length
    """In the air, from take-off to landing, as estimated."""
    battery: Length
    """Share of a battery's usable time."""
    burst: MissionBurst | None = None
    """Left out where each station has one photograph."""

    @model_serializer(mode="wrap")
    def _as_json(self, default: SerializerFunctionWrapHandler) -> dict[str, Any]:
        found: dict[str, Any] = default(self)
        return found if self.burst else {key: value for key, value in found.items() if key != "burst"}

    @property
    def photographs(self) -> int:
        """How many are taken."""
        return len(self.shots) * (self.burst.photographs if self.burst else 1) + len(self.passings)

    @property
    def plots(self) -> tuple[str, ...]:
        """Names, in the order they are flown."""
        shown = (plot for passing in self.passings for plot in passing.plots)
        return tuple(dict.fromkeys((*(station.plot for station in self.shots), *shown)))


class MissionRecord(Strict):
    """mission.json: what `export-mission` wrote."""

    kind: Literal["mission"] = "mission"
    version: Literal[1] = 1
    fieldkit: str
    """Version that wrote it."""
    name: str
    """Of the site."""
    home: Home
    vehicle: MissionVehicle
    speed_mps: Length
    """Horizontal, between stops."""
    settle_s: Length
    """Standing still before the shutter."""
    exposure_s: Length
    """Standing still after it."""
    plots: Annotated[tuple[MissionPlot, ...], Field(min_length=1)]
    """In the site's order."""
    neighbours: tuple[MissionOutline, ...] = ()
    """Plots that are not flown."""
    obstacles: tuple[MissionObstacle, ...] = ()
    flights: Annotated[tuple[MissionFlight, ...], Field(min_length=1)]
    """In the order they are flown."""
    inside: tuple[Ring, ...] = ()
    """The vehicle stays in one of these, where there are any."""
    outside: tuple[Ring, ...] = ()
    """It keeps out of these."""
    ceiling_m: Height | None = None
    """Nothing is flown higher."""
    rally: tuple[GeoPoint, ...] = ()
    """Places to return to in an emergency."""
    passes: MissionPasses | None = None
    """Where flights are those of a pattern."""
    files: tuple[FileEntry, ...]
    """All that was written beside this one."""

    def way(self, flight: MissionFlight) -> tuple[GeoPoint, ...]:
        """Corners of a flight's way: home, above it, the stops, above the landing place, and there at home's height.

        Its length is the flight's.
        """
        home, landing = self.home, flight.landing
        begin = tuple(GeoPoint(home.latitude_deg, home.longitude_deg, height) for height in (0.0, flight.takeoff_m))
        return (*begin, *flight.stops, landing, GeoPoint(landing.latitude_deg, landing.longitude_deg, 0.0))

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        plots, files = {plot.name for plot in self.plots}, {entry.name for entry in self.files}
        everywhere = (*self.plots, *self.neighbours)
        if len({plot.name for plot in everywhere}) < len(everywhere):
            raise ValueError("two plots have one name")
        for flight in self.flights:
            if flight.file not in files:
                raise ValueError(f"{flight.file} is a flight's, and files does not name it")
            for plot in flight.plots:
                if plot not in plots:
                    raise ValueError(f"a photograph is of {plot}, which is none of the plots")
        return self


def record_path(mission: Path) -> Path:
    """Of the record beside a mission: mission.json for mission.plan, field.mission.json for field.plan."""
    return mission.with_name(MISSION_FILE if mission.stem == "mission" else f"{mission.stem}.{MISSION_FILE}")


def records_in(folder: Path) -> list[Path]:
    """The records that lie in a folder, by name."""
    return sorted(file for pattern in (MISSION_FILE, f"*.{MISSION_FILE}") for file in folder.glob(pattern))


def record_bytes(record: MissionRecord) -> bytes:
    """A record as JSON, UTF-8, indented."""
    return (record.model_dump_json(indent=1, by_alias=True) + "\n").encode("utf-8")


def load_mission(file: Path) -> MissionRecord:
    """Read mission.json."""
    return read_model(MissionRecord, "mission", file, _AGAIN, max_bytes=_MAX_BYTES)
