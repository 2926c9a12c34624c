"""Orientations that the camera recorded wrongly: found out, left out, and said so."""

import csv
import shutil
from pathlib import Path

import pytest

from benchmarks.rigs import RIG_FILE, read_rig, uniform_subset
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.reconstruction.pipeline import place
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (lambda yaw, pitch, k: (yaw, pitch + 90.0), "pitch 0 is straight down"),
        (lambda yaw, pitch, k: (yaw + 180.0, pitch), "yaw is off by 180°"),
        (lambda yaw, pitch, k: (yaw, pitch + 90.0 * (k % 2)), "follow no one convention"),
    ],
)
def test_angles_of_another_convention_are_read_by_it(photographs, built, write, said) -> None:
    folder = photographs()
    table = [line.split(",") for line in (folder / "poses.csv").read_text("utf-8").splitlines()]
    yaw, pitch = table[0].index("yaw_deg"), table[0].index("pitch_deg")
    for k, row in enumerate(table[1:]):
        row[yaw], row[pitch] = map(str, write(float(row[yaw]), float(row[pitch]), k))
    (folder / "poses.csv").write_text("\n".join(map(",".join, table)) + "\n", "utf-8")
    sparse, _ = place(read_capture(folder), ReconstructionSettings(), [], Context(StageCache(built.cache)))
    # What a mixture leaves of the eight is oriented by its matches.
    assert sparse.right >= (7 if "no one" in said else 8)
    notes = " ".join(sparse.frame.notes)
    assert said in notes


@pytest.mark.slow
def test_a_real_flight_with_six_turned_photographs(data_folder: Path, tmp_path: Path) -> None:
    capture = read_capture(data_folder / "drone_trees" / "images")
    sparse, _ = place(capture, ReconstructionSettings(), [], Context(StageCache(tmp_path), Silent(), 2))
    assert sparse.right == len(capture.photos) == 18
    assert sparse.frame.rms_m <= 0.6
    turned = ", ".join(f"DJI_{number:04d}.jpg" for number in range(24, 30))
    assert any(turned in note for note in sparse.frame.notes)


# Few photographs of a plant with positions and nothing else: no angles, no calibration.


@pytest.mark.slow
@pytest.mark.parametrize("phase", range(6))
@pytest.mark.parametrize("name", ["basil_rig", "arabidopsis_rig"])
def test_thirteen_even_views_come_out_right(data_folder: Path, tmp_path: Path, name: str, phase: int) -> None:
    """At phase 5 the blind model that calibrates basil's camera fits four positions, turned by half a circle.

    Of arabidopsis's pairs half are wrong.
    """
    rig, folder = data_folder / name, tmp_path / "views"
    folder.mkdir()
    with (rig / "images" / "poses.csv").open(newline="") as file:
        rows = {row["image"]: row for row in csv.DictReader(file)}
    chosen = uniform_subset(list(read_rig(rig / RIG_FILE)), 13, phase)
    for photo in chosen:
        shutil.copy(rig / "images" / photo, folder / photo)
    with (folder / "poses.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, ["image", "x_m", "y_m", "z_m", "accuracy_m"], extrasaction="ignore")
        table.writeheader()
        table.writerows(rows[photo] for photo in chosen)
    sparse, _ = place(read_capture(folder), ReconstructionSettings(), [], Context(StageCache(tmp_path / "c")))
    assert sparse.right == 13
