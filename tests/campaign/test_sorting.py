"""Photographs into plots and dates."""

from collections.abc import Sequence
from datetime import datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.campaign.reading import CampaignPlot
from fieldkit.campaign.sorting import PhotoToSort, Sorting, folder_date, sort_photographs
from fieldkit.captures.model import GeoTag
from tests.campaign.examples import MORNING, PLAN, field, flown, photo

FIELD = field(3, 4)
FAR = FIELD[0].model_copy(update={"name": "elsewhere", "latitude_deg": 52.3})


def sorted_into(shots: Sequence[PhotoToSort], plots: Sequence[CampaignPlot] = FIELD) -> Sorting:
    return sort_photographs(shots, plots, [PLAN] * len(plots))


def codes(sorting: Sorting) -> list[str]:
    return [finding.code for finding in (*sorting.left_out, *sorting.findings)]


def counts(sorting: Sorting) -> dict[tuple[str, str], int]:
    return {(visit.plot, visit.date): len(visit.places) for visit in sorting.visits}


def test_a_flight_over_plots_side_by_side() -> None:
    shots = [shot for k, plot in enumerate(FIELD) for shot in flown(plot, start=MORNING + timedelta(minutes=k))]
    found = sorted_into(shots)
    assert counts(found) == {(plot.name, "2026-06-18"): 8 for plot in FIELD}
    assert [visit.plot for visit in found.visits] == [plot.name for plot in FIELD]
    assert all(visit.plot in place for visit in found.visits for place in visit.places)
    assert codes(found) == []


def test_far_photographs_are_named_and_not_dropped() -> None:
    found = sorted_into([*flown(FIELD[0]), *flown(FAR)])
    assert counts(found) == {("r1c1", "2026-06-18"): 8}
    assert codes(found) == ["far-from-plots"] * 8
    assert "m from r3c1, the nearest plot" in found.left_out[0].message


@pytest.mark.parametrize(
    ("spacing_m", "angles", "accuracy_m", "told"),
    [(4.0, True, 1.0, True), (1.5, True, 1.0, False), (4.0, False, 0.015, True), (1.5, False, 0.015, False)],
)
def test_plots_too_near_for_their_geotags(spacing_m, angles, accuracy_m, told) -> None:
    plots = field(2, 1, spacing_m=(6.0, spacing_m))
    found = sorted_into(flown(plots[0], angles=angles, accuracy_m=accuracy_m), plots)
    assert [visit.plot for visit in found.visits] == ["r1c1"] * told
    assert codes(found) == ["ambiguous-plot"] * 8 * (not told)


def test_halfway_between_plots() -> None:
    plots = field(2, 1, spacing_m=(6.0, 4.0))
    tag = GeoTag(sum(plot.latitude_deg for plot in plots) / 2, plots[0].longitude_deg, rtk=True)
    (finding,) = sorted_into([PhotoToSort("1.jpg", photo("1.jpg", geotag=tag))], plots).left_out
    assert "4.0 m from it: sort photographs into folders" in finding.message


def test_a_photograph_without_a_tag_is_of_the_only_plot() -> None:
    shot = PhotoToSort("1.jpg", photo("1.jpg", captured_at=MORNING))
    assert counts(sorted_into([shot], FIELD[:1])) == {("r1c1", "2026-06-18"): 1}
    assert codes(sorted_into([shot])) == ["no-plot"]


@pytest.mark.parametrize("folders", ["r2c3/2026-07-02", "20260702/R2C3", "x/2026-07-02/r2c3/DCIM"])
def test_folders_say_plot_and_date(folders: str) -> None:
    found = sorted_into([PhotoToSort("1.jpg", photo("1.jpg"), tuple(folders.split("/")))])
    assert counts(found) == {("r2c3", "2026-07-02"): 1}
    assert codes(found) == []


def test_contradictions_between_folders_and_tags_are_findings() -> None:
    found = sorted_into(flown(FIELD[0], folder="r2c2/2026-07-02"))
    assert counts(found) == {("r2c2", "2026-07-02"): 8}
    assert sorted(codes(found)) == ["date-contradicts-clock", "plot-contradicts-geotag"]
    assert all("8 photographs" in finding.message for finding in found.findings)
    found = sorted_into(flown(FAR, folder="r1c1"))
    assert counts(found) == {("r1c1", "2026-06-18"): 8}
    assert codes(found) == ["plot-contradicts-geotag"]


def test_dates_by_the_cameras_clock() -> None:
    plot = FIELD[5]
    later = flown(plot, start=datetime(2026, 6, 25, 9, 0))
    found = sorted_into([*flown(plot), *later])
    assert counts(found) == {(plot.name, "2026-06-18"): 8, (plot.name, "2026-06-25"): 8}


def test_a_reflight_adds_up_and_another_pass_does_not() -> None:
    plot = FIELD[5]
    again = flown(plot, start=MORNING + timedelta(minutes=40))[:3]
    assert counts(sorted_into([*flown(plot), *again])) == {(plot.name, "2026-06-18"): 11}
    afternoon = flown(plot, start=MORNING + timedelta(hours=6))[:5]
    found = sorted_into([*flown(plot), *afternoon])
    assert counts(found) == {(plot.name, "2026-06-18"): 8}
    assert codes(found) == ["another-pass"] * 5
    assert "from 09:00" in found.visits[0].notes[0]


@pytest.mark.parametrize(
    ("name", "date"),
    [
        ("2026-06-30", "2026-06-30"),
        ("20260630", "2026-06-30"),
        (" 2026-06-30 ", "2026-06-30"),
        ("2026-13-01", None),
        ("2026-0630", None),
        ("12345678", None),
        ("plot 7", None),
        ("2026-06-30b", None),
        ("２０２６０６３０", "2026-06-30"),
    ],
)
def test_folder_dates(name: str, date: str | None) -> None:
    assert folder_date(name) == date


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["", "r1c1", "r9c9", "2026-06-30", "a/b", "r2c2/2026-01-01"]),
            st.none() | st.tuples(st.floats(-90, 90), st.floats(-180, 180)),
            st.none() | st.datetimes(datetime(1, 1, 1), datetime(9999, 12, 31)),
            st.none() | st.floats(-360, 360),
            st.none() | st.floats(-90, 90),
        ),
        max_size=12,
    )
)
def test_every_photograph_is_in_one_visit_or_left_out(rows: list[tuple]) -> None:
    shots = []
    for k, (folder, place, taken, yaw, pitch) in enumerate(rows):
        tag = None if place is None else GeoTag(*place)
        name = f"{folder}/{k}.jpg"
        said = photo(name, geotag=tag, captured_at=taken, yaw_deg=yaw, pitch_deg=pitch)
        shots.append(PhotoToSort(name, said, tuple(folder.split("/"))))
    found = sorted_into(shots)
    sorted_ = [place for visit in found.visits for place in visit.places] + [f.subject for f in found.left_out]
    assert sorted(sorted_) == sorted(shot.place for shot in shots)


@pytest.mark.parametrize(
    ("longitude_deg", "ahead_h", "date"),
    [
        (150.7, 0.0, "2026-07-01"),  # a clock on UTC in New South Wales: 23:20 the evening before
        (150.7, 10.0, "2026-06-30"),
        (150.7, None, "2026-06-30"),  # nobody says what the clock is on
        (80.0, 8.0, "2026-06-30"),  # China has one zone
        (-75.0, 0.0, "2026-06-30"),
        (6.4, 2.0, "2026-06-30"),
    ],
)
def test_dates_are_those_of_the_place(longitude_deg: float, ahead_h: float | None, date: str) -> None:
    ahead = None if ahead_h is None else timedelta(hours=ahead_h)
    taken = datetime(2026, 6, 30, 23, 20)
    said = photo("1.jpg", geotag=GeoTag(52.3, longitude_deg), captured_at=taken, clock_ahead=ahead)
    assert counts(sorted_into([PhotoToSort("1.jpg", said, ("r1c1",))])) == {("r1c1", date): 1}
