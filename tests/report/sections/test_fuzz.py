"""Damaged and hostile results: a report or an error for people, never anything else."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.errors import FieldkitError, MetadataError
from fieldkit.report.sections.loaded import check_plausible
from fieldkit.report.write_report import write_report
from tests.report.page_checks import checked
from tests.report.sections.examples import HOSTILE, write_campaign, write_everything

FILES = (
    "reference/reference.json",
    "plan/plan.json",
    "plan/search.json",
    "plan/outcome.json",
    "plan/evaluations.jsonl",
    "scores/evaluation.json",
    "mission/field.mission.json",
)
JUNK: tuple[Any, ...] = (
    None, True, 0, -1, 10**18, 10**40, 0.0, 1e-300, 1e8, 1e308, -1e308, "", HOSTILE, "../../../etc/passwd", "\0", [],
    {}, [HOSTILE], {"a": {"b": [1e308]}},
)  # fmt: skip


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("fuzz") / "season"
    write_everything(root)
    return root


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The places of all values in a document, its containers among them."""
    found = [path] if path else []
    if isinstance(value, dict):
        return found + [leaf for key, inner in value.items() for leaf in leaves(inner, (*path, key))]
    if isinstance(value, list):
        return found + [leaf for key, inner in enumerate(value[:3]) for leaf in leaves(inner, (*path, key))]
    return found


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_changed_values(season: Path, tmp_path: Path, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(FILES))
    file = season / name
    text = file.read_text()
    lines = text.splitlines() if name.endswith("jsonl") else [text]
    document = json.loads(lines[0])
    for _ in range(data.draw(st.integers(1, 3))):
        places = leaves(document)
        *way, last = data.draw(st.sampled_from(places))
        target = document
        for key in way:
            target = target[key]
        if data.draw(st.booleans()) or not isinstance(target, dict):
            target[last] = data.draw(st.sampled_from(JUNK))
        else:
            del target[last]
    try:
        file.write_text("\n".join([json.dumps(document), *lines[1:]]) + "\n")
        made = write_report(season, tmp_path / "r.html", points=1000, overwrite=True)
    finally:
        file.write_text(text)
    assert made.references + made.plans + made.missions + made.evaluations + made.campaigns >= 3
    checked((tmp_path / "r.html").read_text(encoding="utf-8"))


def test_a_campaign_with_values_that_no_fieldkit_wrote(tmp_path: Path) -> None:
    write_campaign(tmp_path / "campaign")
    for column, value in (("chamfer_m", 1e308), ("chamfer_m", "x"), ("date", HOSTILE), ("images", -5), ("notes", "{")):
        (file,) = tmp_path.glob("campaign/visits/maize-2/2026-06*/visit.json")
        file.write_text(json.dumps(json.loads(file.read_text()) | {column: value}))
        try:
            write_report(tmp_path / "campaign", tmp_path / "r.html", overwrite=True)
        except FieldkitError as error:
            assert error.remedy  # noqa: PT017
        else:
            checked((tmp_path / "r.html").read_text(encoding="utf-8"))


def test_what_is_plausible() -> None:
    check_plausible({"a": [1, 2.5, {"b": (None, "x", True)}], "seed": 2**63}, Path("f"))
    for value in (1e10, float("nan"), float("-inf"), 10**30):
        with pytest.raises(MetadataError, match=r"a\.1\.b: is a number"):
            check_plausible({"a": [1, {"b": value}]}, Path("f"))
