"""fieldkit simulate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from fieldkit.cli.common import (
    JsonOption,
    OutputOption,
    OverwriteOption,
    SeedOption,
    VehicleOption,
    answer,
    emit_json,
    read_numbers,
    read_pose_noise,
    scenes_like,
)
from fieldkit.errors import UsageError
from fieldkit.vocabulary import BURST_INTERVAL_S
from fieldkit.wording import count

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fieldkit.geometry import Intrinsics, Pose
    from fieldkit.scenes.description import SceneDescription
    from fieldkit_sim.simulation import Stations


_MOST_OVERLAP = 95.0
"""Percent."""


@dataclass(frozen=True)
class StationOptions:
    """Where photographs are taken from."""

    plan: Path | None = None
    """plan.json: photograph from its stations, or its pattern's passes over the scene's box."""
    plant_height: Annotated[float | None, Option(metavar="M")] = None
    """Fit a plan for plots of a kind to plants of this height first."""
    poses: Path | None = None
    """poses.csv with yaw_deg and pitch_deg, plot frame."""
    ring: Annotated[str, Option(metavar="N[,RADIUS,HEIGHT]")] = ""
    """N stations on a circle about the plants."""
    dense: Annotated[int, Option(metavar="N", min=0)] = 0
    """N stations on three circles, for a reference."""
    survey: Annotated[str, Option(metavar="HEIGHT,FRONT,SIDE")] = ""
    """An app's grid straight down over the plants: height in metres, overlaps in percent."""
    oblique: bool = False
    """With --survey: four oblique directions more, with 20 percent less overlap."""

    def circle(self) -> tuple[float, ...]:
        """The numbers of --ring, which may be none."""
        if (
            sum([self.plan is not None, self.poses is not None, bool(self.ring), self.dense > 0, bool(self.survey)])
            != 1
        ):
            remedy = "Give one of --plan, --poses, --ring, --dense and --survey."
            raise UsageError("which stations?", remedy=remedy)
        if self.plant_height is not None and (self.plan is None or not 0.0 < self.plant_height < 10.0):
            raise UsageError(
                f"--plant-height {self.plant_height:g}: fits a --plan to plants of a height in metres",
                remedy="Write it like --plan plan --plant-height 1.2.",
            )
        numbers = read_numbers("--ring", self.ring, (1, 3)) if self.ring else ()
        if numbers and not (numbers[0].is_integer() and 1 <= numbers[0] <= 1000 and min(numbers) > 0):
            remedy = "Write it like --ring 10 or --ring 10,1.5,1.2 (metres)."
            raise UsageError(f"--ring: not a ring: {self.ring}", remedy=remedy)
        return numbers

    def grid(self) -> tuple[float, ...]:
        """The height and the shares of overlap of --survey, none where it is not given."""
        if not self.survey:
            return ()
        height, *percent = read_numbers("--survey", self.survey, (3,))
        if height == 0.0 or max(percent) > _MOST_OVERLAP:
            remedy = "Write it like --survey 8,80,70: metres and percent."
            raise UsageError(f"--survey: not a survey: {self.survey}", remedy=remedy)
        return (height, *(0.01 * share for share in percent))

    def read(self, scene: SceneDescription) -> tuple[Stations | Sequence[Pose], Intrinsics | None]:
        """The stations over a scene; and the camera that a plan is for."""
        circle = self.circle()
        from fieldkit_sim.simulation import dense_about, poses_from_csv, ring_about, survey_over

        if self.plan is not None:
            from fieldkit.results.plan_file import load_plan

            loaded = load_plan(self.plan, patterns=True)
            if loaded.pattern is not None:
                if self.plant_height is not None:
                    raise UsageError("--plant-height fits stations", remedy="A pattern holds as it is: leave it out.")
                from fieldkit_sim.surveys import pattern_over

                return pattern_over(loaded.pattern, scene), loaded.camera
            if self.plant_height is not None:
                from fieldkit.sites.fitted import fitted_to_height

                loaded = fitted_to_height(loaded, self.plant_height)
            return [s.pose for s in loaded.stations], loaded.camera
        if self.poses is not None:
            return poses_from_csv(self.poses), None
        if self.survey:
            return survey_over(*self.grid(), oblique=self.oblique), None
        return ring_about(int(circle[0]), *circle[1:]) if circle else dense_about(self.dense), None


def command(
    scene: Annotated[Path, Argument(autocompletion=scenes_like)],
    output: OutputOption,
    stations: StationOptions,
    *,
    burst: Annotated[int, Option(metavar="K", min=1, max=100)] = 1,
    interval: Annotated[float, Option(metavar="S", min=0.05, max=60.0)] = BURST_INTERVAL_S,
    vehicle: VehicleOption = None,
    size: Annotated[str, Option(metavar="WxH")] = "",
    pose_noise: Annotated[str, Option(metavar="M,DEG")] = "",
    blur: Annotated[float | None, Option(metavar="S", min=0.0, max=1.0)] = None,
    no_poses: bool = False,
    no_gps: bool = False,
    truth_cloud: Path | None = None,
    seed: SeedOption = 0,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Photograph a simulated plot as a drone would.

    Writes JPEGs with EXIF, GPS and gimbal angles, poses.csv with the commanded poses and camera.toml: a folder that
    `fieldkit reference` and `fieldkit evaluate` take. The true poses go to CAPTURES.truth.csv beside the folder. Noise
    and exposure that are not given, the camera's other effects and the wind are the scene file's. Leaves move from
    photograph to photograph by the wind, and with --vehicle by its wash, which depends on its mass.

    Args:
        scene: Scene file, a folder with scene.toml, or a name such as case-1.
        burst: Photographs per station.
        interval: Time between the photographs of a burst.
        size: Of the photographs, pixels.
        pose_noise: True against commanded poses, standard deviations.
        blur: Exposure time, in which the drone drifts.
        no_poses: Leave out poses.csv and camera.toml.
        no_gps: Leave out GPS and gimbal angles.
        truth_cloud: Also write the plants' true surfaces there (PLY).

    Examples:
        fieldkit simulate case-1 --dense 45 -o case-1-dense
        fieldkit simulate case-1 --plan case-1-plan --pose-noise 0.05,2 -o flight_1
        fieldkit simulate case-1 --plan case-1-plan --burst 5 --vehicle dji-mavic-3-enterprise -o flight_2
        fieldkit simulate block --survey 8,80,70 --oblique --size 2000x1500 -o flight
    """
    stations.circle()
    stations.grid()
    off, pixels = read_pose_noise(pose_noise) if pose_noise else None, _size(size) if size else None
    from dataclasses import asdict, replace

    from fieldkit.cli.progress import open_progress
    from fieldkit.scenes.library import find_scene
    from fieldkit.scenes.scene_file import read_scene
    from fieldkit.scenes.simulate import Outdoors
    from fieldkit.vehicles.vehicle_file import load_vehicle
    from fieldkit_sim.simulation import simulate

    description = read_scene(find_scene(scene))
    commanded, camera = stations.read(description)
    camera = camera or description.camera
    noise, effects = description.noise, description.camera_effects
    if off is not None:
        noise = replace(noise, position_m=off[0], angle_deg=off[1])
    mass_kg = 0.0 if vehicle is None else load_vehicle(vehicle).mass_kg
    outdoors = Outdoors(description.wind_m, mass_kg, burst, interval)
    description = replace(
        description,
        camera=(camera if pixels is None else _at_size(camera, *pixels)).without_distortion(),
        noise=noise,
        camera_effects=effects if blur is None else replace(effects, exposure_s=blur),
    )
    with open_progress(as_json=as_json) as progress:
        done = simulate(
            description,
            commanded,
            output,
            outdoors=outdoors,
            seed=seed,
            poses_csv=not no_poses,
            gps=not no_gps,
            truth_cloud=truth_cloud,
            overwrite=overwrite,
            progress=progress,
        )
    if as_json:
        emit_json({"output": output, "scene": description.name, **asdict(done)})
    else:
        answer(f"{count(done.photographs, 'photograph')} in {output}; their true poses in {done.truth}")


def _at_size(camera: Intrinsics, width: int, height: int) -> Intrinsics:
    found = camera.at_size(width, height)
    if found is None:
        raise UsageError(
            f"--size: {width}×{height} has another shape than the camera's {camera.width}×{camera.height}",
            remedy="Keep the ratio, or set the camera in the scene file.",
        )
    return found


def _size(text: str) -> tuple[int, int]:
    parts = text.lower().replace("×", "x").split("x")
    if len(parts) != 2 or not all(part.strip().isdecimal() and 16 <= int(part) <= 16384 for part in parts):
        raise UsageError(f"--size: not a size: {text}", remedy="Write it like 2000x1500, 16 to 16384 pixels a side.")
    return int(parts[0]), int(parts[1])
