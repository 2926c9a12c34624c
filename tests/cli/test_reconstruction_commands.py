"""The options of reference and evaluate, before any photograph is read."""

import json
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldkit.cli.main import main
from fieldkit.cli.reconstruction_options import parse_bounds
from fieldkit.errors import UsageError
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.reconstruction.settings import ReconstructionSettings


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FIELDKIT_CACHE", str(tmp_path / "cache"))


def test_settings() -> None:
    asked = EvaluationSettings(
        mapping="prior", fidelity="fine", mask="none", bounds_m=parse_bounds("-1,-2,0,1,2,3.5"), seed=7
    )
    made = asked.reconstruction
    assert (made.mapping, made.fidelity, made.mask, made.seed) == ("prior", "fine", "none", 7)
    assert (made.bounds.lower, made.bounds.upper) == ((-1, -2, 0), (1, 2, 3.5))
    assert EvaluationSettings().reconstruction == ReconstructionSettings()


@pytest.mark.parametrize("command", ["reference", "evaluate"])
class TestUsage:
    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ("", "missing argument"),
            ("photos", "missing option '--output' / '-o'"),
            ("photos -o out --mapping magic", "'magic' is not one of 'auto', 'incremental'"),
            ("photos -o out --workers 0", "invalid value for '--workers'"),
            ("photos -o out --seed -1", "invalid value for '--seed'"),
            ("photos -o out --bounds -1,0,0,1,1", "--bounds: not the lowest and highest corner"),
            ("photos -o out --bounds 0,0,0,1,1,0", "--bounds: not the lowest and highest corner"),
            ("photos -o out --gsd 0.01", "gsd_m: it is the cells of rasters"),
            ("photos -o out --rasters --gsd -1", "gsd_m: input should be greater than 0"),
            ("photos -o out --resume --no-cache", "--resume goes on from what the cache holds"),
        ],
    )
    def test_message_and_code(
        self,
        command: str,
        arguments: str,
        message: str,
        capsys: pytest.CaptureFixture[str],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "photos").mkdir()
        assert main([command, *arguments.split(), "--json"]) == 2
        error = json.loads(capsys.readouterr().out)["error"]
        assert error["type"] == "UsageError"
        assert message in error["message"]
        assert error["remedy"]
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--reference plot_7", "--reference is of one plot"),
        ("--bounds 0,0,0,1,1,1", "--bounds is of one plot"),
        ("--refine", "--refine is of one plot"),
    ],
)
def test_a_flight_over_many_plots_takes_nothing_of_one(
    arguments: str, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("photos", "plot_7"):
        (tmp_path / name).mkdir()
    (tmp_path / "plots.geojson").touch()
    assert main(["evaluate", "photos", "--plots", "plots.geojson", "-o", "out", *arguments.split(), "--json"]) == 2
    assert message in json.loads(capsys.readouterr().out)["error"]["message"]


@given(st.text(alphabet="0123456789.,-einfa ", max_size=20))
def test_any_text_is_a_box_or_a_usage_error(text: str) -> None:
    with suppress(UsageError):
        x0, y0, z0, x1, y1, z1 = parse_bounds(text)
        assert x0 < x1
        assert y0 < y1
        assert z0 < z1


@pytest.mark.parametrize("text", ["-150,-75,0,150,75,120", "-1500,-750,0,1500,750,1200"])
def test_a_box_in_other_units_is_told_before_photographs_are_read(text: str) -> None:
    with pytest.raises(UsageError, match="in metres, at most 100"):
        parse_bounds(text)
