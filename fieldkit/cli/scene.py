"""fieldkit scene from-reference, new and show."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from typer import Argument, Option

from fieldkit.cli.common import JsonOption, OutputOption, OverwriteOption, SeedOption, answer, emit_json, show, table
from fieldkit.errors import UsageError
from fieldkit.vocabulary import Stage
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.runtime.progress import Progress
    from fieldkit.scenes.description import SceneDescription
    from fieldkit.scenes.plot_description import TrialDescription


def scene_from_reference(
    reference: Path,
    output: OutputOption,
    images: Path | None = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Make a scene of a reference's clouds, so that a real plot can be simulated and planned on.

    Every point becomes a small square in its photographed colour, with --images in the photographs' own resolution.
    The result is a folder with scene.toml that goes wherever a scene file does.

    Args:
        reference: What `fieldkit reference` wrote, with scene.ply.
        images: Its photographs: surfels take their pixels from them.

    Examples:
        fieldkit scene from-reference plot_7-reference --images plot_7/ -o plot_7-scene
    """
    from fieldkit.cli.progress import open_progress
    from fieldkit.evaluation.proxy import make_proxy

    with open_progress(as_json=as_json) as progress:
        made = make_proxy(reference, output, images=images, overwrite=overwrite, progress=progress)
    if as_json:
        from dataclasses import asdict

        emit_json({"output": output, **asdict(made)})
    else:
        answer(f"{made.plant_surfels:,} surfels of plants and {made.ground_surfels:,} of the rest: {made.scene}")


Layout = Literal["rows", "grid", "random"]


@dataclass(frozen=True)
class TrialOptions:
    """A block of a trial instead of a few plants."""

    panel: ClassVar[str] = "A trial"

    trial: Annotated[str, Option(metavar="RANGESxCOLUMNS")] = ""
    """Plots side by side: 4x10 has 40."""
    rows: Annotated[int, Option(min=1, max=8)] = 2
    """Of a plot."""
    length: Annotated[float, Option(metavar="M", min=0.5, max=20.0)] = 4.0
    """Of a row."""
    alley: Annotated[float, Option(metavar="M", min=0.0, max=5.0)] = 1.0
    """Bare ground between ranges."""
    stage: Stage = "V10"
    """Growth stage: V4 to V18, VT, R1."""
    weeds: Annotated[float, Option(metavar="PER_M2", min=0.0, max=200.0)] = 0.0
    """Broad-leaved weeds a square metre, and 7.5 times as many small ones."""

    def described(self, row_spacing_m: float, plant_spacing_m: float, seed: int) -> TrialDescription:
        """The trial that is asked for."""
        ranges, mark, columns = self.trial.lower().replace("×", "x").partition("x")
        if not (mark and ranges.isdecimal() and columns.isdecimal()):
            raise UsageError(f"--trial: {self.trial} is no number of plots", remedy="Write it like --trial 4x10.")
        from pydantic import ValidationError

        from fieldkit.documents.toml_file import sentence
        from fieldkit.scenes.plot_description import TrialDescription

        try:
            return TrialDescription(
                seed=seed,
                ranges=int(ranges),
                columns=int(columns),
                rows=self.rows,
                row_spacing_m=row_spacing_m,
                plant_spacing_m=plant_spacing_m,
                length_m=self.length,
                alley_m=self.alley,
                stage=self.stage,
            )
        except ValidationError as error:
            raise UsageError(f"--trial: {sentence(error)}", remedy="See --help for what each option means.") from error


def scene_new(
    plants: Annotated[int, Option(min=1, max=60)] = 3,
    layout: Layout = "rows",
    spacing: Annotated[float | None, Option("--plant-spacing", "--spacing", metavar="M", min=0.05, max=2.0)] = None,
    row_spacing: Annotated[float | None, Option(metavar="M", min=0.05, max=3.0)] = None,
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    *,
    trial: TrialOptions,
    complete: bool = False,
    seed: SeedOption = 0,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a new scene file: maize plants of their own forms, soil and sun, all from the seed.

    Edit it as you like; the command says which page explains every key.

    Args:
        plants: How many.
        layout: In rows along x, on a grid, or at random.
        spacing: Between plants: 0.22, in a trial 0.18.
        row_spacing: Between rows: 0.50, in a trial 0.75.
        output: The scene file; of a trial a folder. Without: the text goes to stdout.
        complete: Write every key, also those at their default.

    With --trial the folder holds the scene, plots.geojson with the plots' outlines, and truth.csv with each plot's
    heights, cover, volume and leaf area.

    Examples:
        fieldkit scene new --plants 6 --seed 7 --layout rows -o plot.toml
        fieldkit scene new --trial 4x10 --stage V10 --seed 7 -o block
        fieldkit scene new --plants 3 --complete
    """
    from fieldkit.regular_files import check_replaceable

    if trial.trial:
        block = trial.described(row_spacing or 0.75, spacing or 0.18, seed)
        _new_trial(block, trial.weeds, output, overwrite=overwrite, as_json=as_json)
        return
    if output is not None:
        check_replaceable(output, overwrite=overwrite)
    import sys

    from fieldkit.scenes.scene_file import scene_text, write_scene
    from fieldkit_sim.generator import new_scene

    name = f"plants-{plants}-seed-{seed}" if output is None else output.stem
    scene = new_scene(
        plants,
        seed,
        layout=layout,
        spacing_m=spacing or 0.22,
        row_spacing_m=row_spacing or 0.50,
        name=name,
        notes=f"fieldkit scene new --plants {plants} --seed {seed} --layout {layout}",
    )
    text = scene_text(scene, complete=complete)
    if output is not None:
        write_scene(output, scene, complete=complete)
    if as_json:
        emit_json({"output": output, "name": name, "plants": plants, "seed": seed, "text": text})
    elif output is None:
        sys.stdout.write(text)
    else:
        from fieldkit.runtime.shipped import shipped_page

        answer(f"{count(plants, 'plant')} in {output}; {shipped_page('sim/README.md')} explains its keys")


def _new_trial(trial: TrialDescription, weeds: float, output: Path | None, *, overwrite: bool, as_json: bool) -> None:
    if output is None:
        raise UsageError("a trial is a folder", remedy="Name it: -o block.")
    from dataclasses import asdict

    from fieldkit.cli.progress import open_progress
    from fieldkit_sim.trial.files import new_trial, write_trial

    with open_progress(as_json=as_json) as progress:
        notes = f"fieldkit scene new --trial, seed {trial.seed}"
        scene = new_trial(trial, weeds_per_m2=weeds, name=output.name, notes=notes)
        truth = write_trial(output, scene, overwrite=overwrite, progress=progress)
    if as_json:
        emit_json({"output": output, "seed": trial.seed, "plots": [asdict(plot) | {"lai": plot.lai} for plot in truth]})
    else:
        plants = count(sum(plot.plants for plot in truth), "plant")
        answer(f"{count(len(truth), 'plot')} with {plants} in {output}: scene.toml, plots.geojson, truth.csv")


def scene_show(
    scene: Annotated[Path | None, Argument()] = None,
    output: Annotated[Path | None, Option("--output", "-o")] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """List the scenes that come with fieldkit, or check a scene file and draw it.

    Args:
        scene: Scene file, folder or name. Without: lists fieldkit's own scenes.
        output: Draw the scene into this picture (PNG or JPEG).

    Examples:
        fieldkit scene show
        fieldkit scene show case-2 -o case-2.png
        fieldkit scene show plot.toml
    """
    if scene is None:
        if output is not None:
            raise UsageError("which scene?", remedy="Name one: `fieldkit scene show case-1 -o case-1.png`.")
        _show_all(as_json)
        return
    from fieldkit.regular_files import check_replaceable

    if output is not None:
        check_replaceable(output, overwrite=overwrite)
    if output is not None and output.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise UsageError("is neither .png nor .jpg", path=output, remedy="Name a picture, such as scene.png.")
    from fieldkit.cli.progress import open_progress
    from fieldkit.scenes.library import find_scene
    from fieldkit.scenes.scene_file import read_scene, scene_text

    found = find_scene(scene)
    description = read_scene(found)
    facts: dict[str, object] = {"scene": found, **_facts(description)}
    if output is not None:
        with open_progress(as_json=as_json) as progress:
            facts |= {"output": output, **_draw(description, output, progress)}
    if as_json:
        emit_json(facts)
        return
    if output is None:
        import sys

        sys.stdout.write(scene_text(description, complete=True))
    else:
        trial = description.plot.trial
        plants = count(len(description.plot.plants), "plant")
        grown = plants if trial is None else count(trial.ranges * trial.columns, "plot")
        answer(f"{grown}, {facts['triangles']:,} triangles: {output}")


def _show_all(as_json: bool) -> None:
    from fieldkit.scenes.library import find_scene, scene_names
    from fieldkit.scenes.scene_file import read_scene

    scenes = {name: read_scene(find_scene(name)) for name in scene_names()}
    if as_json:
        emit_json({"scenes": {name: _facts(scene) for name, scene in scenes.items()}})
        return
    rows = [(name, str(len(scene.plot.plants)), scene.notes) for name, scene in scenes.items()]
    show(table("Scenes that come with fieldkit", ["name", "plants>", "what it is"], rows))


def _facts(description: SceneDescription) -> dict[str, object]:
    return {
        "name": description.name,
        "notes": description.notes,
        "plants": len(description.plot.plants),
        "lower_m": description.bounds.lower_m,
        "upper_m": description.bounds.upper_m,
    }


def _draw(description: SceneDescription, output: Path, progress: Progress) -> dict[str, object]:
    from io import BytesIO

    from PIL import Image

    from fieldkit.files import write_atomic
    from fieldkit.geometry import Intrinsics
    from fieldkit.scenes.description import build, scene_digest
    from fieldkit.scenes.renderer import Renderer
    from fieldkit_sim.simulation import ring_about

    with progress.stage("Growing the plants", len(description.plot.plants) or None) as advance:
        scene = build(description, advance)
    camera = Intrinsics.pinhole(1600, 1200, 1360.0)
    with Renderer(scene) as renderer:
        image = renderer.photograph(ring_about(16)(scene, camera)[7], camera)
    file = BytesIO()
    Image.fromarray(image).save(file, "PNG" if output.suffix.lower() == ".png" else "JPEG")
    write_atomic(output, file.getvalue())
    return {"triangles": scene.triangles, "digest": scene_digest(scene)}
