"""Reading and writing mission.json."""

from __future__ import annotations

from pathlib import Path

from fieldkit.documents.json_file import read_model
from fieldkit.results.mission import MissionRecord

MISSION_FILE = "mission.json"
_MAX_BYTES = 128 << 20
_AGAIN = "Give the mission.json that `fieldkit export-mission` wrote beside the mission, or export it again."


def record_path(mission: Path) -> Path:
    """Of the record beside a mission: mission.json for mission.plan, field.mission.json for field.plan."""
    return mission.with_name(MISSION_FILE if mission.stem == "mission" else f"{mission.stem}.{MISSION_FILE}")


def records_in(folder: Path) -> list[Path]:
    """The records that lie in a folder, by name."""
    return sorted(file for pattern in (MISSION_FILE, f"*.{MISSION_FILE}") for file in folder.glob(pattern))


def record_bytes(record: MissionRecord) -> bytes:
    """A record as JSON, UTF-8, indented."""
    return (record.model_dump_json(indent=1) + "\n").encode("utf-8")


def load_mission(file: Path) -> MissionRecord:
    """Read mission.json.

    Raises:
        MetadataError: it is missing, not JSON, no mission's, of another version, or a field is wrong.
    """
    return read_model(MissionRecord, "mission", file, _AGAIN, max_bytes=_MAX_BYTES)
