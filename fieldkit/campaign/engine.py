"""Which fieldkit computes visits, and which visits were computed by another one."""

from __future__ import annotations

from fieldkit.evaluation.prediction import prediction_model
from fieldkit.reconstruction.versions import STAGES
from fieldkit.results.visit import Visit


def stage_versions() -> dict[str, int]:
    """Versions of all that a visit is computed by: what invalidates results, and the fit that predictions are by."""
    return {**STAGES, "prediction": prediction_model().version}


def changed_stages(visit: Visit) -> tuple[str, ...] | None:
    """Stages that computed a visit and have another version today; none where it is current, None where not known."""
    if not visit.stages:
        return None
    now = stage_versions()
    return tuple(name for name in {**now, **visit.stages} if now.get(name) != visit.stages.get(name))


def is_current(visit: Visit) -> bool:
    """Whether this fieldkit would compute a visit in the same way."""
    return changed_stages(visit) == ()
