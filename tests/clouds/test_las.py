import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.clouds import Cloud, read_cloud, read_las, write_cloud, write_las
from fieldkit.errors import CloudError
from tests.clouds.examples import clouds, leaves

laspy = pytest.importorskip("laspy", reason="LAS needs the extra geo")
one_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@given(clouds(), st.sampled_from(["cloud.las", "cloud.laz"]))
@settings(one_folder)
def test_what_is_written_is_read_again(tmp_path: Path, cloud: Cloud, name: str) -> None:
    path = tmp_path / name
    write_las(path, cloud)
    first = path.read_bytes()
    again = read_las(path).cloud
    np.testing.assert_allclose(again.points, cloud.points, rtol=0, atol=0.51e-4)
    if len(cloud) and cloud.colors is not None and cloud.colors.any():
        np.testing.assert_array_equal(again.colors, cloud.colors)
    if len(cloud) and cloud.normals is not None:
        np.testing.assert_array_equal(again.normals, cloud.normals)
    write_las(path, cloud)
    assert path.read_bytes() == first


def test_utm_coordinates_keep_their_tenths_of_a_millimetre_and_their_crs(tmp_path: Path) -> None:
    points = leaves(1000) + np.array([448_262.1234, 5_411_932.6543, 118.0])
    write_las(tmp_path / "cloud.laz", Cloud(points), crs_epsg=32632)
    las = read_las(tmp_path / "cloud.laz")
    np.testing.assert_allclose(las.cloud.points, points, rtol=0, atol=0.51e-4)
    assert las.crs.to_epsg() == 32632
    np.testing.assert_array_equal(read_cloud(tmp_path / "cloud.laz").points, las.cloud.points)


@pytest.mark.parametrize("epsg", [4326, 2263, 999_999])
def test_systems_that_are_not_metric_are_refused(tmp_path: Path, epsg: int) -> None:
    with pytest.raises(CloudError, match=f"EPSG:{epsg}"):
        write_las(tmp_path / "cloud.las", Cloud(np.zeros((1, 3))), crs_epsg=epsg)


@pytest.mark.parametrize("name", ["cloud.las", "cloud.laz"])
def test_truncated_files_and_lying_headers(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    write_las(path, Cloud(leaves(2000)))
    whole = path.read_bytes()
    for length in (5, 100, 300, 400, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(CloudError) as caught:
            read_las(path)
        assert caught.value.path == path
        assert caught.value.remedy
    lying = bytearray(whole)
    lying[247:255] = (10**15).to_bytes(8, "little")
    path.write_bytes(lying)
    with pytest.raises(CloudError):
        read_las(path)


def test_a_damaged_chunk_table_does_not_take_the_process_with_it(tmp_path: Path) -> None:
    path = tmp_path / "cloud.laz"
    write_las(path, Cloud(leaves(2000)))
    content = bytearray(path.read_bytes())
    points = int.from_bytes(content[96:100], "little")
    table = int.from_bytes(content[points : points + 8], "little")
    content[table + 4 : table + 8] = b"\xff\xff\xff\xff"
    path.write_bytes(content)
    with pytest.raises(CloudError, match="more than it can hold"):
        read_las(path)
    content[table + 4 : table + 8] = b"\1\0\0\0"
    content[103] = 200  # the number of records, which laspy would go on to read past the end
    path.write_bytes(content)
    with pytest.raises(CloudError, match="records, more than it can hold"):
        read_las(path)
    content[103] = 0
    content[points : points + 8] = (10**12).to_bytes(8, "little")
    path.write_bytes(content)
    with pytest.raises(CloudError, match="no table"):
        read_las(path)


@given(st.lists(st.tuples(st.integers(0, 700), st.integers(0, 255)), min_size=1, max_size=4))
@settings(one_folder)
def test_damaged_las_gives_a_cloud_or_a_cloud_error(tmp_path: Path, edits) -> None:
    path = tmp_path / "cloud.las"
    if not (tmp_path / "whole").exists():
        write_las(path, Cloud(leaves(20), np.full((20, 3), 9, np.uint8)), crs_epsg=32632)
        (tmp_path / "whole").write_bytes(path.read_bytes())
    content = bytearray((tmp_path / "whole").read_bytes())
    for position, value in edits:
        content[position] = value
    path.write_bytes(content)
    try:
        cloud = read_las(path).cloud
    except CloudError as raised:
        error = raised
    else:
        error = None
        assert np.isfinite(cloud.points).all()
    assert error is None or error.remedy


@pytest.mark.parametrize("name", ["a.ply", "a.las", "a.LAZ"])
def test_written_by_ending_and_read_by_content(tmp_path: Path, name: str) -> None:
    write_cloud(tmp_path / name, Cloud(leaves(10)))
    (tmp_path / name).rename(tmp_path / "renamed.bin")
    assert len(read_cloud(tmp_path / "renamed.bin")) == 10


FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937


def las_in(path: Path, points: np.ndarray, *, crs: str | None = None, keys: tuple[tuple[int, int], ...] = ()) -> Path:
    """A LAS 1.2 file of points in the units of a reference system, or with GeoTIFF keys."""
    import laspy
    import pyproj
    from laspy.vlrs.known import GeoKeyDirectoryVlr, GeoKeyEntryStruct

    header = laspy.LasHeader(version="1.4" if crs else "1.2", point_format=6 if crs else 0)
    header.offsets, header.scales = np.floor(points.min(axis=0)), np.full(3, 1e-4)
    if crs:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    if keys:
        record = GeoKeyDirectoryVlr()
        record.geo_keys = [GeoKeyEntryStruct(key, 0, 1, value) for key, value in keys]
        record.geo_keys_header.number_of_keys = len(keys)
        header.vlrs.append(record)
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.write(path)
    return path


@pytest.mark.parametrize(
    ("stated", "plane", "up"),
    [
        ({"crs": "EPSG:2263"}, SURVEY_FOOT, SURVEY_FOOT),
        ({"crs": "EPSG:2222"}, FOOT, FOOT),
        ({"crs": "EPSG:26849+6360"}, SURVEY_FOOT, SURVEY_FOOT),
        ({"crs": "EPSG:26849+5703"}, SURVEY_FOOT, 1.0),
        ({"crs": "EPSG:32615"}, 1.0, 1.0),
        ({"keys": ((1024, 1), (3072, 32767), (3076, 9003))}, SURVEY_FOOT, SURVEY_FOOT),
        ({"keys": ((1024, 1), (3072, 32767), (3076, 9002), (4099, 9001))}, FOOT, 1.0),
        ({"keys": ((1024, 1), (3072, 2263), (3076, 9003), (4099, 9001))}, SURVEY_FOOT, 1.0),
        ({"keys": ((1024, 1), (3072, 32615), (4099, 9003))}, 1.0, SURVEY_FOOT),
        ({}, 1.0, 1.0),
    ],
)
def test_feet_become_metres(tmp_path: Path, stated: dict, plane: float, up: float) -> None:
    points = leaves(50) * 10 + np.array([900_000.0, 200_000.0, 650.0])
    las = read_las(las_in(tmp_path / "cloud.las", points, **stated))
    np.testing.assert_allclose(las.cloud.points, points * [plane, plane, up], rtol=0, atol=1e-4)


def test_points_in_degrees_are_refused(tmp_path: Path) -> None:
    path = las_in(tmp_path / "cloud.las", np.array([[-92.0, 46.8, 198.0], [-91.9, 46.9, 199.0]]), crs="EPSG:4326")
    with pytest.raises(CloudError, match="degrees") as caught:
        read_cloud(path)
    assert "Reproject" in caught.value.remedy


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
def test_more_points_than_a_file_can_hold_are_refused_before_they_are_read(tmp_path: Path, name: str) -> None:
    write_las(tmp_path / name, Cloud(np.zeros((1000, 3))))
    data = bytearray((tmp_path / name).read_bytes())
    struct.pack_into("<Q", data, 247, 50_000_000)
    (tmp_path / name).write_bytes(data)
    with pytest.raises(CloudError, match="promises 50,000,000 points"):
        read_cloud(tmp_path / name)


@pytest.mark.parametrize("name", ["a.las", "a.laz"])
@pytest.mark.parametrize("point_format", [3, 7])
def test_noise_and_withheld_points_are_left_out(tmp_path: Path, name: str, point_format: int) -> None:
    header = laspy.LasHeader(version="1.4", point_format=point_format)
    header.scales = [0.001] * 3
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.arange(8.0), np.zeros(8), np.array([0.0, 0, 15, 0, -8, 0, 0, 0])
    las.red = las.green = las.blue = (np.arange(8) * 257).astype(np.uint16)
    las.classification = np.array([1, 2, 7, 5, 18, 1, 1, 9], np.uint8)
    las.withheld = np.array([0, 0, 0, 0, 0, 0, 1, 0], np.uint8)
    las.write(tmp_path / name)
    read = read_las(tmp_path / name)
    assert read.cloud.points[:, 0].tolist() == [0.0, 1.0, 3.0, 5.0, 7.0]
    assert read.cloud.colors is not None
    assert read.cloud.colors[:, 0].tolist() == [0, 1, 3, 5, 7]
    assert read.left_out == 3
