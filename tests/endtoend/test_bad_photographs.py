"""Photographs that cannot be used: what is wrong, which file, what to do, the exit code, and nothing left over."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from fieldkit.cli.main import main
from tests.captures.photographs import bomb_png
from tests.endtoend.commands import DRAFT, CommandLine, partial_folders

Photographs = Callable[..., Path]


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def no_images(photographs: Photographs) -> None:
    Path("photos").mkdir()
    Path("photos/readme.txt").write_text("the photographs are on the other disk")


def one_image(photographs: Photographs) -> None:
    photographs(count=1)
    Path("photos/zero.jpg").touch()


def truncated(photographs: Photographs) -> None:
    photo = photographs(count=1, poses=False) / "IMG_0001.jpg"
    photo.write_bytes(photo.read_bytes()[:9000])


def no_pose_fits(photographs: Photographs) -> None:
    folder = photographs(count=2)
    (folder / "poses.csv").write_text("image,x_m,y_m,z_m\nDJI_0001.jpg,0,0,1\nDJI_0002.jpg,1,0,1\n")


@pytest.mark.parametrize("command", ["reference", "evaluate"])
@pytest.mark.parametrize(
    ("make", "code", "kind", "message", "remedy", "path"),
    [
        (no_images, 3, "CaptureError", "there are no photographs in this folder", "", "photos"),
        (one_image, 4, "ReconstructionError", "needs at least two photographs", "", "photos"),
        (truncated, 3, "CaptureError", "IMG_0001.jpg: the file is cut short", "Copy the photographs again", "photos"),
        (
            no_pose_fits,
            3,
            "MetadataError",
            "names no photograph of the folder",
            "Write the photographs' file names",
            "photos/poses.csv",
        ),
    ],
)
def test_nothing_usable(make, code, kind, message, remedy, path, command, place, photographs, capsys) -> None:
    """A kind of each; every kind of bad file is a case of tests/captures/test_folder.py."""
    make(photographs)
    assert main([command, "photos", "-o", "out", *DRAFT, "--json"]) == code
    output = capsys.readouterr()
    assert "Traceback" not in output.err
    found = json.loads(output.out)
    if command == "evaluate" and code == 4:  # a plot that does not reconstruct is a result
        (plot,) = found["plots"]
        error = plot["error"] | {"findings": plot["findings"]}
        assert "photos" in error["message"]
    else:
        error = found["error"]
        assert error["path"] in (path, str(place / path))
        line, advice = output.err[output.err.index("Error: ") :].splitlines()[:2]
        assert f"{path}: " in line
        assert message in line
        assert advice == f"  {error['remedy']}"
        assert not Path("out").exists()
    assert error["type"] == kind
    assert message in error["message"]
    assert error["remedy"]
    assert remedy in error["remedy"]
    names = [finding["name"] for finding in error.get("findings", [])]
    assert ("zero.jpg" in names) == (make is one_image)
    assert partial_folders(place) == []


@pytest.mark.slow
def test_bad_files_among_good_ones(line: CommandLine, photographs: Photographs) -> None:
    """The good ones are used, whatever their names; each bad one is named in the report, and none is decoded."""
    folder = photographs()
    long_name = f"IMG_0004{'x' * 243}.jpg"
    strange_name = 'IMG_0003 ähre 玉米 №3, "quoted" [1].jpg'
    table = (folder / "poses.csv").read_text("utf-8").splitlines()
    for number, name in ((3, strange_name), (4, long_name)):
        (folder / f"IMG_{number:04d}.jpg").rename(folder / name)
        quoted = '"' + name.replace('"', '""') + '"'
        table[number] = table[number].replace(f"IMG_{number:04d}.jpg", quoted)
    (folder / "poses.csv").write_text("\n".join(table) + "\n", "utf-8")
    good = (folder / "IMG_0001.jpg").read_bytes()
    (folder / "truncated.jpg").write_bytes(good[: len(good) // 2])
    (folder / "zero.jpg").touch()
    (folder / "text.jpg").write_text("not a photograph")
    (folder / "copy.jpg").write_bytes(good)
    (folder / "video.mp4").write_bytes(b"\0\0\0\x18ftypmp42")
    bomb_png(folder / "huge.png")
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    done, peak_bytes = line.run_measured("reference", "photos", "-o", "out", *DRAFT, "--json")
    assert done.code == 0, done.err
    report = done.json
    assert (report["images"], report["registered"], report["right"]) == (8, 8, 8)
    left_out = {finding["name"]: finding["code"] for finding in report["findings"] if finding["left_out"]}
    assert left_out == {
        "truncated.jpg": "truncated",
        "zero.jpg": "empty-file",
        "text.jpg": "not-an-image",
        "copy.jpg": "duplicate",
        "huge.png": "too-large",
    }
    saved = json.loads((line.folder / "out" / "reference.json").read_text("utf-8"))
    assert {long_name, strange_name} <= {image["name"] for image in saved["image_reports"] if image["right"]}
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    if sys.platform == "linux":
        assert peak_bytes < 2e9


def write_mask(path: Path, photograph: Path, share: float = 1.0) -> None:
    """A mask image with a white window in the middle."""
    with Image.open(photograph) as image:
        size = image.size
    mask = Image.new("L", size, 0)
    corner = tuple(round(side * (1 - share) / 2) for side in size)
    mask.paste(255, (*corner, *(side - c for side, c in zip(size, corner, strict=True))))
    mask.save(path)


def test_masks_from_files_that_are_not_there(line: CommandLine, photographs: Photographs) -> None:
    """Told before anything is computed."""
    folder = photographs()
    (folder / "masks").mkdir()
    for path in sorted(folder.glob("*.jpg"))[2:]:
        write_mask(folder / "masks" / f"{path.stem}.png", path)
    done = line.run("reference", "photos", "-o", "out", "--mask", "file", "--json", code=3)
    assert "no mask image for IMG_0001.jpg and IMG_0002.jpg" in done.error["message"]
    assert "--mask exg" in done.error["remedy"]
    assert line.entries() == 0
    assert not (line.folder / "out").exists()
