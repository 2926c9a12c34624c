"""Values of `fieldkit plan`'s options that are written as text."""

from __future__ import annotations

from pathlib import Path

from fieldkit.cli.numbers import read_numbers
from fieldkit.errors import UsageError

_FROM = "from:"
_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0}


def pose_noise_of(text: str) -> tuple[float, float]:
    """M,DEG, or from:EVAL."""
    if not text.startswith(_FROM):
        numbers = read_numbers("--pose-noise", text, (2,))
        return numbers[0], numbers[1]
    from fieldkit.campaign import CAMPAIGN_FILE, read_campaign, visit_plots
    from fieldkit.evaluation.adherence import flown_noise
    from fieldkit.results.report_files import load_evaluation_report

    file = Path(text.removeprefix(_FROM))
    if not file.name:
        raise UsageError("--pose-noise: from what?", remedy="Write it like --pose-noise from:EVAL, a folder or a file.")
    if (file / CAMPAIGN_FILE).is_file():
        return flown_noise(visit_plots(read_campaign(file)), file)
    return flown_noise(load_evaluation_report(file).plots, file)


def score_weights(text: str) -> tuple[float, ...]:
    """GAP,NOISE,TIE, or from:RUN."""
    if not text.startswith(_FROM):
        return read_numbers("--weights", text, (3,))
    run = text.removeprefix(_FROM)
    if not run:
        raise UsageError("--weights: from what?", remedy="Write it like --weights from:RUN, the folder of a run.")
    from fieldkit.planning.run.fitted_weights import weights_of_run
    from fieldkit.runtime.threads import limit_threads

    limit_threads(1)
    return weights_of_run(Path(run))


def seconds(text: str) -> float:
    """Of a number and a unit: 600, 10m, 2h."""
    number, unit = (text[:-1], text[-1]) if text[-1:] in _UNITS else (text, "s")
    return read_numbers("--time-budget", number, (1,))[0] * _UNITS[unit]
