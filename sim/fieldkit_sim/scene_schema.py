"""What the keys of a scene file mean: as a JSON Schema, and by dataclass for the table in sim/README.md."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import typing
from typing import Any, cast

from pydantic import TypeAdapter

from fieldkit.documents.json_file import schema_text
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.scene_file import FORMAT


def scene_schema() -> str:
    """JSON Schema (2020-12) of a scene file, as text that ends in a newline."""
    schema = TypeAdapter(SceneDescription).json_schema(mode="validation")
    schema["properties"] = {"format": {"const": FORMAT, "type": "integer"}, **schema["properties"]}
    schema["required"] = ["format", *schema.get("required", [])]
    _describe(schema)
    return schema_text(schema)


def described_types() -> list[type]:
    """The dataclasses that make up a scene file, each once, the outermost first."""
    found: list[type] = []

    def visit(kind: Any) -> None:
        if dataclasses.is_dataclass(kind) and isinstance(kind, type):
            if kind not in found:
                found.append(kind)
                for hint in _hints(kind).values():
                    visit(hint)
            return
        for part in getattr(kind, "__args__", ()):
            visit(part)

    visit(SceneDescription)
    return found


def key_docs(kind: type) -> dict[str, str]:
    """What a dataclass says of each field: the string behind it, or behind the next field that has one."""
    fields = {field.name for field in dataclasses.fields(kind)}
    docs: dict[str, str] = {}
    waiting: list[str] = []
    for part in cast(ast.ClassDef, ast.parse(inspect.getsource(kind)).body[0]).body:
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name) and part.target.id in fields:
            waiting.append(part.target.id)
        elif isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant) and waiting:
            docs |= dict.fromkeys(waiting, " ".join(str(part.value.value).split()))
            waiting = []
    return docs


def _hints(kind: type) -> dict[str, Any]:
    return {k: v for k, v in typing.get_type_hints(kind).items() if k in {f.name for f in dataclasses.fields(kind)}}


def _describe(schema: dict[str, Any]) -> None:
    for kind in described_types():
        part = schema if kind is SceneDescription else schema["$defs"].get(kind.__name__)
        if part is None:
            continue
        part["description"] = (kind.__doc__ or "").strip().split("\n\n")[0]
        for name, text in key_docs(kind).items():
            part["properties"][name].setdefault("description", text)
