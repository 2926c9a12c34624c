"""fieldkit upload."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Option

from fieldkit.cli.boundary import finding_entry
from fieldkit.cli.common import (
    JsonOption,
    SiteOptions,
    VehicleOption,
    answer,
    emit_json,
    say,
    show_findings,
)
from fieldkit.errors import MissionError
from fieldkit.wording import count

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fieldkit.results.finding import Finding


def command(
    mission: Path,
    connect: Annotated[str, Option(metavar="URL")],
    *,
    site: SiteOptions,
    vehicle: VehicleOption = None,
    force: bool = False,
    as_json: JsonOption = False,
) -> None:
    """Check a mission, upload it, read it back and compare it; clear it and try again, three times in all.

    What check-mission calls an error is refused, unless --force is given. However it ends, it says what the vehicle
    holds: the new mission whole, none, or that it is not known. Fences and rally points stay as they are.

    Args:
        mission: Mission with MAVLink items: .plan or .waypoints.
        connect: udpin://0.0.0.0:14550, udpout://…, tcpout://… or serial://…
        force: Send a mission that check-mission finds errors in.

    Examples:
        fieldkit upload field.plan --connect udpin://0.0.0.0:14550 --site site.toml
        fieldkit upload field.plan --connect serial:///dev/ttyUSB0:57600 --site site.toml
    """
    from fieldkit.cli.progress import open_progress
    from fieldkit.link.upload import check_size, upload_mission
    from fieldkit.link.vehicle import Vehicle
    from fieldkit.missions.check import findings_by_dialect
    from fieldkit.missions.files.formats import read_mission
    from fieldkit.vehicles.vehicle_file import load_vehicle

    read = read_mission(mission).behind_home()
    if not read.items:
        raise MissionError(
            f"a {read.format} file holds no MAVLink items",
            path=mission,
            remedy="Export the mission as .plan or .waypoints; take this one over with its own app.",
        )
    check_size(read.items)
    place = site.load()
    profile = None if vehicle is None else load_vehicle(vehicle)
    with open_progress(as_json=as_json):
        found = findings_by_dialect(read, profile, place, file=mission)
    fewest = min(found.values(), key=_errors)
    _require_no_errors(fewest, mission, force=force)
    with Vehicle(connect) as connection:
        findings = found.get(connection.name.lower(), fewest)
        _require_no_errors(findings, mission, force=force)
        with open_progress(as_json=as_json) as progress, progress.stage("upload", len(read.items)) as advance:
            dialect = read.firmware or (None if profile is None else profile.dialect)
            report = upload_mission(connection, read.items, home=read.home, dialect=dialect, advance=advance)
    if as_json:
        emit_json(
            {
                "mission": mission,
                "autopilot": report.autopilot,
                "items": report.items,
                "attempts": report.attempts,
                "seconds": report.seconds,
                "vehicle_holds": "new mission",
                "findings": [finding_entry(finding) for finding in findings],
            }
        )
        return
    held = f"{count(report.items, 'item')}, read back and compared, in {count(report.attempts, 'attempt')}"
    answer(f"The {report.autopilot} holds the new mission whole: {held}.")
    if read.fence.inside or read.fence.outside or (place is not None and (place.fence or place.no_fly)):
        say("note: fence and rally points are not uploaded: set them up with your ground station")
    if findings:
        show_findings(findings, mission)
    if errors := _errors(findings):
        answer(f"The mission was sent in spite of {count(errors, 'error')}: do not start it as it is.")


def _errors(findings: Sequence[Finding]) -> int:
    return sum(finding.severity == "error" for finding in findings)


def _require_no_errors(findings: Sequence[Finding], mission: Path, *, force: bool) -> None:
    from fieldkit.missions.findings import group_text, ranked

    texts = [group_text(group) for group in ranked(findings) if group[0].severity == "error"]
    if not texts or force:
        return
    more = f"; and {count(len(texts) - 3, 'more kind')}" if len(texts) > 3 else ""
    said = f"{count(_errors(findings), 'error')}: {'; '.join(texts[:3])}{more}"
    remedy = (
        "Correct it (fieldkit check-mission says more), give --vehicle where yours needs less clearance, or --force to "
        "send it all the same."
    )
    raise MissionError(f"must not be flown: {said}. Nothing was sent", path=mission, remedy=remedy)
