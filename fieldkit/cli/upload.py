"""fieldkit upload."""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from fieldkit.cli.common import DebugOption, JsonOption, PlotIdOption, PlotsOption, emit_json, say, vehicles_like
from fieldkit.cli.mission_findings import finding_entries, show_findings
from fieldkit.cli.option_groups import grouped
from fieldkit.errors import MissionError, UsageError
from fieldkit.figures.style import format_length
from fieldkit.wording import count

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fieldkit.link.mavsdk_vehicle import MavsdkVehicle
    from fieldkit.link.start import Standing
    from fieldkit.link.upload_outcome import UploadReport
    from fieldkit.missions.files.read_mission import ReadMission
    from fieldkit.missions.findings import Finding
    from fieldkit.routing.mission import Fence
    from fieldkit.sites.site import Site

_WORD = "START"
_MOST_NAMED = 3


@dataclass(frozen=True)
class LinkOptions:
    """Of the link to the vehicle."""

    signed: Annotated[bool, Option("--signed", help="Refuse to run over an unsigned link.")] = False
    signing_key: Annotated[
        Path | None, Option("--signing-key", metavar="FILE", help="MAVLink key: 32 bytes or 64 hex digits.")
    ] = None
    attempts: Annotated[int, Option("--attempts", min=1, max=100, help="Uploads before it is given up.")] = 6
    timeout: Annotated[float, Option("--timeout", metavar="S", min=1.0, max=600.0, help="To hear the vehicle.")] = 10.0
    reply: Annotated[
        float, Option("--reply", metavar="S", min=0.05, max=30.0, help="Time for an answer; more on slow radios.")
    ] = 0.5

    def key(self) -> bytes | None:
        """The MAVLink key.

        Raises:
            UsageError: --signed without one.
            MetadataError: the file holds none.
        """
        if self.signing_key is None:
            if self.signed:
                raise UsageError("--signed needs a key", remedy="Give --signing-key FILE.")
            return None
        from fieldkit.link.signing import read_key

        return read_key(self.signing_key)


@grouped
def command(
    mission: Annotated[Path, Argument(help="Mission with MAVLink items: .plan or .waypoints.")],
    connect: Annotated[
        str, Option("--connect", metavar="URL", help="udpin://0.0.0.0:14550, udpout://…, tcpout://… or serial://…")
    ],
    *,
    site: Annotated[
        Path | None, Option("--site", metavar="FILE", help="Site file: checked against it; its fence is uploaded.")
    ] = None,
    plots: PlotsOption = None,
    plot_id: PlotIdOption = None,
    vehicle: Annotated[
        str | None,
        Option(
            "--vehicle",
            autocompletion=vehicles_like,
            metavar="NAME",
            help="Vehicle profile to check for: a name or a TOML file.",
        ),
    ] = None,
    force: Annotated[bool, Option("--force", help="Send a mission that check-mission finds errors in.")] = False,
    no_fence: Annotated[bool, Option("--no-fence", help="Leave the vehicle's fence as it is.")] = False,
    start: Annotated[
        bool, Option("--start", help="Arm and start, after checks and a typed confirmation; needs --site.")
    ] = False,
    within: Annotated[
        float, Option("--within", metavar="M", min=0.5, max=1000.0, help="From the site's home, to start.")
    ] = 10.0,
    link: LinkOptions,
    as_json: JsonOption = False,
    debug: DebugOption = False,
) -> None:
    """Check a mission, upload it, read it back and compare it; clear it and try again after any failure.

    What check-mission calls an error is refused, unless --force is given. However it ends, it says what the vehicle
    holds: the new mission whole, none, or that it is not known.

    Examples:
        fieldkit upload field.plan --connect udpin://0.0.0.0:14550 --site site.toml
        fieldkit upload field.plan --connect serial:///dev/ttyUSB0:57600 --reply 2 --site site.toml
        fieldkit upload field.plan --connect udpin://0.0.0.0:14550 --site site.toml --signing-key key --signed --start

    Exit codes:
        0  the vehicle holds the new mission whole, and is started with --start
        2  wrong usage
        3  a file cannot be used
        5  check-mission finds errors, too large or empty, an item is refused, the vehicle is armed or may not start
        6  the link failed

    See Also:
        fieldkit check-mission, fieldkit replay
    """
    key = link.key()
    if start and site is None:
        raise UsageError("--start needs to know where home is", remedy="Give --site SITE.toml.")
    if start and force:
        raise UsageError("--start does not fly what was forced", remedy="Correct the mission, or start it yourself.")
    if start and not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(
            "--start asks a person, and there is no terminal", remedy="Run it in a terminal, or without --start."
        )

    from fieldkit.cli.progress import open_progress
    from fieldkit.link.upload import autopilot_name, check_size, connected, upload_to
    from fieldkit.link.upload_outcome import Patience
    from fieldkit.missions.check_upload import findings_by_dialect
    from fieldkit.sites.site_file import load_site
    from fieldkit.vehicles.vehicle_file import load_vehicle

    read, place = _with_items(mission).behind_home(), None if site is None else load_site(site, plots, plot_id)
    check_size(read.items)
    profile = None if vehicle is None else load_vehicle(vehicle)
    found = findings_by_dialect(read, profile, place, file=mission)
    fewest = min(found.values(), key=_errors)
    if not force:
        _require_no_errors(fewest, mission)
    fence = None if no_fence else _fence(read, place)
    patience = Patience(connect_s=link.timeout, attempts=link.attempts, reply_s=link.reply)
    standing = None
    with connected(connect, key=key, patience=patience) as connection:
        findings = found.get(autopilot_name(connection).lower(), fewest)
        if not force:
            _require_no_errors(findings, mission)
        with open_progress(as_json=as_json) as progress, progress.stage("upload", len(read.items)) as advance:
            report = upload_to(
                connection, read.items, home=read.home, fence=fence,
                dialect=read.firmware or (None if profile is None else profile.dialect), signed=key is not None,
                patience=patience, advance=advance,
            )  # fmt: skip
        if not as_json:
            _tell(report, read)
            _tell_findings(findings, mission)
        if start and place is not None:
            standing = _start(connection, place, within, report.items)
    if as_json:
        emit_json({
            "mission": mission, "autopilot": report.autopilot, "items": report.items,
            "fence_items": report.fence_items, "attempts": report.attempts, "downloads": report.downloads,
            "seconds": report.seconds, "signed": report.signed, "vehicle_holds": "new mission",
            "roundings": list(report.roundings), "findings": finding_entries(findings), "started": standing is not None,
            "distance_from_home_m": None if standing is None else standing.distance_m,
        })  # fmt: skip


def _with_items(mission: Path) -> ReadMission:
    from fieldkit.missions.files.reading import read_mission

    read = read_mission(mission)
    if not read.items:
        raise MissionError(
            f"a {read.format} file holds no MAVLink items", path=mission,
            remedy="Export the mission as .plan or .waypoints; take this one over with its own app.",
        )  # fmt: skip
    return read


def _errors(findings: Sequence[Finding]) -> int:
    return sum(finding.severity == "error" for finding in findings)


def _require_no_errors(findings: Sequence[Finding], mission: Path) -> None:
    """Refuse a mission that should not be flown, before anything is sent.

    Raises:
        MissionError: there is an error.
    """
    from fieldkit.missions.findings import grouped

    if not _errors(findings):
        return
    texts = [each.text for each in grouped(findings) if each.first.severity == "error"]
    more = f"; and {count(len(texts) - _MOST_NAMED, 'more kind')}" if len(texts) > _MOST_NAMED else ""
    errors = _errors(findings)
    raise MissionError(
        f"must not be flown: {count(errors, 'error')}: {'; '.join(texts[:_MOST_NAMED])}{more}. "
        "Nothing was sent",
        path=mission, remedy="Correct it (fieldkit check-mission says more), or give --force to send it all the same.",
    )  # fmt: skip


def _tell_findings(findings: Sequence[Finding], mission: Path) -> None:
    """Warnings, and what was forced."""
    if findings:
        show_findings(findings, mission)
    if errors := _errors(findings):
        say(f"The mission was sent in spite of {count(errors, 'error')}: do not start it as it is.")


def _fence(read: ReadMission, site: Site | None) -> Fence | None:
    from fieldkit.routing.mission import Fence

    if read.fence is not None:
        return read.fence
    if site is not None and (site.fence or site.no_fly):
        return Fence(inside=site.fence, outside=tuple(zone.corners for zone in site.no_fly), ceiling_m=site.ceiling_m)
    return None


def _tell(report: UploadReport, read: ReadMission) -> None:
    tries = "" if report.attempts == 1 else f" in {report.attempts} attempts"
    corners = (
        f", a fence of {count(report.fence_items, 'corner or circle', 'corners and circles')}"
        if report.fence_items
        else ""
    )
    held = f"{count(report.items, 'item')}{corners}, read back and compared{tries}"
    say(f"The {report.autopilot} holds the new mission whole: {held}.")
    alike = Counter(note.split(" ", 2)[2] for note in report.roundings)  # without "item N"
    for note, items in alike.most_common(10):
        say(f"note: {note}{f' ({items} items)' if items > 1 else ''}")
    if len(alike) > 10:
        say(f"note: and {count(len(alike) - 10, 'more kind')} of numbers that the autopilot rounds (all with --json)")
    if read.rally:
        say(f"note: {count(len(read.rally), 'rally point')} of the file not uploaded")
    if read.fence is not None and read.fence.ceiling_m is not None:
        say(f"note: the fence's ceiling is a parameter: set FENCE_ALT_MAX to {read.fence.ceiling_m:g} on an ArduPilot")


def _start(vehicle: MavsdkVehicle, site: Site, within_m: float, items: int) -> Standing:
    from fieldkit.link.start import check_standing, start_mission
    from fieldkit.routing.mission import Home

    home = Home(site.home.latitude_deg, site.home.longitude_deg, site.home.amsl_m)
    standing = check_standing(vehicle, home, within_m=within_m)
    say(
        f"The vehicle stands {format_length(standing.distance_m)} from the site's home, uses GPS "
        f"({standing.satellites} satellites) and is disarmed."
    )
    if not _confirmed(f"It will ARM, TAKE OFF and fly {count(items, 'item')}. Type {_WORD} to do it: "):
        raise MissionError("not started. The vehicle holds the new mission whole", remedy=f"Type {_WORD} to start it.")
    # A person may take long to answer; the vehicle may have been carried away meanwhile.
    standing = check_standing(vehicle, home, within_m=within_m)
    start_mission(vehicle)
    say("Started: armed, in AUTO.")
    return standing


def _confirmed(question: str) -> bool:
    sys.stderr.write(question)
    sys.stderr.flush()
    return sys.stdin.readline().strip() == _WORD
