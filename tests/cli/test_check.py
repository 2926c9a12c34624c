"""The check command: what it prints, its exit codes, and calls that cannot be."""

import json
from io import StringIO
from pathlib import Path

import cv2
import numpy as np
import pytest
from rich.console import Console

from fieldkit.cli.check import check_blocks
from fieldkit.cli.main import main
from fieldkit.fieldcheck.model import CheckReport, StationCheck
from fieldkit.figures.terminal import rendered
from fieldkit.geometry import Pose
from fieldkit.results.plan_file import plan_from_poses, save_plan
from fieldkit.sites.site_file import load_site
from tests.campaign.examples import field, plots_geojson


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The check of two photographs of noise with rows in poses.csv against a plan of three stations."""
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path / "cache"))
    poses = [Pose.look_at((np.sin(a), np.cos(a), 1.0), (0.0, 0.0, 0.2)) for a in (0.0, 0.5, 1.1)]
    save_plan(tmp_path / "plan.json", plan_from_poses(poses))
    folder = tmp_path / "plot"
    folder.mkdir()
    rows = ["image,x_m,y_m,z_m,yaw_deg,pitch_deg"]
    for k in (0, 2):
        noise = np.random.default_rng(k).integers(40, 200, (120, 160), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{k}.png"), noise)
        yaw, pitch, _ = poses[k].yaw_pitch_roll_deg()
        rows.append(f"{k}.png,{','.join(f'{v:.4f}' for v in poses[k].center)},{yaw:.3f},{pitch:.3f}")
    (folder / "poses.csv").write_text("\n".join(rows), "utf-8")
    return ["check", str(folder), "--plan", str(tmp_path / "plan.json")]


def test_json_is_one_object(call: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*call, "--json"]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert printed.err == ""
    assert found["ok"] is False
    assert 2 in found["fly_again"]
    assert {"code": "missing", "station": 2}.items() <= next(f for f in found["findings"] if f["station"] == 2).items()
    assert [row["photograph"] for row in found["stations"]] == ["0.png", "", "2.png"]
    assert found["plots"][0]["summary"] == found["summary"]
    assert main(call) == 0
    printed = capsys.readouterr().out
    assert "it has no photograph" in printed
    assert " of : " not in printed
    assert main(call[:2]) == 0
    assert "no --plan" in capsys.readouterr().out


def test_a_narrow_terminal_shows_stations_names_and_verdicts() -> None:
    rows = tuple(
        StationCheck(k, f"0000{k}_rgb.jpg", "fine", 1.4, 1.0, -0.1, 0.0, 0.05, 1.2, 365, (8, 9, 11, 12))
        for k in (10, 11)
    )
    console = Console(width=80, file=StringIO(), color_system=None)
    for shown in rendered(check_blocks(CheckReport("plot_7", 2, rows, ()))):
        console.print(shown)
    text = console.file.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    for words in ("station", "verdict", "   11  ", "000010_rgb.jpg", "365: 9,", "fine"):
        assert words in text
    assert "…" not in text


def test_plots_of_a_file_of_their_own(call, capsys, tmp_path) -> None:
    """Whoever exports with --site and --plots checks with both, and flies again with them."""
    field_of_two = field(1, 2)
    (tmp_path / "plots.geojson").write_text(plots_geojson(field_of_two))
    (tmp_path / "site.toml").write_text(
        "format = 1\n[home]\nlatitude_deg = 52.2957\nlongitude_deg = 10.437\namsl_m = 40.0\n"
    )
    site = ["--site", str(tmp_path / "site.toml")]
    plots = ["--plots", str(tmp_path / "plots.geojson"), "--plot-id", "name"]
    assert main([*call, *site]) == 3
    assert "--plots takes such a file" in capsys.readouterr().err
    assert main([*call, *site, *plots, "--plot", "r9c9"]) == 2
    assert "Its plots are r1c1 and r1c2" in capsys.readouterr().err
    again = ["--vehicle", "px4-gimbal", "-o", str(tmp_path / "again.plan"), "--adjust", "--plant-height", "0.3"]
    assert main([*call, *site, *plots, "--plot", "r1c2", *again]) == 0
    assert 'ids from "name"' in capsys.readouterr().err
    assert json.loads((tmp_path / "again.mission.json").read_text("utf-8"))["plots"][0]["name"] == "r1c2"


def test_no_mission_for_nothing_is_said(call, capsys, tmp_path) -> None:
    Path(call[1], "poses.csv").unlink()  # which station is missing, nothing tells
    site = Path(__file__).parents[2] / "missions" / "sites" / "example.toml"
    call += ["--site", str(site), "--plot", load_site(site).plots[0].name]
    assert main([*call, "--vehicle", "px4-gimbal", "-o", str(tmp_path / "again.plan")]) == 0
    assert "again.plan was not written" in " ".join(capsys.readouterr().out.split())
    assert not (tmp_path / "again.plan").exists()
