"""Where intrinsics come from, and which photographs share them."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.captures import read_capture
from fieldkit.captures.camera_file import parse_camera_file
from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.geometry import Intrinsics
from tests.captures.photographs import MakePhoto, exif_block

TOML = 'model = "OPENCV"\nwidth = 120\nheight = 90\nparams = [100.0, 101, 60, 45, -0.1, 0.01, 0, 0]\n'
OPENCV = Intrinsics("OPENCV", 120, 90, (100.0, 101.0, 60.0, 45.0, -0.1, 0.01, 0.0, 0.0))


def test_without_anything_the_camera_calibrates_itself(photo_file: MakePhoto) -> None:
    photo_file("a.jpg")
    (group,) = read_capture(photo_file("b.jpg").parent).groups
    assert (group.photos, group.intrinsics) == (("a.jpg", "b.jpg"), None)
    assert (group.source, group.fixed) == ("self-calibrated", False)


def test_exif_gives_a_start_value(photo_file: MakePhoto) -> None:
    (group,) = read_capture(photo_file("a.jpg", exif=exif_block(detail={41989: 26})).parent).groups
    assert (group.source, group.fixed) == ("EXIF", False)
    assert group.intrinsics.model == "SIMPLE_RADIAL"
    assert group.intrinsics.params == pytest.approx((26 * 150 / 43.2666, 60, 45, 0), rel=1e-5)


def test_a_camera_file_wins_over_exif_and_is_held_fixed(photo_file: MakePhoto) -> None:
    folder = photo_file("a.jpg", exif=exif_block(detail={41989: 26})).parent
    (folder / "camera.toml").write_text(TOML)
    capture = read_capture(folder)
    (group,) = capture.groups
    assert (group.intrinsics, group.source, group.fixed) == (OPENCV, "camera.toml", True)
    assert capture.findings == ()


def test_another_size_of_the_same_aspect_is_scaled(photo_file: MakePhoto) -> None:
    folder = photo_file("a.jpg", size=(60, 45)).parent
    (folder / "camera.toml").write_text(TOML)
    capture = read_capture(folder)
    assert capture.groups[0].intrinsics == OPENCV.scaled(60, 45)
    assert [finding.code for finding in capture.findings] == ["camera-scaled"]


def test_several_cameras_by_name_and_by_size(photo_file: MakePhoto) -> None:
    for name in ("left_1.jpg", "left_2.jpg", "right_1.jpg"):
        photo_file(name)
    folder = photo_file("tele.jpg", size=(64, 64)).parent
    params = "params = [90, 60, 45]"
    left = f'[[cameras]]\nmodel = "SIMPLE_PINHOLE"\nwidth = 120\nheight = 90\n{params}\nimages = ["left_*"]\n'
    tele = '[[cameras]]\nmodel = "SIMPLE_PINHOLE"\nwidth = 64\nheight = 64\nparams = [200, 32, 32]\n'
    wide = '[[cameras]]\nmodel = "SIMPLE_PINHOLE"\nwidth = 120\nheight = 90\nparams = [50, 60, 45]\n'
    nobody = wide + 'images = "up_*"\n'
    (folder / "camera.toml").write_text(left + tele + wide + nobody)
    capture = read_capture(folder)
    focal = {name: capture.group_of(name).intrinsics.fx for name in capture.names if capture.group_of(name).intrinsics}
    assert focal == {"left_1.jpg": 90, "left_2.jpg": 90, "right_1.jpg": 50, "tele.jpg": 200}
    assert len(capture.groups) == 3
    assert len({group.key for group in capture.groups}) == 3
    assert {finding.code for finding in capture.findings} == {"mixed-sizes", "camera-unused"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("model = OPENCV", "is not TOML: Invalid value (at line 1"),
        ("", "model: is missing"),
        ('model = "OPENCV"\n', "width: is missing"),
        (TOML + "focal = 3\n", "focal: is not a key"),
        (TOML.replace("120", '"120"'), 'width: should be a number and is the text "120"'),
        (TOML.replace("120", "-5"), "width: input should be"),
        (TOML.replace("OPENCV", "FISHEYE"), "FISHEYE"),
        (TOML.replace(", 0, 0]", "]"), "takes 8 parameters"),
        (TOML.replace("100.0", "nan"), "finite"),
        (TOML.replace("100.0", '"f"'), 'params 1: should be a number and is the text "f"'),
        (TOML + "images = 3\n", "images"),
        (TOML + 'fixed = "yes"\n', "fixed"),
        ("cameras = []", "cameras: "),
        ("cameras = [3]", "cameras 1: should be a table"),
        ("[[cameras]]\nmodel = 'OPENCV'\n", "cameras 1.width: is missing"),
    ],
)
def test_mistakes_in_a_camera_file(text: str, words: str) -> None:
    with pytest.raises(MetadataError) as caught:
        parse_camera_file(text, Path("camera.toml"))
    assert words in caught.value.message
    assert caught.value.remedy


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["model", "width", "height", "params", "images", "cameras", "fixed"]), inner)
    ),
    max_leaves=12,
)


@given(json_values)
def test_any_json_is_read_or_refused(value: object) -> None:
    try:
        entries = parse_camera_file(json.dumps(value), Path("camera.json"))
    except FieldkitError:
        return
    assert entries
