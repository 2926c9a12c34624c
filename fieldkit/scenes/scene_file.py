"""Scene files: a `SceneDescription` as TOML. sim/README.md lists the keys.

A file holds the description's fields as tables of their own names, so that what a description can say a file can say.
What is left out has its default. Unknown keys, other types and numbers that are not finite are errors.
"""

from __future__ import annotations

import dataclasses
import json
import os
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from pydantic import TypeAdapter, ValidationError

from fieldkit.documents.mistaken import refuse_other
from fieldkit.documents.toml_file import read_toml, toml_text
from fieldkit.documents.validation_sentence import validation_sentence
from fieldkit.errors import SceneError
from fieldkit.files import named_file, write_atomic
from fieldkit.runtime.shipped import shipped_page
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.plot_description import MeshPlantDescription, check_mesh_file

FORMAT = 1
"""Number of the format of scene files."""
_MAX_BYTES = 16 << 20
"""Largest scene file that is read, bytes."""
_REMEDY = f"{shipped_page('sim/README.md')} lists the keys of a scene file."
_MISSING = "`fieldkit scene new` makes a scene file; `fieldkit scene show` lists those that come with fieldkit."
_ADAPTER = TypeAdapter(SceneDescription)
_KINDS = {"maize": "MaizeDescription", "mesh": "MeshPlantDescription"}
_TEXTS = {
    "unexpected_keyword_argument": "is not a key of this format",
    "extra_forbidden": "is not a key of this format",
    "dataclass_type": "should be a table",
    "dataclass_exact_type": "should be a table",
}


def read_scene(path: Path) -> SceneDescription:
    """The scene that a file describes.

    Mesh and cloud files it names are relative to it and lie in its folder or below; only an absolute path may lead
    elsewhere. They become absolute paths and must exist.
    """
    path = Path(path)
    refuse_other(path, "scene file", _REMEDY, error=SceneError)
    document = read_toml(path, "scene file", _REMEDY, _MAX_BYTES, missing=_MISSING, error=SceneError)
    _check_format(document.pop("format", None), path)
    for place, plant in _plants(document):
        kind = plant.setdefault("kind", "mesh" if "file" in plant else "maize")
        if kind not in tuple(_KINDS):  # a list has no place in a mapping
            raise SceneError(
                f"{place}.kind: {kind!r} is no kind of plant", path=path, remedy=f"It is one of {', '.join(_KINDS)}."
            )
    try:
        # From JSON, so that arrays may become tuples while everything else stays strict.
        description = _ADAPTER.validate_json(json.dumps(document, default=str))
    except ValidationError as error:
        raise SceneError(_sentence(error, document), path=path, remedy=_REMEDY) from error
    except (ValueError, RecursionError) as error:
        raise SceneError(f"cannot be understood: {error}", path=path, remedy=_REMEDY) from error
    return _with_files(description, path)


def scene_text(description: SceneDescription, folder: Path | None = None, *, complete: bool = False) -> str:
    """The canonical text of a scene file.

    Files below ``folder``, where it will lie, are named relative to it. ``complete`` also writes what has its default.
    """
    document = _plain(description, folder, complete)
    return toml_text({"format": FORMAT, **document})


def write_scene(path: Path, description: SceneDescription, *, complete: bool = False) -> None:
    """Write a scene file."""
    path = Path(path)
    write_atomic(path, scene_text(description, Path(os.path.abspath(path.parent)), complete=complete))  # noqa: PTH100


def _check_format(found: Any, path: Path) -> None:
    if found is None:
        raise SceneError("has no 'format'", path=path, remedy=f"Put 'format = {FORMAT}' on its first line.")
    if found != FORMAT or isinstance(found, bool):
        newer = isinstance(found, int) and found > FORMAT
        remedy = "Install a newer fieldkit." if newer else f"Put 'format = {FORMAT}' on its first line."
        raise SceneError(f"has format {found!r}; this fieldkit reads {FORMAT}", path=path, remedy=remedy)


def _plants(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    plot = document.get("plot")
    plants = plot.get("plants") if isinstance(plot, dict) else None
    for i, plant in enumerate(plants if isinstance(plants, list) else [], 1):
        if isinstance(plant, dict):
            yield f"plot.plants {i}", plant
    if isinstance(plot, dict):
        plot.setdefault("plants", [])


def _with_files(description: SceneDescription, path: Path) -> SceneDescription:
    """The description with absolute paths that exist."""
    plants = []
    for i, plant in enumerate(description.plot.plants, 1):
        kept: Any = plant
        if isinstance(plant, MeshPlantDescription):
            file = named_file(plant.file, path, f"plot.plants {i}.file", what="scene", error=SceneError)
            try:
                check_mesh_file(file, plant.sha256)
            except SceneError as error:
                raise SceneError(
                    f"plot.plants {i}.file ({file}): {error.message}", path=path, remedy=error.remedy
                ) from error
            kept = dataclasses.replace(plant, file=file)
        plants.append(kept)
    recorded = description.recorded
    if recorded is not None:
        files: dict[str, Any] = {key: _existing(file, path, f"recorded.{key}") for key, file in recorded.files.items()}
        recorded = dataclasses.replace(recorded, **files)
    return dataclasses.replace(
        description,
        plot=dataclasses.replace(description.plot, plants=tuple(plants)),
        recorded=recorded,
        name=description.name or path.stem,
    )


def _existing(file: Path, scene: Path, key: str) -> Path:
    found = named_file(file, scene, key, what="scene", error=SceneError)
    if not found.is_file():
        raise SceneError(f"{key}: there is no {found}", path=scene, remedy="Put the file there, or correct the path.")
    return found


def _plain(value: Any, folder: Path | None, complete: bool) -> dict[str, Any]:
    """A dataclass as plain values for TOML, without what has its default."""
    hints = typing.get_type_hints(type(value))
    table: dict[str, Any] = {}
    for field in sorted(dataclasses.fields(value), key=lambda f: f.name != "kind"):
        item = getattr(value, field.name)
        if not complete and field.name != "kind" and _has_default(field, item):
            continue
        table[field.name] = _plain_value(item, hints[field.name], folder, complete)
    if complete:
        return table
    return {key: item for key, item in table.items() if item != {}}


def _plain_value(item: Any, hint: Any, folder: Path | None, complete: bool) -> Any:
    if dataclasses.is_dataclass(item):
        return _plain(item, folder, complete)
    if isinstance(item, Path):
        inside = folder is not None and item.is_absolute() and item.is_relative_to(folder.resolve())
        return (item.relative_to(cast(Path, folder).resolve()) if inside else item).as_posix()
    if isinstance(item, list | tuple):
        part = next(iter(getattr(hint, "__args__", ())), None)
        return [_plain_value(each, part, folder, complete) for each in item]
    if hint is float:
        return float(item)
    return item


def _has_default(field: dataclasses.Field[Any], item: Any) -> bool:
    if field.default is not dataclasses.MISSING:
        return bool(item == field.default)
    if field.default_factory is not dataclasses.MISSING:
        return bool(item == field.default_factory())
    return False


def _sentence(error: ValidationError, document: dict[str, Any]) -> str:
    """The first problem as ``key: what is wrong``, and how many more there are."""
    problems = [p for p in error.errors(include_url=False, include_context=False) if not _other_kind(p, document)]
    key = ""
    for part in problems[0]["loc"]:
        if isinstance(part, int):
            key += f" {part + 1}"
        elif part not in _KINDS.values():
            key += f".{part}" if key else str(part)
    return validation_sentence(key or "the scene", problems, _TEXTS)


def _other_kind(problem: Any, document: dict[str, Any]) -> bool:
    """Whether a problem only says that a plant of one kind is none of another kind."""
    location = problem["loc"]
    if len(location) < 4 or location[:2] != ("plot", "plants") or location[3] not in _KINDS.values():
        return False
    plant = document["plot"]["plants"][location[2]]
    return isinstance(plant, dict) and _KINDS[plant["kind"]] != location[3]
