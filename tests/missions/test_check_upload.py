"""What speaks against an upload, with a vehicle's profile and without."""

from collections.abc import Sequence
from dataclasses import replace

from fieldkit.missions.autopilots.writing import render
from fieldkit.missions.check import findings_by_dialect
from fieldkit.missions.files.read_mission import ReadMission
from fieldkit.missions.findings import Finding
from fieldkit.sites.site import Obstacle, Site, SiteHome, SitePlot
from fieldkit.vehicles.vehicle import Battery
from tests.missions.vehicles import HOME, small_mission, vehicle


def errors(findings: Sequence[Finding]) -> set[str]:
    return {finding.code for finding in findings if finding.severity == "error"}


def test_a_file_that_names_no_autopilot_is_checked_for_each() -> None:
    read = ReadMission("waypoints", render(small_mission(), vehicle("px4")), home=HOME)
    found = findings_by_dialect(read)
    assert set(found) == {"ardupilot", "px4"}
    assert errors(found["px4"]) == set()
    assert "item-rejected" in errors(found["ardupilot"])
    assert set(findings_by_dialect(replace(read, firmware="px4"))) == {"px4"}


def test_what_only_a_profile_says_needs_one() -> None:
    low = replace(small_mission(), stops=tuple(
        replace(stop, place=replace(stop.place, height_m=0.2)) for stop in small_mission(vias=False).stops
    ), settle_s=0.0)  # fmt: skip
    read = ReadMission("plan", render(low, vehicle())[1:], home=HOME, firmware="ardupilot")
    assert errors(findings_by_dialect(read)["ardupilot"]) == set()
    tired = vehicle(battery=Battery(endurance_s=30.0, reserve=0.5))
    assert {"too-low", "endurance"} <= errors(findings_by_dialect(read, tired)["ardupilot"])


def test_the_sites_home_and_obstacles_count() -> None:
    home = SiteHome(latitude_deg=HOME.latitude_deg, longitude_deg=HOME.longitude_deg, amsl_m=92.0)
    read = ReadMission("plan", render(small_mission(), vehicle())[1:], home=HOME, firmware="ardupilot")
    plot = SitePlot(latitude_deg=50.865, longitude_deg=6.4473, height_m=92.0, datum="amsl")
    plain = Site(home=home, plots=(plot,))
    assert {f.code for f in findings_by_dialect(read, None, plain)["ardupilot"]} == {"plants-unchecked"}
    planted = plot.model_copy(update={"length_m": 4.0, "width_m": 4.0, "plant_height_m": 2.0})
    full = findings_by_dialect(read, None, plain.model_copy(update={"plots": (planted,)}))
    assert errors(full["ardupilot"]) == {"leg-plants"}
    shot = small_mission().shots[0].place
    mast = Obstacle(
        name="mast", latitude_deg=shot.latitude_deg, longitude_deg=shot.longitude_deg, radius_m=1.0, top_m=9.0
    )
    met = findings_by_dialect(read, None, plain.model_copy(update={"obstacles": (mast,)}))
    assert errors(met["ardupilot"]) == {"leg-obstacle"}
    elsewhere = plain.model_copy(update={"home": home.model_copy(update={"latitude_deg": 51.5})})
    assert {"other-home", "far-from-home"} <= errors(findings_by_dialect(read, None, elsewhere)["ardupilot"])
