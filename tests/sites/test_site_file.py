"""Site files and plots files."""

import json
import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from benchmarks.fuzzing import Target, fuzz
from fieldkit.documents.mistaken import SWAPPED
from fieldkit.errors import MetadataError
from fieldkit.routing.mission import Home
from fieldkit.sites.placement import SiteFrame
from fieldkit.sites.plots_file import heading_near, load_plots, plot_shape
from fieldkit.sites.site import NoFly, Obstacle, Site, SitePlot
from fieldkit.sites.site_file import load_site, with_plots
from tests.vehicles.test_vehicle_file import check_table

ROOT = Path(__file__).parents[2]
SITES = ROOT / "missions" / "sites"
SITE = """format = 1
[home]
latitude_deg = 50.8649
longitude_deg = 6.4473
amsl_m = 92.0
[[plots]]
latitude_deg = 50.8650
longitude_deg = 6.4473
"""
SQUARE = [[6.4472, 50.8650], [6.4474, 50.8650], [6.4474, 50.8651], [6.4472, 50.8651], [6.4472, 50.8650]]


def site_file(folder: Path, text: str = SITE) -> Path:
    path = folder / "site.toml"
    path.write_text(text, encoding="utf-8")
    return path


def with_top(top: str) -> str:
    """The site with keys at its top."""
    return SITE.replace("format = 1\n", f"format = 1\n{top}\n")


def point(lon: float = 6.4473, lat: float = 50.8650, *rest: float, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": "Point", "coordinates": [lon, lat, *rest]},
    }


def polygon(*rings: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": "Polygon", "coordinates": list(rings)}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def geojson(folder: Path, *features: Any, name: str = "plots.geojson", **more: Any) -> Path:
    path = folder / name
    path.write_text(json.dumps({"type": "FeatureCollection", **more, "features": list(features)}))
    return path


def rectangle(middle: tuple[float, float], heading: float, length: float, width: float) -> list[list[float]]:
    """A closed GeoJSON ring of a rectangle whose first side leads towards a heading."""
    frame = SiteFrame(Home(latitude_deg=middle[0], longitude_deg=middle[1]))
    angle = np.radians(heading)
    along, left = np.array([np.sin(angle), np.cos(angle)]), np.array([-np.cos(angle), np.sin(angle)])
    corners = [a * length / 2 * along + b * width / 2 * left for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))]
    latitude, longitude, _ = frame.to_geodetic(np.column_stack([corners, np.zeros(5)]))
    return [[float(x), float(y)] for x, y in zip(longitude, latitude, strict=True)]


def test_the_example() -> None:
    site = load_site(SITES / "example.toml")
    assert (site.name, site.home.amsl_m, len(site.plots)) == ("example", 92.0, 1)
    assert site.ground_m(site.plots[0]) == 0.0
    assert len(site.fence) == 1
    assert len(site.fence[0]) == 4
    assert [zone.name for zone in site.no_fly] == ["weather station"]
    many = load_site(SITES / "example.toml", SITES / "plots.geojson")
    assert [plot.name for plot in many.plots] == [f"maize-{n}" for n in range(1, 9)]
    # Rounded to 1e-8°, the sides of 6 m are true to 0.02°. The fifth is drawn the other way round.
    assert all(abs(plot.row_heading_deg - 99.5) < 0.02 for plot in many.plots)
    assert [round(many.ground_m(plot), 9) for plot in many.plots] == [0, 0, 0, 0.1, 0.1, 0.1, 0.2, 0.2]
    assert many.home == site.home


@pytest.mark.parametrize(
    ("section", "model"),
    [
        ("At the top of a site file", Site),
        ("`[home]`", Home),
        ("`[[plots]]`", SitePlot),
        ("`[[no_fly]]`", NoFly),
        ("`[[obstacles]]`", Obstacle),
    ],
)
def test_the_readme_lists_the_keys(section: str, model: type[BaseModel] | type[Home]) -> None:
    check_table(section, model)


def test_polygons_inline_and_beside_are_the_same(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    geojson(tmp_path, polygon(SQUARE, name="hut"), name="zones.geojson")
    geojson(tmp_path / "maps", polygon(SQUARE, name=3), name="fence.geojson")
    beside = with_top('geofence = "maps/fence.geojson"\nno_fly = "zones.geojson"')
    corners = [[lat, lon] for lon, lat in SQUARE]
    inline = with_top(f'geofence = [{corners[:-1]}]\nno_fly = [{{name = "hut", corners = {corners}}}]')
    assert load_site(site_file(tmp_path, beside)) == load_site(site_file(tmp_path, inline))
    (tmp_path / "multi.geojson").write_text(json.dumps({"type": "MultiPolygon", "coordinates": [[SQUARE], [SQUARE]]}))
    site = load_site(site_file(tmp_path, with_top('geofence = "multi.geojson"')))
    assert len(site.fence) == 2
    assert site.fence[0] == site.fence[1] == tuple((lat, lon) for lon, lat in SQUARE[:-1])


def test_plots_beside_in_place_of_or_instead_of(tmp_path: Path) -> None:
    geojson(tmp_path, point(name="a", row_heading_deg=10))
    other = geojson(tmp_path, point(name="b", row_heading_deg=20), name="other.geojson")
    alone = SITE.partition("[[plots]]")[0]
    named = alone.replace("format = 1", 'format = 1\nplots = "plots.geojson"')
    assert [p.name for p in load_site(site_file(tmp_path, named)).plots] == ["a"]
    assert [p.name for p in load_site(site_file(tmp_path, named), other).plots] == ["b"]
    assert [p.name for p in load_site(site_file(tmp_path, alone), other).plots] == ["b"]
    assert [p.name for p in load_site(site_file(tmp_path), other).plots] == ["b"]
    # Plots that are not flown stay obstacles: what the site names must be there, but for a campaign's own copy.
    lacking = site_file(tmp_path, named.replace("plots.geojson", "lost.geojson"))
    with pytest.raises(MetadataError, match="lost"):
        load_site(lacking, other)
    assert [p.name for p in load_site(lacking, other, converted=True).plots] == ["b"]
    with pytest.raises(MetadataError, match="has no plots") as caught:
        load_site(site_file(tmp_path, alone))
    assert "--plots" in caught.value.remedy


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format = 1", "", "has no 'format'"),
        ("latitude_deg = 50.8649", "lat = 50.8649", "home.latitude_deg: is missing"),
        ("amsl_m = 92.0", "amsl_m = 92.0\nellipsoid_m = 300", "home: ellipsoid_m 300 and amsl_m 92 differ by more"),
        (
            "latitude_deg = 50.8650\nlongitude_deg = 6.4473",
            "latitude_deg = 6.4473\nlongitude_deg = 50.8650",
            "km from home",
        ),
        ("latitude_deg = 50.8650", "latitude_deg = 52.8650", 'plot "plot" lies 223 km from home'),
        ("format = 1", "format = 1\nceiling_m = 4", "takeoff_m is 5, above ceiling_m, which is 4"),
        ("format = 1", "format = 1\ngeofence = [[[1, 2], [3, 4], [1, 2]]]", "fewer than three different corners"),
        (
            "format = 1",
            "format = 1\ngeofence = [[[50.8, 6.4], [50.9, 6.5], [50.8, 6.5], [50.9, 6.4]]]",
            "geofence 1 crosses itself or has no area",
        ),
        (
            "format = 1",
            "format = 1\ngeofence = [[[6.4, 50.8], [6.5, 50.9], [6.5, 50.8]]]",
            "a corner of geofence 1 lies",
        ),
        ("format = 1", 'format = 1\ngeofence = "../fence.geojson"', "leads out of the site file's folder"),
        ("format = 1", 'format = 1\ngeofence = "no.geojson"', "there is no such file"),
        ("format = 1", 'format = 1\nno_fly = ""', "no_fly: is not a path"),
    ],
)
def test_site_errors(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SITE
    path = site_file(tmp_path, SITE.replace(old, new, 1))
    with pytest.raises(MetadataError, match=re.escape(message)) as caught:
        load_site(path)
    assert caught.value.path is not None
    assert caught.value.remedy


def test_no_way_out_of_the_folder(tmp_path: Path) -> None:
    outside = geojson(tmp_path, polygon(SQUARE), name="fence.geojson")
    inside = tmp_path / "site"
    inside.mkdir()
    (inside / "link.geojson").symlink_to(outside)
    (inside / "circle.geojson").symlink_to(inside / "circle.geojson")
    with pytest.raises(MetadataError, match="leads out of"):
        load_site(site_file(inside, with_top('geofence = "link.geojson"')))
    with pytest.raises(MetadataError):
        load_site(site_file(inside, with_top('geofence = "circle.geojson"')))
    assert load_site(site_file(inside, with_top(f'geofence = "{outside}"'))).fence


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ([point()], "feature 1: is a point without row_heading_deg"),
        ([point(row_heading_deg="90")], "feature 1: row_heading_deg: "),
        ([point(50.8650, 96.4473, row_heading_deg=0)], SWAPPED.looks_like),
        ([point(326543.2, 5637000.1, row_heading_deg=0)], "metres of a map projection look like this"),
        ([point(6.4, 50.8, 91.5, row_heading_deg=0)], "has the height 91.5 in its coordinates"),
        ([point(row_heading_deg=0, height_m=91.5)], "height_m is 91.5, but above what?"),
        ([polygon(SQUARE, SQUARE)], "has a hole"),
        ([polygon([SQUARE[0], SQUARE[1], SQUARE[0]])], "fewer than three different corners"),
        ([polygon(rectangle((50.0, 6.0), 20, 4.1, 4.0))], "nearly square"),
        ([{"type": "Feature", "geometry": None}], "feature 1: is not a feature with a geometry"),
        ([{"type": "Feature", "geometry": {"type": "Point", "coordinates": [True, 1]}}], "is no GeoJSON"),
        ([], "holds no features"),
        ([point(row_heading_deg=0)] * 2001, "holds more than 2000 features"),
    ],
)
def test_plots_errors(tmp_path: Path, features: list[Any], message: str) -> None:
    path = geojson(tmp_path, *features)
    with pytest.raises(MetadataError, match=re.escape(message)) as caught:
        load_plots(path)
    assert caught.value.path == path
    assert caught.value.remedy


def test_plots_far_from_home_or_without_its_datum(tmp_path: Path) -> None:
    site = site_file(tmp_path)
    swapped = geojson(tmp_path, point(50.8650, 6.4473, row_heading_deg=0))
    with pytest.raises(MetadataError, match=r"lies .* km from home") as caught:
        load_site(site, swapped)
    assert caught.value.path == swapped
    assert "longitude in GeoJSON" in caught.value.remedy
    plots = load_plots(geojson(tmp_path, point(row_heading_deg=0, height_m=140.0, datum="ellipsoid")))
    with pytest.raises(MetadataError, match="home needs ellipsoid_m"):
        with_plots(load_site(site), plots)
    for height, refused in ((93.0, True), (12.0, False)):  # 200 m from home, which is 92 m above the sea
        plots = load_plots(geojson(tmp_path, point(lat=50.8667, row_heading_deg=0, height_m=height, datum="home")))
        with pytest.raises(MetadataError, match="heights above another datum") if refused else nullcontext():
            with_plots(load_site(site), plots)


@given(
    st.sampled_from([(50.8, 6.4), (-33.4, 179.99999), (89.99, 20.0), (-89.9, -100.0), (0.0, 0.0)]),
    st.floats(0, 180, exclude_max=True),
    st.floats(2.0, 80.0),
    st.floats(0.05, 0.9),
    st.integers(0, 3),
    st.booleans(),
)
def test_shapes(middle, heading, length, share, first, backwards) -> None:
    ring = rectangle(middle, heading, length, length * share)[:-1]
    ring = ring[first:] + ring[:first]
    shape = plot_shape([(lat, lon) for lon, lat in (ring[::-1] if backwards else ring)])
    frame = SiteFrame(Home(latitude_deg=middle[0], longitude_deg=middle[1]))
    centre = frame.to_local(shape.latitude_deg, shape.longitude_deg, 0.0)[0]
    assert np.abs(centre).max() < 1e-4
    assert abs((shape.side_deg - heading + 90) % 180 - 90) < 0.01
    assert shape.sides_m == pytest.approx((length, length * share), abs=1e-4)
    assert not shape.nearly_square


def test_all_plots_of_a_field_lie_the_same_way_round(tmp_path: Path) -> None:
    """Rows about 135°, where the first choice turns over: the second follows the first."""
    rows = [polygon(rectangle((50.8650, 6.4473), h, 6.0, 3.0)) for h in (134.5, 135.5, 315.2, 314.0)]
    headings = [plot.row_heading_deg for plot in load_plots(geojson(tmp_path, *rows))]
    assert headings == pytest.approx([134.5, 135.5, 135.2, 134.0], abs=0.01)
    own = [polygon(rectangle((50.8650, 6.4473), 20.0, 6.0, 3.0), row_heading_deg=200.0), *rows[1:]]
    headings = [plot.row_heading_deg for plot in load_plots(geojson(tmp_path, *own))]
    assert headings == pytest.approx([200.0, 315.5, 315.2, 314.0], abs=0.01)
    assert heading_near(0.0, 45.0) == 0.0
    assert heading_near(90.0, 45.0) == 90.0
    assert heading_near(170.0, 45.0) == 350.0


def test_changed_at_random(tmp_path: Path) -> None:
    sites = tmp_path / "sites"
    sites.mkdir()
    (sites / "example-fence.geojson").write_bytes((SITES / "example-fence.geojson").read_bytes())
    (sites / "plots.geojson").write_bytes((SITES / "plots.geojson").read_bytes())
    whole = with_top('geofence = "example-fence.geojson"\nlanding = {latitude_deg = 50.8649, longitude_deg = 6.4473}')
    slopes = SITE + "slope_percent = 4.5\nuphill_heading_deg = 0\nlength_m = 3\nwidth_m = 1.5\n"
    slopes += SITE.partition("[[plots]]")[1] + '\nname = "b"\nlatitude_deg = 50.866\nlongitude_deg = 6.4473\n'
    slopes += "slope_percent = 6.1\nuphill_heading_deg = 20.0\nplant_height_m = 1.2\nrow_spacing_m = 0.75\n"
    seeds = [(SITES / "example.toml").read_bytes(), whole.encode(), slopes.encode()]
    (sites / "slopes.toml").write_text(slopes)
    assert [round(plot.slope_percent, 1) for plot in load_site(sites / "slopes.toml").plots] == [4.5, 6.1]
    found = fuzz(Target(".toml", seeds, load_site), 100, sites, seed=5)
    assert not found.defects
    assert (found.hangs, found.written) == (0, ())
    seeds = [(SITES / name).read_bytes() for name in ("plots.geojson", "hillside.geojson", "example-fence.geojson")]
    found = fuzz(Target(".geojson", seeds, load_plots), 100, tmp_path, seed=6)
    assert not found.defects
    assert (found.hangs, found.written) == (0, ())
    assert found.refused > 10


def test_plots_side_by_side_may_share_an_edge(tmp_path: Path) -> None:
    """Drawn by hand, neighbours overlap a little."""
    more = '[[plots]]\nname = "a"\nlatitude_deg = 50.86502\nlongitude_deg = 6.4473\nlength_m = 3\nwidth_m = 2.6\n'
    text = SITE.replace("[[plots]]", f'{more}[[plots]]\nlength_m = 3\nwidth_m = 2.6\nname = "b"', 1)
    assert len(load_site(site_file(tmp_path, text)).plots) == 2
