from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.rigs import uniform_subset
from fieldkit.captures import Capture, read_capture
from fieldkit.clouds import Volume
from fieldkit.geometry import Intrinsics, Pose, Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.pipeline import KnownPlot, place
from fieldkit.reconstruction.result import SparseResult
from fieldkit.reconstruction.settings import FeatureSettings, ReconstructionSettings
from fieldkit.runtime.context import Context
from tests.reconstruction.test_unknown_focal_length import codes, photographed

LOW_M = 3.0
BASIL = Intrinsics("SIMPLE_RADIAL", 2304, 1296, (1718.6, 1152.0, 648.0, 0.0257))


def flown(folder: Path, corners: list[tuple[float, float]], accuracy_m: float = 0.02) -> Capture:
    """Four photographs with known poses about each of the places, which see nothing of the others'."""
    offsets = [(0.0, 0.0), (1.2, 0.0), (0.0, 1.0), (1.2, 1.0)]
    poses = [
        Pose.from_yaw_pitch((x + dx, y + dy, LOW_M + 0.1 * k), 20.0 * k, -85.0)
        for x, y in corners
        for k, (dx, dy) in enumerate(offsets)
    ]
    photographed(folder, poses, equivalent=20)
    lines = ["image,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg,accuracy_m"]
    for k, pose in enumerate(poses):
        values = [*pose.center, *pose.yaw_pitch_roll_deg(), accuracy_m]
        lines.append(f"{k}.jpg,{','.join(repr(float(value)) for value in values)}")
    (folder / "poses.csv").write_text("\n".join(lines))
    return read_capture(folder)


def mapped(capture: Capture, settings: ReconstructionSettings, plot: KnownPlot | None = None) -> SparseResult:
    return place(capture, settings, [], Context(), plot)[0]


@pytest.mark.parametrize(("corners", "told"), [([(0.0, 0.0)], []), ([(-3.0, 0.0), (6.0, 0.0)], ["weakly-tied"])])
def test_groups_without_a_pair_across_are_named(tmp_path, corners, told) -> None:
    result = mapped(flown(tmp_path / "flight", corners), ReconstructionSettings())
    assert result.right == 4 * len(corners)
    assert [code for code in codes(result) if code == "weakly-tied"] == told
    if told:
        message = next(finding.message for finding in result.findings if finding.code == "weakly-tied")
        assert "4.jpg, 5.jpg, 6.jpg and 7.jpg could lie" in message
        assert "take photographs between them and the others" in message


def with_blank(capture: Capture, names: list[str]) -> Capture:
    """The same where these photographs show nothing, and no roll is stated."""
    folder = capture.folder
    for name in names:
        with Image.open(folder / name) as photo:
            Image.new("RGB", photo.size, "gray").save(folder / name, exif=photo.getexif())
    poses = folder / "poses.csv"
    poses.write_text(poses.read_text().replace("roll_deg", "note"))
    return read_capture(folder)


@pytest.mark.parametrize(("accuracy_m", "stated"), [(0.003, ["3.jpg"]), (0.02, [])])
def test_without_matches_a_stated_pose_counts_that_the_others_show_to_be_good(
    tmp_path: Path, accuracy_m: float, stated: list[str]
) -> None:
    capture = with_blank(flown(tmp_path / "flight", [(0.0, 0.0)], accuracy_m), ["3.jpg"])
    result = mapped(capture, ReconstructionSettings())
    assert [image.name for image in result.images if image.stated] == stated
    assert result.right == 3 + len(stated)
    assert set(result.groups) >= set(result.poses)
    if not stated:
        reason = next(image.reason for image in result.images if image.name == "3.jpg")
        assert reason.startswith("loose: too few features; its record tells its place to 4 cm and its angles to")


def test_two_positions_place_no_model(tmp_path: Path) -> None:
    capture = with_blank(flown(tmp_path / "flight", [(0.0, 0.0)]), ["2.jpg", "3.jpg"])
    result = mapped(capture, ReconstructionSettings())
    assert (result.registered, result.right) == (2, 0)


def basil(data_folder: Path, names: tuple[str, ...], kept: float, draw: int) -> SparseResult:
    capture = read_capture(data_folder / "basil_rig" / "images")
    group = replace(capture.groups[0], photos=names)
    priors = {name: capture.priors[name] for name in names}
    photos = tuple(photo for photo in capture.photos if photo.name in names)
    capture = replace(capture, photos=photos, groups=(group,), priors=priors)
    source = SourceFrame("poses.csv", None, Similarity.identity())
    plot = KnownPlot(source, Volume((-1, -1, -1), (1, 1, 1)), None, {group.key: BASIL})
    features = FeatureSettings(kept=float(np.sqrt(kept)), draw=draw)
    return mapped(capture, ReconstructionSettings(features=features), plot)


@pytest.mark.slow
def test_a_ring_with_gaps_that_bends_is_told_and_an_even_one_is_not(data_folder: Path) -> None:
    """With half of the matches withheld the centres are up to 12 mm off, and all within the bound of 20 mm."""
    names = sorted(photo.name for photo in read_capture(data_folder / "basil_rig" / "images").photos)
    # Two opposite gaps of 55°.
    places = np.concatenate([np.linspace(27.5, 152.5, 7), np.linspace(207.5, 332.5, 6)])
    gapped = [names[(round(place * len(names) / 360.0) + 3) % len(names)] for place in places]
    bent = basil(data_folder, tuple(sorted(gapped)), 0.5, 3)
    assert "weakly-tied" in codes(bent)
    even = basil(data_folder, tuple(sorted(uniform_subset(names, 13, 3))), 1.0, 0)
    assert even.right == 13
    assert codes(even) == []
