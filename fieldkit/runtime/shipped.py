"""Files that come with fieldkit beside its code: scenes, recorded flights, vehicle profiles, example sites, pages."""

from __future__ import annotations

from pathlib import Path

_INSTALLED = "shipped"


def shipped_folder(name: str) -> Path:
    """A folder by its path in the repository: in the installed package, or in the repository it runs from.

    Example:
        >>> shipped_folder("sim/scenes")
    """
    return _shipped(name)


def shipped_page(name: str) -> Path:
    """A page of the documentation that messages point to, by its path in the repository; see `shipped_folder`.

    Example:
        >>> shipped_page("missions/README.md")
    """
    return _shipped(name)


def _shipped(name: str) -> Path:
    package = Path(__file__).parents[1]
    installed = package / _INSTALLED / name
    return installed if installed.exists() else package.parent / name
