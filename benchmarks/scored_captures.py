"""Few photographs of simulated plots, evaluated without a reference and scored against the truth.

Plants' figures and predicted scores are measured on them. Captures in a folder are kept.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.true_plants import kept_truth
from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.captures import read_capture
from fieldkit.clouds import Cloud, ReferenceIndex, crop, score
from fieldkit.clouds.canopy import rectangle
from fieldkit.errors import ReconstructionError
from fieldkit.evaluation.conversion import failed_plot, plot_evaluation
from fieldkit.evaluation.traits import PlotOutline
from fieldkit.files import write_atomic
from fieldkit.geometry import Pose, Similarity
from fieldkit.planning.objective.simulated import Proxy
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.families import families
from fieldkit.reconstruction.pipeline import reconstruct
from fieldkit.reconstruction.plot_frame import find_ground
from fieldkit.reconstruction.result import Reconstruction
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.frame import Plane
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Progress
from fieldkit.scenes.description import SceneDescription
from fieldkit.scenes.library import find_scene
from fieldkit.scenes.renderer import Renderer
from fieldkit.scenes.scene_file import read_scene
from fieldkit.scenes.simulate import Outdoors, Sidecars, simulate_capture
from fieldkit_sim.simulation import ring_about

FITTED = tuple(f"tuning-{k}" for k in range(1, 7))
HELD_OUT = (*(f"case-{k}" for k in range(1, 4)), *(f"test-case-{k}" for k in range(1, 6)))
DISTANCES_M = (0.002, 0.005, 0.010, 0.020)
FITTED_EACH, HELD_OUT_EACH = 8, 4
_KINDS = ("ring", "arc", "random", "chain", "circle", "spiral", "random", "ring")
_CLAIMED_M = 0.010
_FEWEST = 6


@dataclass(frozen=True)
class Design:
    """A capture to make."""

    scene: str
    """By name."""
    number: int
    """Of the capture within its scene."""
    kind: str
    """Of the set of cameras: a family at random parameters, ``"random"``, or ``"circle"``, the plain plan."""
    cameras: int
    """Number of cameras."""
    position_m: float
    angle_deg: float
    """Noise of the poses, standard deviation per axis."""
    image_grey: float
    """Noise in addition to the scene's grain, grey levels."""
    wind_m: float
    """Sway of the leaves."""

    @property
    def name(self) -> str:
        return f"{self.scene}-{self.number:02d}"


def designs(
    fitted: int = FITTED_EACH, held_out: int = HELD_OUT_EACH, *, start: tuple[int, int] = (0, 0)
) -> list[Design]:
    """Captures of very different quality, of the fit's scenes and held-out ones in turn.

    Args:
        fitted: number of captures of each scene of `FITTED`.
        held_out: of each of `HELD_OUT`.
        start: number of the first one of either.
    """
    found = []
    for index in range(max(len(FITTED), len(HELD_OUT))):
        for scenes, each, first in ((FITTED, fitted, start[0]), (HELD_OUT, held_out, start[1])):
            if index < len(scenes):
                found += [_design(scenes[index], 2 * index + (scenes is HELD_OUT), first + k) for k in range(each)]
    return found


def _design(scene: str, index: int, number: int) -> Design:
    rng = np.random.default_rng([41, index, number])
    noise = ((0.0, 0.0), (0.010, 1.0), (0.010, 1.0), (0.030, 2.0))[int(rng.integers(4))]
    return Design(
        scene,
        number,
        _KINDS[(index + number * 3) % len(_KINDS)],
        int(rng.integers(10, 14)),
        *noise,
        float((0.0, 2.0, 5.0)[int(rng.integers(3))]),
        float((0.0, 0.0, 0.003, 0.008)[int(rng.integers(4))]),
    )


def make_captures(folder: Path, wanted: Sequence[Design], *, progress: Progress) -> None:
    """Render, evaluate and score every design that is missing in ``folder``.

    Args:
        folder: gets NAME.json and NAME.npz of each.
        wanted: designs, grouped by scene, since a change of scene builds it anew.
    """
    folder.mkdir(parents=True, exist_ok=True)
    missing = [design for design in wanted if not (folder / f"{design.name}.json").is_file()]
    last: tuple[str, SceneDescription, Proxy, Renderer] | None = None
    try:
        with progress.stage("Captures", len(missing)) as advance:
            for design in missing:
                if last is None or last[0] != design.scene:
                    if last is not None:
                        last[3].close()
                    description = read_scene(find_scene(design.scene))
                    proxy = Proxy.from_description(description)
                    kept_truth(folder, design.scene, proxy)
                    last = design.scene, description, proxy, Renderer(proxy.scene)
                _make(folder, design, *last[1:])
                advance(1)
    finally:
        if last is not None:
            last[3].close()


def cameras_of(design: Design, proxy: Proxy) -> Cameras:
    """The feasible commanded cameras of a design."""
    rng = np.random.default_rng([42, design.number, *design.scene.encode()])
    envelope = Envelope.around(Cloud(proxy.plot.points), proxy.volume)
    if design.kind == "random":
        return envelope.sample(design.cameras, int(rng.integers(1 << 30)))
    problem = PlanningProblem(design.cameras, envelope, proxy.camera, (proxy.plot,))
    if design.kind == "circle":
        return problem.nearest(Cameras.from_poses(ring_about(design.cameras)(proxy.scene, proxy.camera)))
    family = next(f for f in families(problem) if f.name == design.kind)
    return problem.nearest(family.decode(rng.uniform(size=len(family))))


def _make(folder: Path, design: Design, description: SceneDescription, proxy: Proxy, renderer: Renderer) -> None:
    cameras = cameras_of(design, proxy)
    noise = replace(
        description.noise, position_m=design.position_m, angle_deg=design.angle_deg, image_sigma=design.image_grey
    )
    with tempfile.TemporaryDirectory(prefix="fieldkit-") as temporary:
        whole, part = Path(temporary) / "whole", Path(temporary) / "part"
        simulate_capture(
            whole,
            renderer,
            cameras.poses(),
            proxy.camera,
            noise=noise,
            seed=design.number,
            effects=description.camera_effects,
            economy=True,
            outdoors=Outdoors(design.wind_m),
            sidecars=Sidecars(poses=True, accuracy_m=max(_CLAIMED_M, design.position_m), camera=True),
        )
        _leave_out(whole, part, design)
        cache = StageCache(Path(temporary) / "cache")  # shared features of the whole and the part
        for capture, name in ((part, f"{design.name}-part"), (whole, design.name)):
            _evaluate(folder, name, design, capture, proxy, cache)


def _leave_out(whole: Path, part: Path, design: Design) -> None:
    """A capture without some photographs: random ones, or those of one side."""
    rng = np.random.default_rng([43, design.number, *design.scene.encode()])
    names = sorted(path.name for path in whole.glob("*.jpg"))
    kept = int(rng.integers(_FEWEST, len(names) - 1))
    first = int(rng.integers(len(names)))
    index = (first + np.arange(kept)) % len(names) if design.number % 2 else rng.permutation(len(names))[:kept]
    chosen = [names[k] for k in sorted(index)]
    part.mkdir()
    for name in (*chosen, "camera.toml"):
        shutil.copyfile(whole / name, part / name)
    head, *lines = (whole / "poses.csv").read_text(encoding="utf-8").splitlines()
    rows = [line for line in lines if line.partition(",")[0] in chosen]
    (part / "poses.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def _evaluate(folder: Path, name: str, design: Design, capture: Path, proxy: Proxy, cache: StageCache) -> None:
    settings = ReconstructionSettings()
    record: dict[str, Any] = {"design": asdict(design), "truth": None}
    arrays: dict[str, NDArray[Any]] = {}
    spent = Spent.now()
    read = read_capture(capture)
    try:
        found = reconstruct(read, settings, context=Context(cache))
    except ReconstructionError as error:
        plot = failed_plot(name, error, photographs=len(read.photos), spent=spent)
    else:
        plot = plot_evaluation(
            name,
            found,
            settings,
            score=None,
            spent=spent,
            outline=scene_outline(found, proxy),
        )
        record["truth"] = truth_scores(found, proxy)
        arrays = _arrays(found)
    record["plot"] = plot.model_dump(mode="json")
    if arrays:
        np.savez(folder / f"{name}.npz", **arrays)  # type: ignore[arg-type]
    write_atomic(folder / f"{name}.json", json.dumps(record, ensure_ascii=False) + "\n")


def settle_in_scene(points: FloatArray, poses: Mapping[str, Pose]) -> tuple[Similarity, Plane | None]:
    """`KnownPlot.settle` of captures in the scene's own frame: they stay there, and the ground is theirs."""
    return Similarity.identity(), find_ground(points, poses, seed=0, up=np.array([0.0, 0.0, 1.0]))


def scene_outline(found: Reconstruction, proxy: Proxy) -> PlotOutline:
    """The footprint of the scene's volume, in the capture's plot frame."""
    corners = np.array([(x, y, 0.0) for x, y in rectangle(proxy.volume.lower, proxy.volume.upper)])
    moved = found.sparse.frame.plot_from_source.apply(corners)
    return PlotOutline(tuple((float(x), float(y)) for x, y, _ in moved))


def truth_scores(found: Reconstruction, proxy: Proxy) -> dict[str, Any] | None:
    """Scores of the plot's own plants against the scene's true cloud; None without points."""
    to_scene = found.sparse.frame.plot_from_source.inverse()
    own = crop(found.plants.transformed(to_scene), proxy.volume)
    if not found.sparse.frame.metric or not len(own):
        return None
    result = score(ReferenceIndex(proxy.reference), own, DISTANCES_M)
    return {
        "points": len(own),
        "chamfer_m": result.chamfer.chamfer_m,
        "accuracy_m": result.chamfer.accuracy_m,
        "completeness_m": result.chamfer.completeness_m,
        "f_score": {f"{d:.3f}": s.f_score for d, s in result.f_scores.items()},
    }


def _arrays(found: Reconstruction) -> dict[str, NDArray[Any]]:
    """The inputs of figures, so that others can be tried without rendering again."""
    plants, sparse = found.plants, found.sparse
    names = sorted(sparse.poses)
    model = sparse.model
    ids = sorted(model.point3D_ids())
    number = {
        str(model.image(i).name): names.index(str(model.image(i).name))
        for i in model.reg_image_ids()
        if str(model.image(i).name) in sparse.poses
    }
    tracks = [
        (row, number[str(model.image(element.image_id).name)])
        for row, key in enumerate(ids)
        for element in model.points3D[key].track.elements
        if str(model.image(element.image_id).name) in number
    ]
    arrays = {
        "points": plants.points.astype(np.float32),
        "rotations": np.array([sparse.poses[n].rotation for n in names]),
        "centers": np.array([sparse.poses[n].center for n in names]),
        "focal_px": np.array([sparse.intrinsics[n].fx for n in names]),
        "size_px": np.array([(sparse.intrinsics[n].width, sparse.intrinsics[n].height) for n in names]),
        "sparse": np.array([model.points3D[k].xyz for k in ids]).astype(np.float32),
        "sparse_error_px": np.array([model.points3D[k].error for k in ids]).astype(np.float32),
        "tracks": np.array(tracks, dtype=np.int32).reshape(-1, 2),
        "plot_from_source": sparse.frame.plot_from_source.matrix(),
    }
    if plants.normals is not None:
        arrays["normals"] = np.round(127.0 * plants.normals).astype(np.int8)
    return arrays


def read_captures(folder: Path) -> Iterator[tuple[dict[str, Any], dict[str, NDArray[Any]]]]:
    """The results of `make_captures`, by name."""
    for path in sorted(folder.glob("*.json")):
        record = json.loads(path.read_text(encoding="utf-8"))
        npz = path.with_suffix(".npz")
        arrays: dict[str, NDArray[Any]] = {}
        if npz.is_file():
            with np.load(npz) as loaded:
                arrays = {key: loaded[key] for key in loaded.files}
        yield record, arrays


def stored_cloud(arrays: dict[str, NDArray[Any]]) -> Cloud:
    """The plants' cloud of a stored capture."""
    normals = arrays.get("normals")
    unit = None if normals is None else (normals / 127.0).astype(np.float32)
    return Cloud(arrays["points"].astype(np.float64), None, unit)
