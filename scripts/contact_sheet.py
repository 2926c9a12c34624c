"""Draw the contact sheet of simulated scenes, docs/images/field-contact-sheet.jpg.

    python scripts/contact_sheet.py
    FIELDKIT_DATA=DIR python scripts/contact_sheet.py --with-real -o sheet.jpg

Every picture is one photograph as the scene file says a camera would take it. With --with-real, photographs of the
recorded rigs stand in a row below them. They are other people's, so such a sheet is not written into the repository.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw

from benchmarks.scene_views import load_scene, photograph, ring_about_plants
from fieldkit.runtime.progress import Silent
from fieldkit.scenes.renderer import Renderer

ROOT = Path(__file__).resolve().parents[1]
SHEET = ROOT / "docs" / "images" / "field-contact-sheet.jpg"
SCENES = (
    ("tuning-4", "6 plants, V5 and V6"), ("tuning-1", "3 plants, V8 to V10"), ("tuning-5", "2 plants, V12"),
    ("tuning-3", "between neighbour rows"), ("tuning-6", "bare, crusted soil"), ("case-3", "6 plants in two rows"),
)  # fmt: skip
REAL = (("basil_rig", 0), ("basil_rig", 30), ("arabidopsis_rig", 10))
_COLUMNS, _WIDTH, _HEIGHT, _GAP = 3, 640, 480, 6


def rendered(name: str, start_deg: float = 25.0) -> Image.Image:
    """A photograph of a scene file's plot from 1.7 m."""
    study = load_scene(name)
    with Renderer(study.scene) as renderer, tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "capture"
        photograph(
            target, study, renderer, ring_about_plants(study.description, 1, start_deg=start_deg), 1, Silent()
        )  # fmt: skip
        with Image.open(next(target.glob("*.jpg"))) as image:
            return image.convert("RGB")


def recorded(data: Path, name: str, number: int) -> Image.Image:
    """A photograph of a recorded set."""
    with Image.open(sorted((data / name / "images").glob("*.jpg"))[number]) as image:
        return image.convert("RGB")


def sheet(pictures: list[tuple[Image.Image, str]]) -> Image.Image:
    """The pictures in rows of three, each cut to 4:3 about its middle, with its words below left."""
    rows = -(-len(pictures) // _COLUMNS)
    page = Image.new("RGB", (_COLUMNS * (_WIDTH + _GAP) - _GAP, rows * (_HEIGHT + _GAP) - _GAP), "white")
    for i, (picture, words) in enumerate(pictures):
        scale = max(_WIDTH / picture.width, _HEIGHT / picture.height)
        small = picture.resize((round(picture.width * scale), round(picture.height * scale)), Image.Resampling.LANCZOS)
        left, top = (small.width - _WIDTH) // 2, (small.height - _HEIGHT) // 2
        cell = small.crop((left, top, left + _WIDTH, top + _HEIGHT))
        ImageDraw.Draw(cell).text((10, _HEIGHT - 24), words, fill="white", font_size=16)
        page.paste(cell, (i % _COLUMNS * (_WIDTH + _GAP), i // _COLUMNS * (_HEIGHT + _GAP)))
    return page


def main() -> int:
    """Draw the sheet that is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=SHEET)
    parser.add_argument("--with-real", action="store_true", help="with the recorded rigs; needs FIELDKIT_DATA and -o")
    options = parser.parse_args()
    output = options.output.absolute()
    data = os.environ.get("FIELDKIT_DATA")
    if options.with_real and (not data or output.resolve().is_relative_to(ROOT)):
        print("--with-real needs FIELDKIT_DATA, and -o with a file outside the repository", file=sys.stderr)
        return 2
    pictures = [(rendered(name), f"{name}: {words}") for name, words in SCENES]
    if options.with_real and data:
        pictures += [(recorded(Path(data), name, number), f"{name}, real") for name, number in REAL]
    sheet(pictures).save(output, "JPEG", quality=82, optimize=True)
    print(f"{output}: {output.stat().st_size // 1000} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
