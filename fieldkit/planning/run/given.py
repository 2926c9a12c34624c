"""What a run may be planned on, as far as the options tell. Light, so that slips are told at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fieldkit.errors import UsageError
from fieldkit.wording import count


def check_given(
    scenes: Sequence[Path], references: Sequence[Path], captures: Path | str | None, images: Sequence[Path]
) -> bool:
    """Whether a run is planned on recorded photographs. Raises UsageError: what is given does not go together."""
    recorded = captures is not None and not scenes
    if images and (recorded or not references):
        raise UsageError("--images are a reference's photographs", remedy="Give --reference, too, or leave it out.")
    if recorded and len(references) > 1:
        raise UsageError("recorded photographs have one reference", remedy="Give --reference once.")
    if not recorded and bool(scenes) == bool(references):
        raise UsageError(
            "plan on what?", remedy="Give --scene SCENE, --reference REF or --captures IMAGES [--reference REF]."
        )
    if images and len(images) != len(references):
        raise UsageError(
            f"--images is given {count(len(images), 'time')} for {count(len(references), 'reference')}",
            remedy="Give it once for each --reference, in the same order.",
        )
    return recorded
