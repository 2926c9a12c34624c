"""reference.json and evaluation.json on disk."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.clouds import score
from fieldkit.errors import CaptureError, MetadataError
from fieldkit.evaluation.conversion import evaluation_report, failed_plot, plot_evaluation, reference_report
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
from fieldkit.results.report_files import (
    SCHEMA_FILES,
    check_file,
    describe_files,
    json_schema,
    load_evaluation_report,
    load_reference_report,
    save_report,
)
from tests.evaluation.examples import plant_cloud, reconstruction

SETTINGS = ReconstructionSettings()
DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def reference() -> ReferenceReport:
    return reference_report(reconstruction(), SETTINGS)


@pytest.fixture(scope="module")
def evaluation() -> EvaluationReport:
    result = reconstruction()
    plots = [
        plot_evaluation("a", result, SETTINGS, score=score(plant_cloud(seed=1), result.plants)),
        failed_plot("b", CaptureError("no photographs", remedy="Copy them.")),
    ]
    return evaluation_report(
        "field", plots, SETTINGS, reference_sha256="a" * 64, refine=False, distances_m=(0.002, 0.005)
    )


def test_round_trip(tmp_path: Path, reference: ReferenceReport, evaluation: EvaluationReport) -> None:
    save_report(tmp_path / "reference.json", reference)
    assert load_reference_report(tmp_path) == load_reference_report(tmp_path / "reference.json") == reference
    save_report(tmp_path / "evaluation.json", evaluation)
    assert load_evaluation_report(tmp_path) == evaluation


@pytest.mark.parametrize("name", SCHEMA_FILES)
def test_committed_schemas_are_current(name: str) -> None:
    """Else: python scripts/make_scenes.py."""
    assert (DOCS / "schemas" / name).read_text("utf-8") == json_schema(SCHEMA_FILES[name])


def without(key: str) -> Callable[[dict[str, Any]], Any]:
    return lambda document: document.pop(key)


def setting(*path: str | int, value: Any) -> Callable[[dict[str, Any]], Any]:
    def change(document: Any) -> None:
        for part in path[:-1]:
            document = document[part]
        document[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("images"), "images: is missing"),
        (setting("kind", value="plan"), "is not a fieldkit reference: its \"kind\" is 'plan'"),
        (setting("version", value=2), "has version 2 of the format; this fieldkit reads 1"),
        (setting("images", value="8"), "images: should be a number and is the text"),
        (setting("colour", value="green"), "colour: is not known to this version of the format"),
        (setting("gsd_m", value=float("nan")), "gsd_m: input should be a finite number"),
        (setting("frame", "origin", "latitude_deg", value=91), "frame.origin: latitude 91.0° is outside"),
    ],
)
def test_wrong_fields(tmp_path, reference, change, message) -> None:
    document = json.loads(reference.model_dump_json())
    change(document)
    file = tmp_path / "reference.json"
    file.write_text(json.dumps(document))
    with pytest.raises(MetadataError) as raised:
        load_reference_report(tmp_path)
    assert raised.value.message.startswith(message)
    assert raised.value.path == file
    assert raised.value.remedy
    assert ("newer" in raised.value.remedy) == ("version 2" in message)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not JSON: it is empty"),
        (b"\xff\xfe\x00", "is not text in UTF-8"),
        (b"[" * 100_000, "is not JSON that a reference could hold"),
        (b"[" + b"9" * 10_000 + b"]", "is not JSON that a reference could hold"),
    ],
)
def test_other_files(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "reference.json").write_bytes(content)
    with pytest.raises(MetadataError) as raised:
        load_reference_report(tmp_path)
    assert raised.value.message.startswith(message)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    document=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
        max_leaves=8,
    )
)
def test_any_json_is_an_error_for_people(tmp_path: Path, document: Any) -> None:
    if isinstance(document, dict):
        document = {**document, "kind": "reference", "version": 1}
    (tmp_path / "reference.json").write_text(json.dumps(document))
    with pytest.raises(MetadataError):
        load_reference_report(tmp_path)


class TestFiles:
    def test_described_and_checked(self, tmp_path: Path, reference: ReferenceReport) -> None:
        (tmp_path / "cloud.ply").write_bytes(b"ply\n")
        files = describe_files(tmp_path, ["cloud.ply"])
        report = reference.model_copy(update={"files": files})
        assert check_file(tmp_path, report, "cloud.ply") == tmp_path / "cloud.ply"
        with pytest.raises(MetadataError, match=r"has no scene\.ply"):
            check_file(tmp_path, report, "scene.ply")
        (tmp_path / "cloud.ply").write_bytes(b"plz\n")
        with pytest.raises(MetadataError, match="was changed"):
            check_file(tmp_path, report, "cloud.ply")
        (tmp_path / "cloud.ply").unlink()
        with pytest.raises(MetadataError, match="is missing"):
            check_file(tmp_path, report, "cloud.ply")
