"""Scene files: a `SceneDescription` as TOML. sim/README.md lists the keys.

A file holds the description's fields as tables of their own names, so that what a description can say a file can say.
What is left out has its default. Unknown keys, other types and numbers that are not finite are errors.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from fieldkit.documents.mistaken import refuse_other
from fieldkit.documents.toml_file import FORMAT, read_toml, toml_text
from fieldkit.documents.validation_sentence import validation_sentence
from fieldkit.errors import SceneError
from fieldkit.files import named_file, write_atomic
from fieldkit.runtime.shipped import shipped_page
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.plot_description import PLANT_KINDS, MeshPlantDescription, check_mesh_file

_MAX_BYTES = 16 << 20
"""Largest scene file that is read, bytes."""
_REMEDY = f"{shipped_page('sim/README.md')} lists the keys of a scene file."
_MISSING = "`fieldkit scene new` makes a scene file; `fieldkit scene show` lists those that come with fieldkit."
_ADAPTER = TypeAdapter(SceneDescription)
_NO_KEY = "is not a key of this format"
_NO_TABLE = "should be a table"
_TEXTS = {
    "unexpected_keyword_argument": _NO_KEY,
    "extra_forbidden": _NO_KEY,
    "dataclass_type": _NO_TABLE,
    "dataclass_exact_type": _NO_TABLE,
    "union_tag_not_found": _NO_TABLE,
    "union_tag_invalid": f"is no kind of plant: {' or '.join(PLANT_KINDS)}",
}


def read_scene(path: Path) -> SceneDescription:
    """The scene that a file describes.

    Mesh and cloud files it names are relative to it and lie in its folder or below; only an absolute path may lead
    elsewhere. They become absolute paths and must exist.
    """
    path = Path(path)
    refuse_other(path, "scene file", _REMEDY, error=SceneError)
    document = read_toml(path, "scene file", _REMEDY, _MAX_BYTES, missing=_MISSING, error=SceneError)
    number = document.pop("format", None)
    if number != FORMAT or isinstance(number, bool):
        remedy = f"Put 'format = {FORMAT}' on its first line; a higher one needs a newer fieldkit."
        raise SceneError(f"has 'format' {number}; this fieldkit reads {FORMAT}", path=path, remedy=remedy)
    if isinstance(plot := document.get("plot"), dict):
        plot.setdefault("plants", [])
    try:
        # From JSON, so that arrays may become tuples while everything else stays strict.
        description = _ADAPTER.validate_json(json.dumps(document, default=str))
    except ValidationError as error:
        raise SceneError(_sentence(error), path=path, remedy=_REMEDY) from error
    except (ValueError, RecursionError) as error:
        raise SceneError(f"cannot be understood: {error}", path=path, remedy=_REMEDY) from error

    def existing(file: Path, key: str) -> Path:
        file = named_file(file, path, key, what="scene", error=SceneError)
        try:
            if key.startswith("plot."):
                check_mesh_file(file)
        except SceneError as error:
            raise SceneError(f"{key} ({file}): {error.message}", path=path, remedy=error.remedy) from error
        if not file.is_file():
            remedy = "Put the file there, or correct the path."
            raise SceneError(f"{key}: there is no {file}", path=path, remedy=remedy)
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


def _sentence(error: ValidationError) -> str:
    """The first problem as ``key: what is wrong``, and how many more there are."""
    problems = error.errors(include_url=False, include_context=False)
    key = ""
    for part in problems[0]["loc"]:
        if isinstance(part, int):
            key += f" {part + 1}"
        elif part not in PLANT_KINDS:
            key += f".{part}" if key else str(part)
    return validation_sentence(key or "the scene", problems, _TEXTS)
