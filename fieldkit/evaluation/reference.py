"""fieldkit reference: a dense capture becomes a reference that later captures are scored against."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from fieldkit.captures import read_capture
from fieldkit.captures.bursts import by_station
from fieldkit.captures.programs import PosesFile
from fieldkit.clouds import Cloud, Volume, read_cloud, write_cloud
from fieldkit.errors import MetadataError, UsageError
from fieldkit.evaluation.conversion import reference_report, settings_entry
from fieldkit.evaluation.rasters import Rasters, coarse_place, write_georeferenced, write_rasters
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.figures.spreadsheets import TRAITS_FILE, trait_row, traits_csv
from fieldkit.files import atomic_folder, write_atomic
from fieldkit.reconstruction.colmap_model import color_points
from fieldkit.reconstruction.pipeline import KnownPlot, reconstruct, with_scene
from fieldkit.reconstruction.result import Reconstruction
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.reconstruction.silhouettes import ENOUGH_VIEWS, outlines
from fieldkit.reconstruction.steady import steady_capture
from fieldkit.results.evaluation import CLOUD_FILE, SCENE_FILE, ReferenceReport
from fieldkit.results.fields import clean_text
from fieldkit.results.report_files import REFERENCE_FILE, check_file, describe_files, load_reference_report, save_report
from fieldkit.runtime.context import Context
from fieldkit.runtime.machine import Spent
from fieldkit.runtime.progress import Progress

MODEL_FOLDER = "model"


def build_reference(
    images: Path | str,
    output: Path | str,
    settings: EvaluationSettings | None = None,
    context: Context | None = None,
    *,
    scene: bool = True,
    poses: PosesFile | None = None,
    reconstruction: ReconstructionSettings | None = None,
    overwrite: bool = False,
    resume: bool = False,
) -> ReferenceReport:
    """Build a reference from a folder of photographs.

    The plants come first: ``output`` is a whole reference of them while the scene is still in work.

    Args:
        images: the folder; never written to.
        output: folder of the result: reference.json, cloud.ply (plants), scene.ply (with the ground), model/ (COLMAP's
            binary format, plot frame), traits.csv and, where it is georeferenced, cloud.laz and
            scene.laz in UTM.
        settings: choices; None takes the defaults. Rasters need the scene; a note says where they cannot be.
        context: None takes the usual cache and one process, and says nothing.
        scene: also reconstruct what is not plant.
        poses: that another program found; None takes what lies beside the photographs.
        reconstruction: all that a reconstruction can be told, in place of what ``settings`` say of it.
        overwrite: replace an earlier reference in ``output``.
        resume: add the scene to an earlier reference in ``output`` that was made alike and has none.

    Raises:
        UsageError: ``output`` exists.
        InputError: the photographs or what lies beside them cannot be used.
        ReconstructionError: they do not reconstruct.
    """
    asked = settings or EvaluationSettings()
    chosen, rasters = reconstruction or asked.reconstruction, asked.wanted_rasters
    images, output = Path(images).absolute(), Path(output).absolute()  # the working folder may be replaced
    context = replace(context or Context.usual(), seed=chosen.seed)
    progress = context.progress
    spent = Spent.now()
    goes_on = resume and scene and _lacks_scene(output, images, chosen)
    with ExitStack() as pictures:
        with atomic_folder(output, overwrite=overwrite or goes_on, marker=REFERENCE_FILE) as folder:
            capture = by_station(read_capture(images, poses=poses), chosen.mask)
            capture = pictures.enter_context(steady_capture(capture, context))
            found = reconstruct(capture, chosen, context)
            color_points(found.sparse.model, found.sparse.capture.photos)
            if not scene:
                found = replace(found, scene=None)
            elif goes_on:
                found = with_scene(found, chosen, context)
            report = _write(folder, found, chosen, progress, spent, rasters)
        if not scene or found.scene is not None:
            return report
        progress.note(
            f"the plants' reference is whole in {output}; the scene about them follows, which plans of new poses need "
            "(--no-scene leaves it out, and --resume adds it later)"
        )
        with atomic_folder(output, overwrite=True, marker=REFERENCE_FILE) as folder:
            found = with_scene(found, chosen, context)
            return _write(folder, found, chosen, progress, spent, rasters)


def _lacks_scene(output: Path, images: Path, settings: ReconstructionSettings) -> bool:
    """Whether a folder holds a reference of these photographs, made with these settings, that has no scene."""
    if not (output / REFERENCE_FILE).exists():
        return False
    report = load_reference_report(output)
    if report.scene_points is not None or report.settings != settings_entry(settings):
        return False
    capture = by_station(read_capture(images), settings.mask)
    same = report.source == clean_text(capture.folder.name)
    return same and tuple(image.name for image in report.image_reports) == capture.names


def _write(
    folder: Path,
    found: Reconstruction,
    settings: ReconstructionSettings,
    progress: Progress,
    spent: Spent,
    rasters: Rasters | None,
) -> ReferenceReport:
    """Write the files of a reference.

    Rasters are written once there is a scene.
    """
    clouds = {CLOUD_FILE: found.plants} | ({} if found.scene is None else {SCENE_FILE: found.scene})
    for name, cloud in clouds.items():
        write_cloud(folder / name, cloud)
    (folder / MODEL_FOLDER).mkdir()
    found.sparse.model.write_binary(folder / MODEL_FOLDER)
    names = [*clouds, *sorted(f"{MODEL_FOLDER}/{path.name}" for path in (folder / MODEL_FOLDER).iterdir())]
    for name, cloud in clouds.items():
        laz = Path(name).with_suffix(".laz").name
        if write_georeferenced(folder / laz, cloud, found.sparse.frame, progress):
            names.append(laz)
    draft = reference_report(
        found,
        settings,
        shown=outlines(found.sparse, settings.mask, most=ENOUGH_VIEWS),
        spent=spent,
    )
    if rasters is not None and found.scene is not None:
        try:
            names += write_rasters(folder, found, rasters, draft.traits)
            told = coarse_place(found.sparse.frame)
        except UsageError as error:
            told = error.message
        if told:
            progress.note(told)
    write_atomic(folder / TRAITS_FILE, traits_csv([trait_row(draft.source, draft.date, draft.traits)]))
    report = draft.model_copy(update={"files": describe_files(folder, [*names, TRAITS_FILE])})
    save_report(folder / REFERENCE_FILE, report)
    return report


class Reference:
    """A reference read back: its report, its plants' cloud and what it fixes for later captures.

    Args:
        path: the folder, or its reference.json.
    """

    def __init__(self, path: Path) -> None:
        folder = path if path.is_dir() else path.parent
        self.report = load_reference_report(path)
        if not self.report.metric:
            raise MetadataError(
                "this reference has no metric scale, so nothing can be placed in its frame",
                path=path,
                remedy="Build it again with poses.csv, geo.txt, GPS or markers.toml beside the photographs.",
            )
        self.cloud: Cloud = read_cloud(check_file(folder, self.report, CLOUD_FILE))

    def known_plot(self) -> KnownPlot:
        """Frame, volume, ground and cameras of the reference."""
        frame = self.report.frame
        return KnownPlot(
            source=frame.of_source(self.report.metric_source),
            volume=Volume(self.report.volume.lower_m, self.report.volume.upper_m),
            ground=frame.ground,
            calibrated={c.key: c.intrinsics for c in self.report.cameras},
        )
