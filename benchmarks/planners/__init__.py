"""The paper's baselines and rivals of fieldkit's planner, as methods of a run: `plan(…, methods=PLANNERS)`."""

from benchmarks.planners.registry import PLANNERS

__all__ = ["PLANNERS"]
