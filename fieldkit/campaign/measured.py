"""Heights that people measured by hand, joined to a campaign's visits, and how the two agree.

Bias and limits of agreement are those of Bland & Altman (1986), doi:10.1016/S0140-6736(86)90837-8: of the differences
their mean, and 1.96 standard deviations about it, each with its 95 % confidence interval by Student's t.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from statistics import fmean, stdev

from fieldkit.campaign.reading import Campaign
from fieldkit.documents.csv_text import csv_text
from fieldkit.documents.file_bytes import decoded, file_bytes
from fieldkit.documents.mistaken import as_centimetres
from fieldkit.errors import MetadataError, about
from fieldkit.figures.content import Table, tabulated
from fieldkit.figures.registry import FIGURES
from fieldkit.figures.style import decimal
from fieldkit.files import write_atomic
from fieldkit.results.visit import Visit
from fieldkit.sites.site import TALLEST_M
from fieldkit.wording import count

MEASURED_FILE = "measured.csv"
"""In a campaign's folder: the heights by hand that `fieldkit campaign show` and reports join."""
LIMITS = 1.96
"""Standard deviations of the differences between which 95 % of them lie."""
_COLUMNS = ("plot", "date", "height_m")
_MOST_BYTES = 4 << 20
"""Largest table of heights that is read, bytes."""
_REMEDY = "Write a row for each plot and date: plot,date,height_m, then for instance A1,2026-07-02,1.25."


@dataclass(frozen=True)
class Pair:
    """A plot's height on a date, by fieldkit and by hand."""

    visit: Visit
    height_m: float
    measured_m: float

    @property
    def difference_m(self) -> float:
        """Fieldkit's less the one by hand."""
        return self.height_m - self.measured_m

    @property
    def within(self) -> bool | None:
        """Whether the one by hand is within the stated error; None where none is stated."""
        error = FIGURES["height_m"].error_towards(self.visit, self.difference_m < 0)
        return None if error is None else abs(self.difference_m) <= error


@dataclass(frozen=True)
class Agreement:
    """Heights by fieldkit and by hand, and how they agree."""

    pairs: tuple[Pair, ...]
    """By plot and date."""
    apart: tuple[str, ...]
    """Measured, and not joined: which and why."""

    @property
    def bias_m(self) -> float:
        """Mean difference."""
        return fmean(pair.difference_m for pair in self.pairs)

    @property
    def rmse_m(self) -> float:
        """Root mean square of the differences."""
        return math.sqrt(fmean(pair.difference_m**2 for pair in self.pairs))

    @property
    def limits_m(self) -> tuple[float, float] | None:
        """Limits of agreement: 95 % of the differences lie between them; None of fewer than three."""
        if len(self.pairs) < 3:
            return None
        reach = LIMITS * stdev(pair.difference_m for pair in self.pairs)
        return self.bias_m - reach, self.bias_m + reach

    def half_interval_m(self, times: float) -> float:
        """Half the 95 % confidence interval of the bias (``times`` 1) or of a limit (3)."""
        from scipy.stats import t

        number = len(self.pairs)
        spread = stdev(pair.difference_m for pair in self.pairs)
        return float(t.ppf(0.975, number - 1)) * spread * math.sqrt(times / number)

    def sentences(self) -> Iterator[str]:
        """What a person should know: how they agree, then what was not joined."""
        if self.pairs:
            plots = len({pair.visit.plot for pair in self.pairs})
            told = (
                f"{count(len(self.pairs), 'height')} by hand on {count(plots, 'plot')}: bias {_signed(self.bias_m)} m"
            )
            if (limits := self.limits_m) is not None:
                low, high = map(_signed, limits)
                known, limit = (decimal(self.half_interval_m(times), 3) for times in (1, 3))
                told += f" (known to ± {known} m), limits of agreement {low} to {high} m (± {limit} m)"
            stated = [pair.within for pair in self.pairs if pair.within is not None]
            within = f"{sum(stated)} of {len(stated)} within the stated errors"
            yield f"{told}, RMSE {decimal(self.rmse_m, 3)} m; {within}."
            if len(self.pairs) > plots:
                yield "Heights of one plot on several dates are not independent: the limits are a little too narrow."
        yield from self.apart

    def table(self) -> Table:
        """A row per pair."""
        return tabulated(
            "Heights by hand",
            [
                {
                    "plot": pair.visit.plot,
                    "date": pair.visit.date,
                    FIGURES["height_m"].column: FIGURES["height_m"].cell(pair.visit),
                    "by hand, m>": decimal(pair.measured_m, 3),
                    "difference, m>": _signed(pair.difference_m),
                    "within the error": {True: "yes", False: "no", None: None}[pair.within],
                }
                for pair in self.pairs
            ],
        )

    def plain(self) -> dict[str, object]:
        """As JSON has it."""
        figures: dict[str, object] = {"bias_m": self.bias_m, "rmse_m": self.rmse_m} if self.pairs else {}
        if self.limits_m is not None:
            figures |= {
                "limits_m": self.limits_m,
                "bias_interval_m": self.half_interval_m(1),
                "limits_interval_m": self.half_interval_m(3),
            }
        names = ("height_m", "measured_m", "difference_m", "within")
        pairs = [
            {"plot": pair.visit.plot, "date": pair.visit.date} | {name: getattr(pair, name) for name in names}
            for pair in self.pairs
        ]
        return {"pairs": pairs, **figures, "not_joined": self.apart}


def keep_measured(file: Path, campaign: Campaign) -> Path:
    """Check a table of heights by hand, and keep it in the campaign's folder in place of an earlier one."""
    kept = campaign.folder / MEASURED_FILE
    rows = [(*key, height_m) for key, height_m in _read(file, campaign).items()]
    write_atomic(kept, csv_text(_COLUMNS, rows))
    return kept


def measured_agreement(campaign: Campaign) -> Agreement | None:
    """How the heights by hand that are kept in a campaign agree with its visits'; None where there are none."""
    file = campaign.folder / MEASURED_FILE
    if not file.is_file():
        return None
    visits = {visit.key: visit for visit in campaign.visits}
    pairs, apart = [], []
    for (plot, day), measured_m in sorted(_read(file, campaign).items()):
        visit = visits.get((plot, day))
        if visit is not None and visit.height_m is not None:
            pairs.append(Pair(visit, visit.height_m, measured_m))
            continue
        dates = ", ".join(key[1] for key in visits if key[0] == plot)
        why = f"its visits are of {dates}" if dates else "it has no visit"
        if visit is not None:
            why = visit.error or (visit.traits and visit.traits.unknown.get("height_m")) or "its visit has no height"
        apart.append(f"{plot} {day}, {decimal(measured_m)} m by hand, is not joined: {why}.")
    return Agreement(tuple(pairs), tuple(apart))


def _read(file: Path, campaign: Campaign) -> dict[tuple[str, str], float]:
    with about(file, _REMEDY):
        return _heights(file, campaign)


def _heights(file: Path, campaign: Campaign) -> dict[tuple[str, str], float]:
    """Heights in metres by plot and date; of several rows the highest, since a plot's height is its highest leaf's."""
    text = decoded(file_bytes(file, _MOST_BYTES, noun="table of heights"))
    rows = csv.DictReader(io.StringIO(text), delimiter=";" if ";" in text.partition("\n")[0] else ",", restval="")
    if lacking := [name for name in _COLUMNS if name not in (rows.fieldnames or ())]:
        raise MetadataError(f"has no column {lacking[0]}")
    known = {plot.name for plot in campaign.plots} | set(campaign.vanished)
    heights: dict[tuple[str, str], float] = {}
    for row in rows:
        plot, day, height = (row[name].strip() for name in _COLUMNS)
        plot = plot if plot in known else plot.removeprefix("'")  # as `csv_cell` writes names like formulas
        if not height:
            continue
        line = f"line {rows.line_num}"
        if plot not in known:
            remedy = "Write plots' names as `fieldkit campaign show` does."
            raise MetadataError(f'{line}: there is no plot "{plot}"', remedy=remedy)
        try:
            key = plot, date.fromisoformat(day).isoformat()
            value = float(height.replace(",", "."))
        except ValueError as error:
            raise MetadataError(f"{line}: {error}") from error
        if not 0.0 <= value <= TALLEST_M:
            slip = as_centimetres(value, TALLEST_M)
            raise MetadataError(f"{line}: {height} is no height in metres{slip}")
        heights[key] = max(value, heights.get(key, 0.0))
    if not heights:
        raise MetadataError("has no height")
    return heights


def _signed(value: float) -> str:
    return f"{value:+.3f}".replace("-", "−")
