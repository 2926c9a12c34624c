"""Heights that nobody can put above home are never said to be clear of plants, and the site's datum counts."""

from dataclasses import replace

import pytest

from fieldkit.missions.autopilots.writing import render
from fieldkit.missions.check import check_on_ground
from fieldkit.missions.files.read_mission import ReadMission, ReadStop
from fieldkit.missions.findings import Report
from fieldkit.missions.ground import Ground
from fieldkit.missions.items import Frame
from fieldkit.routing.mission import GeoPoint, Home
from fieldkit.sites.site import Site, SitePlot
from tests.missions.vehicles import HOME, small_mission, vehicle

FIELD = Site(
    home=Home(latitude_deg=HOME.latitude_deg, longitude_deg=HOME.longitude_deg),
    plots=(SitePlot(name="a", latitude_deg=50.866, longitude_deg=6.4473),),
    neighbours=(SitePlot(name="b", latitude_deg=50.867, longitude_deg=6.4473),),
).with_each(lambda plot: plot.model_copy(update={"length_m": 3.0, "width_m": 2.0, "plant_height_m": 1.0}))


def checked(read: ReadMission, site: Site = FIELD) -> Report:
    return check_on_ground(read, vehicle("dji" if read.stops else "ardupilot"), Ground(site))


def in_frame(frame: Frame, amsl_m: float | None, by_m: float = 0.0) -> ReadMission:
    items = [
        replace(item, frame=frame, params=(*item.params[:6], item.params[6] + by_m)) if item.params[4] else item
        for item in render(small_mission(), vehicle())[1:]
    ]
    return ReadMission("plan", tuple(items), home=replace(HOME, amsl_m=amsl_m), firmware="ardupilot")


@pytest.mark.parametrize("above", ["home", "ground", "ellipsoid"])
def test_waypoints_above_something_else_than_home(above: str) -> None:
    stops = tuple(ReadStop(k, GeoPoint(50.866 + 1e-5 * k, 6.4473, 9.0), height_from=above) for k in range(2))
    report = checked(ReadMission("wpml", stops=stops, firmware="dji"))
    assert (set(report.unchecked or ()) == {"a", "b"}) == (above != "home")


def test_items_above_sea_level_are_above_the_sites_home() -> None:
    assert checked(in_frame(Frame.GLOBAL, None)).unchecked
    assert not checked(in_frame(Frame.GLOBAL, 92.0, 92.0)).unchecked
    assert checked(in_frame(Frame.GLOBAL_TERRAIN_ALT, 92.0)).unchecked
    # The file's home lies 6 m too low, so that its heights above sea level seem to be clear of plants.
    site = FIELD.model_copy(update={"home": replace(FIELD.home, amsl_m=98.0)})
    read = in_frame(Frame.GLOBAL, 92.0, 92.0)
    lowest = [min(p.place.height_m for p in checked(read, each).photographs if p.place) for each in (FIELD, site)]
    assert lowest[0] - lowest[1] == pytest.approx(6.0)
