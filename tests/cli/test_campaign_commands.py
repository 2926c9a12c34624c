"""fieldkit campaign init, show and export, and where fieldkit evaluate puts its results."""

import json
from pathlib import Path

import pytest

from fieldkit.campaign import Visit, read_campaign
from fieldkit.campaign.reading import keep_visit
from fieldkit.cli.main import main
from fieldkit.evaluation.rasters import Rasters
from tests.campaign.examples import campaign_folder, field

FIELD = field(1, 2)


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def answer(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> dict:
    assert main([*arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def test_init_takes_the_settings(place, capsys, monkeypatch) -> None:
    campaign_folder(place, FIELD)
    given = "--plan sources/plan.json --site sources/site.toml --fidelity fine --mask none --bounds -1,-1,0,1,1,2"
    arguments = [*given.split(), "--seed", "7"]
    made = answer(capsys, "campaign", "init", "new", *arguments, "--vehicle", "ardupilot-pitch")
    assert made == {"output": "new", "campaign": "new", "plots": ["r1c1", "r1c2"], "stations": 8, "references": []}
    found = read_campaign(place / "new")
    settings = found.evaluation.reconstruction
    assert (settings.fidelity, settings.mask, settings.seed) == ("fine", "none", 7)
    assert settings.bounds.upper == (1, 1, 2)
    assert answer(capsys, "campaign", "init", "new", *arguments, code=2)["error"]["type"] == "UsageError"
    assert not found.evaluation.rasters
    answer(capsys, "campaign", "init", "maps", *arguments, "--rasters", "--gsd", "0.01")
    assert read_campaign(place / "maps").evaluation.wanted_rasters == Rasters(0.01)
    with monkeypatch.context() as without:  # found out before anything is computed
        without.setattr("importlib.util.find_spec", lambda name: None)
        error = answer(capsys, "evaluate", ".", "--campaign", "maps", code=2)["error"]
        assert error["message"] == "rasters need the extra 'geo'"
    error = answer(capsys, "campaign", "init", "x", *arguments, "--gsd", "0.01", code=2)["error"]
    assert "rasters = true" in error["message"]
    error = answer(capsys, "campaign", "init", "x", *arguments, "--reference", "nowhere=x", code=2)["error"]
    assert "names no plot" in error["message"]
    error = answer(capsys, "campaign", "init", "x", *arguments, "--reference", "r1c1=x", code=3)["error"]
    assert error["path"].endswith("x")
    error = answer(capsys, "campaign", "init", "x", "--plan", "no.json", "--site", "sources/site.toml", code=3)["error"]
    assert error["path"] == "no.json"
    assert not (place / "x").exists()


def test_show_and_export_find_the_campaign_about_the_folder(place, capsys, monkeypatch) -> None:
    folder = campaign_folder(place, FIELD)
    visit = Visit(plot="r1c1", date="2026-06-18", chamfer_m=0.01, notes=("[bold]",), no_rasters="[bold]")
    keep_visit(folder, visit)
    for arguments in (["show"], ["export", "-o", "out.csv"]):
        assert answer(capsys, "campaign", *arguments, code=2)["error"]["message"] == "which campaign?"
    (folder / "deep").mkdir()
    monkeypatch.chdir(folder / "deep")
    assert answer(capsys, "campaign", "show")["ranking"] == {
        "2026-06-18": [
            {"rank": 1, "tied": False, "plot": "r1c1", "chamfer_m": 0.01, "predicted": False, "noise_m": 0.001645}
        ]
    }
    assert main(["campaign", "show"]) == 0
    assert "r1c1" in capsys.readouterr().out
    written = answer(capsys, "campaign", "export", "-o", "out.gpkg")
    assert written == {"output": "out.gpkg", "format": "gpkg", "visits": 1, "plots": 2}
    assert Path("out.gpkg").is_file()
    assert answer(capsys, "campaign", "export", "-o", "out.gpkg", code=2)["error"]["path"] == "out.gpkg"
    error = answer(capsys, "campaign", "export", "-o", "maps", "--rasters", code=2)["error"]
    assert error["message"] == "no visit has rasters: no rasters of r1c1 2026-06-18: [bold]"
    assert not Path("maps").exists()


def test_where_evaluate_puts_its_results(place, capsys, monkeypatch) -> None:
    folder = campaign_folder(place, FIELD)
    (place / "photos").mkdir()
    error = answer(capsys, "evaluate", "photos", code=2)["error"]
    assert "--campaign" in error["remedy"]
    error = answer(capsys, "evaluate", "photos", "-o", "out", "--campaign", "season", code=2)["error"]
    assert "its own folder" in error["message"]
    # Also a value that is the default is one that campaign.toml has to say.
    options = ("--fidelity standard", "--refine", "--seed 0", "--reference .", "--plan .", "--rasters --gsd 0.01")
    for option in options:
        error = answer(capsys, "evaluate", "photos", "--campaign", "season", *option.split(), code=2)["error"]
        assert error["message"].startswith(option.split()[0])
        assert "campaign.toml" in error["remedy"]
    error = answer(capsys, "evaluate", "photos", "--campaign", "season", "--log", ".", code=2)["error"]
    assert "--log" in error["message"]
    assert answer(capsys, "evaluate", "photos", "--campaign", "photos", code=3)["error"]["path"].endswith("photos")
    monkeypatch.chdir(folder)
    assert answer(capsys, "evaluate", "../photos", code=3)["error"]["message"].startswith("there are no usable photo")
