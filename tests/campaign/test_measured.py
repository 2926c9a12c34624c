"""Heights by hand joined to visits: how they agree, and what is said of tables that do not fit."""

from pathlib import Path

import pytest

from fieldkit.campaign.measured import keep_measured, measured_agreement
from fieldkit.campaign.reading import Campaign, keep_visit, read_campaign
from fieldkit.errors import MetadataError
from fieldkit.results.traits import TraitsEntry
from fieldkit.results.visit import Visit
from tests.campaign.examples import campaign_folder, field

DAY, LATER = "2026-06-18", "2026-06-25"
HEIGHTS = {("r1c1", DAY): 0.50, ("r1c2", DAY): 0.60, ("r2c1", DAY): 0.70, ("r1c1", LATER): 0.80, ("r2c2", DAY): None}


@pytest.fixture
def season(tmp_path: Path) -> Campaign:
    folder = campaign_folder(tmp_path, field(2, 2))
    for (plot, day), height_m in HEIGHTS.items():
        error = {} if height_m is None else {"height_error_m": 0.05, "height_error_below_m": 0.02}
        unknown = {"height_m": "pictures end"} if height_m is None else {}
        keep_visit(folder, Visit(plot=plot, date=day, traits=TraitsEntry(height_m=height_m, unknown=unknown, **error)))
    return read_campaign(folder)


def table(folder: Path, text: str) -> Path:
    (folder / "heights.csv").write_text(text, encoding="utf-8-sig")
    return folder / "heights.csv"


def test_bias_and_limits_of_agreement(season: Campaign, tmp_path: Path) -> None:
    """Differences of −3, −1, −4 and +3 cm: mean −1.25, standard deviation 3.0957 cm, Student's t 3.1824."""
    text = (
        f"plot;date;height_m\nr1c1;{DAY};0,525\nr1c1;{DAY};0,53\nr1c2;{DAY};0,61\nr2c1;{DAY};0,74\n"
        f"r1c1;{LATER};0,77\nr2c2;{DAY};0,90\nr1c2;{LATER};0,90\nr2c1;{DAY};\n"
    )
    keep_measured(table(tmp_path, text), season)
    found = measured_agreement(season)
    assert [round(pair.difference_m, 4) for pair in found.pairs] == [-0.03, 0.03, -0.01, -0.04]
    assert [pair.within for pair in found.pairs] == [True, False, True, True]  # 5 cm above, 2 cm below
    assert found.bias_m == pytest.approx(-0.0125)
    assert found.rmse_m == pytest.approx(0.029580, abs=1e-6)
    assert found.limits_m == pytest.approx((-0.0125 - 1.96 * 0.030957, -0.0125 + 1.96 * 0.030957), abs=1e-5)
    assert found.half_interval_m(1) == pytest.approx(3.1824 * 0.030957 / 2, rel=1e-3)
    assert found.half_interval_m(3) == pytest.approx(3.1824 * 0.030957 * (3 / 4) ** 0.5, rel=1e-3)
    first, repeated, *apart = found.sentences()
    assert first == (
        "4 heights by hand on 3 plots: bias −0.013 m (known to ± 0.049 m), limits of agreement −0.073 to +0.048 m "
        "(± 0.085 m), RMSE 0.030 m; 3 of 4 within the stated errors."
    )
    assert "not independent" in repeated
    assert apart == [
        f"r1c2 {LATER}, 0.90 m by hand, is not joined: its visits are of {DAY}.",
        f"r2c2 {DAY}, 0.90 m by hand, is not joined: pictures end.",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"plot,date\nr1c1,{DAY}\n", "no column height_m"),
        (f"plot,date,height_m\nr1c9,{DAY},1\n", 'line 2: there is no plot "r1c9"'),
        (f"plot,date,height_m\nr1c1,{DAY},92\n", "92 cm are 0.92 m"),
        (f"plot,date,height_m\nr1c1,{DAY},tall\n", "line 2: could not convert"),
        ("plot,date,height_m\nr1c1,18.6.2026,1\n", "line 2: Invalid isoformat"),
        ("plot,date,height_m\n", "has no height"),
        ("", "no column plot"),
    ],
)
def test_a_table_that_does_not_fit_is_refused_and_the_earlier_one_stays(
    season: Campaign, tmp_path: Path, text: str, said: str
) -> None:
    keep_measured(table(tmp_path, f"plot,date,height_m\nr1c1,{DAY},0.5\n"), season)
    with pytest.raises(MetadataError, match=said) as caught:
        keep_measured(table(tmp_path, text), season)
    assert caught.value.remedy
    (pair,) = measured_agreement(season).pairs
    assert pair.difference_m == 0.0
