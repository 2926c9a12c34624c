"""From tables of a log's messages to its flight: one path for all formats, each of which says where it has what."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldkit.arrays import BoolArray, FloatArray
from fieldkit.flightlogs.model import (
    Attitude,
    Clock,
    FlightLog,
    Gimbal,
    LogKind,
    Place,
    Series,
    Track,
    Trigger,
    YawFrame,
)
from fieldkit.geometry.geodesy import on_earth
from fieldkit.geometry.pose import wrapped_deg
from fieldkit.wording import count

_GIMBAL_REACH_S = 2.0
"""Time to the nearest sample beyond which a gimbal's angles are unknown, seconds."""
_FASTEST_GIMBAL_DPS = 100.0
"""Camera gimbals on multicopters turn at 30 to 100 °/s when they are told to."""
_ACCURACY_REACH_S = 10.0
"""Time to the nearest sample beyond which the receiver's accuracy is unknown, seconds."""
_FIXED_M = 0.1
"""Of a height: a fixed solution of RTK is good to some centimetres, a float one to decimetres, like the barometer."""
_MOST_LISTED = 8
"""Most missing triggers that are named."""
_YAW_LOCK = 16
"""GIMBAL_DEVICE_FLAGS_YAW_LOCK (MAVLink common.xml)."""
_YAW_VEHICLE = 32
"""GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME (MAVLink common.xml)."""
_YAW_NORTH = 64
"""GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME (MAVLink common.xml)."""
_UTC_RANGE = (1.0e9, 4.2e9)
"""Seconds since 1970 that a clock which was set may show: 2001 to 2103."""
_BOOT_LIMIT_S = 4.4e6
"""Most seconds since boot: 50 days, where MAVLink's 32-bit milliseconds end."""


@dataclass(frozen=True, eq=False)
class Table:
    """All messages of one name, in the log's order."""

    rows: NDArray[np.void]
    """(n,) structured, raw."""
    scales: Mapping[str, float]
    """Of columns, to seconds, degrees and metres; 1 where not given."""
    times_s: FloatArray
    """(n,) on the log's clock."""
    stamps_s: FloatArray
    """(n,) when they were recorded, on the recorder's clock."""

    @classmethod
    def of(cls, rows: NDArray[np.void], scales: Mapping[str, float], time: str) -> Table:
        """Whose clock is a column's."""
        own = cls(rows, scales, np.zeros(0), np.zeros(0))
        return replace(own, times_s=own.column(time), stamps_s=own.column(time))

    def __len__(self) -> int:
        return len(self.rows)

    def column(self, names: str, width: int = 1) -> FloatArray:
        """(n,) or (n, width) values in their unit of the first of some columns ("R|Roll") that the log has.

        NaN where it has none, or that is no number.
        """
        shape = () if width == 1 else (width,)
        name = next((name for name in names.split("|") if name in (self.rows.dtype.names or ())), None)
        if name is None or self.rows.dtype[name].base.kind not in "iuf" or self.rows.dtype[name].shape != shape:
            return np.full((len(self.rows), *shape), np.nan)
        with np.errstate(invalid="ignore"):  # signalling NaNs, in damaged logs
            return np.asarray(self.rows[name].astype(np.float64) * self.scales.get(name, 1.0))

    def values(self, columns: Sequence[str]) -> FloatArray:
        """(n, k) of k columns; a quaternion ``q`` alone is roll, pitch and yaw."""
        if tuple(columns) == ("q",):
            return euler_deg(self.column("q", 4)).reshape(-1, 3)
        return np.stack([self.column(name) for name in columns], axis=1)

    def select(self, keep: BoolArray) -> Table:
        """Those rows only."""
        return Table(self.rows[keep], self.scales, self.times_s[keep], self.stamps_s[keep])


Tables = Mapping[str, Table]
"""By the messages' names; those that the log does not hold are not there."""
Source = tuple[str, tuple[str, ...]]
"""A message's name, and its columns."""


@dataclass(frozen=True)
class TriggerSource:
    """A trigger message's columns; empty where it has none."""

    message: str
    image: str
    place: tuple[str, ...] = ()
    """Latitude, longitude, height above sea level, perhaps that above home."""
    attitude: tuple[str, ...] = ()
    camera: str = ""
    """Which of several cameras."""
    boot: str = ""
    """Time since boot; else that of the table."""
    utc: str = ""
    result: str = ""
    """1 for a photograph, 0 where none was taken, −1 where nobody knows."""


@dataclass(frozen=True)
class Layout:
    """Where a format's logs say what. Of several sources the first that a log holds counts."""

    triggers: tuple[TriggerSource, ...]
    position: Source
    """As `TriggerSource.place`."""
    velocity: tuple[Source, ...]
    """North, east, down."""
    attitude: Source
    gimbals: tuple[tuple[str, tuple[str, ...], str], ...]
    """Message, columns of roll, pitch and yaw, and "vehicle", "north" or the column of flags that says from where the
    yaw counts (`gimbal_yaw_frame`)."""
    accuracy: tuple[Source, ...]
    """Of the receiver's place, horizontal."""
    vertical: tuple[Source, ...]
    height: tuple[Source, ...]
    """Of the receiver, above sea level, and its accuracy."""
    home: Source
    """Latitude, longitude, height above sea level."""

    @property
    def messages(self) -> frozenset[str]:
        """Names of all that it reads."""
        gnss = (*self.accuracy, *self.vertical, *self.height)
        sources = (self.position, *self.velocity, self.attitude, *gnss, self.home)
        names = [*(each.message for each in self.triggers), *(each[0] for each in self.gimbals)]
        return frozenset([*names, *(name for name, _ in sources)])


def flight_log(
    path: Path,
    kind: LogKind,
    tables: Tables,
    layout: Layout,
    remarks: Sequence[str],
    *,
    clock: Clock = "boot",
    utc_offset_s: float | None = None,
) -> FlightLog:
    """The flight that a log's messages tell of.

    Args:
        path, kind: of the log.
        utc_offset_s: UTC less time since boot, where it is known.
    """
    source = next((each for each in layout.triggers if each.message in tables), None)
    if source is None:
        home = _home(tables, layout.home, float("inf"))
        return FlightLog(path, kind, clock, home, (), _track(tables, layout, home), tuple(remarks))

    def of_camera(number: int | None, shots: Table, told: list[str]) -> FlightLog:
        home = _home(tables, layout.home, float(np.min(shots.stamps_s, initial=np.inf)))
        taken, failed = _taken(shots, source, told)
        found = _triggers(taken, source, clock, utc_offset_s, home)
        if len(found) < len(taken):
            untimed = count(len(taken) - len(found), "trigger message has", "trigger messages have")
            told.append(f"{untimed} no time that makes sense; not used")
        track = _track(tables, layout, home)
        once: dict[tuple[float, int | None], Trigger] = {}  # one that was recorded twice counts once
        for trigger in sorted(found, key=lambda each: each.time_s):
            once.setdefault((trigger.time_s, trigger.image), trigger)
        estimated = [_completed(trigger, track) for trigger in once.values()]
        triggers = _at_receivers_heights(estimated, track, told)
        said = (*told, *_missing_numbers(triggers, failed))
        return FlightLog(path, kind, clock, home, triggers, track, said, number)

    shots = tables[source.message]
    cameras = shots.column(source.camera)
    known = np.unique(cameras[np.isfinite(cameras)]).astype(int).tolist()
    if len(known) < 2:
        return of_camera(None, shots, list(remarks))
    several = f"the log has triggers of {len(known)} cameras; those of camera {{}} are used"
    first, *others = (
        of_camera(number, shots.select(cameras == number), [*remarks, several.format(number)]) for number in known
    )
    return replace(first, others=tuple(others))


def _taken(shots: Table, source: TriggerSource, told: list[str]) -> tuple[Table, set[int]]:
    """Without the triggers that the camera says failed, and these' numbers; all where it says so of all."""
    results = shots.column(source.result)
    failed = results == 0.0
    if not failed.any():
        return shots, set()
    if failed.all():
        told.append("the camera reports each of its photographs as failed, which is not believed")
        return shots, set()
    told.append(
        f"{count(int(failed.sum()), 'trigger')} failed, as the camera reports: no photographs of those are expected"
    )
    numbers = shots.column(source.image)[failed]
    return shots.select(~failed), set(numbers[np.isfinite(numbers)].astype(int).tolist())


def _home(tables: Tables, source: Source, before_s: float) -> Place | None:
    """The last home position that was told before a time, else the first."""
    table = tables.get(source[0])
    if table is None:
        return None
    rows = zip(table.stamps_s.tolist(), table.values(source[1]).tolist(), strict=True)
    known = [(stamp, place) for stamp, row in rows if (place := as_place(row[0], row[1], row[2], 0.0)) is not None]
    earlier = [place for stamp, place in known if stamp <= before_s]
    return earlier[-1] if earlier else known[0][1] if known else None


def _triggers(
    shots: Table, source: TriggerSource, clock: Clock, utc_offset_s: float | None, home: Place | None
) -> list[Trigger]:
    """What each trigger message says itself; those without a time are left out."""
    boots = shots.column(source.boot) if source.boot else shots.times_s
    utcs, images = shots.column(source.utc), shots.column(source.image)
    places = _above_home(shots.values(source.place), home) if source.place else np.full((len(shots), 4), np.nan)
    attitudes = shots.values(source.attitude) if source.attitude else np.full((len(shots), 3), np.nan)
    found = []
    for k in range(len(shots)):
        boot, utc = as_boot(boots[k]), as_utc(utcs[k])
        if clock == "boot" and utc_offset_s is not None:
            boot = as_boot(utc - utc_offset_s) if boot is None and utc is not None else boot
            utc = as_utc(boot + utc_offset_s) if utc is None and boot is not None else utc
        time = boot if clock == "boot" else utc
        if time is not None:
            image = int(images[k]) if math.isfinite(images[k]) else None
            place, attitude = as_place(*places[k]), as_attitude(*attitudes[k])
            found.append(Trigger(time, utc, image, place, attitude, None, None, None, source.message))
    return found


def _above_home(places: FloatArray, home: Place | None) -> FloatArray:
    """Places (n, 3) or (n, 4) with the height above home: NaN where home has none."""
    if places.shape[1] == 4:
        return places
    zero = np.nan if home is None or home.amsl_m is None else home.amsl_m
    return np.column_stack([places, places[:, 2] - zero])


def _track(tables: Tables, layout: Layout, home: Place | None) -> Track:
    position = _series(tables, (layout.position,), angles=(1,))
    vehicle, north = _gimbals(tables, layout)
    return Track(
        # An unknown height above home must not cost the others, so it is added to what `Series.of` kept.
        position=Series(position.times_s, _above_home(position.values, home), (1,)),
        velocity=_series(tables, layout.velocity),
        attitude=_series(tables, (layout.attitude,), angles=(0, 1, 2)),
        gimbal_vehicle=vehicle,
        gimbal_north=north,
        accuracy=_series(tables, layout.accuracy),
        vertical_accuracy=_series(tables, layout.vertical),
        receiver_height=_series(tables, layout.height),
    )


def _series(tables: Tables, sources: Sequence[Source], angles: tuple[int, ...] = ()) -> Series:
    """Of the first message that there is."""
    for message, columns in sources:
        if message in tables:
            values = tables[message].values(columns)
            return Series.of(tables[message].times_s, values, values.shape[1], angles)
    return Series.empty(len(angles) if sources[0][1] == ("q",) else len(sources[0][1]))


def _gimbals(tables: Tables, layout: Layout) -> tuple[Series, Series]:
    """The camera's angles with yaws from the vehicle's heading and from north, of the first kind of report there is."""
    for message, columns, frame in layout.gimbals:
        table = tables.get(message)
        angles = np.zeros((0, 3)) if table is None else table.values(columns)
        if table is None or not np.isfinite(angles).all(axis=1).any():
            continue
        north = np.full(len(table), frame == "north")
        if frame not in ("vehicle", "north"):
            flags = np.nan_to_num(table.column(frame)).tolist()
            north = np.array([gimbal_yaw_frame(int(each)) == "north" for each in flags])
        times = table.times_s
        return (
            Series.of(times[~north], angles[~north], 3, (0, 1, 2)),
            Series.of(times[north], angles[north], 3, (0, 1, 2)),
        )
    return Series.empty(3), Series.empty(3)


def _completed(trigger: Trigger, track: Track) -> Trigger:
    """A trigger with what its message leaves out, of the track."""
    time, place, attitude = trigger.time_s, trigger.place, trigger.attitude
    if place is None:
        row = track.position.at(time)
        place = None if row is None else as_place(*row)
    if attitude is None:
        row = track.attitude.at(time)
        attitude = None if row is None else as_attitude(*row)
    velocity = track.velocity.at(time)
    accuracy = track.accuracy.at(time, _ACCURACY_REACH_S)
    return replace(
        trigger,
        place=place,
        attitude=attitude,
        gimbal=_gimbal(track, time),
        speed_mps=None if velocity is None else float((velocity @ velocity) ** 0.5),
        accuracy_m=None if accuracy is None or accuracy[0] <= 0.0 else float(accuracy[0]),
        turning_dps=_turning(track, time),
    )


def _at_receivers_heights(triggers: Sequence[Trigger], track: Track, told: list[str]) -> tuple[Trigger, ...]:
    """With the receiver's heights in place of the estimate's where it had a fixed solution, and the others beside them.

    The estimate's come from the barometer, unless ArduPilot's EK3_SRC1_POSZ or PX4's EKF2_HGT_REF say otherwise, and
    drift by decimetres within a flight.
    """
    known: dict[float, tuple[float, float]] = {}
    for trigger in triggers:
        accuracy = track.vertical_accuracy.at(trigger.time_s, _ACCURACY_REACH_S)
        height = track.receiver_height.at(trigger.time_s)
        own = None if trigger.place is None else trigger.place.amsl_m
        if own is not None and height is not None and accuracy is not None and 0.0 < accuracy[0] <= _FIXED_M:
            known[trigger.time_s] = float(height[0]) - own, float(accuracy[0])
    if not known:
        return tuple(triggers)
    shifts = [shift for shift, _ in known.values()]
    if (most := max(map(abs, shifts))) > _FIXED_M:
        told.append(
            "heights are the receiver's, which had a fixed solution; the autopilot's estimate, from the barometer as a "
            f"rule, is up to {most:.2f} m away"
        )
    return tuple(
        trigger
        if trigger.place is None or trigger.place.amsl_m is None
        else replace(
            trigger,
            place=replace(
                trigger.place,
                amsl_m=trigger.place.amsl_m + float(np.interp(trigger.time_s, list(known), shifts)),
            ),
            height_accuracy_m=known[trigger.time_s][1] if trigger.time_s in known else None,
        )
        for trigger in triggers
    )


def _missing_numbers(triggers: Sequence[Trigger], failed: set[int]) -> list[str]:
    """A remark where the autopilot's numbers say that trigger messages are missing from the log."""
    taken = [t.image for t in triggers if t.image is not None]
    numbers = sorted({*taken, *failed})
    if len(numbers) < 2 or taken != sorted(set(taken)):
        return []
    absent = numbers[-1] - numbers[0] + 1 - len(numbers)
    if not 0 < absent <= 100_000:
        return []
    have = set(numbers)
    listed = [n for n in range(numbers[0], numbers[-1] + 1) if n not in have][:_MOST_LISTED]
    more = ", …" if absent > len(listed) else ""
    names = ", ".join(map(str, listed))
    lost = count(absent, "trigger message is", "trigger messages are")
    return [f"{lost} missing from the log (lost on the link?): image {names}{more}"]


def _gimbal(track: Track, time_s: float) -> Gimbal | None:
    """The gimbal as reported around a time.

    A jump faster than gimbals turn is a new target, of one that reports its targets. Mission items run in order, the
    gimbal's before the shutter's, so the target behind such a jump is the one that the shutter found.
    """
    in_vehicle = track.gimbal_vehicle.distance_s(time_s) <= track.gimbal_north.distance_s(time_s)
    series: Series = track.gimbal_vehicle if in_vehicle else track.gimbal_north
    row = series.at(time_s, _GIMBAL_REACH_S)
    if row is not None and _rate(series, time_s) > _FASTEST_GIMBAL_DPS:
        row = series.values[int(np.searchsorted(series.times_s, time_s))]
    if row is None:
        return None
    roll, pitch, yaw = row.tolist()
    return Gimbal(roll, pitch, yaw, "vehicle" if in_vehicle else "north") if abs(pitch) <= 180.0 else None


def _turning(track: Track, time_s: float) -> float | None:
    """How fast the camera turns, degrees per second: the vehicle's heading or the gimbal, whichever is faster."""
    kinds = (track.attitude, track.gimbal_vehicle, track.gimbal_north)
    rates = [_rate(series, time_s, yaw_only=series is track.attitude) for series in kinds if len(series) > 1]
    return max(rates) if rates else None


def _rate(series: Series, time_s: float, *, yaw_only: bool = False) -> float:
    """Degrees per second between the samples on both sides of a time; 0 beyond the ends and over gaps."""
    after = int(np.searchsorted(series.times_s, time_s))
    if not 0 < after < len(series):
        return 0.0
    span = float(series.times_s[after] - series.times_s[after - 1])
    if span > 2.0 * _GIMBAL_REACH_S:
        return 0.0
    step = wrapped_deg(series.values[after] - series.values[after - 1])
    return float(np.abs(step[2:] if yaw_only else step).max()) / span


def as_place(
    latitude_deg: float, longitude_deg: float, amsl_m: float | None, above_home_m: float | None
) -> Place | None:
    """A place, or None for (0, 0) (no fix) and for what is not on Earth; heights beyond 100 km are dropped."""
    if not on_earth(latitude_deg, longitude_deg) or (latitude_deg == 0.0 and longitude_deg == 0.0):
        return None
    return Place(float(latitude_deg), float(longitude_deg), _height(amsl_m), _height(above_home_m))


def as_attitude(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Attitude | None:
    """An attitude with its yaw in [0, 360), or None where a number is no angle."""
    if not all(math.isfinite(a) and abs(a) <= 720.0 for a in (roll_deg, pitch_deg, yaw_deg)):
        return None
    return Attitude(float(roll_deg), float(pitch_deg), float(yaw_deg) % 360.0)


def as_utc(seconds: float) -> float | None:
    """Seconds since 1970, or None where that lies outside 2001 … 2103: clocks that were never set."""
    return float(seconds) if math.isfinite(seconds) and _UTC_RANGE[0] < seconds < _UTC_RANGE[1] else None


def as_boot(seconds: float) -> float | None:
    """Seconds since boot, or None where that is more than 50 days (MAVLink's 32-bit milliseconds)."""
    return float(seconds) if math.isfinite(seconds) and 0.0 <= seconds < _BOOT_LIMIT_S else None


def median_offset(utc_s: FloatArray, boot_s: FloatArray) -> float | None:
    """UTC less time since boot, of messages that say both."""
    known = (_UTC_RANGE[0] < utc_s) & (utc_s < _UTC_RANGE[1]) & np.isfinite(boot_s)
    return float(np.median((utc_s - boot_s)[known])) if known.any() else None


def gimbal_yaw_frame(flags: int) -> YawFrame:
    """What GIMBAL_DEVICE_ATTITUDE_STATUS.q's yaw counts from (MAVLink common.xml, GIMBAL_DEVICE_FLAGS).

    Flag 32 (YAW_IN_VEHICLE_FRAME) or 64 (YAW_IN_EARTH_FRAME) says it; senders older than these mean north where the
    yaw is locked (16), the vehicle's heading otherwise.
    """
    if flags & _YAW_VEHICLE:
        return "vehicle"
    return "north" if flags & (_YAW_NORTH | _YAW_LOCK) else "vehicle"


def euler_deg(quaternions: ArrayLike) -> FloatArray:
    """Roll, pitch, yaw (n, 3) in degrees (Tait–Bryan Z-Y-X) of quaternions (n, 4), w first.

    NaN where a quaternion is no rotation. Within 0.1° of pitch ±90 roll and yaw are one rotation: it goes to yaw.
    """
    q = np.atleast_2d(np.asarray(quaternions, dtype=np.float64))
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.linalg.norm(q, axis=1, keepdims=True)
        w, x, y, z = (q / np.where((length > 0.5) & (length < 2.0), length, np.nan)).T
        sine = np.clip(2.0 * (w * y - z * x), -1.0, 1.0)
        upright = np.abs(sine) > np.sin(np.radians(89.9))
        roll = np.where(upright, 0.0, np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)))
        yaw = np.where(
            upright,
            np.arctan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z)),
            np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )
        return np.asarray(np.degrees(np.stack([roll, np.arcsin(sine), yaw], axis=1)))


def _height(metres: float | None) -> float | None:
    return float(metres) if metres is not None and math.isfinite(metres) and abs(metres) < 1e5 else None
