"""fieldkit: reference clouds and capture scores of field plots from photographs.

The commands as functions: `build_reference` and `evaluate_captures`. They are imported when first used, so that
``import fieldkit`` stays light.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from fieldkit.errors import FieldkitError
    from fieldkit.evaluation.evaluate import evaluate_captures
    from fieldkit.evaluation.reference import build_reference
    from fieldkit.evaluation.report_files import load_evaluation_report, load_reference_report
    from fieldkit.evaluation.schema import EvaluationReport, ReferenceReport
    from fieldkit.reconstruction.settings import ReconstructionSettings

__all__ = [
    "EvaluationReport",
    "FieldkitError",
    "ReconstructionSettings",
    "ReferenceReport",
    "__version__",
    "build_reference",
    "evaluate_captures",
    "load_evaluation_report",
    "load_reference_report",
]

_HOMES = {
    "EvaluationReport": "fieldkit.evaluation.schema",
    "FieldkitError": "fieldkit.errors",
    "ReconstructionSettings": "fieldkit.reconstruction.settings",
    "ReferenceReport": "fieldkit.evaluation.schema",
    "build_reference": "fieldkit.evaluation.reference",
    "evaluate_captures": "fieldkit.evaluation.evaluate",
    "load_evaluation_report": "fieldkit.evaluation.report_files",
    "load_reference_report": "fieldkit.evaluation.report_files",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'fieldkit' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
