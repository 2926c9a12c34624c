"""Reading any mission file, and whatever else somebody calls one."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.fuzzing import Target, fuzz
from fieldkit.documents.json_file import json_number
from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.missions.check import Surroundings, check_mission
from fieldkit.missions.files.formats import mission_bytes, read_mission
from fieldkit.missions.files.limits import MAX_BYTES, number
from tests.missions.vehicles import small_mission, vehicle

ARDUPILOT, DJI = vehicle(), vehicle("dji")
FILES = {
    ".plan": mission_bytes("plan", small_mission(), ARDUPILOT),
    ".waypoints": mission_bytes("waypoints", small_mission(), ARDUPILOT),
    ".kmz": mission_bytes("wpml", small_mission(), DJI),
    ".csv": mission_bytes("litchi", small_mission(), DJI),
}


def test_what_is_no_mission(tmp_path: Path) -> None:
    (tmp_path / "a.gpx").write_bytes(b"")
    (tmp_path / "big.plan").write_bytes(b" " * (MAX_BYTES + 1))
    (tmp_path / "deep.plan").write_bytes(b"[" * 100_000)
    (tmp_path / "folder.plan").mkdir()
    for name, message in (
        ("a.gpx", "no known mission format"),
        ("none.plan", "no such file"),
        ("none.csv", "no such file"),
        ("big.plan", "far too large"),
        ("deep.plan", "not JSON"),
        ("folder.plan", "cannot be read"),
        ("nul\0.csv", "cannot be read"),
    ):
        with pytest.raises(MetadataError, match=message) as caught:
            read_mission(tmp_path / name)
        assert caught.value.remedy


def test_numbers() -> None:
    assert [number(t) for t in ("1", " -2.5e3 ", ".5", "+7.")] == [1.0, -2500.0, 0.5, 7.0]
    for text in ("", "nan", "inf", "0x10", "1_000", "٣", "1e999", "9" * 30, "1,5", "1 2"):
        assert number(text) is None, text
    assert json_number(3) == 3.0
    for value in (True, "3", None, float("inf"), float("nan"), 10**400, 1e300):
        assert json_number(value) is None


@pytest.mark.parametrize("suffix", FILES)
def test_files_changed_at_random_are_read_or_refused_and_checked(tmp_path: Path, suffix: str) -> None:
    def checked(path: Path) -> None:
        try:
            read = read_mission(path)
        except FieldkitError as error:
            if error.path != path or "\n" in error.message:
                raise ValueError(error.message) from error
            raise
        for by in (ARDUPILOT, vehicle("px4"), DJI):
            report = check_mission(read, by, Surroundings(planned=small_mission().shots, origin=small_mission().home))
            json.dumps([finding.message for finding in report.findings])

    found = fuzz(Target(suffix, [FILES[suffix]], checked), 200 if suffix == ".plan" else 80, tmp_path, seed=7)
    assert not found.defects
    assert (found.hangs, found.written) == (0, ())
    assert 0 < found.refused < found.files


VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.just([]),
    st.just({}),
    st.sampled_from([16, 22, 93, 115, 177, 201, 205, 1000, 2000, 3, 0, 2, 10**400, -1, 1e9, 90.0000001]),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_plans_with_any_value_anywhere(tmp_path: Path, data: st.DataObject) -> None:
    document = json.loads(FILES[".plan"])
    for _ in range(data.draw(st.integers(1, 4))):
        here, key = document, data.draw(st.sampled_from(["mission", "geoFence", "rallyPoints", "mission"]))
        for _ in range(5):
            below = here[key]
            if isinstance(below, dict) and below:
                here, key = below, data.draw(st.sampled_from(sorted(below)))
            elif isinstance(below, list) and below:
                here, key = below, data.draw(st.integers(0, len(below) - 1))
            else:
                break
        here[key] = data.draw(VALUES)
        if not all(isinstance(document[k], dict) and document[k] for k in ("mission", "geoFence", "rallyPoints")):
            break
    path = tmp_path / "a.plan"
    path.write_text(json.dumps(document))
    try:
        read = read_mission(path)
    except MetadataError:
        return
    for by in (ARDUPILOT, vehicle("px4"), DJI):
        check_mission(read, by, Surroundings(planned=small_mission().shots, origin=small_mission().home))
