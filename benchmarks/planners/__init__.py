"""The paper's baselines and rivals of fieldkit's planner, as methods of a run: `plan_views(…, methods=PLANNERS)`."""

from benchmarks.planners.registry import PLANNERS

__all__ = ["PLANNERS"]
