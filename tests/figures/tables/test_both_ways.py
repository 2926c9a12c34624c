"""The same figures on a terminal and in HTML."""

import io
import re
from collections.abc import Sequence

import pytest
from rich.console import Console

from fieldkit.figures.content import Block, KeyFigures, Page, Section, Table, Terms
from fieldkit.figures.tables import adherence, comparison, reconstruction, scores
from fieldkit.figures.terminal.blocks import rendered
from fieldkit.report.html.document import render
from fieldkit.results.comparison import ComparedEvaluation, ComparisonReport, DifferenceEntry, ValueEntry
from fieldkit.results.evaluation import AdherenceEntry, Prediction, StationErrorEntry
from tests.figures.terminal.test_results import FAILED, TRAITS, scored
from tests.report.page_checks import checked

ERROR = StationErrorEntry(
    station="station 1", image="a.jpg", east_m=0.11, north_m=-0.2, up_m=None, yaw_deg=1.5, pitch_deg=0.5
)
KEPT = AdherenceEntry(
    stations=(ERROR,),
    missing=("station 5",),
    extra=("b.jpg",),
    horizontal_rms_m=0.21,
    yaw_rms_deg=1.5,
    pitch_rms_deg=0.5,
)
PREDICTION = Prediction(chamfer_m=0.012, low_m=0.006, high_m=0.024, reason="", model=1)
PLOT = scored("plot 7").model_copy(update={"traits": TRAITS, "prediction": PREDICTION, "adherence": KEPT})
GAPS = adherence.gaps(KEPT)
EVALUATIONS = tuple(
    ComparedEvaluation(label=label, sources=(label,), reference_sha256=None, plots=("a",)) for label in ("may", "june")
)
COMPARISON = ComparisonReport(
    fieldkit="0", evaluations=EVALUATIONS, figures=("chamfer_m", "f_score_0.005"), notes=("A note.",),
    values=(ValueEntry(plot="a", figure="chamfer_m", label="june", value=0.0132, repeats=1, spread=None),),
    differences=(
        DifferenceEntry(
            plot="a", figure="chamfer_m", label="june", less="may", difference=-0.0034, noise="repeats",
            noise_sd=0.0001, low=-0.0036, high=-0.0032, beyond=True,
        ),
        DifferenceEntry(
            plot="a", figure="f_score_0.005", label="june", less="may", difference=0.0124, noise=None, noise_sd=None,
            low=None, high=None, beyond=None,
        ),
    ),
)  # fmt: skip


def texts(blocks: Sequence[Block]) -> set[str]:
    """Every text of blocks that a terminal shows, too."""
    found: set[str] = set()
    for block in blocks:
        if isinstance(block, Table):
            shown = [k for k, column in enumerate(block.columns) if not column.detail]
            found |= {cell for row in block.rows for k in shown if isinstance(cell := row[k], str)}
        elif isinstance(block, Terms):
            found |= {text for item in block.items for text in item}
        elif isinstance(block, KeyFigures):
            found |= {text for item in block.items for text in (item.label, item.value, item.meaning)}
    return found


@pytest.mark.parametrize(
    "blocks",
    [
        (
            Terms(reconstruction.quality_rows(PLOT)),
            reconstruction.photograph_table(PLOT.image_reports, "Photographs", metric=True),
            reconstruction.stage_table(PLOT),
            reconstruction.finding_table(PLOT.findings, 3),
        ),
        (KeyFigures(tuple(scores.score_figures(PLOT))), scores.distance_table(PLOT)),
        (scores.plot_table((PLOT,)), *scores.plant_tables((PLOT,)), scores.failure_table((FAILED,))),
        (adherence.adherence_by_plot((PLOT,)), *([GAPS] if GAPS else [])),
        tuple(comparison.comparison_blocks(COMPARISON)),
    ],
    ids=["reconstruction", "scores", "plots", "adherence", "comparison"],
)
def test_no_figure_is_lost(blocks: tuple[Block, ...]) -> None:
    console = Console(file=io.StringIO(), width=160, color_system=None)
    for each in rendered(blocks):
        console.print(each)
    terminal = console.file.getvalue()
    page = checked(render(Page("t", "", (Section("s", "S", blocks),)))).text
    wanted = {re.sub(r"\s+", " ", text) for text in texts(blocks)}
    assert len(wanted) > 4
    for shown in (terminal, page):
        said = re.sub(r"\s+", " ", shown)
        assert [text for text in wanted if text.strip() not in said] == []
