"""What options name is there: said before anything heavy is imported."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fieldkit.errors import CaptureError, InputError, MetadataError

_FILE = (MetadataError, "there is no such file", "Check its name.")
_PHOTOGRAPHS = (CaptureError, "the folder does not exist", "Give the folder that holds the photographs.")
_REFERENCE = (*_FILE[:2], "Give the folder that `fieldkit reference` wrote, or run it again.")
_EVALUATION = (*_FILE[:2], "Give the folder that `fieldkit evaluate` wrote, or run it again.")
_NAMES: Mapping[str, tuple[type[InputError], str, str]] = {
    "captures": _PHOTOGRAPHS,
    "images": _PHOTOGRAPHS,
    "reference": _REFERENCE,
    "references": _REFERENCE,
    "evaluations": _EVALUATION,
    "plan": (*_FILE[:2], "Give the plan.json of a plan, or the folder that holds it."),
    **dict.fromkeys(("site", "plots", "log", "poses", "mission", "file", "camera", "measured"), _FILE),
    "report": (MetadataError, "there is no such folder", "Give a folder that a command of fieldkit wrote."),
    "campaign": (
        MetadataError,
        "is no campaign: there is no campaign.toml in it",
        "Make one with `fieldkit campaign init`.",
    ),
}
"""By the names of parameters; for ``folder``, by those of commands."""


def check_given(command: str, values: Mapping[str, Any]) -> None:
    """Raise an InputError for the first file, folder, scene or vehicle of a command that is not there."""
    for name, value in values.items():
        for given in value if isinstance(value, list | tuple) else (value,):
            each = given
            if not isinstance(each, str | Path):
                continue
            if name in ("scene", "scenes"):
                from fieldkit.scenes.library import find_scene

                find_scene(each)
            elif name == "vehicle":
                from fieldkit.vehicles.vehicle_file import find_vehicle

                find_vehicle(each)
            elif name == "evaluations" and isinstance(each, str):
                each = Path(each) if os.path.lexists(each) else Path(each.partition("=")[2] or each)  # LABEL=PATH
            kind = command.split()[0] if name == "folder" and command != "campaign init" else name
            if isinstance(each, Path) and kind in _NAMES and not os.path.lexists(each.expanduser()):
                error, message, remedy = _NAMES[kind]
                raise error(message, path=each, remedy=remedy)
