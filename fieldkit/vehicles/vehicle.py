"""What a vehicle can do: the values of a profile in missions/vehicles/*.toml. missions/README.md lists the keys."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PositiveInt, model_validator

from fieldkit.geometry import Intrinsics
from fieldkit.results.fields import Pitch, Strict

Dialect = Literal["ardupilot", "px4", "dji"]
Positive = Annotated[float, Field(ge=1e-3, le=1e6)]
NotNegative = Annotated[float, Field(ge=0, le=1e6)]


_ONE_FLIGHT_M = 0.1
"""Positions of a flight without RTK share an offset: that well stations are held against each other."""
_APART = 3.0
"""Distance between stations that are told apart, in accuracies of their positions."""
_ROUNDING_DEG = 1e-3
"""Of angles in files, no leeway."""


class Mount(Strict):
    """What turns the camera."""

    kind: Literal["pitch", "pitch-yaw", "fixed"]
    """"pitch": heading comes from the vehicle; "pitch-yaw": a pan gimbal, too; "fixed": nothing moves."""
    pitch_deg: tuple[Pitch, Pitch]
    """Lowest and highest; both the same where fixed."""
    yaw_deg: tuple[float, float] = (0.0, 0.0)
    """Of a pan gimbal, against the vehicle's nose."""

    @model_validator(mode="after")
    def _in_order(self) -> Mount:
        if self.pitch_deg[0] > self.pitch_deg[1] or self.yaw_deg[0] > self.yaw_deg[1]:
            raise ValueError("the lowest angle comes first")
        if self.kind == "fixed" and self.pitch_deg[0] != self.pitch_deg[1]:
            raise ValueError("a fixed mount has one pitch: give it twice")
        return self

    def reaches(self, pitch_deg: float) -> bool:
        """Whether it turns to a pitch."""
        low, high = self.pitch_deg
        return low - _ROUNDING_DEG <= pitch_deg <= high + _ROUNDING_DEG

    def nearest_deg(self, pitch_deg: float) -> float:
        """The pitch nearest to one that it turns to."""
        low, high = self.pitch_deg
        return min(max(pitch_deg, low), high)

    @property
    def range_text(self) -> str:
        """For people: "-90° to 30°"."""
        low, high = self.pitch_deg
        return f"{low:g}° to {high:g}°"


class Trigger(Strict):
    """How the shutter is released, and what it takes."""

    command: Literal["image_start_capture", "digicam_control", "dji"]
    settle_s: NotNegative
    """Standing still with the camera turned, before the shutter."""
    exposure_s: NotNegative
    """Standing still after it."""
    interval_s: Positive = 2.0
    """Shortest time from one photograph to the next."""
    shutter_s: Positive = 0.001
    """For how long light falls in where photographs are taken in passing."""
    passing: Literal["distance", "time", "never"] = "distance"
    """What releases the shutter in passing; "never": the vehicle stops for every photograph."""


class Speeds(Strict):
    """Of the vehicle in a mission."""

    cruise_mps: Positive
    climb_mps: Positive
    descent_mps: Positive
    acceleration_mps2: Positive
    yaw_dps: Positive
    """Degrees per second."""


class Battery(Strict):
    """How long one lasts."""

    endurance_s: Positive
    """Hovering with this camera, from full to empty."""
    reserve: Annotated[float, Field(ge=0, lt=1)]
    """Share of it that is left when the vehicle lands."""

    @property
    def usable_s(self) -> float:
        """Flight time of one battery."""
        return self.endurance_s * (1.0 - self.reserve)


class Vehicle(Strict):
    """A vehicle profile."""

    format: Literal[1]
    title: str
    """For people."""
    dialect: Dialect
    autopilot: str
    """With the version it was written for: "ArduCopter 4.5.6"."""
    checked: str
    """How the profile's facts are known: measured, read, guessed."""
    mount: Mount
    trigger: Trigger
    camera: Intrinsics
    speeds: Speeds
    battery: Battery
    min_height_m: NotNegative
    """Least height above the ground at a station."""
    acceptance_m: Positive
    """How near a waypoint counts as reached."""
    gps_accuracy_m: Positive
    """Standard deviation of a position, horizontal."""
    clearance_m: NotNegative
    """Distance it keeps to plants and other obstacles: half its size and what wind adds."""
    mass_kg: Positive = 1.0
    """At take-off, with camera and battery; 1 kg where a profile does not say. Leaves move in its wash."""
    max_items: PositiveInt | None = None
    """Mission items that it stores."""

    @property
    def held_m(self) -> float:
        """How well it holds stations of one flight against each other, standard deviation."""
        return min(self.gps_accuracy_m, _ONE_FLIGHT_M)

    @property
    def apart_m(self) -> float:
        """Least distance between stations: three such errors."""
        return _APART * self.held_m

    @property
    def rtk(self) -> bool:
        """Whether its positions are good to a decimetre from flight to flight, too."""
        return self.gps_accuracy_m <= _ONE_FLIGHT_M
