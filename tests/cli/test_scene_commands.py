"""fieldkit scene and fieldkit simulate."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fieldkit.captures import read_capture
from fieldkit.cli.main import main
from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit.scenes.scene_file import read_scene
from fieldkit_sim.generator import new_scene
from fieldkit_sim.simulation import ring

TINY = """\
format = 1
[plot.soil]
core_m = 0.5
spacing_m = 0.02
texture_px = 256
stones = 10
residues = 5
[[plot.plants]]
seed = 3
leaves = 6
[camera]
model = "PINHOLE"
width = 200
height = 150
params = [170, 170, 100, 75]
"""


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    (tmp_path / "tiny.toml").write_text(TINY)
    return tmp_path / "tiny.toml"


class TestSceneNew:
    def test_writes_a_file(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        file = tmp_path / "plot.toml"
        assert main(["scene", "new", "--plants", "6", "--seed", "7", "--layout", "rows", "-o", str(file)]) == 0
        scene = read_scene(file)
        assert scene.plot == new_scene(6, 7, layout="rows").plot
        assert scene.name == "plot"
        assert "6 plants in" in capsys.readouterr().out
        assert main(["scene", "new", "-o", str(file)]) == 2
        assert "--overwrite" in capsys.readouterr().err
        assert main(["scene", "new", "-o", str(file), "--overwrite", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["plants"] == 3


class TestSceneShow:
    def test_lists(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["scene", "show", "--json"]) == 0
        scenes = json.loads(capsys.readouterr().out)["scenes"]
        assert scenes["case-3"]["plants"] == 6
        assert main(["scene", "show"]) == 0
        assert "tuning-6" in capsys.readouterr().out

    def test_draws(self, tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["scene", "show", str(tiny), "-o", str(tmp_path / "a.jpg"), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["triangles"] > 1_000
        image = np.asarray(Image.open(tmp_path / "a.jpg"), float)
        assert image.shape == (1200, 1600, 3)
        green = image[..., 1] - image[..., 2] > 25
        assert green[300:900, 400:1200].mean() > 0.02  # the plant fills the middle

    def test_errors(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (tmp_path / "bad.toml").write_text("format = 1\n[plot.soil]\nstone = 3\n")
        assert main(["scene", "show", str(tmp_path / "bad.toml")]) == 3
        error = capsys.readouterr().err
        assert error.startswith(f"Error: {tmp_path}/bad.toml: plot.soil.stone: is not a key of this format\n")
        assert main(["scene", "show", "case-9"]) == 3
        assert "Did you mean case-" in capsys.readouterr().err
        assert main(["scene", "show", "case-1", "-o", str(tmp_path / "a.tiff")]) == 2


class TestSimulate:
    def test_from_a_plan(self, tiny: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        save_plan(tmp_path / "plan" / "plan.json", plan_from_poses(ring(3, 1.2, 0.9)))
        arguments = ["simulate", str(tiny), "--plan", str(tmp_path / "plan"), "-o", str(tmp_path / "flight")]
        noise = ["--pose-noise", "0.02,1", "--blur", "0.004"]
        assert main([*arguments, *noise, "--seed", "4", "--json"]) == 0
        done = json.loads(capsys.readouterr().out)
        assert done["photographs"] == 3
        assert 0.005 < done["position_error_m"] < 0.1
        assert Path(done["truth"]) == tmp_path / "flight.truth.csv"
        capture = read_capture(tmp_path / "flight")
        assert {p.position_sigma_m for p in capture.priors.values()} == {0.02}
        centers = [capture.priors[p.name].position for p in capture.photos]
        np.testing.assert_allclose(np.array(centers), [p.center for p in ring(3, 1.2, 0.9)], atol=1e-5)
        assert main(arguments) == 2  # exists
        assert "flight: the result exists already" in capsys.readouterr().err
        # The truth of a capture that was moved away is kept as well.
        truth = (tmp_path / "flight.truth.csv").read_bytes()
        (tmp_path / "flight").rename(tmp_path / "moved")
        assert main([*arguments, "--seed", "5"]) == 2
        assert "flight.truth.csv: exists already" in capsys.readouterr().err
        assert (tmp_path / "flight.truth.csv").read_bytes() == truth
        assert not (tmp_path / "flight").exists()
        assert main([*arguments, "--seed", "5", "--overwrite"]) == 0
        assert (tmp_path / "flight.truth.csv").read_bytes() != truth

    def test_other_stations_and_sizes(self, tiny: Path, tmp_path: Path) -> None:
        (tmp_path / "poses.csv").write_text("image,x_m,y_m,z_m,yaw_deg,pitch_deg\na.jpg,0,-1.5,1,0,-30\n")
        burst = ["--ring", "2,1.5,1.0", "--burst", "2", "--interval", "1.5", "--vehicle", "dji-mini-4-pro"]
        for i, (stations, count) in enumerate(
            ((["--poses", str(tmp_path / "poses.csv")], 1), (burst, 4), (["--dense", "4"], 4))
        ):
            folder = tmp_path / str(i)
            assert main(["simulate", str(tiny), *stations, "--size", "100x75", "-o", str(folder)]) == 0
            photos = sorted(folder.glob("*.jpg"))
            assert len(photos) == count
            with Image.open(photos[0]) as photo:
                assert photo.size == (100, 75)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ([], "which stations?"),
            (["--ring", "3", "--dense", "4"], "which stations?"),
            (["--ring", "3,x"], "--ring: cannot be 3,x"),
            (["--survey", "8,80,99"], "--survey: not a survey"),
            (["--ring", "2.5"], "--ring: not a ring"),
            (["--ring", "3", "--pose-noise", "1"], "--pose-noise: cannot be 1"),
            (["--ring", "3", "--size", "big"], "--size: not a size"),
            (["--ring", "3", "--size", "100x100"], "--size: 100×100 has another shape"),
            (["--ring", "3", "--burst", "0"], "invalid value for '--burst'"),
            (["--ring", "3", "--blur", "2"], "invalid value for '--blur'"),
        ],
    )
    def test_wrong_usage(self, tiny, tmp_path, options, message, capsys) -> None:
        assert main(["simulate", str(tiny), *options, "-o", str(tmp_path / "a")]) == 2
        assert message in capsys.readouterr().err
        assert not (tmp_path / "a").exists()
