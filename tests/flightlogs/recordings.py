"""The recordings of real flights (sim/sitl; the larger ones lie beside the recorded image sets)."""

import json
import os
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from fieldkit.flightlogs import FlightLog, read_flight_log

NEAR = Path(__file__).parents[2] / "sim" / "sitl"


def recording(name: str) -> Path:
    """A recording's file; the test is skipped where it is not at hand."""
    if (NEAR / name).is_file():
        return NEAR / name
    data = os.environ.get("FIELDKIT_DATA")
    if not data:
        pytest.skip(f"FIELDKIT_DATA is unset: {name} lies in the folder sitl beside it")
    path = Path(data).parent / "sitl" / name
    if not path.is_file():
        pytest.skip(f"there is no {path}")
    return path


@cache
def flight_log(name: str) -> FlightLog:
    """A recording as it is read, once for all tests of a process."""
    return read_flight_log(recording(name))


def description(name: str) -> dict[str, Any]:
    """A recording's JSON."""
    document: dict[str, Any] = json.loads(recording(f"{name}.json").read_text())
    return document
