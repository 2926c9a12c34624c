"""What the models of all result files share: strictness, and the ranges of their numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Vector = tuple[float, float, float]
Count = Annotated[int, Field(ge=0)]
Ordinal = Annotated[int, Field(ge=1)]
Length = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=180)]
Heading = Annotated[float, Field(ge=-360, le=360)]
Pitch = Annotated[float, Field(ge=-90, le=90)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def vector(values: Iterable[float]) -> Vector:
    """Three numbers, perhaps of an array, as models hold them."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def finite(value: float | None) -> float | None:
    """None where it is not finite, for JSON has no such numbers."""
    return None if value is None or not math.isfinite(value) else float(value)


def clean_text(text: str) -> str:
    """Text that UTF-8 can hold: names of files may have bytes that are none."""
    return text.encode("utf-8", "backslashreplace").decode()


Text = Annotated[str, BeforeValidator(lambda given: clean_text(given) if isinstance(given, str) else given)]
"""Text that is made one that UTF-8 can hold."""

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, use_attribute_docstrings=True)


class Strict(BaseModel):
    """Unknown keys, other types and numbers that are not finite are errors; values are never coerced."""

    model_config = STRICT | {"frozen": True}
