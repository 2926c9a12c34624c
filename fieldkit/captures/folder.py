"""Which files of a folder are photographs: by content, with everything else named and left out."""

from __future__ import annotations

import os
import re
import unicodedata
from dataclasses import dataclass, replace
from pathlib import Path

from fieldkit.errors import CaptureError
from fieldkit.regular_files import check_regular, open_regular
from fieldkit.results.finding import Finding

PHOTO_SUFFIXES = frozenset({".jpg", ".jpeg", ".jpe", ".jfif", ".png", ".tif", ".tiff"})
RAW_SUFFIXES = frozenset(
    {".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".rw2", ".raf", ".pef", ".srw", ".3fr", ".iiq", ".raw"}
)
SIDECARS = ("poses.csv", "geo.txt", "camera.toml", "camera.json", "markers.toml")
"""Found in whatever case their names are written."""
CONTROL_POINTS = ("gcp_list.txt", "gcp.txt")
"""ODM's files of ground control points, which are not read."""

_FORMAT_SUFFIXES = {"JPEG": {".jpg", ".jpeg", ".jpe", ".jfif"}, "PNG": {".png"}, "TIFF": {".tif", ".tiff"}}
_BEGINNINGS = {
    "JPEG": rb"\xff\xd8\xff",
    "PNG": rb"\x89PNG\r\n\x1a\n",
    "TIFF": rb"II[*+]\0|MM\0[*+]",
    "AVIF": rb"....ftypavi[fs]",
    "HEIC": rb"....ftyp(hei[cxms]|hev[cx]|mif1|msf1)",
    "WebP": rb"RIFF....WEBP",
    "GIF": rb"GIF8[79]a",
    "BMP": rb"BM....\0{4}",
    "JPEG 2000": rb"\0\0\0\x0cjP  ",
    "JPEG XL": rb"\xff\x0a|\0\0\0\x0cJXL ",
}
"""Of files, by the format that they announce."""
_MASK = re.compile(r"(^|[._-])mask\.[a-z]+$", re.IGNORECASE)
_THUMBNAIL_SUFFIXES = frozenset({".thm"})
_HEAD_BYTES = 64
"""Bytes of a file by which its kind is told."""
_CONTROL_POINTS_UNUSED = (
    "ground control points are not read; scale and place come from poses.csv, geo.txt, GPS or printed markers"
)
_CARD_FOLDER = re.compile(
    r"[1-9][0-9]{2}(MEDIA|MSDCF|CANON|EOS..|GOPRO|NIKON|ND[0-9]{3}|OLYMP|_PANA|_FUJI|PENTX|RICOH|SIGMA|LEICA|APPLE)",
    re.IGNORECASE,
)
_ANY_CARD_FOLDER = re.compile(r"[1-9][0-9]{2}[A-Z0-9_]{5}", re.IGNORECASE)
"""Folders of a camera's card (DCF, CIPA DC-009): three digits that count on when one is full, and five characters."""


@dataclass(frozen=True)
class Candidate:
    """A file whose first bytes are those of a photograph."""

    path: Path
    name: str
    format: str


@dataclass(frozen=True)
class FolderContents:
    """What lies in a capture's folder."""

    image_folder: Path
    candidates: tuple[Candidate, ...]
    sidecars: dict[str, Path]
    findings: tuple[Finding, ...]


def natural_key(name: str) -> tuple[tuple[int, int | str], ...]:
    """A sort key by which ``IMG_2`` comes before ``IMG_10``."""
    parts = re.split(r"([0-9]+)", unicodedata.normalize("NFC", name))
    key: list[tuple[int, int | str]] = []
    for index, part in enumerate(parts):
        if index % 2:
            key.append((0, int(part[-4000:])))
        elif part:
            key.append((1, part.casefold()))
    # Names equal but for case or leading zeros still need one order everywhere.
    return (*key, (2, name))


def sniff_format(head: bytes) -> str | None:
    """The image format that a file's first bytes (64 or more) announce, or None."""
    return next((kind for kind, begin in _BEGINNINGS.items() if re.match(begin, head, re.DOTALL)), None)


def is_mask_name(name: str) -> bool:
    """Whether a file's name marks it as a mask: ``X.mask.png``, ``X_mask.png``, ``mask.png``."""
    return _MASK.search(name) is not None


def find_mask(path: Path) -> Path | None:
    """The mask image that belongs to a photograph, or None.

    Looked for, in this order: ``X.jpg.mask.png``, ``X.mask.png``, ``X_mask.png`` and ``X_mask`` with the
    photograph's own suffix beside it, then ``X.jpg.png`` (COLMAP's), ``X.png`` and ``X.jpg`` in ``masks/``.
    """
    stem, suffix, folder = path.stem, path.suffix, path.parent
    beside = [f"{path.name}.mask.png", f"{stem}.mask.png", f"{stem}_mask.png", f"{stem}_mask{suffix}"]
    inside = [f"{path.name}.png", f"{stem}.png", path.name]
    for candidate in [*(folder / n for n in beside), *(folder / "masks" / n for n in inside)]:
        if _is_file(candidate):
            return candidate
    return None


def list_folder(folder: Path) -> FolderContents:
    """Sort a folder's files into photographs, sidecars and what is left out.

    Photographs lie directly in ``folder``; when there are none, ``folder/images`` is used. Hidden files, masks and
    files that are neither images nor named like one are passed over in silence.
    """
    root = Path(folder)
    try:
        resolved = root.resolve(strict=True)
    except (OSError, RuntimeError) as error:
        reason = "the folder does not exist" if not os.path.lexists(root) else f"cannot be opened ({_reason(error)})"
        raise CaptureError(reason, path=root, remedy="Give the folder that holds the photographs.") from error
    if not resolved.is_dir():
        raise CaptureError(
            "this is a file, not a folder", path=root, remedy="Give the folder that holds the photographs."
        )
    candidates, findings = _scan(root, resolved)
    image_folder = root
    inner = root / "images"
    if not candidates and inner.is_symlink() and not _stays_inside(inner, resolved):
        findings.append(Finding("images", "symlink-outside", "a symbolic link that leaves the folder", True))
    elif not candidates and inner.is_dir():
        inner_candidates, inner_findings = _scan(inner, resolved)
        if inner_candidates or not findings:
            candidates, image_folder = inner_candidates, inner
            findings = findings + inner_findings
    sidecars, sidecar_findings = _find_sidecars((image_folder, root), resolved)
    return FolderContents(image_folder, tuple(candidates), sidecars, tuple(findings + sidecar_findings))


def list_capture(folder: Path) -> FolderContents:
    """As `list_folder`; a camera's card, whose folders 100MEDIA and 101MEDIA hold one flight, is one capture.

    So it is for a folder that holds no photographs itself, only such folders, two or more, directly or in ``DCIM``. The
    photographs' names are then paths, since cameras begin to count anew in each folder: ``101MEDIA/DJI_0001.JPG``.
    """
    contents = list_folder(folder)
    if contents.candidates or any(finding.left_out for finding in contents.findings):
        return contents
    root = Path(folder)
    resolved = root.resolve()
    for base in (root, *(path for path in _subfolders(root) if path.name.upper() == "DCIM")):
        halves = _card_folders(base)
        if not halves:
            continue
        candidates: list[Candidate] = []
        findings: list[Finding] = []
        for half in halves:
            inner, odd = _scan(half, resolved)
            candidates += [replace(c, name=f"{half.name}/{c.name}") for c in inner]
            findings += [replace(f, subject=f"{half.name}/{f.subject}") for f in odd]
            findings += [
                Finding(f"{half.name}/{path.name}", "sidecar-unused", f"put it into {base.name}, beside {half.name}")
                for path in _find_sidecars((half,), resolved)[0].values()
            ]
        sidecars, sidecar_findings = _find_sidecars((base, root), resolved)
        return FolderContents(base, tuple(candidates), sidecars, (*findings, *sidecar_findings))
    return contents


def folders_of_photographs(folder: Path) -> list[str]:
    """Names of the subfolders that hold photographs, directly or in their ``images``."""
    return [path.name for path in _subfolders(folder) if list_folder(path).candidates]


def _card_folders(base: Path) -> list[Path]:
    """The folders of a card that hold photographs; none where there are fewer than two, or others beside them."""
    pattern = _ANY_CARD_FOLDER if base.name.upper() == "DCIM" else _CARD_FOLDER
    with_photographs = [path for path in _subfolders(base) if list_folder(path).candidates]
    alike = len(with_photographs) > 1 and all(pattern.fullmatch(path.name) for path in with_photographs)
    return with_photographs if alike else []


def _subfolders(folder: Path) -> list[Path]:
    """Of a folder, in natural order, without hidden ones and links."""
    try:
        with os.scandir(folder) as entries:
            names = [e.name for e in entries if _is_folder(e) and not e.is_symlink() and not e.name.startswith(".")]
    except OSError:
        return []
    return [Path(folder) / name for name in sorted(names, key=natural_key) if os.access(Path(folder) / name, os.R_OK)]


def _is_text(name: str) -> bool:
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _reason(error: BaseException) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()


def _scan(folder: Path, root: Path) -> tuple[list[Candidate], list[Finding]]:
    try:
        with os.scandir(folder) as entries:
            names = sorted((e.name for e in entries if not _is_folder(e)), key=natural_key)
    except OSError as error:
        raise CaptureError(
            f"the folder cannot be read ({_reason(error)})", path=folder, remedy="Check its permissions."
        ) from error
    candidates: list[Candidate] = []
    findings: list[Finding] = []
    for name in names:
        if name.startswith(".") or name.lower() in SIDECARS or is_mask_name(name):
            continue
        if not _is_text(name):
            shown = name.encode("utf-8", "backslashreplace").decode()
            findings.append(Finding(shown, "bad-name", "the file's name is not UTF-8; rename it", True))
            continue
        found = _classify(folder / name, root)
        if isinstance(found, Finding):
            findings.append(found)
        elif found is not None:
            candidates.append(found)
            expected = _FORMAT_SUFFIXES[found.format]
            if found.path.suffix.lower() not in expected:
                findings.append(Finding(name, "wrong-suffix", f"the content is {found.format}; read as such"))
    return candidates, findings


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # beside a photograph whose name is as long as names can be, X_mask.png is too long
        return False


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a symbolic link that leads to itself
        return False


def _classify(path: Path, root: Path) -> Candidate | Finding | None:
    """A photograph, a finding that leaves the file out, or None for a file that is none of our business."""
    name, suffix = path.name, path.suffix.lower()
    named_like_one = suffix in PHOTO_SUFFIXES
    if suffix in _THUMBNAIL_SUFFIXES:
        return None
    if path.is_symlink() and not _stays_inside(path, root):
        if not named_like_one and suffix not in RAW_SUFFIXES:
            return None
        return Finding(name, "symlink-outside", "a symbolic link that leaves the folder or leads nowhere", True)
    if suffix in RAW_SUFFIXES:
        return Finding(name, "unsupported-format", "a raw file; convert it to JPEG or TIFF", True)
    try:
        if check_regular(path).st_size == 0:
            message = "0 bytes; copy it again from the camera"
            return Finding(name, "empty-file", message, True) if named_like_one else None
        with open_regular(path) as stream:
            head = stream.read(_HEAD_BYTES)
    except OSError as error:
        return Finding(name, "unreadable", f"cannot be read ({_reason(error)})", True) if named_like_one else None
    kind = sniff_format(head)
    if kind in _FORMAT_SUFFIXES:
        return Candidate(path, name, str(kind))
    if kind is not None:
        return Finding(name, "unsupported-format", f"{kind} is not read; convert it to JPEG", True)
    if named_like_one:
        return Finding(name, "not-an-image", "the content is neither JPEG, PNG nor TIFF", True)
    return None


def _stays_inside(path: Path, root: Path) -> bool:
    try:
        return path.resolve(strict=True).is_relative_to(root)
    except (OSError, RuntimeError):
        return False


def _find_sidecars(folders: tuple[Path, ...], root: Path) -> tuple[dict[str, Path], list[Finding]]:
    found: dict[str, Path] = {}
    findings: list[Finding] = []
    for folder in dict.fromkeys(folders):
        for path in _text_files(folder):
            name = path.name.lower()
            if name in CONTROL_POINTS:
                findings.append(Finding(path.name, "control-points-unused", _CONTROL_POINTS_UNUSED))
            elif path.is_symlink() and not _stays_inside(path, root):
                findings.append(
                    Finding(
                        path.name, "symlink-outside", "a symbolic link that leaves the folder or leads nowhere", True
                    )
                )
            elif path.is_file() and name not in found:
                found[name] = path
            elif path.is_file() and found[name].parent == folder:
                findings.append(Finding(path.name, "sidecar-unused", f"{found[name].name} is used instead"))
            elif not path.is_dir():
                findings.append(Finding(path.name, "unreadable", "not a regular file", True))
    return found, findings


def _text_files(folder: Path) -> list[Path]:
    """Sidecars and control points in a folder, those first whose names are in small letters."""
    known = (*SIDECARS, *CONTROL_POINTS)
    try:
        found = [path for path in Path(folder).iterdir() if path.name.lower() in known]
    except OSError:
        return []
    return sorted(found, key=lambda path: (known.index(path.name.lower()), path.name != path.name.lower(), path.name))
