"""Scenes for tests of the 3D view, and pages that hold them under the strictest policy that a page may have."""

import base64
import hashlib
from dataclasses import replace

import numpy as np

from fieldkit.figures.content import FrustumLayer, LineLayer, PlaceName, PointLayer, ViewerScene
from fieldkit.geometry import Pose
from fieldkit.report.html.viewer import viewer_html, viewer_script, viewer_style


def leaves(count: int = 6000, seed: int = 0) -> PointLayer:
    """Three upright leaves and a patch of ground, with colours and values."""
    rng = np.random.default_rng(seed)
    t, s = rng.uniform(0, 1, count), rng.uniform(-1, 1, count)
    leaf = rng.integers(0, 4, count)
    x = 0.25 * (leaf - 1) + 0.3 * t**2 * np.where(leaf == 1, 1, -1)
    points = np.stack([x, 0.05 * s * (1 - t), 0.7 * t - 0.2 * t**2], axis=1)
    ground = leaf == 3
    points[ground] = np.stack([t - 0.5, 0.5 * s, np.zeros(count)], axis=1)[ground]
    colors = np.where(ground[:, None], [120, 95, 70], np.stack([60 + 80 * t, 120 + 80 * t, 50 + 20 * t], axis=1))
    values = 0.03 * t + rng.normal(0, 0.001, count)
    return PointLayer("Capture", points.astype(np.float32), colors.astype(np.uint8), values.astype(np.float32), 0.02)


def cameras(name: str, color: str, shift: float = 0.0, count: int = 6) -> FrustumLayer:
    """A circle of cameras that look at the middle."""
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False) + 0.3
    poses = [Pose.look_at([1.3 * np.cos(a) + shift, 1.3 * np.sin(a), 1.0 + shift], [0.0, 0.0, 0.2]) for a in angles]
    return FrustumLayer(name, poses, [f"{name} {i + 1}" for i in range(count)], 0.5, 0.38, color)


def small_scene() -> ViewerScene:
    """One of every kind of layer."""
    planned = replace(cameras("Planned", "#2f6fb3"), numbers=[str(k + 1) for k in range(6)])
    other = leaves(3000, seed=1)
    corners = np.array([pose.center for pose in planned.poses], dtype=np.float32)
    return ViewerScene(
        "Plot 7",
        points=[leaves(), PointLayer("Reference", other.points + np.float32(0.03))],
        frusta=[planned, cameras("Achieved", "#d07a1f", shift=0.05)],
        lines=[LineLayer("Legs", [corners], "#a03060")],
        places=[PlaceName("Plot 7", (0.0, 0.0, 0.0))],
    )


def page_of(*scenes: ViewerScene, gap_px: int = 0) -> str:
    """A page of views, ``gap_px`` apart, in which nothing but its own style and script applies."""
    style = f"{viewer_style()} body {{ margin: 12px; font: 16px sans-serif; }} .gap {{ height: {gap_px}px; }}"
    script = viewer_script()
    policy = f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}"
    views = '<div class="gap"></div>'.join(viewer_html(scene, identifier=f"view-{i}") for i, scene in enumerate(scenes))
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" content="light dark">
<title>Test</title><style>{style}</style></head><body>{views}<script>{script}</script></body></html>
"""


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
