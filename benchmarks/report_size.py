"""The size of a report's 3D view, and a browser's time to show and turn it."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.headless import NoBrowserError, headless_browser, offline_page
from benchmarks.result import Cell, ResultTable, StudyResult
from fieldkit.clouds.cloud import Cloud
from fieldkit.errors import InputError
from fieldkit.figures.content import FrustumLayer, PointLayer, ViewerScene
from fieldkit.report.html.viewer import viewer_html, viewer_script, viewer_style
from fieldkit.runtime.progress import Progress

if TYPE_CHECKING:
    from playwright.sync_api import Browser

NAME, TITLE = "report-size", "Reports: size and time to the first picture"
COUNTS = (100_000, 1_000_000)
_SCENE, _SAMPLES, _NOISE_M, _LIMIT_M = "case-1", 300_000, 0.0007, 0.005
_TURNS, _WIDTH, _HEIGHT = 40, 1280, 900
_READY = '.fk-view[data-state="ready"]'
_LIMIT_MS = 120_000
# Each turn is drawn before the next: a second frame is requested, which comes when the first is on the screen.
_TURN = """async (turns) => {
    const view = document.querySelector(".fk-view").fieldkitView;
    const frame = () => new Promise((done) => requestAnimationFrame(done));
    const found = [];
    await frame();
    for (let i = 0; i < turns; i++) {
        const begun = performance.now();
        view.turn(0.04, 0);
        await frame();
        await frame();
        found.push([performance.now() - begun, view.drawn]);
    }
    return found;
}"""


@dataclass(frozen=True)
class ReportSize:
    """A page with a cloud of colours and values, and 13 cameras."""

    points: int
    """In the cloud."""
    file_bytes: int
    """Size of the page, including the view's script."""
    script_bytes: int
    """Size of the view's script, the same for any cloud and number of views."""
    write_s: float
    """Time to make the page."""
    first_frame_s: float
    """From opening the file to the first picture of the cloud."""
    still_ms: float
    """Median time of a frame of all points."""
    moving_ms: float
    """Median time of a frame while the view turns, after the first ten, in which the view adapts its number of points.
    """
    moving_points: int
    """Median number of points drawn in these frames."""
    renderer: str
    """Name of WebGL's renderer."""


def study(*, counts: Sequence[int] = COUNTS, seed: int = 0, progress: Progress) -> StudyResult:
    """Pages with clouds of ``counts`` points on simulated maize, opened from disk in headless Chromium.

    Args:
        counts: points of each page.
        seed: of the points.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        viewer_script()
        with headless_browser() as browser, progress.stage(TITLE, len(counts)) as advance:
            found = []
            for scene in scenes_of(counts, seed):
                found.append(measure(browser, scene))
                advance(1)
    except (NoBrowserError, InputError) as error:
        return StudyResult(NAME, TITLE, skipped=str(error))
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            f"{page.points:,}",
            f"{page.file_bytes / 1e6:.1f}",
            f"{page.first_frame_s:.1f}",
            f"{page.still_ms:.0f}",
            f"{page.moving_ms:.0f}",
            f"{page.moving_points:,}",
        )
        for page in found
    )
    columns = ("points>", "file, MB>", "first picture, s>", "frame, ms>", "frame moving, ms>", "points moving>")
    return StudyResult(
        name=NAME,
        title=TITLE,
        tables=(ResultTable(f"One 3D view, {_WIDTH} × {_HEIGHT} pixels", columns, rows),),
        notes=(
            f"Drawn by {found[0].renderer}." if found else "",
            f"The script is {found[0].script_bytes / 1e6:.2f} MB of each file." if found else "",
            "While the view moves it draws as many points as the machine bears; at rest, all.",
        ),
        figures={"pages": [asdict(page) for page in found]},
        wall_s=time.perf_counter() - wall,
        cpu_s=time.process_time() - cpu,
    )


def scenes_of(counts: Sequence[int], seed: int = 0) -> list[ViewerScene]:
    """A plot's cloud for each count: stereo-like noise, the distance to the true surface as value, and 13 cameras."""
    from benchmarks.scene_views import load_scene, ring_about_plants
    from fieldkit.scenes.sampling import sample_visible

    under_study = load_scene(_SCENE)
    cloud = sample_visible(under_study.scene, (min(_SAMPLES, 2 * max(counts, default=0)),), seed)[0]
    poses = ring_about_plants(under_study.description, 13)
    cameras = FrustumLayer("Cameras", poses, [f"Camera {i + 1}" for i in range(13)], 0.59, 0.44, "#27609b")
    scenes = []
    for count in counts:
        rng = np.random.default_rng([seed, count])
        chosen = rng.integers(0, len(cloud.points), count)  # with the noise, a point drawn twice is two points
        scenes.append(ViewerScene(f"{count:,} points", points=[_noisy(cloud, chosen, rng)], frusta=[cameras]))
    return scenes


def page_of(scene: ViewerScene) -> str:
    """A page with one view only."""
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>View</title>'
        f"<style>{viewer_style()}</style></head><body>{viewer_html(scene, identifier='view')}"
        f"<script>{viewer_script()}</script></body></html>\n"
    )


def measure(browser: Browser, scene: ViewerScene) -> ReportSize:
    """Write a page, open it, turn it."""
    begun = time.perf_counter()
    text = page_of(scene)
    wrote = time.perf_counter() - begun
    with tempfile.TemporaryDirectory() as folder, offline_page(browser, width=_WIDTH, height=_HEIGHT) as opened:
        page, complaints = opened
        file = Path(folder) / "page.html"
        file.write_text(text, encoding="utf-8")
        page.set_default_timeout(_LIMIT_MS)
        page.goto(file.as_uri())
        page.wait_for_selector(_READY)
        # Reading the picture back waits until it is drawn; the mark before only means that the commands were sent.
        page.evaluate(_READ_BACK)
        first = float(page.evaluate("performance.now()"))
        still: list[float] = [page.evaluate(_STILL) for _ in range(5)]
        moving: list[tuple[float, int]] = page.evaluate(_TURN, _TURNS)
        renderer = page.evaluate(_RENDERER)
        if complaints:
            raise RuntimeError(f"the page complained: {complaints[0]}")
    settled = moving[10:]
    return ReportSize(
        points=sum(len(layer.points) for layer in scene.points),
        file_bytes=len(text.encode()),
        script_bytes=len(viewer_script().encode()),
        write_s=wrote,
        first_frame_s=first / 1000,
        still_ms=float(np.median(still)),
        moving_ms=float(np.median([took for took, _ in settled])),
        moving_points=int(np.median([drawn for _, drawn in settled])),
        renderer=str(renderer),
    )


_READ_BACK = """() => {
    const view = document.querySelector(".fk-view").fieldkitView;
    view.draw();
    const gl = view.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}"""
_STILL = f"() => {{ const begun = performance.now(); ({_READ_BACK})(); return performance.now() - begun; }}"
_RENDERER = """() => {
    const gl = document.querySelector(".fk-view").fieldkitView.renderer.getContext();
    const more = gl.getExtension("WEBGL_debug_renderer_info");
    return gl.getParameter(more ? more.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
}"""


def _noisy(cloud: Cloud, chosen: Any, rng: np.random.Generator) -> PointLayer:
    assert cloud.colors is not None
    offsets = rng.normal(0.0, _NOISE_M, (len(chosen), 3))
    return PointLayer(
        "Capture",
        (cloud.points[chosen] + offsets).astype(np.float32),
        np.asarray(cloud.colors, dtype=np.uint8)[chosen],
        np.linalg.norm(offsets, axis=1).astype(np.float32),
        _LIMIT_M,
    )
