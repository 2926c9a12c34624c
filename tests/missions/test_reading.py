"""Reading any mission file, and whatever else somebody calls one."""

import io
import json
import random
import re
import zipfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.documents.json_file import json_number
from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.missions.check import check_mission
from fieldkit.missions.files.archive import zip_bytes
from fieldkit.missions.files.limits import MAX_BYTES, number
from fieldkit.missions.files.reading import read_mission
from fieldkit.missions.files.writing import mission_bytes
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
        ("a.gpx", "no known mission format"), ("none.plan", "no such file"), ("none.csv", "no such file"),
        ("big.plan", "far too large"), ("deep.plan", "not JSON"), ("folder.plan", "cannot be read"),
        ("nul\0.csv", "cannot be read"),
    ):  # fmt: skip
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


NUMBERS = [b"0", b"-1", b"-0.0", b"1e30", b"1e-30", b"90.1", b"-180.5", b"65536", b"22", b"201", b"2.5", b"16", b"null"]
PIECES = [
    b"1e999", b"-", b"NaN", b"Infinity", b"[[[[", b"\0", b"\xff", b"99999999999", b'"', b"{}", b"<!DOCTYPE a>", b"\n",
]  # fmt: skip


def mutated(content: bytes, rng: random.Random) -> bytes:
    """A copy with numbers replaced, and at times bytes changed, cut out, doubled or inserted."""
    data = bytearray(content)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(data) + 1)
        match rng.randrange(10):
            case 0 if data:
                data[at % len(data)] = rng.randrange(256)
            case 1:
                del data[at : at + rng.randint(1, 40)]
            case 2:
                data[at:at] = rng.choice(PIECES)
            case 3:
                data[at:at] = data[at : at + rng.randint(1, 200)]
            case 4 if rng.random() < 0.2:
                data = data[:at]
            case _:
                found = re.compile(rb"-?[0-9]+(\.[0-9]+)?").search(data, at)
                if found is not None:
                    data[found.start() : found.end()] = rng.choice(NUMBERS)
    return bytes(data)


def mutated_waylines(rng: random.Random) -> bytes:
    """A sound archive of a mutated document."""
    with zipfile.ZipFile(io.BytesIO(FILES[".kmz"])) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    return zip_bytes([(name, mutated(content, rng)) for name, content in members])


@pytest.mark.parametrize("suffix", FILES)
def test_mutated_files_are_read_or_refused_and_checked(tmp_path: Path, suffix: str) -> None:
    rng = random.Random(suffix)
    path = tmp_path / f"a{suffix}"
    read_back = 0
    refused: list[FieldkitError] = []
    for k in range(300):
        path.write_bytes(mutated_waylines(rng) if suffix == ".kmz" and k % 2 else mutated(FILES[suffix], rng))
        for by in (ARDUPILOT, vehicle("px4"), DJI):
            try:
                report = check_mission(
                    read_mission(path), by, planned=small_mission().shots, origin=small_mission().home
                )
            except FieldkitError as error:
                refused.append(error)
                break
            read_back += 1
            json.dumps([f.message for f in report.findings])
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert read_back > 0
    assert refused
    assert all(error.path == path and "\n" not in error.message for error in refused)


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just([]), st.just({}),
    st.sampled_from([16, 22, 93, 115, 177, 201, 205, 1000, 2000, 3, 0, 2, 10**400, -1, 1e9, 90.0000001]),
)  # fmt: skip


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
        check_mission(read, by, planned=small_mission().shots, origin=small_mission().home)
