"""Something a person should know: of a photograph, a plot, a plan on a plot, a mission's item or a station."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AliasChoices, Field, model_serializer
from pydantic.dataclasses import dataclass
from pydantic.json_schema import SkipJsonSchema

from fieldkit.results.fields import STRICT, Count, Text

Severity = Literal["error", "warning"]


@dataclass(frozen=True, config=STRICT)
class Finding:
    """Something a person should know about one file or plot."""

    subject: Annotated[Text, Field(validation_alias=AliasChoices("name", "subject"))]
    """The file."""
    code: str
    """Kebab-case; docs/captures.md lists those of captures."""
    message: Text
    left_out: bool = False
    """Whether the file was not used because of it."""
    severity: SkipJsonSchema[Severity] = "warning"
    """With an error a plan or mission must not be flown."""
    remedy: SkipJsonSchema[Text] = ""
    """What to do about it; empty where there is nothing to do."""
    item: SkipJsonSchema[Count | None] = None
    """Number of a mission's item, as its file counts."""
    photograph: SkipJsonSchema[Count | None] = None
    """Of a mission, by its place in the file, from 0."""
    station: SkipJsonSchema[Count | None] = None
    """Of the plan, from 0."""

    def __str__(self) -> str:
        return f"{self.subject}: {self.message}" if self.subject else self.message

    @model_serializer
    def stored(self) -> dict[str, Any]:
        """As files and `--json` have one about photographs."""
        return {"name": self.subject, "code": self.code, "message": self.message, "left_out": self.left_out}
