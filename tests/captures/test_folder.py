"""What is a photograph and what is left out, by name."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from fieldkit.captures import Capture, find_mask, read_capture, read_image
from fieldkit.captures.folder import sniff_format
from fieldkit.errors import CaptureError
from tests.captures.photographs import MakePhoto, bomb_png, texture


def codes(capture: Capture) -> dict[str, str]:
    return {finding.subject: finding.code for finding in capture.findings}


def left_out(capture: Capture) -> dict[str, str]:
    return {finding.subject: finding.code for finding in capture.findings if finding.left_out}


def test_jpeg_png_and_tiff_are_read_in_natural_order(photo_file: MakePhoto) -> None:
    for name in ("IMG_10.jpg", "IMG_2.png", "IMG_1.tif", "img_3.JPEG"):
        folder = photo_file(name).parent
    capture = read_capture(folder)
    assert capture.names == ("IMG_1.tif", "IMG_2.png", "img_3.JPEG", "IMG_10.jpg")
    assert [photo.format for photo in capture.photos] == ["TIFF", "PNG", "JPEG", "JPEG"]
    assert {(photo.width, photo.height) for photo in capture.photos} == {(120, 90)}
    assert len({photo.sha256 for photo in capture.photos}) == 4
    assert capture.findings == ()


def test_the_content_decides_not_the_suffix(photo_file: MakePhoto) -> None:
    photo_file("really_png.jpg", format="PNG")
    photo_file("no_suffix", format="JPEG")
    folder = photo_file("a.jpg").parent
    (folder / "notes.txt").write_text("not a photograph")
    (folder / "letter.jpg").write_text("Dear Sir or Madam, this is no photograph at all, but text.")
    capture = read_capture(folder)
    assert capture.names == ("a.jpg", "no_suffix", "really_png.jpg")
    assert codes(capture) == {
        "really_png.jpg": "wrong-suffix",
        "no_suffix": "wrong-suffix",
        "letter.jpg": "not-an-image",
    }


def test_an_images_folder_is_used_when_nothing_lies_beside_it(photo_file: MakePhoto) -> None:
    folder = photo_file("images/a.jpg").parent.parent
    (folder / "poses.csv").write_text("image,x_m,y_m,z_m\na.jpg,1,2,3\n")
    capture = read_capture(folder)
    assert capture.names == ("a.jpg",)
    assert capture.image_folder == folder / "images"
    assert tuple(capture.priors["a.jpg"].position) == (1.0, 2.0, 3.0)
    (folder / "poses.csv").unlink()
    photo_file("b.jpg")
    assert read_capture(folder).names == ("b.jpg",)


def test_masks_are_found_beside_the_photograph_and_in_masks(photo_file: MakePhoto) -> None:
    a, b, c, d = (photo_file(f"{name}.jpg") for name in "abcd")
    mask_a, mask_b, mask_c = photo_file("a.mask.png"), photo_file("masks/b.jpg.png"), photo_file("masks/c.png")
    assert [find_mask(path) for path in (a, b, c, d)] == [mask_a, mask_b, mask_c, None]


def test_damaged_files_are_left_out_by_name(photo_file: MakePhoto) -> None:
    folder = photo_file("good.jpg").parent
    whole = photo_file("cut.jpg").read_bytes()
    (folder / "cut.jpg").write_bytes(whole[: len(whole) * 2 // 3])
    (folder / "zeros.jpg").write_bytes(whole[: len(whole) // 2] + bytes(len(whole) - len(whole) // 2))
    (folder / "cut_in_header.jpg").write_bytes(whole[:30])
    (folder / "empty.jpg").write_bytes(b"")
    png = photo_file("cut.png").read_bytes()
    (folder / "cut.png").write_bytes(png[: len(png) // 2])
    (folder / "bit.png").write_bytes(png[:500] + bytes([png[500] ^ 1]) + png[501:])
    tiff = photo_file("cut.tif").read_bytes()
    (folder / "cut.tif").write_bytes(tiff[: len(tiff) // 2])
    capture = read_capture(folder)
    assert capture.names == ("good.jpg",)
    assert left_out(capture) == {
        "cut.jpg": "truncated",
        "zeros.jpg": "truncated",
        "cut_in_header.jpg": "truncated",
        "empty.jpg": "empty-file",
        "cut.png": "truncated",
        "bit.png": "truncated",
        "cut.tif": "truncated",
    }


def raw_tiff(bits: int, kind: int) -> bytes:
    """A grey TIFF of 8 × 6 pixels with numbers of so many bits (kind 1 unsigned, 2 signed, 3 floating point)."""
    data = bytes(range(8 * bits // 8)) * 6
    tags = [(256, 8), (257, 6), (258, bits), (259, 1), (262, 1), (273, 8), (277, 1), (278, 6), (279, len(data))]
    entries = b"".join(struct.pack("<HHIHH", tag, 3, 1, value, 0) for tag, value in [*tags, (339, kind)])
    return b"II*\0" + struct.pack("<I", 8 + len(data)) + data + struct.pack("<H", 10) + entries + bytes(4)


def test_tiffs_that_are_no_pictures_are_left_out(photo_file: MakePhoto) -> None:
    folder = photo_file("a.jpg").parent
    kinds = [(32, 3), (64, 3), (16, 3), (32, 1), (32, 2), (16, 2), (1, 1), (2, 1), (4, 1), (10, 1), (12, 1), (14, 1)]
    for bits, kind in kinds:
        (folder / f"{bits}_{kind}.tif").write_bytes(raw_tiff(bits, kind))
    temperatures = np.linspace(10, 40, 64, dtype=np.float32).reshape(8, 8)
    Image.fromarray(temperatures).save(folder / "thermal.tiff")
    Image.fromarray(np.arange(64, dtype=np.uint16).reshape(8, 8) * 60).save(folder / "dark.tif")
    Image.fromarray(np.arange(64, dtype=np.uint16).reshape(8, 8) * 1000).save(folder / "deep.tif")
    photo_file("plain.tif")
    (folder / "eight.tif").write_bytes(raw_tiff(8, 1))
    capture = read_capture(folder)
    assert set(capture.names) == {"a.jpg", "plain.tif"}
    names = [f"{bits}_{kind}.tif" for bits, kind in kinds] + ["thermal.tiff", "dark.tif"]
    # Pictures of one channel are read, but not among others in colour: the finding names the first.
    assert left_out(capture) == dict.fromkeys(names, "unsupported-format") | {"deep.tif": "other-camera"}
    for name in ("a.jpg", "plain.tif"):
        (folder / name).unlink()
    grey = read_capture(folder)
    assert set(grey.names) == {"deep.tif", "eight.tif"}
    for photo in grey.photos:
        assert read_image(photo).shape == (photo.height, photo.width, 3)


def test_a_decompression_bomb_is_not_decoded(photo_file: MakePhoto) -> None:
    folder = photo_file("a.jpg").parent
    bomb_png(folder / "bomb.png")
    capture = read_capture(folder)
    assert capture.names == ("a.jpg",)
    assert left_out(capture) == {"bomb.png": "too-large"}
    assert "900 Mpx" in capture.findings[0].message


def test_links_that_leave_the_folder_are_not_followed(photo_file: MakePhoto, tmp_path: Path) -> None:
    folder = photo_file("a.jpg").parent
    texture(77).save(tmp_path / "outside.jpg")
    (tmp_path / "outside.csv").write_text("secret,of,somebody,else\n")
    (folder / "out.jpg").symlink_to(tmp_path / "outside.jpg")
    (folder / "up.jpg").symlink_to("../outside.jpg")
    (folder / "broken.jpg").symlink_to("nowhere.jpg")
    (folder / "loop.jpg").symlink_to("loop.jpg")
    (folder / "poses.csv").symlink_to(tmp_path / "outside.csv")
    (folder / "inside.jpg").symlink_to("a.jpg")
    capture = read_capture(folder)
    assert capture.names == ("a.jpg",)
    outside = dict.fromkeys(("out.jpg", "up.jpg", "broken.jpg", "loop.jpg", "poses.csv"), "symlink-outside")
    assert left_out(capture) == {**outside, "inside.jpg": "duplicate"}


def test_a_name_that_is_no_text_is_left_out(photo_file: MakePhoto) -> None:
    good = photo_file("a.jpg")
    try:
        Path(os.fsdecode(os.fsencode(good.parent) + b"/b\xff.jpg")).write_bytes(texture(5).tobytes())
    except OSError:
        pytest.skip("this file system allows UTF-8 names only")
    capture = read_capture(good.parent)
    assert left_out(capture) == {"b\\udcff.jpg": "bad-name"}


@pytest.mark.parametrize(
    "halves", [("100MEDIA", "101MEDIA"), ("DCIM/100_0001", "DCIM/101_0001"), ("100MSDCF", "103MSDCF")]
)
def test_a_cards_folders_are_one_capture(photo_file: MakePhoto, halves: tuple[str, str]) -> None:
    for seed, half in enumerate(halves):
        for number in (1, 2):
            photo_file(f"{half}/DJI_000{number}.JPG", seed=10 * seed + number)
    folder = photo_file(f"{halves[1]}/DJI_0003.JPG").parent.parent
    (folder.parent if folder.name == "DCIM" else folder).joinpath("note.txt").write_text("no photograph")
    names = [f"{half.rpartition('/')[2]}/DJI_000{number}.JPG" for half in halves for number in (1, 2, 3)]
    names.remove(f"{halves[0].rpartition('/')[2]}/DJI_0003.JPG")
    rows = "".join(f"{name},{k},{k % 2},3\n" for k, name in enumerate(names))
    (folder / "poses.csv").write_text(f"image,x_m,y_m,z_m\n{rows}")
    (folder / names[0]).parent.joinpath("geo.txt").write_text("EPSG:4326\nDJI_0001.JPG 13.0 52.0 30\n")
    for place in {folder, folder.parent if folder.name == "DCIM" else folder}:
        capture = read_capture(place)
        assert list(capture.names) == names
        assert len(capture.groups) == 1
        assert [tuple(capture.priors[name].position) for name in names] == [(k, k % 2, 3.0) for k in range(len(names))]
        assert codes(capture) == {f"{names[0].partition('/')[0]}/geo.txt": "sidecar-unused"}


@pytest.mark.parametrize("what", ["missing", "file", "empty", "only bad"])
def test_unusable_folders_say_what_to_do(what: str, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    if what == "file":
        folder.write_text("")
    elif what != "missing":
        folder.mkdir()
    if what == "only bad":
        (folder / "a.jpg").write_bytes(b"")
    with pytest.raises(CaptureError) as caught:
        read_capture(folder)
    assert caught.value.path == folder
    assert caught.value.remedy
    assert caught.value.exit_code == 3
    if what == "only bad":
        assert "a.jpg" in caught.value.message


@given(st.binary(max_size=64))
def test_sniffing_takes_any_bytes(head: bytes) -> None:
    sniff_format(head)
