"""The recordings in sim/sitl, and missions made of them."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fieldkit.missions.items import POSITIONAL, MissionItem
from fieldkit_sim.standin.recording import Recording, read_recording

SITL = Path(__file__).parents[3] / "sim" / "sitl"


@pytest.fixture(scope="session")
def sitl() -> Path:
    return SITL


@pytest.fixture(scope="session")
def probe() -> dict[str, Any]:
    document: dict[str, Any] = json.loads((SITL / "probe_items.json").read_text())
    return document


@pytest.fixture(scope="session")
def recording() -> Recording:
    """A vehicle that stands at home, disarmed; it uses GPS from 41.5 s on."""
    return read_recording(SITL / "probe_items.tlog")


@pytest.fixture(scope="session")
def flown() -> tuple[MissionItem, ...]:
    """The 67 items, without home, of mount_then_yaw."""
    document = json.loads((SITL / "mount_then_yaw.json").read_text())
    return tuple(_item(item) for item in document["items"][1:])


@pytest.fixture(scope="session")
def delays() -> Callable[[int], tuple[MissionItem, ...]]:
    """Missions of any number of items, all different."""

    def make(count: int) -> tuple[MissionItem, ...]:
        return tuple(MissionItem(93, 2, (float(k), -1.0, -1.0, -1.0, 0.0, 0.0, 0.0)) for k in range(count))

    return make


def _item(item: dict[str, Any]) -> MissionItem:
    scale = 1e-7 if item["cmd"] in POSITIONAL else 1.0
    p1, p2, p3, p4 = item["p"]
    return MissionItem(item["cmd"], item["frame"], (p1, p2, p3, p4, item["x"] * scale, item["y"] * scale, item["z"]))
