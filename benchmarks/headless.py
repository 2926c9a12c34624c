"""A headless Chromium that opens only files, for studies and tests of pages."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Route

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# SwiftShader renders WebGL on the CPU, on machines without a GPU and the same on all.
ARGUMENTS = (
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
_BAD = ("error", "warning")
_REMEDY = "`make test` installs it on Debian where it may; elsewhere install the package chromium"


class NoBrowserError(RuntimeError):
    """Chromium or Playwright is missing; the message says what to do."""


def find_chromium() -> Path:
    """The browser on the path."""
    for name in NAMES:
        if found := shutil.which(name):
            return Path(found)
    raise NoBrowserError(f"none of {', '.join(NAMES)} is installed: {_REMEDY}")


@contextmanager
def headless_browser(*arguments: str) -> Iterator[Browser]:
    """A browser, closed at the end of the block.

    Playwright keeps an asyncio loop running in this thread until then, so ``asyncio.run`` fails inside the block.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise NoBrowserError("the Python package playwright is not installed: pip install playwright") from None
    executable = find_chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=[*ARGUMENTS, *arguments])
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def offline_page(
    browser: Browser,
    *,
    width: int = 1280,
    height: int = 900,
    dark: bool = False,
    touch: bool = False,
    reduced_motion: bool = True,
) -> Iterator[tuple[Page, list[str]]]:
    """A page of a new profile, and its complaints.

    Args:
        browser: from `headless_browser`.
        width, height: of the window, CSS pixels.
        dark: whether the person prefers dark pages.
        touch: whether the screen is touched.
        reduced_motion: whether the person prefers less motion; then nothing is animated.

    Yields:
        The page, and a list that grows: errors and warnings on the console, uncaught exceptions, failed requests, and
        requests to anything but the file itself, which are refused.
    """
    complaints: list[str] = []

    def refuse(route: Route) -> None:
        complaints.append(f"request: {route.request.url[:200]}")
        route.abort()

    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme="dark" if dark else "light",
        has_touch=touch,
        reduced_motion="reduce" if reduced_motion else "no-preference",
        offline=True,
    )
    try:
        page = context.new_page()
        page.route(lambda url: not url.startswith(("file:", "data:", "blob:")), refuse)
        page.on(
            "console", lambda m: complaints.append(f"{m.type}: {m.text}") if m.type in ("error", "warning") else None
        )
        page.on("pageerror", lambda error: complaints.append(f"exception: {error}"))
        page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url[:200]}"))
        yield page, complaints
    finally:
        context.close()
