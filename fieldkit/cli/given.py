"""What options name is there: said before anything heavy is imported."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fieldkit.errors import InputError

_PHOTOGRAPHS = "Give the folder that holds the photographs."
_REFERENCE = "Give the folder that `fieldkit reference` wrote, or run it again."
_REMEDIES = {
    "captures": _PHOTOGRAPHS,
    "images": _PHOTOGRAPHS,
    "reference": _REFERENCE,
    "references": _REFERENCE,
    "plan": "Give the plan.json of a plan, or the folder that holds it.",
    "campaign": "Make one with `fieldkit campaign init`.",
}
"""By the names of parameters."""
_READ = (*_REMEDIES, "site", "plots", "log", "poses", "mission", "file", "camera", "measured")
"""Parameters that name what a command reads; ``folder`` is read by all but `campaign init`."""


def check_given(command: str, values: Mapping[str, Any]) -> None:
    """Raise an InputError for the first file, folder, scene or vehicle of a command that is not there."""
    for name, value in values.items():
        for path in value if isinstance(value, list | tuple) else (value,):
            if not isinstance(path, str | Path):
                continue
            if name in ("scene", "scenes"):
                from fieldkit.scenes.library import find_scene

                find_scene(path)
            elif name == "vehicle":
                from fieldkit.vehicles.vehicle_file import find_vehicle

                find_vehicle(path)
            read = name in _READ or (name == "folder" and command != "campaign init")
            if read and isinstance(path, Path) and not os.path.lexists(path.expanduser()):
                remedy = _REMEDIES.get(command.split()[0] if name == "folder" else name, "Check its name.")
                raise InputError("there is no such file or folder", path=path, remedy=remedy)
