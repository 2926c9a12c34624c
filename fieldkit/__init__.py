"""fieldkit: reference clouds, capture scores, camera plans and missions of field plots from photographs.

The commands as functions: `build_reference`, `plan`, `export_mission`, `evaluate`, `compare_evaluations` and
`write_report`. They are imported when first used, so that ``import fieldkit`` stays light.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fieldkit.version import __version__

if TYPE_CHECKING:
    from fieldkit.clouds.io import read_cloud
    from fieldkit.errors import FieldkitError
    from fieldkit.evaluation.compare import Comparison, compare_evaluations
    from fieldkit.evaluation.evaluate import evaluate_captures
    from fieldkit.evaluation.reference import build_reference
    from fieldkit.missions.export_mission import export_mission
    from fieldkit.notebook import evaluate, plan
    from fieldkit.planning.run.outcome import Outcome
    from fieldkit.planning.run.plan_views import plan_views, resume_plan
    from fieldkit.planning.run.request import search_settings
    from fieldkit.planning.settings import SearchSettings
    from fieldkit.reconstruction.settings import ReconstructionSettings
    from fieldkit.report.write_report import write_report
    from fieldkit.results.evaluation import EvaluationReport, ReferenceReport
    from fieldkit.results.plan import Plan
    from fieldkit.results.plan_file import load_plan
    from fieldkit.results.report_files import load_evaluation_report, load_reference_report

__all__ = [
    "Comparison",
    "EvaluationReport",
    "FieldkitError",
    "Outcome",
    "Plan",
    "ReconstructionSettings",
    "ReferenceReport",
    "SearchSettings",
    "__version__",
    "build_reference",
    "compare_evaluations",
    "evaluate",
    "evaluate_captures",
    "export_mission",
    "load_evaluation_report",
    "load_plan",
    "load_reference_report",
    "plan",
    "plan_views",
    "read_cloud",
    "resume_plan",
    "search_settings",
    "write_report",
]

_HOMES = {
    "Comparison": "fieldkit.evaluation.compare",
    "EvaluationReport": "fieldkit.results.evaluation",
    "FieldkitError": "fieldkit.errors",
    "Outcome": "fieldkit.planning.run.outcome",
    "Plan": "fieldkit.results.plan",
    "ReconstructionSettings": "fieldkit.reconstruction.settings",
    "ReferenceReport": "fieldkit.results.evaluation",
    "SearchSettings": "fieldkit.planning.settings",
    "build_reference": "fieldkit.evaluation.reference",
    "compare_evaluations": "fieldkit.evaluation.compare",
    "evaluate": "fieldkit.notebook",
    "evaluate_captures": "fieldkit.evaluation.evaluate",
    "export_mission": "fieldkit.missions.export_mission",
    "load_evaluation_report": "fieldkit.results.report_files",
    "load_plan": "fieldkit.results.plan_file",
    "load_reference_report": "fieldkit.results.report_files",
    "plan": "fieldkit.notebook",
    "plan_views": "fieldkit.planning.run.plan_views",
    "read_cloud": "fieldkit.clouds.io",
    "resume_plan": "fieldkit.planning.run.plan_views",
    "search_settings": "fieldkit.planning.run.request",
    "write_report": "fieldkit.report.write_report",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'fieldkit' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
