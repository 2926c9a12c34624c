"""fieldkit geotag."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from fieldkit.cli.common import JsonOption, OverwriteOption, SitePlotOptions, answer, emit_json, read_numbers, say
from fieldkit.errors import UsageError
from fieldkit.wording import count

if TYPE_CHECKING:
    from fieldkit.flightlogs import FixedMount
    from fieldkit.flightlogs.geotag import GeotagReport
    from fieldkit.geometry.geodesy import LocalFrame
    from fieldkit.sites.site_file import Tell


def command(
    images: Path,
    log: Annotated[Path, Option()],
    output: Annotated[Path, Option("--output", "-o")] = Path("poses.csv"),
    *,
    place: SitePlotOptions,
    mount: Annotated[str, Option(metavar="PITCH[,YAW]")] = "",
    camera_offset: Annotated[float | None, Option(metavar="S")] = None,
    camera: Annotated[int | None, Option(metavar="N")] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write where photographs were taken, from a flight log.

    Photographs and triggers are matched by time and place, never by order: the camera's clock may be off, photographs
    may be missing, and others may lie between them. The photographs are only read.

    Args:
        images: Folder of the photographs of one flight.
        log: Flight log: .tlog, .BIN or .ulg, also as .gz.
        output: poses.csv to write.
        mount: Of a camera without a gimbal, against the vehicle.
        camera_offset: Camera's clock less UTC, where several offsets fit.
        camera: Whose triggers, of several cameras'. Without: what fits.

    Examples:
        fieldkit geotag flight_7/ --log 00000042.BIN -o flight_7/poses.csv
        fieldkit geotag flight_7/ --log flight_7.ulg --site field.toml --plots plots.gpkg --plot r3c2 -o p.csv
        fieldkit geotag flight_7/ --log flight_7.tlog --mount -90 --camera-offset 7200 -o poses.csv
    """
    origin, heading_deg = frame_of_plot(place, tell=None if as_json else say)
    fixed = _mount(mount)
    from fieldkit.flightlogs.geotag import geotag

    report = geotag(
        images,
        log,
        output,
        origin=origin,
        heading_deg=heading_deg,
        mount=fixed,
        offset_s=camera_offset,
        camera=camera,
        overwrite=overwrite,
    )
    if as_json:
        emit_json({"output": output, **_facts(report), "x_heading_deg": heading_deg})
    else:
        _tell(report, output)


def _facts(report: GeotagReport) -> dict[str, object]:
    matches, origin = report.matches, report.origin
    return {
        "images": report.images,
        "triggers": report.triggers,
        "matched": len(report.poses),
        "images_without_trigger": matches.photographs,
        "ambiguous": matches.ambiguous,
        "triggers_without_image": matches.triggers,
        "clock_offset_s": matches.offset_s,
        "clock_drift_ppm": matches.drift_ppm,
        "origin": {
            "latitude_deg": origin.latitude_deg,
            "longitude_deg": origin.longitude_deg,
            "altitude_m": origin.altitude_m,
            "datum": origin.datum,
            "source": report.origin_source,
        },
        "remarks": report.remarks,
    }


def _tell(report: GeotagReport, output: Path) -> None:
    matches = report.matches
    triggers = count(report.triggers, "trigger")
    answer(f"{len(report.poses)} of {count(report.images, 'photograph')} matched to the log's {triggers}: {output}")
    if matches.photographs:
        answer(f"without a trigger: {', '.join(matches.photographs)}")
    if matches.triggers:
        answer(f"triggers without a photograph: {', '.join(map(str, matches.triggers))}")
    for remark in report.remarks:
        say(remark)


def frame_of_plot(place: SitePlotOptions, *, tell: Tell | None) -> tuple[LocalFrame | None, float]:
    """A plot's origin and the heading of its rows, the plan's frame there; without a site the log's home and east."""
    from fieldkit.geometry.geodesy import EAST_DEG, LocalFrame

    site = place.load(tell=tell)
    if site is None:
        return None, EAST_DEG

    path, name = place.site, place.plot
    plot = next((p for p in site.plots if p.name == name or (not name and len(site.plots) == 1)), None)
    if plot is None:
        names = ", ".join(p.name for p in site.plots[:10])
        raise UsageError(f"which plot? The site has {names}", path=path, remedy="Give --plot NAME.")
    zero = 0.0 if plot.datum == "amsl" else site.home.amsl_m if plot.datum == "home" else None
    if zero is None:
        raise UsageError(
            f"does not say how high {plot.name} lies above sea level, which logs count from",
            path=path,
            remedy="Give the home's amsl_m and the plot's height above home.",
        )
    origin = LocalFrame(plot.latitude_deg, plot.longitude_deg, zero + plot.height_m, "sea level")
    return origin, plot.row_heading_deg


def _mount(text: str) -> FixedMount | None:
    if not text:
        return None
    numbers = read_numbers("--mount", text, (1, 2), least=-360.0)
    if not -90.0 <= numbers[0] <= 90.0:
        raise UsageError(f"--mount: not a pitch: {text}", remedy="Write it like --mount -60 (degrees; −90 is down).")
    from fieldkit.flightlogs import FixedMount

    return FixedMount(numbers[0], numbers[1] if len(numbers) > 1 else 0.0)
