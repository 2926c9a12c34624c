"""Reading and writing plan.json."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fieldkit.documents.json_file import read_model
from fieldkit.errors import MetadataError
from fieldkit.files import write_atomic
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.results.plan import Plan, Station
from fieldkit.version import __version__

PLAN_FILE = "plan.json"
SETTINGS_FILE = "search.json"
_MAX_BYTES = 16 << 20
"""Largest plan that is read, bytes."""
_AGAIN = "Give the plan.json of a plan, or the folder that holds it."


def plan_from_poses(poses: Sequence[Pose], intrinsics: Intrinsics | None = None, **more: Any) -> Plan:
    """A plan of level poses in the plot frame; their roll, which a gimbal does not have, is dropped."""
    stations = []
    for pose in poses:
        yaw, pitch, _ = pose.yaw_pitch_roll_deg()
        x, y, z = (float(v) for v in pose.center)
        stations.append(Station(position_m=(x, y, z), yaw_deg=yaw, pitch_deg=pitch))
    return Plan(fieldkit=__version__, stations=tuple(stations), camera=intrinsics, **more)


def save_plan(path: Path, plan: Plan) -> None:
    """Write a plan as JSON (UTF-8, indented)."""
    write_atomic(path, plan_bytes(plan))


def plan_bytes(plan: Plan) -> bytes:
    """A plan as JSON, UTF-8, indented."""
    return (plan.model_dump_json(indent=2) + "\n").encode("utf-8")


def load_plan(path: Path | str, *, patterns: bool = False) -> Plan:
    """Read plan.json; ``path`` is the file or the folder that holds it.

    Args:
        patterns: take a pattern, too, not stations alone.

    Raises:
        MetadataError: it is missing, not JSON, no plan, of another version, or a field is wrong; or it is a pattern.
    """
    path = Path(path)
    file = path / PLAN_FILE if path.is_dir() else path
    plan = read_model(Plan, "plan", file, _AGAIN, max_bytes=_MAX_BYTES)
    if plan.pattern is not None and not patterns:
        raise MetadataError(
            "is a pattern of passes over a field, not stations about a plot",
            path=file,
            remedy="Fly it with fieldkit export-mission; photographs of a field need no --plan.",
        )
    return plan
