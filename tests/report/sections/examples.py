"""Folders of results of every kind, small and made by fieldkit's own writers; their names may be hostile."""

import json
import os
from pathlib import Path

import numpy as np
from PIL import Image

from fieldkit.campaign import Visit
from fieldkit.campaign.create import CampaignSources, init_campaign
from fieldkit.campaign.reading import keep_visit
from fieldkit.clouds import Cloud, score, write_cloud
from fieldkit.errors import CaptureError
from fieldkit.evaluation.conversion import evaluation_report, failed_plot, plot_evaluation, reference_report
from fieldkit.missions.export_mission import export_mission
from fieldkit.missions.settings import MissionSettings
from fieldkit.planning.run.folder import LogEntry
from fieldkit.planning.settings import GivenPlot, SearchSettings
from fieldkit.reconstruction.settings import ReconstructionSettings
from fieldkit.results.evaluation import (
    AdherenceEntry,
    EvaluationReport,
    FlightEntry,
    ReferenceReport,
    StationErrorEntry,
)
from fieldkit.results.plan import Plan, PlanMethod, PlanSource
from fieldkit.results.plan_file import save_plan
from fieldkit.results.report_files import describe_files, file_sha256, save_report
from fieldkit.results.traits import TraitsEntry
from tests.evaluation.examples import plant_cloud, reconstruction
from tests.missions.test_export import LOW_M, SITES, planned

SETTINGS = ReconstructionSettings()
HOSTILE = '<script>document.title="owned"</script>"\'><img src=x onerror=alert(1)>\u202egnp.exe'
"""A name with a script, all quotes, an event handler and a right-to-left override."""

SHOWN = HOSTILE.replace("\u202e", "\\u202e")
"""The same as people see it."""
SECTIONS = (
    "summary",
    "reference-1",
    "plan-1",
    "mission-1",
    "evaluation-1",
    "campaign-1",
    "glossary",
    "provenance",
)
"""Of the page about everything that `write_everything` writes, in their order."""


def write_reference(folder: Path, *, source: str = "dense", points: int = 4000) -> ReferenceReport:
    """A reference's folder."""
    folder.mkdir(parents=True)
    cloud = plant_cloud(points)
    write_cloud(folder / "cloud.ply", cloud)
    draft = reference_report(reconstruction(cloud=cloud), SETTINGS)
    Image.new("RGB", (300, 200), (60, 120, 60)).save(folder / "overview.png")
    files = describe_files(folder, ["cloud.ply", "overview.png"])
    report = draft.model_copy(update={"source": source, "files": files})
    save_report(folder / "reference.json", report)
    return report


def write_evaluation(
    folder: Path,
    reference: Path | None = None,
    *,
    source: str = "season",
    plots: tuple[str, ...] = ("plot 7",),
    failed: str = "",
    adherence: bool = False,
    points: int = 3000,
) -> EvaluationReport:
    """An evaluation's folder; every plot lies 2 mm beside the reference, with a leaf fewer."""
    folder.mkdir(parents=True)
    entries = []
    other = plant_cloud(4000)
    for number, name in enumerate(plots):
        whole = plant_cloud(points, seed=number + 1)
        cloud = Cloud(whole.points[whole.points[:, 0] > -0.1] + (0.002, 0.0, 0.0), None, None)
        cloud = Cloud(cloud.points, np.full((len(cloud), 3), 120, np.uint8))
        plot = plot_evaluation(
            name,
            reconstruction(cloud=cloud),
            SETTINGS,
            score=score(other, cloud) if reference is not None else None,
        )
        if (folder / name).resolve().is_relative_to(folder.resolve()) and "\0" not in name:
            (folder / name).mkdir(parents=True)
            write_cloud(folder / name / "cloud.ply", cloud)
            Image.new("RGB", (300, 200), (60, 120, 60)).save(folder / name / "overview.png")
            files = describe_files(folder, [f"{name}/cloud.ply", f"{name}/overview.png"])
            plot = plot.model_copy(update={"files": files})
        if adherence:
            plot = plot.model_copy(update={"adherence": _adherence(name)})
        entries.append(plot)
    if failed:
        error = CaptureError("no photographs in it", remedy="Copy them again.")
        entries.append(failed_plot(failed, error))
    report = evaluation_report(
        source,
        entries,
        SETTINGS,
        refine=False,
        distances_m=(0.002, 0.005, 0.010, 0.020),
        reference_sha256=None if reference is None else file_sha256(reference / "reference.json"),
    )
    save_report(folder / "evaluation.json", report)
    return report


def write_flight(folder: Path, plots: tuple[str, ...] = ("118", "119", HOSTILE), *, picture: bool = True) -> None:
    """An evaluation of a flight over plots beside each other, of which the last failed; the field's picture is 8 m wide
    and has a red south-western corner.
    """
    report = write_evaluation(folder, plots=plots[:-1], failed=plots[-1], source="grid")
    made = []
    for k, plot in enumerate(report.plots):
        x = 2.0 * k - 2.0
        outline = ((x, 0.0), (x + 1.5, 0.0), (x + 1.5, 4.0), (x, 4.0))
        if plot.error is None:
            Image.new("RGB", (900, 600), (60, 120, 60)).save(folder / plot.name / "photo.jpg")
            files = describe_files(folder, [f"{plot.name}/cloud.ply", f"{plot.name}/photo.jpg"])
            traits = TraitsEntry(height_m=1.0 + k, height_error_m=0.03)
            plot = plot.model_copy(update={"files": files, "traits": traits})
        made.append(plot.model_copy(update={"outline": outline}))
    whole = Image.new("RGB", (800, 600), (50, 40, 30))
    whole.paste((255, 0, 0), (0, 500, 100, 600))
    corners = ((4.0, -1.0), (4.0, 5.0), (-4.0, 5.0), (-4.0, -1.0)) if picture else ()
    if picture:
        whole.save(folder / "field.jpg")
    flight = FlightEntry(images=9, registered=9, right=9, loose=0, unregistered={}, pose_rms_m=0.01, picture=corners)
    save_report(folder / "evaluation.json", report.model_copy(update={"plots": tuple(made), "flight": flight}))


def write_run(folder: Path, reference: Path | None = None, *, name: str = "dense", trials: int = 40) -> Plan:
    """The folder of a planning run, finished."""
    folder.mkdir(parents=True)
    sha256 = None if reference is None else file_sha256(reference / "reference.json")
    source = PlanSource(kind="reference", name=name, sha256=sha256)
    given = (GivenPlot(source=source, path="dense"),)
    settings = SearchSettings(fieldkit="0.1.0", given=given, cameras=7, method="field", evaluations=trials)
    (folder / "search.json").write_text(settings.model_dump_json(indent=2))
    plan = planned(7).model_copy(
        update={
            "source": source,
            "method": PlanMethod(
                name="field", seed=0, evaluations=trials, chamfer_m=0.0041, chamfer_spread_m=0.0002, repeats=3
            ),
        }
    )
    rows = tuple((*s.position_m, s.yaw_deg, s.pitch_deg) for s in plan.stations)
    rng = np.random.default_rng(0)
    lines = []
    for k in range(trials):
        value = 0.005 + 0.004 * np.exp(-k / 10) * (1 + rng.random())
        weights = {"set-matern": 0.5 + 0.3 * k / trials, "set-rbf": 0.5 - 0.3 * k / trials} if k >= 16 else None
        lines.append(
            LogEntry(
                number=k,
                stage="search",
                origin=f"circle {k}" if k < 3 else f"near {k - 1}",
                seed=0,
                fidelity="draft",
                cameras=rows,
                value_m=value,
                chamfer_m=value,
                accuracy_m=value / 2,
                completeness_m=value / 2,
                f_score=dict.fromkeys(("0.002", "0.005", "0.010", "0.020"), 0.5),
                registered=7,
                right=7,
                models=1,
                points=5,
                cloud_digest="0" * 32,
                views=(),
                failure="",
                measured=k != 5,
                cpu_s=9.0,
                wall_s=9.5,
                proposal_cpu_s=0.1,
                finished_s=10.0 * (k + 1),
                notes={} if weights is None else {"weights": weights},
            ).model_dump_json()
        )
    (folder / "evaluations.jsonl").write_text("\n".join(lines) + "\n")
    finalist = {
        "number": trials - 1,
        "origin": f"near {trials - 2}",
        "search_value_m": 0.0051,
        "value_m": 0.0041,
        "spread_m": 0.0002,
        "right": [7, 7, 6],
    }
    (folder / "outcome.json").write_text(
        json.dumps(
            {
                "method": "field",
                "cameras": 7,
                "chamfer_m": 0.0041,
                "chamfer_spread_m": 0.0002,
                "evaluations": trials,
                "failed_evaluations": 1,
                "confirmations": 3,
                "seconds": 10.0 * trials,
                "evaluation_cpu_s": 9.0 * trials,
                "proposal_cpu_s": 4.0,
                "stopped": "evaluations",
                "finalists": [finalist],
            }
        )
    )
    save_plan(folder / "plan.json", plan)
    return plan


def write_mission(folder: Path, plots: Path | None = None) -> Path:
    """A mission's folder; its mission.json."""
    folder.mkdir(parents=True)
    done = export_mission(
        planned(5),
        "ardupilot-pitch",
        SITES / "example.toml",
        folder / "field.plan",
        MissionSettings(plant_height=LOW_M),
        plots=plots,
        picture=False,
    )
    return next(file for file in done.files if file.suffix == ".json")


def write_campaign(
    folder: Path, *, name: str = "maize 2026", dates: tuple[str, ...] = ("2026-06-30", "2026-07-14")
) -> None:
    """A campaign's folder with a visit of every plot on every date; one of them failed."""
    save_plan(folder.parent / "campaign-plan.json", planned(5))
    sources = CampaignSources(folder.parent / "campaign-plan.json", SITES / "example.toml", SITES / "plots.geojson")
    campaign = init_campaign(folder, sources, name=name)
    (folder.parent / "campaign-plan.json").unlink()
    for day, date in enumerate(dates):
        for k, plot in enumerate(campaign.plots):
            value = 0.008 + 0.001 * k + 0.002 * day
            visit = Visit(
                plot=plot.name,
                date=date,
                captures="captures",
                folder=f"visits/{date}/{plot.name}",
                images=13,
                registered=13,
                right=13 if k else 11,
                pose_rms_m=0.02,
                chamfer_m=value,
                accuracy_m=value / 3,
                completeness_m=2 * value / 3,
                f_score={"0.005": 0.6, "0.010": 0.9 - 0.02 * k},
                cpu_s=20.0,
                traits=TraitsEntry(height_m=0.6 + 0.2 * day, cover_percent=30.0 + 5.0 * day, canopy_volume_m3=0.2),
                notes=(HOSTILE,) if k == 2 else (),
            )
            if k == 7:
                visit = Visit(plot=plot.name, date=date, images=9, error=f"the photographs fell apart {HOSTILE}")
            elif k == 6:
                visit = Visit(
                    plot=plot.name,
                    date=date,
                    images=13,
                    registered=13,
                    right=13,
                    predicted_chamfer_m=0.011,
                    predicted_low_m=0.008,
                    predicted_high_m=0.016,
                    traits=TraitsEntry(height_m=0.7, cover_percent=40.0, canopy_volume_m3=0.25),
                )
            keep_visit(folder, visit)


def write_photographs(folder: Path, count: int = 8, *, side: int = 320) -> None:
    """Photographs as the examples' reports name them."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    for number in range(1, count + 1):
        pixels = np.kron(rng.integers(0, 255, (6, 8, 3)), np.ones((side // 8, side // 8, 1))).astype(np.uint8)
        Image.fromarray(pixels).save(folder / f"IMG_{number:04d}.jpg", quality=90)


def write_everything(root: Path) -> None:
    """A season's folder with results of every kind, hostile names among them, and one that is damaged."""
    write_reference(root / "reference", source=HOSTILE)
    write_run(root / "plan", root / "reference", name=HOSTILE)
    write_mission(root / "mission", SITES / "plots.geojson")
    names = ("plot 7", HOSTILE.replace("/", "∕"))
    write_evaluation(
        root / "scores", root / "reference", plots=names, failed="empty", adherence=True, source="captures"
    )
    write_campaign(root / "campaign")
    (root / "broken").mkdir()
    (root / "broken" / "evaluation.json").write_text('{"kind": "evaluation", "version": 1}')
    os.mkfifo(root / "pipe.geojson.part")  # nothing of ours, and nothing to wait for


def _adherence(plot: str) -> AdherenceEntry:
    stations = tuple(
        StationErrorEntry(
            station=f"station {k + 1}",
            image=f"IMG_{k + 1:04d}.jpg",
            east_m=0.1 * k - 0.2,
            north_m=0.05,
            up_m=None if k else -0.1,
            yaw_deg=1.5,
            pitch_deg=-0.5,
            speed_mps=0.04,
            turning_dps=0.3,
        )
        for k in range(5)
    )
    return AdherenceEntry(
        stations=stations,
        missing=("station 6", f"station {plot}"),
        extra=("IMG_0008.jpg",),
        horizontal_rms_m=0.21,
        yaw_rms_deg=1.5,
        pitch_rms_deg=0.5,
    )
