"""Which plots a folder of captures holds."""

from __future__ import annotations

from pathlib import Path

from fieldkit.captures.folder import list_capture, natural_key
from fieldkit.errors import CaptureError
from fieldkit.results.fields import clean_text


def find_plots(captures: Path) -> tuple[list[tuple[str, Path]], list[str]]:
    """Names and folders of the plots, and the names of the subfolders that were passed over; names as text.

    A folder that holds photographs is one plot; else its subfolders are the plots.

    Photographs in ``captures/images``, or in a card's 100MEDIA and 101MEDIA, make ``captures`` one plot. Subfolders
    without any image file are passed over; one that cannot be read, or whose images cannot be used, still counts, so
    that it is reported. So does the folder itself where no subfolder counts.
    """
    captures = Path(captures)
    itself = [(clean_text(captures.absolute().name), captures)]
    contents = list_capture(captures)
    if contents.candidates:
        return itself, []
    folders = sorted((p for p in captures.iterdir() if p.is_dir() and not p.name.startswith(".")),
                     key=lambda p: natural_key(p.name))  # fmt: skip
    plots = [(clean_text(folder.name), folder) for folder in folders if _holds_images(folder)]
    if not plots and any(finding.left_out for finding in contents.findings):
        return itself, []  # reading it says what is wrong with each file
    if not plots:
        raise CaptureError(
            "there are no photographs in this folder, nor in its subfolders",
            path=captures,
            remedy="Give a folder of photographs, or a folder with one folder of photographs per plot.",
        )
    counted = {folder for _, folder in plots}
    return plots, [clean_text(folder.name) for folder in folders if folder not in counted]


def count_photographs(folder: Path) -> int:
    """Image files of a plot's folder; 0 where it cannot be read."""
    try:
        return len(list_capture(folder).candidates)
    except CaptureError:
        return 0


def _holds_images(folder: Path) -> bool:
    try:
        contents = list_capture(folder)
    except CaptureError:
        return True  # reading it says what is wrong
    return bool(contents.candidates) or any(finding.left_out for finding in contents.findings)
