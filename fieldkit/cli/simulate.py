"""fieldkit simulate."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fieldkit.cli.common import (
    DebugOption,
    JsonOption,
    OutputOption,
    OverwriteOption,
    SeedOption,
    emit_json,
    say,
)
from fieldkit.cli.numbers import read_numbers
from fieldkit.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fieldkit.geometry import Intrinsics, Pose
    from fieldkit.scenes.simulation import Stations


def command(
    scene: Annotated[Path, typer.Argument(help="Scene file, a folder with scene.toml, or a name such as case-1.")],
    output: OutputOption,
    plan: Annotated[Path | None, typer.Option("--plan", help="plan.json: photograph from its stations.")] = None,
    poses: Annotated[
        Path | None, typer.Option("--poses", help="poses.csv with yaw_deg and pitch_deg, plot frame.")
    ] = None,
    ring: Annotated[
        str,
        typer.Option("--ring", metavar="N[,RADIUS,HEIGHT]", help="N stations on a circle about the plants."),
    ] = "",
    dense: Annotated[
        int, typer.Option("--dense", metavar="N", min=0, help="N stations on three circles, for a reference.")
    ] = 0,
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="Of the photographs, pixels.")] = "",
    pose_noise: Annotated[
        str, typer.Option("--pose-noise", metavar="M,DEG", help="True against commanded poses, standard deviations.")
    ] = "",
    image_noise: Annotated[
        float | None, typer.Option("--image-noise", metavar="GREY", help="Standard deviation per channel.")
    ] = None,
    gps_noise: Annotated[
        str, typer.Option("--gps-noise", metavar="M[,M]", help="Of GPS positions: horizontal and vertical.")
    ] = "",
    blur: Annotated[
        float | None, typer.Option("--blur", metavar="S", help="Exposure time: the drone drifts meanwhile.")
    ] = None,
    wind: Annotated[
        float | None,
        typer.Option(
            "--wind", metavar="M", min=0.0, max=0.2, help="Leaves sway by this, half a metre out; 0 for none."
        ),
    ] = None,
    no_poses: Annotated[bool, typer.Option("--no-poses", help="Leave out poses.csv and camera.toml.")] = False,
    no_gps: Annotated[bool, typer.Option("--no-gps", help="Leave out GPS and gimbal angles.")] = False,
    truth_cloud: Annotated[
        Path | None, typer.Option("--truth-cloud", help="Also write the plants' true surfaces there (PLY).")
    ] = None,
    seed: SeedOption = 0,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Photograph a simulated plot as a drone would.

    Writes JPEGs with EXIF, GPS and gimbal angles, poses.csv with the commanded poses and camera.toml: a folder that
    `fieldkit reference` and `fieldkit evaluate` take. The true poses go to CAPTURES.truth.csv beside the folder. Noise,
    camera effects and wind that are not given are the scene file's.

    Examples:
        fieldkit simulate case-1 --dense 45 -o case-1-dense
        fieldkit simulate case-1 --plan case-1-plan --pose-noise 0.05,2 -o flight_1
        fieldkit simulate plot.toml --ring 10,1.5,1.2 --size 1000x750 --blur 0.002 -o ring

    Files:
        OUTPUT/IMG_0001.jpg …  photographs with EXIF and XMP
        OUTPUT/poses.csv, camera.toml  the commanded poses, the exact camera
        OUTPUT.truth.csv  the true poses, beside the folder

    Exit codes:
        0  done
        2  wrong usage, or the output exists already
        3  scene, plan or output cannot be used, or this machine cannot render

    See Also:
        fieldkit scene new, fieldkit reference, fieldkit evaluate
    """
    if sum([plan is not None, poses is not None, bool(ring), dense > 0]) != 1:
        raise UsageError("which stations?", remedy="Give one of --plan, --poses, --ring and --dense.")
    ring_numbers = read_numbers("--ring", ring, (1, 3)) if ring else ()
    if ring and not (ring_numbers[0].is_integer() and 1 <= ring_numbers[0] <= 1000 and min(ring_numbers) > 0):
        raise UsageError(f"--ring: not a ring: {ring}", remedy="Write it like --ring 10 or --ring 10,1.5,1.2 (metres).")
    pose = read_numbers("--pose-noise", pose_noise, (2,)) if pose_noise else None
    gps = read_numbers("--gps-noise", gps_noise, (1, 2)) if gps_noise else None
    width_height = _size(size) if size else None
    for name, number in (("--image-noise", image_noise), ("--blur", blur)):
        if number is not None and not (isfinite(number) and number >= 0):
            raise UsageError(f"{name}: cannot be {number}", remedy="Give 0 (off) or more.")
    if blur is not None and blur > 1:
        raise UsageError(f"--blur: {blur:g} s is too long", remedy="Give the exposure time in seconds, such as 0.002.")

    from dataclasses import replace

    from fieldkit.cli.progress import open_progress
    from fieldkit.scenes.library import find_scene
    from fieldkit.scenes.scene_file import read_scene
    from fieldkit.scenes.simulation import simulate, with_noise

    description = read_scene(find_scene(scene))
    stations, camera = _stations(plan, poses, ring_numbers, dense)
    camera = camera or description.camera
    if width_height is not None:
        camera = _at_size(camera, *width_height)
    noise = with_noise(
        description.noise, pose=None if pose is None else (pose[0], pose[1]), image=image_noise,
        gps=None if gps is None else (gps[0], gps[-1]),
    )  # fmt: skip
    effects = description.camera_effects
    if blur is not None:
        effects = replace(effects, exposure_s=blur)
    with open_progress(as_json=as_json) as progress:
        done = simulate(
            description, stations, output, intrinsics=camera, noise=noise, effects=effects, seed=seed,
            wind_m=wind, poses_csv=not no_poses, gps=not no_gps,
            truth_cloud=truth_cloud, overwrite=overwrite, progress=progress,
        )  # fmt: skip
    if as_json:
        from dataclasses import asdict

        emit_json({"output": output, "scene": description.name, **asdict(done)})
    else:
        say(f"{done.photographs} photographs in {output}; their true poses in {done.truth}")


def _stations(
    plan: Path | None, poses: Path | None, ring: tuple[float, ...], dense: int
) -> tuple[Stations | Sequence[Pose], Intrinsics | None]:
    from fieldkit.scenes.simulation import dense_about, poses_from_csv, ring_about

    if plan is not None:
        from fieldkit.results.plan_file import load_plan

        loaded = load_plan(plan)
        return [s.pose for s in loaded.stations], None if loaded.camera is None else loaded.camera.intrinsics
    if poses is not None:
        return poses_from_csv(poses), None
    if ring:
        return ring_about(int(ring[0]), *ring[1:]), None
    return dense_about(dense), None


def _at_size(camera: Intrinsics, width: int, height: int) -> Intrinsics:
    if abs(camera.width * height - camera.height * width) > max(camera.width, camera.height, width, height):
        raise UsageError(
            f"--size: {width}×{height} has another shape than the camera's {camera.width}×{camera.height}",
            remedy="Keep the ratio, or set the camera in the scene file.",
        )
    return camera.scaled(width, height)


def _size(text: str) -> tuple[int, int]:
    parts = text.lower().replace("×", "x").split("x")
    if len(parts) != 2 or not all(part.strip().isdecimal() and 16 <= int(part) <= 16384 for part in parts):
        raise UsageError(f"--size: not a size: {text}", remedy="Write it like 2000x1500, 16 to 16384 pixels a side.")
    return int(parts[0]), int(parts[1])
