"""fieldkit: reference clouds, capture scores, camera plans and missions of field plots from photographs.

The commands as functions: `build_reference`, `plan`, `export_mission`, `check`, `evaluate`, `evaluate_flight` and
`write_report`. They are imported when first used, so that ``import fieldkit`` stays light.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from fieldkit.version import __version__ as __version__

if TYPE_CHECKING:
    from fieldkit.clouds.ply import read_cloud as read_cloud
    from fieldkit.errors import FieldkitError as FieldkitError
    from fieldkit.evaluation.evaluate import evaluate as evaluate
    from fieldkit.evaluation.flight import evaluate_flight as evaluate_flight
    from fieldkit.evaluation.reference import build_reference as build_reference
    from fieldkit.evaluation.settings import EvaluationSettings as EvaluationSettings
    from fieldkit.fieldcheck.check import check as check
    from fieldkit.fieldcheck.settings import CheckSettings as CheckSettings
    from fieldkit.missions.export_mission import export_mission as export_mission
    from fieldkit.missions.settings import MissionSettings as MissionSettings
    from fieldkit.planning.plan_settings import PlanSettings as PlanSettings
    from fieldkit.planning.run.outcome import Outcome as Outcome
    from fieldkit.planning.run.plan import plan as plan
    from fieldkit.planning.settings import SearchSettings as SearchSettings
    from fieldkit.reconstruction.settings import ReconstructionSettings as ReconstructionSettings
    from fieldkit.report.write_report import write_report as write_report
    from fieldkit.results.evaluation import EvaluationReport as EvaluationReport
    from fieldkit.results.evaluation import ReferenceReport as ReferenceReport
    from fieldkit.results.plan import Plan as Plan
    from fieldkit.results.plan_file import load_plan as load_plan
    from fieldkit.results.report_files import load_evaluation_report as load_evaluation_report
    from fieldkit.results.report_files import load_reference_report as load_reference_report
    from fieldkit.runtime.context import Context as Context


@cache
def _homes() -> dict[str, str]:
    """The modules of the names that are imported above, by name."""
    import ast
    from pkgutil import get_data

    source = get_data(__name__, "__init__.py") or b""
    imports = [node for node in ast.walk(ast.parse(source)) if type(node) is ast.ImportFrom]
    return {name.asname: node.module or "" for node in imports for name in node.names if name.asname}


def __getattr__(name: str) -> Any:
    homes = _homes()
    if name == "__all__":
        return sorted(homes)
    if name not in homes:
        raise AttributeError(f"module 'fieldkit' has no attribute {name!r}")
    from importlib import import_module
    from inspect import isfunction

    value = getattr(import_module(homes[name]), name)
    if isfunction(value):
        from fieldkit.cli.progress import with_usual_context
        from fieldkit.documents.mistaken import checked_call

        value = checked_call(with_usual_context(value))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_homes()})
