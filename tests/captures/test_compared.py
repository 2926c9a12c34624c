"""Facts that have two sources: positions of files and the photographs' own GPS, copies, several places."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fieldkit.captures import GeoTag, Photo, read_capture
from fieldkit.captures.compared import against_gps, several_places
from fieldkit.errors import MetadataError
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.geometry.priors import PosePrior
from tests.captures.photographs import MakePhoto, exif_block, gps_tags

FRAME = LocalFrame(52.0, 13.0, 100.0)
RING = np.array([(12.0 * np.cos(a), 12.0 * np.sin(a), 20.0) for a in np.linspace(0, 5.5, 12)])
EAST = np.array([13.0, 0.0, 0.0])


def taken(places: np.ndarray, height_m: float | None = None) -> list[Photo]:
    """Photographs whose GPS says these places about FRAME."""
    degrees = zip(*FRAME.to_geodetic(places), strict=True)
    tags = [GeoTag(float(a), float(b), float(c), relative_altitude_m=height_m) for a, b, c in degrees]
    bare = Photo(Path("a.jpg"), "a.jpg", 4000, 3000, "JPEG", "")
    return [replace(bare, name=f"{k}.jpg", geotag=tag) for k, tag in enumerate(tags)]


def priors(places: np.ndarray) -> dict[str, PosePrior]:
    return {f"{k}.jpg": PosePrior(place, 0.1) for k, place in enumerate(places)}


def turned(places: np.ndarray, degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return places @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("moved", "origin", "doubted"),
    [
        (RING + np.array([3.0, -4.0, 30.0]), FRAME, False),  # a receiver's error, another height
        (RING + np.array([60.0, 0.0, 0.0]), FRAME, True),  # another plot, or another datum
        (turned(RING, 70.0) + np.array([500.0, 200.0, 0.0]), None, False),  # a frame of its own
        (1.4 * turned(RING, 70.0), None, False),
        (np.roll(RING, 4, axis=0)[::-1] * [1.0, 2.0, 1.0], None, True),  # others' poses under these names
    ],
)
def test_positions_and_gps(moved: np.ndarray, origin: LocalFrame | None, doubted: bool) -> None:
    noise = np.random.default_rng(1).normal(0, 2, RING.shape)
    found = against_gps(taken(RING + noise), priors(moved), origin, "geo.txt")
    assert [finding.code for finding in found] == ["positions-apart"] * doubted
    if doubted and origin is not None:
        assert re.search("(59|60|61) m from their own GPS", found[0].message)


@pytest.mark.parametrize("factor", [1000.0, 100.0, 3.2808, 0.001])
def test_gps_tells_the_unit(factor: float) -> None:
    noise = np.random.default_rng(0).normal(0, 1.0, RING.shape)
    assert [f.code for f in against_gps(taken(RING + noise), priors(factor * RING), None, "")] == ["unit-suspicious"]
    assert against_gps(taken(RING / 50 + noise), priors(factor * RING / 50), None, "") == []  # a small rig


@pytest.mark.parametrize(("metres", "said"), [(2_000.0, "2,000 m"), (200_000.0, "200 km")])
def test_positions_of_another_field_are_refused(metres: float, said: str) -> None:
    with pytest.raises(MetadataError, match=f"puts the photographs {said} from their own GPS") as caught:
        against_gps(taken(RING), priors(RING + np.array([metres, 0.0, 0.0])), FRAME, "geo.txt")
    assert "move it away" in caught.value.remedy


def test_geo_txt_with_the_latitude_first(photo_file: MakePhoto) -> None:
    places, lines = FRAME.to_geodetic(RING[:4]), ["EPSG:4326"]
    for k, (latitude, longitude, height) in enumerate(zip(*places, strict=True)):
        folder = photo_file(f"{k}.jpg", exif=exif_block(gps=gps_tags(latitude, longitude, height))).parent
        lines.append(f"{k}.jpg {latitude:.8f} {longitude:.8f} {height:.3f}")
    (folder / "geo.txt").write_text("\n".join(lines))
    with pytest.raises(MetadataError, match="latitude and longitude look swapped") as caught:
        read_capture(folder)
    assert caught.value.path == folder / "geo.txt"
    lines[1:] = [" ".join([a, c, b, d]) for a, b, c, d in map(str.split, lines[1:])]
    (folder / "geo.txt").write_text("\n".join(lines))
    assert read_capture(folder).metric_source == "geo.txt"


@pytest.mark.parametrize(
    ("places", "height_m", "apart"),
    [
        (np.vstack([RING / 5, RING / 5 + EAST]), 3.0, "2 places, 13 m"),
        (np.vstack([RING / 5, RING / 5 + EAST, RING / 5 + np.array([0.0, 20.0, 0.0])]), 3.0, "3 places, 13 m"),
        (np.vstack([RING / 5, RING / 5 + EAST]), None, "2 places, 13 m"),
        (np.vstack([RING / 5, RING / 5 + EAST]), 20.0, ""),  # pictures overlap
        (np.vstack([RING / 5, RING[:2] + EAST]), 3.0, ""),  # two on the way
        (np.array([(15.0 * i, 40.0 * j, 30.0) for i in range(4) for j in range(3)]), 30.0, ""),  # a survey's lines
        (RING, 3.0, ""),
    ],
)
def test_one_folder_of_several_places(places: np.ndarray, height_m: float | None, apart: str) -> None:
    found = several_places(taken(places, height_m), priors(places))
    assert [finding.code for finding in found] == ["several-places"] * bool(apart)
    assert all(f"of {apart} apart" in finding.message for finding in found)


def test_photographs_that_were_saved_again_are_left_out(photo_file: MakePhoto) -> None:
    """One taken in the same second, and one numbered on, are others."""
    exif = exif_block(detail={0x9003: "2026:06:30 09:00:00"}, gps=gps_tags(52.0, 13.0))
    first = photo_file("DJI_0001.JPG", seed=1, size=(1200, 900), exif=exif)
    for name, size, quality in (("DJI_0001-edited.jpg", (1200, 900), 70), ("small.jpg", (800, 600), 90)):
        with Image.open(first) as image:
            image.resize(size).save(first.with_name(name), quality=quality, exif=exif)
    for name, quality in (("sent.jpg", 92), ("IMG-20260702-WA0007.jpg", 90)):  # messengers leave no time and place
        with Image.open(first) as image:
            image.resize((800, 600)).save(first.with_name(name), quality=quality)
    photo_file("other.jpg", seed=2, size=(1200, 900), exif=exif)
    photo_file("untimed.jpg", seed=3, size=(1200, 900))
    photo_file("DJI_0002.JPG", seed=1, size=(1200, 900), exif=exif, quality=60)
    capture = read_capture(first.parent)
    said = {finding.subject: finding.message for finding in capture.findings if finding.code == "duplicate"}
    again = ("DJI_0001-edited.jpg", "small.jpg", "sent.jpg", "IMG-20260702-WA0007.jpg")
    assert said == dict.fromkeys(again, "DJI_0001.JPG again, saved by another program")
