"""poses.csv: lenient in form, strict in content."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.captures.poses_csv import PoseRow, parse_poses_csv
from fieldkit.captures.tables import decode_text, match_names
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
    ],
)
def test_ways_to_write_the_same(text: str) -> None:
    rows, findings = parse_poses_csv(text)
    assert rows == [PoseRow("a.jpg", (1.5, -2.0, 3.0))]
    assert findings == []


def test_angles_and_accuracy() -> None:
    rows, _ = parse_poses_csv(
        "image,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg,accuracy_m\na.jpg,1,2,3,270,-45,1,0.02\nb.jpg,1,2,3,,,,\n"
    )
    assert rows[0] == PoseRow("a.jpg", (1, 2, 3), 270.0, -45.0, 1.0, 0.02)
    assert rows[1] == PoseRow("b.jpg", (1, 2, 3))


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
    assert caught.value.remedy


def test_decimal_commas_between_commas_are_explained() -> None:
    with pytest.raises(MetadataError) as caught:
        parse_poses_csv(f"{HEADER}\na.jpg,1,5,2,0,3,0\n")
    assert "semicolons" in caught.value.remedy


def test_repeated_lines_and_unknown_columns_are_findings() -> None:
    rows, findings = parse_poses_csv(f"{HEADER},speed\na.jpg,1,2,3,9\na.jpg,1,2,3,9\n")
    assert len(rows) == 1
    assert {finding.code for finding in findings} == {"unknown-column", "pose-repeated"}


def test_encodings() -> None:
    text = f"{HEADER}\nGrünkohl.jpg,1,2,3\n"
    for data in (text.encode(), b"\xef\xbb\xbf" + text.encode(), text.encode("utf-16")):
        assert parse_poses_csv(decode_text(data))[0][0].image == "Grünkohl.jpg"
    with pytest.raises(MetadataError, match="line 2 is not UTF-8"):
        decode_text(text.encode("latin-1"))


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


@given(st.binary(max_size=100))
def test_any_bytes_are_decoded_or_refused(data: bytes) -> None:
    try:
        text = decode_text(data)
    except MetadataError:
        return
    assert "\r" not in text


def test_names_are_matched_exactly_then_loosely() -> None:
    photos = ["a.jpg", "B.JPG", "ä.jpg", "c.jpg", "C.jpg"]
    listed = ["a.jpg", "images/a.jpg", "b.jpg", "a\u0308.jpg", "c.jpg", "C.JPG", "d.jpg"]
    assert match_names(listed, photos) == {
        "a.jpg": "a.jpg",
        "images/a.jpg": "a.jpg",
        "b.jpg": "B.JPG",
        "a\u0308.jpg": "ä.jpg",
        "c.jpg": "c.jpg",
    }
