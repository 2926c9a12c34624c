"""Files that come with fieldkit beside its code: scenes, recorded flights, vehicle profiles, example sites."""

from __future__ import annotations

from pathlib import Path

import fieldkit

_INSTALLED = "shipped"


def shipped_folder(name: str) -> Path:
    """A folder by its path in the repository: in the installed package, or in the repository it runs from.

    Example:
        >>> shipped_folder("sim/scenes")
    """
    package = Path(fieldkit.__file__).parent
    installed = package / _INSTALLED / name
    return installed if installed.is_dir() else package.parent / name
