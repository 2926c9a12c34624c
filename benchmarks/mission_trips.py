"""Random missions, written and read back by pymavlink and MAVSDK."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fieldkit.errors import FieldkitError
from fieldkit.flightlogs.mavlink import mavlink
from fieldkit.missions.autopilots.writing import render
from fieldkit.missions.files.formats import mission_bytes, read_mission
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.files.waypoints import definite
from fieldkit.missions.items import Command, Frame, MissionItem, plain_frame
from fieldkit.routing.mission import GeoPoint, Home, Mission, Shot, Via
from fieldkit.vehicles.vehicle import Vehicle

_CONNECT_S = 30.0


@dataclass(frozen=True)
class Trips:
    """Round trips of missions in one dialect and format."""

    dialect: str
    form: str
    reader: str
    """Of the trips."""
    missions: int
    items: int
    photographs: int
    """Numbers that came back right."""
    failures: int
    """How many did not."""
    wrong: tuple[str, ...]
    """Descriptions of those that did not, at most ten."""


def random_mission(rng: np.random.Generator, most: int = 13) -> Mission:
    """A mission of one to ``most`` photographs within 100 m of a home anywhere but at the poles, pitched −90…30°."""
    latitude, longitude = float(rng.uniform(-80, 80)), float(rng.uniform(0.1, 179.9) * rng.choice([-1, 1]))

    def place() -> GeoPoint:
        north, east = rng.uniform(-9e-4, 9e-4, 2)
        return GeoPoint(latitude + float(north), longitude + float(east), float(rng.uniform(0.5, 60.0)))

    stops: list[Shot | Via] = []
    for station in range(int(rng.integers(1, most + 1))):
        if rng.random() < 0.5:
            stops.append(Via(*astuple(place())))
        stops.append(Shot.at(place(), float(rng.uniform(0, 360)) % 360.0, float(rng.uniform(-90, 30)), "plot", station))
    return Mission(
        "random",
        Home(latitude, longitude, float(rng.uniform(1.0, 4000.0))),
        float(rng.uniform(1.0, 60.0)),
        tuple(stops),
        place(),
        speed_mps=float(rng.uniform(0.1, 15.0)),
        settle_s=float(rng.uniform(0.0, 10.0)),
        exposure_s=float(rng.uniform(0.0, 5.0)),
    )


def make_trips(count: int, vehicles: Sequence[Vehicle], folder: Path, seed: int) -> list[Trips]:
    """Write ``count`` random missions per vehicle as .plan and .waypoints and read them back.

    A trip is right if every item comes back as rendered (places to 1e-7° and 1 cm), by the other program and by
    fieldkit, and every photograph has its own heading and pitch.

    Args:
        count: missions.
        vehicles: each of a MAVLink dialect, with a moving gimbal.
        folder: for the files.
        seed: of the missions.
    """
    found = []
    for vehicle in vehicles:
        rng = np.random.default_rng(seed)
        missions = [random_mission(rng) for _ in range(count)]
        with mavsdk_importer(vehicle.dialect) as importer:
            read = lambda path: importer(path.read_text("utf-8"))  # noqa: E731
            found.append(_trips(missions, vehicle, "plan", "MAVSDK", folder, read))
        found.append(_trips(missions, vehicle, "waypoints", "pymavlink", folder, by_pymavlink))
    return found


def by_pymavlink(path: Path) -> list[MissionItem]:
    """The items of a .waypoints file as pymavlink reads them, home first."""
    from pymavlink import mavwp

    loader = mavwp.MAVWPLoader()
    loader.load(str(path))
    return [
        MissionItem(w.command, w.frame, (w.param1, w.param2, w.param3, w.param4, w.x, w.y, w.z), bool(w.autocontinue))
        for w in loader.wpoints
    ]


@contextmanager
def mavsdk_importer(dialect: str) -> Iterator[Any]:
    """MAVSDK's importer of .plan files: a function from the file's text to the items of an upload, in degrees.

    It needs a vehicle: a heartbeat on loopback makes one.
    """
    from mavsdk.component_type import ComponentType
    from mavsdk.mavsdk import Configuration, Mavsdk
    from mavsdk.plugins.mission_raw import MissionRaw

    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        station.add_any_connection(f"udpin://127.0.0.1:{port}")
        link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        autopilot = mavlink.MAV_AUTOPILOT_PX4 if dialect == "px4" else mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        beat = link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, autopilot, 0, 0, 4).pack(link)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle_end:
            deadline = time.monotonic() + _CONNECT_S
            while not station.get_systems() and time.monotonic() < deadline:
                vehicle_end.sendto(beat, ("127.0.0.1", port))
                time.sleep(0.05)
        raw = MissionRaw(station.get_systems()[0])

        def items(plan: str) -> list[MissionItem]:
            return [_of_mavsdk(item) for item in raw.import_qgroundcontrol_mission_from_string(plan).mission_items]

        yield items
    finally:
        station.destroy()


def complete_photographs(items: Sequence[MissionItem], dialect: str) -> int:
    """The items' photographs with their own heading and pitch."""
    complete = 0
    heading = pitch = False
    for item in items:
        if item.command in (Command.DO_MOUNT_CONTROL, Command.DO_GIMBAL_MANAGER_PITCHYAW):
            pitch = math.isfinite(item.params[0])
        elif item.command == Command.CONDITION_YAW:
            heading = True
        elif item.command == Command.NAV_WAYPOINT and dialect == "px4":
            heading = math.isfinite(item.params[3])
        elif item.command == Command.IMAGE_START_CAPTURE:
            complete += heading and pitch
            heading = pitch = False
    return complete


def upload_items(read: ReadMission, dialect: str) -> tuple[MissionItem, ...]:
    """The items as they are uploaded: with the home item in front for "ardupilot" where the file has a home."""
    home = read.home
    if dialect != "ardupilot" or home is None:
        return read.items
    params = (0.0, 0.0, 0.0, 0.0, home.latitude_deg, home.longitude_deg, home.amsl_m or 0.0)
    return (MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL, params), *read.items)


def same_item(a: MissionItem, b: MissionItem) -> bool:
    """Whether two items mean the same: places within 1e-7° and 1 cm, others to single precision, NaN as NaN."""
    if a.command != b.command or plain_frame(a.frame) != plain_frame(b.frame):
        return False
    for k, (p, q) in enumerate(zip(a.params, b.params, strict=True)):
        tolerance = 1e-6 * max(1.0, abs(p))
        if a.positional and k >= 4:
            tolerance = 0.01 if k == 6 else 1.0000001e-7 + 1e-12
        if math.isnan(p) != math.isnan(q) or abs(p - q) > tolerance:
            return False
    return True


def difference(
    mission: Mission, vehicle: Vehicle, ours: Sequence[MissionItem], theirs: Sequence[MissionItem], form: str = "plan"
) -> str:
    """The differences of a mission read by fieldkit and another program from the rendered one; empty if it is right."""
    items: Sequence[MissionItem] = render(mission, vehicle)
    if form == "waypoints":
        items = definite(items)
    if not len(items) == len(ours) == len(theirs):
        return f"{len(items)} items became {len(ours)} and {len(theirs)}"
    for number, (item, own, other) in enumerate(zip(items, ours, theirs, strict=True)):
        wanted = item
        if number == 0 and vehicle.dialect == "ardupilot":  # home, which MAVSDK makes from plannedHomePosition
            wanted = replace(item, params=(*other.params[:4], *item.params[4:]))
            own = replace(own, params=(*other.params[:4], *own.params[4:]))
        for reader, found in (("fieldkit", own), ("the other program", other)):
            if not same_item(wanted, found):
                return f"item {number}: {wanted.params} became {found.params} by {reader}"
    complete = complete_photographs(theirs, vehicle.dialect)
    if complete != len(mission.shots):
        return f"{complete} of {len(mission.shots)} photographs have heading and pitch"
    return ""


def _trips(missions: Sequence[Mission], vehicle: Vehicle, form: str, reader: str, folder: Path, read: Any) -> Trips:
    path = folder / f"random.{form}"
    good = items = photographs = 0
    wrong: list[str] = []
    for number, mission in enumerate(missions):
        try:
            path.write_bytes(mission_bytes(form, mission, vehicle))
            ours = upload_items(read_mission(path), vehicle.dialect)
            theirs = read(path)
            if form == "waypoints" and vehicle.dialect != "ardupilot":
                theirs = theirs[1:]  # row 0 is home even if the dialect has none
            problem = difference(mission, vehicle, ours, theirs, form)
        except FieldkitError as error:
            problem = str(error)
        if problem:
            wrong.append(f"mission {number}: {problem}")
            continue
        good, items, photographs = good + 1, items + len(theirs), photographs + len(mission.shots)
    return Trips(vehicle.dialect, form, reader, good, items, photographs, len(wrong), tuple(wrong[:10]))


def _of_mavsdk(item: Any) -> MissionItem:
    scale = 1e-7 if MissionItem(item.command, 0, (0.0,) * 7).positional else 1.0
    params = (item.param1, item.param2, item.param3, item.param4, item.x * scale, item.y * scale, item.z)
    return MissionItem(item.command, item.frame, params, bool(item.autocontinue))
