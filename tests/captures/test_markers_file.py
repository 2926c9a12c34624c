"""markers.toml: what it says, and every way to get it wrong."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.captures import MarkerDistance, MarkersFile, read_capture
from fieldkit.captures.markers_file import parse_markers_file
from fieldkit.errors import FieldkitError, MetadataError
from tests.captures.photographs import MakePhoto

BOOK = 'dictionary = "DICT_4X4_50"\n'
SIDE = BOOK + "side_m = 0.12\n"
DISTANCE = "[[distance]]\na = 3\nb = 7\ndistance_m = 1.25\n"


def test_it_is_read_with_the_capture(photo_file: MakePhoto) -> None:
    folder = photo_file("a.jpg").parent
    assert read_capture(folder).markers is None
    (folder / "markers.toml").write_text(SIDE + DISTANCE + "[[distance]]\na = 9\nb = 3\ndistance_m = 2\n")
    capture = read_capture(folder)
    assert capture.markers == MarkersFile("DICT_4X4_50", 0.12, (MarkerDistance(3, 7, 1.25), MarkerDistance(3, 9, 2.0)))
    assert capture.findings == ()
    assert capture.names == ("a.jpg",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("dictionary = DICT", "is not TOML"),
        ("", "dictionary: is missing"),
        ("dictionary = 4\n", "dictionary: input should be a valid string"),
        ('dictionary = ""\nside_m = 1\n', "there is no dictionary ''"),
        ('dictionary = "DICT_3X3_50"\nside_m = 0.1\n', "'DICT_3X3_50'; known are DICT_4X4_100"),
        (BOOK, "neither side_m nor a distance"),
        (BOOK + "size_m = 0.12\n", "size_m: is not a key"),
        (BOOK + "side_m = 120\n", "side_m: input should be less than or equal to 10"),
        (BOOK + "side_m = 0\n", "side_m: input should be"),
        (BOOK + "side_m = -0.1\n", "side_m: input should be"),
        (BOOK + "side_m = nan\n", "side_m: input should be"),
        (BOOK + 'side_m = "12 cm"\n', 'side_m: should be a number and is the text "12 cm"'),
        (BOOK + "side_m = true\n", "side_m: input should be"),
        (SIDE + "distance = 1.25\n", "distance: input should be a valid array"),
        (SIDE + "[distance]\na = 3\nb = 7\ndistance_m = 1\n", "distance: input should be a valid array"),
        (SIDE + "distance = [3]\n", "distance 1: should be a table"),
        (BOOK + DISTANCE.replace("b = 7\n", ""), "distance 1.b: is missing"),
        (BOOK + DISTANCE + "unit = 'm'\n", "distance 1.unit: is not a key"),
        (BOOK + DISTANCE.replace("7", "50"), "1: a marker's number is from 0 to 49, not 50"),
        (BOOK + DISTANCE.replace("7", "-1"), "distance 1.b: input should be"),
        (BOOK + DISTANCE.replace("7", "7.0"), "distance 1.b: input should be"),
        (BOOK + DISTANCE.replace("7", "3"), "same marker 3"),
        (BOOK + DISTANCE.replace("1.25", "0"), "distance 1.distance_m: input should be"),
        (BOOK + DISTANCE.replace("1.25", "inf"), "distance 1.distance_m: input should be"),
        (BOOK + DISTANCE + DISTANCE.replace("3", "9") + "[[distance]]\na = 7\nb = 3\ndistance_m = 1\n", "1 and 3"),
    ],
)
def test_mistakes(text: str, words: str) -> None:
    with pytest.raises(MetadataError) as caught:
        parse_markers_file(text)
    assert words in caught.value.message


words = st.sampled_from(["dictionary", "side_m", "distance", "a", "b", "distance_m", '"4x4_50"', "3", "0.1", "nan"])
signs = st.sampled_from([" = ", "\n", "[[", "]]", "[", "]", "{", "}", ",", '"', "1e400", "-"])


@given(st.lists(words | signs, max_size=12).map("".join) | st.text(max_size=60))
def test_any_text_is_read_or_refused(text: str) -> None:
    for tried in (text, SIDE + text, BOOK + text):
        try:
            markers = parse_markers_file(tried)
        except FieldkitError:
            continue
        assert markers.side_m is not None or markers.distances
