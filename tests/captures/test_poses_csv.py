"""poses.csv: lenient in form, strict in content."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.captures.poses_csv import PoseRow, parse_poses_csv
from fieldkit.errors import FieldkitError, MetadataError

HEADER = "image,x_m,y_m,z_m"


@pytest.mark.parametrize(
    "text",
    [
        "image,x_m,y_m,z_m\na.jpg,1.5,-2,3\n",
        "name,x,y,z\r\na.jpg,1.5,-2,3\r\n",
        "image;x_m;y_m;z_m\na.jpg;1,5;-2,0;3\n",
        "image\tx_m\ty_m\tz_m\na.jpg\t1.5\t-2\t3",
        "z_m, y_m, x_m, image\n3, -2, 1.5, a.jpg\n",
        "Image,X_mm,Y_mm,Z_mm\na.jpg,1500,-2000,3e3\n",
        '# from the rig\nimage,x_m,y_m,z_m\n\n"a.jpg","1.5","-2","3"\n',
        "image,x_m,y_m,z_m,\na.jpg,1.5,-2,3,\n",
        "#Label,X/Easting,Y/Northing,Z/Altitude\na.jpg,1.5,-2,3\n",
        "# CoordinateSystem: Local Coordinates (m)\n#Label,X/East,Y/North,Z/Altitude\na.jpg,1.5,-2,3\n# Total Error\n",
        "# by me, x and name\nimage,x_m,y_m,z_m\n# Label,X,Y,Z\na.jpg,1.5,-2,3\n",
        "imageName X Y Z\na.jpg 1.5 -2 3\n",
        "# imageName  X  Y  Z\na.jpg  1.5 -2   3\n",
        "#imagename,easting [m],northing [m],altitude [m]\na.jpg,1.5,-2,3\n",
        "Image Name;X (cm);Y (cm);Z (cm)\na.jpg;150;-200;300\n",
        'image,x,y,z\na.jpg,"1,5","-2",3\n',
    ],
)
def test_ways_to_write_the_same(text: str) -> None:
    rows, findings = parse_poses_csv(text)
    assert rows == [PoseRow("a.jpg", (1.5, -2.0, 3.0))]
    assert findings == []


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("image,x_ft,y_ft,z_ft\na.jpg,10,20,30\n", 0.3048),
        ("Label,X [ft],Y [ft],Z [ft]\na.jpg,10,20,30\n", 0.3048),
        ("Label;X (US survey feet);Y (US survey feet);Z (US survey feet)\na.jpg;10;20;30\n", 1200 / 3937),
        ("image,x_ftUS,y_ftUS,z_ftUS\na.jpg,10,20,30\n", 1200 / 3937),
    ],
)
def test_feet(text: str, metres: float) -> None:
    (row,), _ = parse_poses_csv(text)
    assert row.position == pytest.approx((10 * metres, 20 * metres, 30 * metres))


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ("412345,67;5188123,4;198,5", (412345.67, 5188123.4, 198.5)),
        ("412345.67;5188123.4;198.5", (412345.67, 5188123.4, 198.5)),
        ("0,345;2,5;3", (0.345, 2.5, 3.0)),
    ],
)
def test_commas_between_semicolons_are_decimals(fields: str, expected: tuple[float, float, float]) -> None:
    for mark in (";", "\t"):
        (row,), findings = parse_poses_csv(f"image;x;y;z\na.jpg;{fields}\n".replace(";", mark))
        assert row.position == pytest.approx(expected)
        assert findings == []


@pytest.mark.parametrize("fields", ["412,345.67;5,188,123.4;198.5", "412.345,67;5.188.123,4;198,5", "5,188,123;2;3"])
def test_marks_between_thousands_are_refused(fields: str) -> None:
    with pytest.raises(MetadataError, match="is not a number") as caught:
        parse_poses_csv(f"image;x;y;z\na.jpg;{fields}\n")
    assert "none between thousands" in caught.value.remedy


LONG_LAT = "a.jpg,-91.99421010,46.84252125,198.61\nb.jpg,-91.99408610,46.84260901,198.70\n"


@pytest.mark.parametrize(
    "header",
    [
        "image,longitude,latitude,altitude",
        "image,lon,lat,alt",
        "#Label,X/Longitude,Y/Latitude,Z/Altitude",
        "imagename,longitude [decimal degrees],latitude [decimal degrees],altitude [meter]",
        "Image Name,Lng,Lat,Height",
        "image,x_deg,y_deg,z_m",
    ],
)
def test_longitude_and_latitude(header: str) -> None:
    rows, findings = parse_poses_csv(f"{header}\n{LONG_LAT}")
    assert rows[0] == PoseRow("a.jpg", (-91.9942101, 46.84252125, 198.61), geographic=True)
    assert findings == []
    swapped = header.split(",")
    swapped[1:3] = swapped[2:0:-1]
    rows, _ = parse_poses_csv(f"{','.join(swapped)}\na.jpg,46.84252125,-91.9942101,198.61\n")
    assert rows[0].position == (-91.9942101, 46.84252125, 198.61)


@pytest.mark.parametrize("header", ["image,x,y,z", "image,x_m,y_m,z_m", "Label,X,Y,Z", "image,easting,northing,height"])
def test_degrees_under_names_of_metres_are_refused(header: str) -> None:
    lat_first = "a.jpg,46.84252125,-91.9942101,198.61\nb.jpg,46.842609,-91.9940861,198.7\n"
    for rows in (LONG_LAT, lat_first):
        with pytest.raises(MetadataError, match="look like degrees") as caught:
            parse_poses_csv(f"{header}\n{rows}")
        assert "longitude, latitude" in caught.value.remedy


def test_metres_are_not_taken_for_degrees() -> None:
    for rows in (
        "a.jpg,1.5,2.25,0.3\nb.jpg,1.5,2.251,0.9\n",  # a slide that goes up
        "a.jpg,0.000012,0.0000031,0.3\nb.jpg,0.000015,0.0000029,0.9\n",
        "a.jpg,91.9942101,46.84252125,3\nb.jpg,93.9942101,46.84252125,3\n",
        "a.jpg,412345.67123,5188123.44123,3\nb.jpg,412345.68123,5188123.44223,3\n",
    ):
        assert len(parse_poses_csv(f"{HEADER}\n{rows}")[0]) == 2


def test_what_metashape_writes_besides() -> None:
    text = (
        "# CoordinateSystem: Local Coordinates (m)\n"
        "#Label,X/Easting,Y/Northing,Z/Altitude,Yaw,Pitch,Roll,Error_(m),X_error,Y_error,Z_error,Accuracy_X/Y_(m),"
        "Accuracy_Z_(m),X_est,Y_est,Z_est\n"
        "a,1,2,3,10,20,0,0.1,,,,0.02,0.05,9,9,9\n"
        "b,,,,,,,,,,,,,9,9,9\n"
        "# Total Error\n,,,,,,,0.5\n"
    )
    with pytest.raises(MetadataError, match="no image name"):
        parse_poses_csv(text)
    rows, findings = parse_poses_csv(text.replace("# Total Error\n,,,,,,,0.5\n", "#Total Error,,,,,,,0.5\n"))
    assert rows == [PoseRow("a", (1.0, 2.0, 3.0), 10.0, 20.0, 0.0, 0.05)]
    assert [finding.code for finding in findings] == ["unknown-column"]
    assert all(name in findings[0].message for name in ("Error_(m)", "X_est"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["empty"]),
        ("\n\n", ["empty"]),
        (HEADER, ["no line below"]),
        ("a.jpg,1,2,3\n", ["no column names"]),
        ("image,x_m,y_m\na.jpg,1,2\n", ["no column z"]),
        ("x_m,y_m,z_m\n1,2,3\n", ["no column image"]),
        ("image,x_m,x,y_m,z_m\na.jpg,1,1,2,3\n", ["x appears twice"]),
        ("image,x_m,y_mm,z_m\na.jpg,1,1,2\n", ["different units"]),
        (f"{HEADER}\na.jpg,1,two,3\n", ["line 2", "y_m", "'two'"]),
        (f"{HEADER}\na.jpg,1,2,3\n\nb.jpg,nan,2,3\n", ["line 4", "x_m", "'nan'"]),
        (f"{HEADER}\na.jpg,1,2,inf\n", ["line 2", "z_m"]),
        (f"{HEADER}\na.jpg,1,2\n", ["line 2", "z_m is empty"]),
        (f"{HEADER}\na.jpg,1,5,2,0,3,0\n", ["line 2", "7 fields"]),
        (f"{HEADER}\n,1,2,3\n", ["line 2", "no image name"]),
        (f"{HEADER}\na.jpg,1e300,2,3\n", ["line 2", "outside"]),
        (f'{HEADER}\n"a.jpg,1,2,3\n', ["line 2"]),
        (f"{HEADER},pitch_deg\na.jpg,1,2,3,100\n", ["line 2", "pitch_deg", "outside"]),
        (f"{HEADER},accuracy_m\na.jpg,1,2,3,0\n", ["line 2", "accuracy_m", "not positive"]),
        (f"{HEADER}\na.jpg,1,2,3\na.jpg,1,2,4\n", ["line 3", "a.jpg", "line 2"]),
    ],
)
def test_mistakes_name_the_line_and_the_column(text: str, words: list[str]) -> None:
    with pytest.raises(MetadataError) as caught:
        parse_poses_csv(text)
    assert all(word in caught.value.message for word in words), caught.value.message


numbers = st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: round(value, 6))
names = st.text(st.characters(blacklist_categories=("Cs", "Cc", "Zl", "Zp")), min_size=1, max_size=20).filter(
    lambda name: name == name.strip() and not name.startswith("#")
)


@given(st.dictionaries(names, st.tuples(numbers, numbers, numbers), min_size=1, max_size=8), st.sampled_from(",;\t"))
def test_written_positions_are_read_back(poses: dict[str, tuple[float, float, float]], delimiter: str) -> None:
    def quoted(name: str) -> str:
        return '"' + name.replace('"', '""') + '"'

    lines = [delimiter.join(("image", "x_m", "y_m", "z_m"))]
    lines += [delimiter.join((quoted(name), *map(repr, position))) for name, position in poses.items()]
    rows, _ = parse_poses_csv("\n".join(lines))
    assert {row.image: row.position for row in rows} == poses


@given(st.one_of(st.text(max_size=200), st.text(alphabet='image,x_myz0123456789.-;"\n\t ', max_size=200)))
def test_any_text_is_read_or_refused(text: str) -> None:
    for candidate in (text, f"{HEADER},yaw_deg\n{text}"):
        try:
            rows, _ = parse_poses_csv(candidate)
        except FieldkitError:
            continue
        assert rows
