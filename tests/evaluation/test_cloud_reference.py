"""Bare clouds as references: where they lie, what counts of them, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from laspy.vlrs.known import GeoKeyDirectoryVlr, GeoKeyEntryStruct

from fieldkit.arrays import FloatArray
from fieldkit.cache import StageCache
from fieldkit.captures import Capture, read_capture
from fieldkit.clouds import Cloud, Volume, read_cloud, write_cloud
from fieldkit.clouds.cloud import concatenate
from fieldkit.errors import CloudError, EmptyCloudError, MetadataError, UsageError
from fieldkit.evaluation.cloud_reference import CloudReference, open_reference
from fieldkit.evaluation.evaluate import evaluate
from fieldkit.evaluation.rasters import write_georeferenced
from fieldkit.evaluation.reference import Reference, build_reference
from fieldkit.evaluation.settings import EvaluationSettings
from fieldkit.geometry import Similarity
from fieldkit.geometry.geodesy import LocalFrame
from fieldkit.reconstruction.result import MetricFrame
from fieldkit.results.report_files import load_evaluation_report
from fieldkit.runtime.context import Context
from fieldkit.runtime.progress import Silent
from tests.evaluation.examples import plant_cloud

PHOTOGRAPHS = Path(__file__).parents[1] / "data" / "small_plot"
ORIGIN = LocalFrame(50.62, 6.985, 152.0, "ellipsoid")
MM = 1e-3


def plot_cloud() -> Cloud:
    """The plant, on soil 2 mm rough about z = 0."""
    rng = np.random.default_rng(4)
    soil = np.column_stack([rng.uniform(-0.5, 0.5, (2000, 2)), 0.002 * rng.normal(size=2000)])
    plant = plant_cloud(1500)
    return concatenate([Cloud(plant.points, plant.colors), Cloud(soil, np.full((2000, 3), 90, np.uint8))])


def opened(path: Path, frame: str = "", bounds: Volume | None = None) -> CloudReference:
    found = open_reference(path, frame, bounds)
    assert isinstance(found, CloudReference)
    return found


def about_origin(found: CloudReference, place: LocalFrame = ORIGIN) -> FloatArray:
    """Its points in the frame about a place."""
    return place.to_local(*found.origin.to_geodetic(found.from_source.inverse().apply(found.cloud.points)))


def above_soil(points: FloatArray) -> FloatArray:
    return points[points[:, 2] > 0.02]


def same(found: FloatArray, wanted: FloatArray) -> bool:
    a, b = above_soil(found), above_soil(wanted)
    return len(a) == len(b) and bool(np.abs(a - b).max() < MM)


def test_a_clouds_plants_ground_and_volume(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", plot_cloud())
    found = opened(tmp_path / "a.ply", "metres")
    assert found.origin is None
    assert abs(found.ground.offset_m) < MM
    assert same(found.cloud.points, plot_cloud().points)
    assert len(found.cloud) < 1600  # hardly any soil
    assert found.volume.contains(found.cloud.points).all()
    (finding,) = found.findings
    assert finding.code == "reference-from-cloud"
    assert "on the ground that was found in it and left out" in finding.message


def test_a_cloud_whose_frame_nobody_knows_is_refused(tmp_path: Path) -> None:
    for name in ("a.ply", "a.las"):
        write_cloud(tmp_path / name, plot_cloud())
        with pytest.raises(CloudError, match="does not say in which frame") as raised:
            open_reference(tmp_path / name)
        assert "--reference-frame" in raised.value.remedy


def test_the_ground_is_not_looked_for_among_leaves(tmp_path: Path) -> None:
    """A rosette cut out of its pot: flat, and all green."""
    rng = np.random.default_rng(0)
    flat = Cloud(
        np.column_stack([rng.uniform(-0.1, 0.1, (1500, 2)), 0.001 * rng.normal(size=1500)]),
        np.tile(np.uint8([60, 150, 50]), (1500, 1)),
    )
    write_cloud(tmp_path / "a.ply", flat)
    assert opened(tmp_path / "a.ply", "metres").ground is None


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_our_own_georeferenced_cloud_comes_back_to_its_place(tmp_path: Path, suffix: str) -> None:
    motion = Similarity(1.0, np.eye(3), np.array([2.0, -3.0, 0.4]))  # into a plot frame
    frame = MetricFrame("geo.txt", motion, ORIGIN, None, None, None)
    plant = replace(plot_cloud(), normals=None)
    assert write_georeferenced(tmp_path / f"a.{suffix}", plant.transformed(motion), frame, Silent())
    found = opened(tmp_path / f"a.{suffix}")
    assert same(about_origin(found), plant.points)
    assert found.origin.datum == "unknown"  # UTM's code says nothing of heights


def geo_keys(keys: tuple[tuple[int, int], ...]) -> GeoKeyDirectoryVlr:
    record = GeoKeyDirectoryVlr()
    record.geo_keys = [GeoKeyEntryStruct(key, 0, 1, value) for key, value in keys]
    record.geo_keys_header.number_of_keys = len(keys)
    return record


def write_las_in(
    path: Path,
    epsg: int | None,
    code: str,
    height_unit_m: float = 1.0,
    place: LocalFrame = ORIGIN,
    keys: tuple[tuple[int, int], ...] = (),
    step_m: float = 1e-5,
) -> None:
    """The plot in the coordinates of a system, heights in its unit; ``epsg`` is what the file says of it."""
    import laspy
    from pyproj import CRS, Transformer

    latitude, longitude, height = place.to_geodetic(plot_cloud().points)
    x, y = Transformer.from_crs(4326, CRS(code), always_xy=True).transform(longitude, latitude)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.offsets, header.scales = np.floor([x[0], y[0], 0.0]), np.full(3, step_m)
    if epsg is not None:
        header.add_crs(CRS(epsg))
    if keys:
        header.vlrs.append(geo_keys(keys))
    las = laspy.LasData(header)
    las.x, las.y, las.z = x, y, height / height_unit_m
    las.write(path)


@pytest.mark.parametrize("says", [True, False])
def test_clouds_in_feet(tmp_path: Path, says: bool) -> None:
    place = LocalFrame(38.5, -121.7, 20.0)
    write_las_in(tmp_path / "a.las", 2226 if says else None, "EPSG:2226", 1200.0 / 3937.0, place)
    found = opened(tmp_path / "a.las", "" if says else "EPSG:2226")
    assert same(about_origin(found, place), plot_cloud().points)


def test_heights_in_metres_beside_feet(tmp_path: Path) -> None:
    place = LocalFrame(38.5, -121.7, 20.0)
    write_las_in(tmp_path / "a.las", None, "EPSG:2226", 1.0, place, keys=((1024, 1), (3072, 2226), (4099, 9001)))
    assert same(about_origin(opened(tmp_path / "a.las"), place), plot_cloud().points)


def test_heights_above_sea_level_and_above_the_ellipsoid_are_told(tmp_path: Path) -> None:
    for code, datum in (("EPSG:25832+7837", "sea level"), ("EPSG:32632", "unknown")):
        write_las_in(tmp_path / "a.las", None, "EPSG:32632")
        found = opened(tmp_path / "a.las", code)
        assert found.origin.datum == datum
        assert [f.code for f in found.findings[1:]] == (["gps-datum"] if "25832" in code else [])


def test_a_frame_that_contradicts_the_file(tmp_path: Path) -> None:
    write_las_in(tmp_path / "a.las", 32632, "EPSG:32632")
    assert same(about_origin(opened(tmp_path / "a.las", "EPSG:32632")), plot_cloud().points)
    with pytest.raises(UsageError, match="zone 33N"):
        open_reference(tmp_path / "a.las", "EPSG:32633")


def test_coordinates_that_32_bits_have_rounded_are_refused(tmp_path: Path) -> None:
    far = Cloud((plot_cloud().points + np.array([364_000.0, 5_609_000.0, 150.0])).astype(np.float32).astype(np.float64))
    write_cloud(tmp_path / "a.ply", far)
    for frame in ("EPSG:32632", "metres"):
        with pytest.raises(CloudError, match="32-bit numbers") as raised:
            open_reference(tmp_path / "a.ply", frame)
        assert "double precision" in raised.value.remedy


def test_bounds_cut_the_cloud(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", plot_cloud())
    box = Volume((-0.1, -0.1, -0.1), (0.1, 0.1, 1.0))
    found = opened(tmp_path / "a.ply", "metres", box)
    assert found.volume == box
    assert box.contains(found.cloud.points).all()
    with pytest.raises(EmptyCloudError):
        open_reference(tmp_path / "a.ply", "metres", Volume((5.0, 5.0, 5.0), (6.0, 6.0, 6.0)))


def capture(origin: LocalFrame | None, source: str) -> Capture:
    read = read_capture(PHOTOGRAPHS)
    return replace(read, origin=origin, metric_source=source)


def test_photographs_and_cloud_in_unrelated_frames(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.ply", plot_cloud())
    local = opened(tmp_path / "a.ply", "metres")
    write_las_in(tmp_path / "a.las", 32632, "EPSG:32632")
    placed = opened(tmp_path / "a.las")
    assert local.known_plot(capture(None, "poses.csv")).source.source == "poses.csv"
    assert placed.known_plot(capture(ORIGIN, "EXIF GPS")).source.origin == placed.origin
    for reference, origin in ((local, ORIGIN), (placed, None)):
        with pytest.raises(MetadataError, match="photographs' positions") as raised:
            reference.known_plot(capture(origin, "poses.csv"))
        assert "--reference-frame" in raised.value.remedy


@pytest.mark.slow
def test_an_evaluation_against_a_bare_cloud_is_that_against_its_reference(tmp_path: Path) -> None:
    draft, cache = EvaluationSettings(fidelity="draft"), StageCache(tmp_path / "cache")
    folder = tmp_path / "reference"
    report = build_reference(PHOTOGRAPHS, folder, draft, context=Context(cache), scene=False)
    assert isinstance(open_reference(folder / "cloud.ply"), Reference)
    with pytest.raises(UsageError, match="bare cloud"):
        open_reference(folder, "metres")
    # In the frame of poses.csv, as another program would have it.
    to_source = Similarity.from_matrix(np.array(report.frame.plot_from_source)).inverse()
    write_cloud(tmp_path / "scan.ply", read_cloud(folder / "cloud.ply").transformed(to_source))
    for name, reference, frame in (("whole", folder, ""), ("bare", tmp_path / "scan.ply", "metres")):
        evaluate(
            PHOTOGRAPHS,
            tmp_path / name,
            draft,
            reference=reference,
            reference_frame=frame,
            context=Context(cache),
        )
    whole, bare = (load_evaluation_report(tmp_path / name) for name in ("whole", "bare"))
    assert whole.plots[0].chamfer_m == pytest.approx(0.0, abs=1e-5)  # the same photographs, the same volume
    assert bare.plots[0].chamfer_m < 0.008  # another volume, and with it other depths, at 3 mm per pixel
    assert bare.settings["reference_frame"] == "metres"
    assert "reference_frame" not in whole.settings
    assert "reference-from-cloud" in [finding.code for finding in bare.plots[0].findings]
