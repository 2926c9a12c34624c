"""Scene files: a `SceneDescription` as TOML. sim/README.md lists the keys.

A file holds the description's fields as tables of their own names, so that what a description can say a file can say.
What is left out has its default. Unknown keys, other types and numbers that are not finite are errors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from fieldkit.documents.mistaken import refuse_other
from fieldkit.documents.toml_file import FORMAT, read_versioned, toml_text, validated
from fieldkit.errors import MetadataError, about
from fieldkit.files import named_file, write_atomic
from fieldkit.runtime.shipped import shipped_page
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.plot_description import MeshPlantDescription

_MAX_BYTES = 16 << 20
"""Largest scene file that is read, bytes."""
_REMEDY = f"{shipped_page('sim/README.md')} lists the keys of a scene file."
_ADAPTER = TypeAdapter(SceneDescription)


def read_scene(path: Path) -> SceneDescription:
    """The scene that a file describes.

    Mesh and cloud files it names are relative to it and lie in its folder or below; only an absolute path may lead
    elsewhere. They become absolute paths and must exist.
    """
    with about(path := Path(path), _REMEDY):
        return _read(path)


def _read(path: Path) -> SceneDescription:
    refuse_other(path, "scene file")
    document = read_versioned(path, "scene file", _MAX_BYTES)
    if isinstance(plot := document.get("plot"), dict):
        plants = plot.setdefault("plants", [])
        for plant in plants if isinstance(plants, list) else ():
            if isinstance(plant, dict):
                plant.setdefault("kind", "mesh" if "file" in plant else "maize")
    description = validated(_ADAPTER, document)

    def existing(file: Path, key: str) -> Path:
        file = named_file(file, path, key, what="scene")
        if not file.is_file():
            raise MetadataError(f"{key}: there is no {file}", remedy="Put the file there, or correct the path.")
        return file

    return replace(_with_files(description, existing), name=description.name or path.stem)


def scene_text(description: SceneDescription, folder: Path | None = None, *, complete: bool = False) -> str:
    """The canonical text of a scene file.

    Files below ``folder``, where it will lie, are named relative to it. ``complete`` also writes what has its default.
    """

    def named(file: Path, _: str) -> Path:
        inside = folder is not None and file.is_absolute() and file.is_relative_to(folder.resolve())
        return file.relative_to(folder.resolve()) if folder is not None and inside else file

    document = _ADAPTER.dump_python(_with_files(description, named), mode="json", exclude_defaults=not complete)
    if plot := document.get("plot"):
        plot["plants"] = [
            {"kind": plant.kind, **table} for plant, table in zip(description.plot.plants, plot["plants"], strict=True)
        ]
        if "soil" in plot:
            plot["soil"] = {"kind": description.plot.soil.kind, **plot["soil"]}
    return toml_text({"format": FORMAT, **document})


def write_scene(path: Path, description: SceneDescription, *, complete: bool = False) -> None:
    """Write a scene file."""
    path = Path(path)
    write_atomic(path, scene_text(description, path.parent.absolute(), complete=complete))


def _with_files(description: SceneDescription, change: Callable[[Path, str], Path]) -> SceneDescription:
    """The description with each file that it names changed, given the file and its key."""
    plants = tuple(
        replace(plant, file=change(plant.file, f"plot.plants {number}.file"))
        if isinstance(plant, MeshPlantDescription)
        else plant
        for number, plant in enumerate(description.plot.plants, 1)
    )
    recorded = description.recorded
    if recorded is not None:
        files: dict[str, Any] = {key: change(file, f"recorded.{key}") for key, file in recorded.files.items()}
        recorded = replace(recorded, **files)
    return replace(description, plot=replace(description.plot, plants=plants), recorded=recorded)
