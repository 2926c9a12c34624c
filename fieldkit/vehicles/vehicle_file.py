"""Vehicle profiles: those that come with fieldkit (missions/vehicles), by name, and those of people, by path.

missions/README.md lists the keys.
"""

from __future__ import annotations

from pathlib import Path

from fieldkit.documents.mistaken import did_you_mean, refuse_other
from fieldkit.documents.toml_file import read_versioned, validated_toml
from fieldkit.errors import MetadataError, about
from fieldkit.runtime.shipped import shipped_folder, shipped_page
from fieldkit.vehicles.vehicle import Vehicle

_SUFFIX = ".toml"
_MAX_BYTES = 256 << 10
"""Largest vehicle profile that is read, bytes."""
_REMEDY = f"{shipped_page('missions/README.md')} lists the keys of a vehicle profile."


def missions_folder() -> Path:
    """The folder of vehicle profiles and example sites."""
    return shipped_folder("missions")


def vehicles_folder() -> Path:
    """The folder of the profiles that come with fieldkit."""
    return missions_folder() / "vehicles"


def vehicle_names() -> list[str]:
    """The names `find_vehicle` knows, sorted."""
    return sorted(path.stem for path in vehicles_folder().glob(f"*{_SUFFIX}"))


def find_vehicle(name: str | Path) -> Path:
    """The profile that a person means: a path, or a name such as "ardupilot-pitch".

    A file of that name in the current folder comes before a profile of fieldkit's own.
    """
    path = Path(name)
    try:
        if path.is_file():
            return path
    except (OSError, ValueError):  # too long for a path, a NUL in it
        pass
    known = vehicle_names()
    text = str(name).removesuffix(_SUFFIX)
    if text in known:
        return vehicles_folder() / f"{text}{_SUFFIX}"
    remedy = did_you_mean(text, known, f"Give the path of a profile, or one of: {', '.join(known)}.")
    raise MetadataError("there is no such vehicle profile", path=path, remedy=remedy)


def load_vehicle(name: str | Path) -> Vehicle:
    """Read a vehicle profile, by path or by name."""
    path = find_vehicle(name)
    with about(path, _REMEDY):
        refuse_other(path, "vehicle profile")
        return validated_toml(Vehicle, read_versioned(path, "vehicle profile", _MAX_BYTES))
