"""The scenes that come with fieldkit (sim/scenes), by name."""

from __future__ import annotations

from pathlib import Path

from fieldkit.documents.mistaken import did_you_mean, refuse_other
from fieldkit.errors import SceneError
from fieldkit.runtime.shipped import shipped_folder

_SUFFIX = ".toml"


def scenes_folder() -> Path:
    """The folder of the scene files."""
    return shipped_folder("sim/scenes")


def scene_names() -> list[str]:
    """The names `find_scene` knows, sorted."""
    return sorted(path.stem for path in scenes_folder().glob(f"*{_SUFFIX}"))


def find_scene(name: str | Path) -> Path:
    """The scene file that a person means: a path, a folder with scene.toml, or a name such as "case-1".

    A file of that name in the current folder comes before a scene of fieldkit's own.
    """
    path = Path(name)
    if path.is_dir() and (path / "scene.toml").is_file():
        return path / "scene.toml"
    if path.is_file():
        return path
    known = scene_names()
    if path.exists():
        refuse_other(path, "scene file", "A folder with scene.toml will do, too.")
    text = str(name).removesuffix(_SUFFIX)
    if text in known:
        return scenes_folder() / f"{text}{_SUFFIX}"
    remedy = did_you_mean(text, known, "`fieldkit scene show` lists the scenes that come with fieldkit.")
    raise SceneError("there is no such scene file", path=path, remedy=remedy)


def scene_reference(file: Path) -> Path:
    """What `find_scene` finds a scene file by on every machine: its name where it is fieldkit's own, else its path."""
    file = file.resolve()
    return Path(file.stem) if file.parent == scenes_folder().resolve() else file
