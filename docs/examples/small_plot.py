"""The small plot of the examples.

One young maize plant on soil, and photographs of 320 × 240 pixels, so that every example takes seconds. In the field
the photographs are there already; then only the names of the folders matter.
"""

# %%
from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from fieldkit import EvaluationSettings, Plan
from fieldkit.geometry import Intrinsics, Pose
from fieldkit.results.plan_file import plan_from_poses
from fieldkit.scenes.description import SceneDescription, build
from fieldkit.scenes.plot_description import MaizeDescription, PlotDescription, SoilDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Light, Scene
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, Site, simulate_capture
from fieldkit_sim.simulation import ring

CAMERA = Intrinsics.pinhole(320, 240, 304.0)
STATIONS = ring(8, 0.85, 0.75, (0.0, 0.0, 0.18))  # on a circle of 0.85 m, 0.75 m above the ground

# Small photographs and a small volume of interest; for a real plot the defaults are right.
SETTINGS = EvaluationSettings(fidelity="draft", bounds_m=(-0.25, -0.25, -0.03, 0.25, 0.25, 0.5))


# %%
def scene() -> SceneDescription:
    """The plot: plants, soil, light and camera."""
    soil = SoilDescription(3, spacing_m=0.02, texture_px=1024, stones=60, residues=30, contrast=1.0, kind="printed")
    plant = MaizeDescription(
        878646292, 0.0026543375127247317, -0.0010486926433338404, 207.96316450185884, 1.0381120913351625, leaves=7
    )
    return SceneDescription(PlotDescription((plant,), soil, Light()), name="small plot", camera=CAMERA)


@cache
def built() -> Scene:
    """The plot's surfaces, made once."""
    return build(scene())


def photograph(folder: Path, poses: Sequence[Pose] = STATIONS, *, seed: int = 3, gps: bool = False) -> Path:
    """A flight over the plot: photographs with poses.csv and camera.toml beside them."""
    noise = CaptureNoise(position_m=0.003, angle_deg=0.3)  # how far a real flight misses its stations
    with Renderer(built()) as renderer:
        simulate_capture(
            folder, renderer, poses, CAMERA, noise=noise, seed=seed, sidecars=Sidecars(poses=True, camera=True),
            site=Site() if gps else None, economy=True,
        )  # fmt: skip
    return folder


def plan() -> Plan:
    """The stations as `fieldkit plan` would write them."""
    return plan_from_poses(STATIONS, CAMERA, row_heading_deg=90.0)
