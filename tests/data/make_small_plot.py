"""Make tests/data/small_plot: eight small photographs of one young maize plant, drawn by fieldkit's own renderer.

They are kept in the repository, so that tests need no renderer and every machine reads the same pixels.

    python tests/data/make_small_plot.py
"""

from pathlib import Path

from fieldkit.geometry import Intrinsics
from fieldkit.scenes.camera_effects import CameraEffects
from fieldkit.scenes.plot_description import MaizeDescription, PlotDescription, SoilDescription
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene import Light
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, simulate_capture
from fieldkit_sim.plot import build_scene
from fieldkit_sim.simulation import ring

SEED = 3


def main() -> None:
    soil = SoilDescription(SEED, 1.2, 0.012, 1024, stones=200, residues=100, contrast=1.0, kind="printed")
    plant = MaizeDescription(
        878646292, 0.0026543375127247317, -0.0010486926433338404, 207.96316450185884, 1.0381120913351625, leaves=7
    )
    scene = build_scene(PlotDescription((plant,), soil, Light()))
    with Renderer(scene) as renderer:
        simulate_capture(
            Path(__file__).parent / "small_plot",
            renderer,
            ring(8, 0.85, 0.75, (0.0, 0.0, 0.18)),
            Intrinsics.pinhole(320, 240, 304.0),
            noise=CaptureNoise(position_m=0.003, angle_deg=0.3),
            seed=SEED,
            sidecars=Sidecars(poses=True, camera=True),
            effects=CameraEffects(jpeg_quality=85),
            overwrite=True,
        )


if __name__ == "__main__":
    main()
