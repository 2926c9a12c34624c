"""What every format's layout makes of the same flight's tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fieldkit.flightlogs import FlightLog, Stamp, dataflash, match_log, read_flight_log, tlog, ulog
from fieldkit.flightlogs.assembly import Layout, Table, flight_log
from fieldkit.flightlogs.geotag import _accuracy_m
from tests.flightlogs.test_px4_logs import flight
from tests.flightlogs.ulog_file import write_ulog

TIMES = np.arange(10.0, 70.0, 10.0)
DRIFT = 0.8 * (TIMES - 10.0) / 50.0
"""Of a barometer's height, metres, at 97 m."""
NAMES = {
    dataflash: (("CAM", "Lat Lng Alt"), ("GPS", "Alt"), ("GPA", "HAcc VAcc")),
    tlog: (("CAMERA_FEEDBACK", "lat lng alt_msl"), ("GPS_RAW_INT", "alt"), ("GPS_RAW_INT", "h_acc v_acc")),
    ulog: (("camera_capture", "lat lon alt"), ("sensor_gps", "altitude_msl_m"), ("sensor_gps", "eph epv")),
}


def logged(module: object, vertical_m: np.ndarray) -> FlightLog:
    """Triggers whose estimated height drifts, beside a receiver that states its accuracy."""
    layout: Layout = module._LAYOUT
    camera, height, accuracy = NAMES[module]
    times = TIMES + (1.7e9 if module is tlog else 0.0)  # UTC
    columns = (
        (*camera, [np.full(6, 50.0), np.full(6, 7.0), 97.0 + DRIFT]),
        (*height, [np.full(6, 97.0)]),
        (*accuracy, [np.full(6, 0.014), vertical_m]),
    )
    rows: dict[str, dict[str, np.ndarray]] = {}
    for message, names, values in columns:
        rows.setdefault(message, {}).update(zip(names.split(), values, strict=True))
    source = next(each for each in layout.triggers if each.message == camera[0])
    tables = {}
    for message, fields in rows.items():
        own = {**fields, "t": times} | ({source.boot: times} if message == source.message and source.boot else {})
        tables[message] = Table.of(np.rec.fromarrays(list(own.values()), names=list(own)), {}, "t")
    clock = "UTC" if module is tlog else "boot"
    return flight_log(Path("a"), "tlog", tables, layout, (), clock=clock)


@pytest.mark.parametrize("module", [dataflash, tlog, ulog])
@pytest.mark.parametrize(
    ("fixed", "heights", "accuracies"),
    [
        ([1, 1, 1, 1, 1, 1], [97.0] * 6, [0.03] * 6),
        ([0, 0, 0, 0, 0, 0], 97.0 + DRIFT, [0.3] * 6),
        ([1, 0, 0, 0, 0, 1], [97.0] * 6, [0.03, *[0.3] * 4, 0.03]),  # the fix was lost between
    ],
)
def test_a_fixed_receivers_height_counts_more_than_the_estimates(module, fixed, heights, accuracies) -> None:
    log = logged(module, np.where(fixed, 0.02, 0.5))
    assert [t.place.amsl_m for t in log.triggers] == pytest.approx(heights)
    assert [_accuracy_m(t) for t in log.triggers] == pytest.approx(accuracies)
    assert any("is up to 0.80 m away" in remark for remark in log.remarks) == any(fixed)


SHOTS = np.cumsum([20.0, 9.1, 13.7, 10.2, 9.8, 12.9, 11.4, 13.1])


def two_cameras(speed_mps: float, shots: int) -> FlightLog:
    """Camera 1 photographs four seconds after camera 0, at the first of its shots only."""
    times = np.concatenate([SHOTS, SHOTS[:shots] + 4.0])
    latitudes = 50.0 + speed_mps * times / 111_240.0
    camera = [0] * len(SHOTS) + [1] * shots
    columns = [times, camera, latitudes, np.full(len(times), 7.0), np.full(len(times), 90.0)]
    table = Table.of(np.rec.fromarrays(columns, names=["TimeUS", "I", "Lat", "Lng", "Alt"]), {}, "TimeUS")
    return flight_log(Path("a"), "dataflash", {"CAM": table}, dataflash._LAYOUT, ())


@pytest.mark.parametrize(
    ("speed", "shots", "known", "camera", "pairs"),
    [
        (5.0, 8, {"offset_s": 0.0}, 1, 8),
        (5.0, 8, {"camera": 1}, 1, 8),
        (5.0, 8, {"camera": 0}, 0, 8),  # the camera's clock is four seconds off
        (5.0, 8, {}, 0, 0),  # both fit, 20 m apart
        (0.0, 8, {}, 0, 8),  # both fit, at one place
        (5.0, 5, {}, 0, 8),  # the other has too few
    ],
)
def test_photographs_are_of_the_camera_whose_triggers_they_fit(speed, shots, known, camera, pairs) -> None:
    photographs = [Stamp(f"{k}.jpg", float(time) + 4.0) for k, time in enumerate(SHOTS)]
    log, matches = match_log(photographs, two_cameras(speed, shots), **known)
    assert (log.camera, len(matches.pairs)) == (camera, pairs)
    assert any("fit the triggers of cameras 0 and 1 alike" in text for text in matches.remarks) == (pairs == 0)
    assert any("2 cameras" in text for text in log.remarks)


def test_px4s_height_in_millimetres(tmp_path: Path) -> None:
    topics = flight()
    times = [row[0] for row in topics["vehicle_gps_position"][1]]
    fields = "uint64_t timestamp;int32_t alt;float eph;float epv;"
    topics["vehicle_gps_position"] = (fields, [(t, 102_900, 0.014, 0.02) for t in times])
    (tmp_path / "flight.ulg").write_bytes(write_ulog(topics))
    heights = [t.place.amsl_m for t in read_flight_log(tmp_path / "flight.ulg").triggers]
    assert heights == pytest.approx([102.9] * 5)
