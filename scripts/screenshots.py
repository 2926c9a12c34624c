"""Take the documentation's pictures of reports, docs/images/report-*.png, in headless Chromium.

    python scripts/screenshots.py --trial my-trial --mission flight --evaluation plot_7 --turntable basil

Each option names a folder of results, of which `fieldkit report` makes a report first; pictures of others stay as they
are. docs/running-benchmarks.md says which results the pictures in the repository show.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from benchmarks.headless import headless_browser
from fieldkit.report.write_report import write_report

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
_COLORS = 256  # a picture takes a third of the bytes then, and looks the same


@dataclass(frozen=True)
class Shot:
    """A picture of a report.

    Attributes:
        name: of the file, without its suffix.
        of: the option that names the results.
        width, height: of the window, CSS pixels; the height is the most that a part takes, too.
        part: selector of what is shown; empty shows the window.
        dark, printed: how it is shown.
        press: name of a button of the part's 3D view that is pressed before.
    """

    name: str
    of: str
    width: int = 1280
    height: int = 900
    part: str = ""
    dark: bool = False
    printed: bool = False
    press: str = ""


SHOTS = (
    Shot("report-summary", "trial", height=1150),
    Shot("report-narrow-dark", "trial", width=390, height=1100, dark=True),
    Shot("report-printed", "trial", width=794, height=1123, printed=True),
    Shot("report-mission", "mission", part="#mission-1 .fk-view"),
    Shot("report-mission-above", "mission", part="#mission-1 .fk-view", press="From above"),
    Shot("report-evaluation", "evaluation", height=1000, part="#evaluation-1"),
    Shot("report-basil", "turntable", part="#evaluation-1 .fk-view"),
)


def take(browser: Browser, shot: Shot, report: Path) -> bytes:
    """A picture of a report, PNG."""
    page = browser.new_page(
        viewport={"width": shot.width, "height": shot.height},
        reduced_motion="reduce",
        color_scheme="dark" if shot.dark else "light",
    )
    page.goto(report.as_uri())
    if shot.printed:
        page.emulate_media(media="print", color_scheme="light")
    taken = _take_part(page, shot) if shot.part else page.screenshot()
    page.close()
    return taken


def _take_part(page: Page, shot: Shot) -> bytes:
    part = page.locator(shot.part).first
    part.scroll_into_view_if_needed()
    page.locator(f'{shot.part.split()[0]} .fk-view[data-state="ready"]').first.wait_for()
    if shot.press:
        part.get_by_role("button", name=shot.press).click()
    page.wait_for_timeout(500)  # a view draws all its points once nothing moves
    box = part.bounding_box()
    assert box is not None
    y = box["y"] + page.evaluate("scrollY")
    clip = {"x": box["x"], "y": y, "width": box["width"], "height": min(box["height"], shot.height)}
    return page.screenshot(full_page=True, clip=clip)  # type: ignore[arg-type]


def main() -> None:
    """Make the reports of the given results and take their pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options = list(dict.fromkeys(shot.of for shot in SHOTS))
    for option in options:
        parser.add_argument(f"--{option}", type=Path, metavar="DIR", help=f"results with a {option}")
    given = {option: folder for option, folder in vars(parser.parse_args()).items() if folder is not None}
    with tempfile.TemporaryDirectory() as place, headless_browser() as browser:
        for option, folder in given.items():
            report = write_report(folder, Path(place) / f"{option}.html").output
            for shot in SHOTS:
                if shot.of == option:
                    target = IMAGES / f"{shot.name}.png"
                    picture = Image.open(BytesIO(take(browser, shot, report))).convert("RGB")
                    picture.quantize(_COLORS).save(target, optimize=True)
                    print(f"{target} ({target.stat().st_size / 1000:.0f} kB)")


if __name__ == "__main__":
    main()
