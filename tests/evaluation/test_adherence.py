"""Poses of captures from a flight log, and how the flight kept to the plan."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from fieldkit.errors import MetadataError
from fieldkit.evaluation.adherence import LoggedFlight, flown_noise
from fieldkit.evaluation.conversion import failed_plot
from fieldkit.geometry import Similarity
from fieldkit.geometry.geodesy import LocalFrame, utm_epsg_of
from fieldkit.reconstruction.known_poses import known_poses
from fieldkit.results.evaluation import AdherenceEntry, EvaluationReport, StationErrorEntry
from fieldkit.results.plan import Plan, Station
from tests.captures.conftest import photo_file
from tests.captures.photographs import MakePhoto
from tests.flightlogs.recordings import description, flight_log, recording
from tests.flightlogs.test_geotag import make

__all__ = ["photo_file"]


@pytest.fixture
def plots(photo_file: MakePhoto) -> list[tuple[str, Path]]:
    """Two folders: photographs 0–7 of mount_then_yaw without the third, and 8–12 with an extra one."""
    for k, trigger in enumerate(flight_log("mount_then_yaw.tlog").triggers):
        if k != 2:
            path = make(photo_file, f"{'a' if k < 8 else 'b'}/{k}.jpg", trigger.utc_s + 3600.1)
    make(
        photo_file,
        "b/extra.jpg",
        3600.1 + (flight_log("mount_then_yaw.tlog").triggers[9].utc_s or 0) + 4,
    )
    root = path.parent.parent
    return [("a", root / "a"), ("b", root / "b")]


def plan_of_the_flight(frame: LocalFrame, motion: Similarity) -> Plan:
    """The stations of the recording in a plot frame that lies turned in the source frame."""
    stations = []
    home_m = 92.06
    for s in description("mount_then_yaw")["stations"]:
        at = frame.to_local(s["lat"] * 1e-7, s["lon"] * 1e-7, home_m + s["h"])[0]
        x, y, z = motion.apply(at)
        turned = np.degrees(np.arctan2(motion.rotation[1, 0], motion.rotation[0, 0]))
        stations.append(
            Station(
                position_m=(float(x), float(y), float(z)),
                yaw_deg=float((s["yaw"] - turned) % 360.0),
                pitch_deg=s["pitch"],
            )
        )
    return Plan(fieldkit="0", stations=tuple(stations))


def test_captures_get_the_poses_of_their_triggers(plots: list[tuple[str, Path]]) -> None:
    flight = LoggedFlight.read(recording("mount_then_yaw.tlog"), plots)
    a, b = flight.capture("a"), flight.capture("b")
    assert (len(a.priors), len(b.priors)) == (7, 5)
    assert a.metric_source == b.metric_source == "flight log"
    assert a.origin == b.origin
    assert utm_epsg_of(a.origin) == 32632
    assert [f.subject for f in b.findings if f.code == "photo-without-trigger"] == ["extra.jpg"]
    known = known_poses(a)
    assert known.frame.source == "flight log"
    told = description("mount_then_yaw")["triggers"]
    for name, prior in a.priors.items():
        t = told[int(name.removesuffix(".jpg"))]
        east, north, _ = a.origin.to_local(t["est"]["lat"], t["est"]["lon"], a.origin.altitude_m)[0]
        assert prior.position == pytest.approx((east, north, t["est"]["rel_alt"]), abs=0.02)
        assert prior.yaw_deg == pytest.approx(t["est"]["yaw"], abs=0.2)
        assert prior.pitch_deg == pytest.approx(t["gimbal"]["pitch"], abs=0.2)
    assert flight.capture("none") is None


def flown(*plots: Sequence[tuple[float | None, ...]] | None) -> EvaluationReport:
    """An evaluation whose plots have these errors: east, north, up, yaw, pitch per station; None: no adherence."""
    entries = []
    for errors in plots:
        stations = tuple(
            StationErrorEntry(
                station=f"station {k}",
                image=f"{k}.jpg",
                east_m=e or 0.0,
                north_m=n or 0.0,
                up_m=u,
                yaw_deg=yaw,
                pitch_deg=pitch,
                speed_mps=None,
                turning_dps=None,
            )
            for k, (e, n, u, yaw, pitch) in enumerate(errors or [])
        )
        kept = AdherenceEntry(
            stations=stations, missing=(), extra=(), horizontal_rms_m=None, yaw_rms_deg=None, pitch_rms_deg=None
        )
        plot = failed_plot("a", MetadataError("none"))
        entries.append(plot.model_copy(update={"adherence": None if errors is None else kept}))
    return EvaluationReport(
        fieldkit="0",
        source="flights",
        reference_sha256=None,
        refine=False,
        distances_m=(0.005,),
        settings={},
        plots=tuple(entries),
        seconds=0.0,
        cpu_seconds=0.0,
        files=(),
    )


def test_noise_is_that_of_the_flights_errors() -> None:
    """Gaussian errors about another offset on every plot; the offsets are no noise."""
    rng = np.random.default_rng(4)
    plots = []
    for offset in ((1.2, -0.4, 46.0), (0.9, -0.2, 45.0)):
        place = rng.normal(offset, 0.03, (400, 3))
        turn = rng.normal(0.0, 0.8, (400, 2))
        plots.append([tuple(row) for row in np.hstack([place, turn]).tolist()])
    position_m, angle_deg = flown_noise(flown(None, *plots).plots, Path("scores"))
    assert position_m == pytest.approx(0.03, rel=0.05)
    assert angle_deg == pytest.approx(0.8, rel=0.05)


@pytest.mark.parametrize(
    ("report", "words"),
    [
        (flown(None), "does not say how a flight kept to its plan"),
        (flown(), "does not say how a flight kept to its plan"),
        (flown(*[[(0.1, 0.0, 0.0, 1.0, 1.0)]] * 5), "of position of too few of 5 stations"),
        (flown([(0.1, 0.0, 0.0, None, None)] * 5), "of heading and gimbal of too few of 5 stations"),
    ],
)
def test_evaluations_without_noise_are_refused(report: EvaluationReport, words: str) -> None:
    with pytest.raises(MetadataError, match=words) as caught:
        flown_noise(report.plots, Path("scores"))
    assert "--pose-noise M,DEG" in caught.value.remedy
    assert caught.value.path == Path("scores")
