"""Photographs of a tree of folders, and captures made of some of them."""

from dataclasses import replace
from pathlib import Path

import pytest

from fieldkit.cache import digest
from fieldkit.captures import read_capture
from fieldkit.captures.selection import capture_of, find_photographs
from tests.captures.photographs import MakePhoto, exif_block, gps_tags

EXIF = {
    "exif": exif_block(
        base={271: "DJI", 272: "M3"}, detail={0x9003: "2026:06:18 09:00:00"}, gps=gps_tags(52.296, 10.437, 100.0)
    )
}
POSES = "image,x_m,y_m,z_m\n"


def places(root: Path) -> list[str]:
    return [each.place for each in find_photographs(root).photos]


def test_everything_below_a_folder_in_natural_order(photo_file: MakePhoto, tmp_path: Path) -> None:
    root = tmp_path / "capture"
    for name in ("b/IMG_10.jpg", "b/IMG_2.jpg", "a.jpg", "c/images/x.png", "c/masks/x.png", ".hidden/x.jpg"):
        photo_file(name)
    (root / "b" / "broken.jpg").write_bytes(b"\xff\xd8\xff")
    (root / "b" / "notes.txt").write_text("x")
    (root / "loop").symlink_to(root)
    found = find_photographs(root)
    assert [each.place for each in found.photos] == ["a.jpg", "b/IMG_2.jpg", "b/IMG_10.jpg", "c/images/x.png"]
    assert found.photos[1].folders == ("b",)
    assert [(f.subject, f.code) for f in found.findings] == [("b/broken.jpg", "truncated")]
    assert places(root / "b") == ["IMG_2.jpg", "IMG_10.jpg"]


def test_the_same_bytes_count_once(photo_file: MakePhoto, tmp_path: Path) -> None:
    photo_file("a/x.jpg", seed=1)
    photo_file("b/x.jpg", seed=1)
    found = find_photographs(tmp_path / "capture")
    assert [each.place for each in found.photos] == ["a/x.jpg"]
    assert [(f.subject, f.code, f.message) for f in found.findings] == [
        ("b/x.jpg", "duplicate", "the same bytes as a/x.jpg")
    ]


@pytest.mark.parametrize("where", ["", "images/"])
def test_a_whole_folder_is_the_capture_that_read_capture_gives(where, photo_file, tmp_path) -> None:
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        photo_file(where + name, **EXIF)
    root = tmp_path / "capture"
    (root / "poses.csv").write_text(POSES + "a.jpg,0,0,1\nb.jpg,1,0,1\nc.jpg,0,1,1\n")
    (root / "camera.toml").write_text('model = "PINHOLE"\nwidth = 120\nheight = 90\nparams = [100, 100, 60, 45]\n')
    expected = read_capture(root)
    found = capture_of(find_photographs(root).photos)
    assert found.photos == expected.photos
    assert digest(found.priors) == digest(expected.priors)
    assert found.groups == expected.groups
    assert found.metric_source == expected.metric_source == "poses.csv"
    assert found.findings == expected.findings
    by_gps = capture_of(find_photographs(root).photos, without=["poses.csv"])
    assert by_gps.metric_source == "EXIF GPS"
    assert by_gps.origin == read_capture(root, sidecars=False).origin


def test_some_photographs_of_several_folders(photo_file: MakePhoto, tmp_path: Path) -> None:
    for folder in ("100", "101"):
        for name in ("a.jpg", "b.jpg", "c.jpg"):
            photo_file(f"{folder}/{name}")
        (tmp_path / "capture" / folder / "poses.csv").write_text(
            POSES + f"a.jpg,{folder},0,1\nb.jpg,{folder},1,1\nc.jpg,{folder},2,1\ngone.jpg,0,0,0\n"
        )
    (tmp_path / "capture" / "101" / "camera.toml").write_text(
        'model = "PINHOLE"\nwidth = 120\nheight = 90\nparams = [100, 100, 60, 45]\n'
    )
    found = [each for each in find_photographs(tmp_path / "capture").photos if each.photo.name != "b.jpg"]
    capture = capture_of(found)
    assert capture.names == ("100/a.jpg", "100/c.jpg", "101/a.jpg", "101/c.jpg")
    assert capture.folder == tmp_path / "capture"
    again = capture_of(found[::-1])
    assert digest(again.priors) == digest(capture.priors)
    assert replace(again, priors=capture.priors) == capture
    assert tuple(capture.priors["101/c.jpg"].position) == (101.0, 2.0, 1.0)
    assert capture.findings == ()  # lines about other plots' photographs are no one's concern here
    assert sorted(group.photos for group in capture.groups) == [("100/a.jpg", "100/c.jpg"), ("101/a.jpg", "101/c.jpg")]
    assert {group.source for group in capture.groups} == {"camera.toml", "self-calibrated"}
    assert len({group.key for group in capture.groups}) == 2
    assert capture.group_of("101/a.jpg").source == "camera.toml"
