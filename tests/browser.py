"""A headless browser for tests of pages: import the fixture ``browser`` into a conftest.py or a test file."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from benchmarks.headless import NoBrowserError, headless_browser, offline_page
from fieldkit.arrays import ByteArray

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

WAIT_MS = 60_000


# One per file, not per session: while it lives, asyncio.run fails in this thread, which other files' tests use.
@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Headless Chromium with WebGL on the CPU."""
    try:
        with headless_browser() as found:
            yield found
    except NoBrowserError as error:
        pytest.skip(str(error))


@contextmanager
def opened(
    browser: Browser,
    file: Path,
    *,
    width: int = 1280,
    height: int = 900,
    dark: bool = False,
    touch: bool = False,
) -> Iterator[Page]:
    """The file from disk, without network; at the end there must have been no error, warning or request."""
    with offline_page(browser, width=width, height=height, dark=dark, touch=touch) as (page, complaints):
        page.set_default_timeout(WAIT_MS)
        page.goto(file.absolute().as_uri())
        yield page
        assert complaints == []


def picture(of: Page | Locator) -> ByteArray:
    """(h, w, 3) as it is on the screen."""
    with Image.open(io.BytesIO(of.screenshot())) as image:
        return np.asarray(image.convert("RGB"))


def colors_in(image: ByteArray) -> int:
    """How many colours a picture has."""
    return len(np.unique(image.reshape(-1, 3), axis=0))


def changed(before: ByteArray, after: ByteArray, by: int = 24) -> int:
    """Pixels that differ in a channel by more than ``by``."""
    return int((np.abs(before.astype(int) - after).max(axis=-1) > by).sum())
