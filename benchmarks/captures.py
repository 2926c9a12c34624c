"""Small captures made for benchmarks: subsets of the recorded rigs, and renderings of the benchmark scenes."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.rigs import RigSet
from benchmarks.scenes import Split, benchmark_cameras, benchmark_scene
from fieldkit.captures.poses_csv import PoseRow, poses_table
from fieldkit.clouds import Cloud
from fieldkit.clouds.volume import Volume
from fieldkit.files import storage_errors
from fieldkit.geometry import Pose, Similarity
from fieldkit.geometry.priors import SourceFrame
from fieldkit.reconstruction.pipeline import KnownPlot
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.sampling import sample_visible
from fieldkit.scenes.scene import Scene
from fieldkit.scenes.simulate import CaptureNoise, Sidecars, camera_toml, simulate_capture
from fieldkit_sim.plot import build_scene

LOWEST_M = 0.03
"""The rendered soil is bumpy: lower points are left out of cloud and truth."""
_TRUTH_POINTS = 200_000


@dataclass(frozen=True, eq=False)
class RenderedPlot:
    """A benchmark scene with its truth."""

    scene: Scene
    """To render."""
    truth: Cloud
    """Visible points of its plants above `LOWEST_M`, plot frame."""
    volume: Volume
    """Of interest."""

    def known(self) -> KnownPlot:
        """The known plot, as from a reference: the frame of poses.csv is the plot frame."""
        return KnownPlot(SourceFrame("poses.csv", None, Similarity.identity()), self.volume, None)


def rendered_plot(split: Split, index: int) -> RenderedPlot:
    """A benchmark scene, built."""
    scene = build_scene(benchmark_scene(split, index))
    visible = sample_visible(scene, (_TRUTH_POINTS,))[0]
    truth = visible.select(visible.points[:, 2] > LOWEST_M)
    around = Volume.around(truth.points, margin_m=0.03)
    return RenderedPlot(scene, truth, Volume((around.lower[0], around.lower[1], LOWEST_M), around.upper))


def rendered_capture(
    folder: Path, plot: RenderedPlot, *, count: int = 10, noise: CaptureNoise, seed: int = 0, progress: Progress
) -> list[Pose]:
    """Photograph a benchmark scene; poses.csv has the commanded poses, camera.toml the camera. Gives the true poses."""
    poses, intrinsics = benchmark_cameras(count)
    with Renderer(plot.scene) as renderer:
        return simulate_capture(
            folder,
            renderer,
            poses,
            intrinsics,
            noise=noise,
            seed=seed,
            sidecars=Sidecars(poses=True, camera=True),
            progress=progress,
        )


def rig_capture(folder: Path, rig: RigSet, names: Sequence[str], poses: Mapping[str, Pose], accuracy_m: float) -> None:
    """Copies of a rig's photographs with these poses as poses.csv and the dense model's calibration as camera.toml."""
    with storage_errors(folder):
        folder.mkdir(parents=True)
        for name in names:
            shutil.copyfile(rig.capture.photo(name).path, folder / name)
        rows = [PoseRow.of(name, poses[name], accuracy_m, roll=True) for name in names]
        (folder / "poses.csv").write_text(poses_table(rows), encoding="utf-8")
        (folder / "camera.toml").write_text(camera_toml(rig.intrinsics), encoding="utf-8")
