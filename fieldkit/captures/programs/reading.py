"""Which files are other programs' results, and reading them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from fieldkit.captures.programs.colmap_folder import colmap_suffix, read_colmap
from fieldkit.captures.programs.metashape_text import looks_like_opk, read_metashape_text
from fieldkit.captures.programs.metashape_xml import read_metashape_xml
from fieldkit.captures.programs.model import PosesFile, ProgramCamera, ProgramPoses, check_open
from fieldkit.captures.programs.opendronemap import (
    CAMERAS,
    RECONSTRUCTION,
    SHOTS,
    TOPOCENTRIC,
    read_cameras,
    read_reconstruction,
    read_shots,
)
from fieldkit.errors import MetadataError
from fieldkit.regular_files import open_regular

_COLMAP_FILES = ("images", "cameras", "points3D", "rigs", "frames")
_COLMAP_PLACES = ("sparse/0", "sparse", ".")
_ODM_PLACES = (
    f"opensfm/{TOPOCENTRIC}", TOPOCENTRIC, f"opensfm/{RECONSTRUCTION}", RECONSTRUCTION, f"odm_report/{SHOTS}", SHOTS,
)  # fmt: skip
_HEAD_BYTES = 4096
_MOST_FILES = 50
_KINDS = (
    "Give a COLMAP model's folder, OpenDroneMap's reconstruction.json or shots.geojson, or Metashape's cameras as "
    "Agisoft XML or Omega Phi Kappa."
)


def find_results(folders: Sequence[Path]) -> list[Path]:
    """Results with poses in a capture's folders, where their programs put them, the first to be used first.

    COLMAP's model in ``sparse/0``, ``sparse`` or the folder itself; OpenDroneMap's files in its project's folder or the
    capture's; Metashape's exports by their content, whatever their names.
    """
    found = [path for folder in dict.fromkeys(folders) for path in _in_folder(folder)]
    roots = [folder.resolve() for folder in folders]
    return [path for path in dict.fromkeys(found) if any(path.resolve().is_relative_to(root) for root in roots)]


def find_cameras_json(folders: Sequence[Path]) -> Path | None:
    """OpenDroneMap's cameras.json in a capture's folders, or None."""
    return next((path for folder in folders if (path := folder / CAMERAS).is_file()), None)


def read_cameras_json(folders: Sequence[Path]) -> tuple[Path, tuple[ProgramCamera, ...]] | None:
    """OpenDroneMap's cameras.json beside photographs, and its calibrations; None where there is none.

    Raises:
        MetadataError: it is malformed.
    """
    path = find_cameras_json(folders)
    return None if path is None else (path, read_cameras(path))


def read_result(given: PosesFile) -> ProgramPoses:
    """Another program's result.

    Raises:
        MetadataError: it is none that is read, unreadable, malformed, or says itself what frame it is in.
    """
    path, frame = given.path, given.frame
    if path.is_dir():
        places = [path, path / "sparse" / "0", path / "sparse"]
        model = next((place for place in places if _is_model(place)), None)
        if model is not None:
            return read_colmap(model, frame)
        inside = find_results([path])
        if not inside:
            raise MetadataError("this folder holds no result with poses", path=path, remedy=_KINDS)
        return read_result(PosesFile(inside[0], frame))
    suffix = path.suffix.lower()
    if suffix in (".bin", ".txt") and path.stem in _COLMAP_FILES and _is_model(path.parent):
        return read_colmap(path.parent, frame)
    if suffix == ".xml":
        return read_metashape_xml(path, frame)
    if suffix in (".json", ".geojson"):
        check_open(frame, path)
        if path.name.lower() == CAMERAS:
            raise MetadataError("has calibrations, and no poses", path=path, remedy=_KINDS)
        if suffix == ".geojson":
            return read_shots(path)
        before = path.with_name(TOPOCENTRIC)
        return read_reconstruction(before if path.name == RECONSTRUCTION and before.is_file() else path)
    if looks_like_opk(_head(path)):
        return read_metashape_text(path, frame)
    raise MetadataError("is no result of COLMAP, OpenDroneMap or Metashape", path=path, remedy=_KINDS)


def _in_folder(folder: Path) -> Iterator[Path]:
    model = next((folder / place for place in _COLMAP_PLACES if _is_model(folder / place)), None)
    if model is not None:
        yield model
    for name in _ODM_PLACES:
        if (folder / name).is_file():
            yield folder / name
            break
    try:
        names = sorted(entry.name for entry in os.scandir(folder) if entry.name.lower().endswith((".xml", ".txt")))
    except OSError:
        return
    for name in names[:_MOST_FILES]:
        head = _head(folder / name)
        if looks_like_opk(head) or (name.lower().endswith(".xml") and "<document" in head and "<chunk" in head):
            yield folder / name


def _is_model(folder: Path) -> bool:
    """Whether a folder holds a COLMAP model. Metashape's cameras may be called cameras.txt, too."""
    suffix = colmap_suffix(folder)
    return suffix is not None and not looks_like_opk(_head(folder / f"cameras{suffix}"))


def _head(path: Path) -> str:
    """The first characters of a file; "" where it cannot be read."""
    try:
        with open_regular(path) as file:
            return file.read(_HEAD_BYTES).decode("utf-8", "replace").lstrip("\ufeff")
    except (OSError, ValueError):
        return ""
