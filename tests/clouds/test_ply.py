import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fieldkit.clouds import Cloud, read_ply, write_ply
from fieldkit.errors import CloudError
from tests.clouds.examples import clouds

in_one_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def ply(tmp_path: Path, header: str, body: bytes = b"", *, newline: str = "\n") -> Path:
    path = tmp_path / "cloud.ply"
    lines = ["ply", *[line.strip() for line in header.strip().splitlines()], "end_header", ""]
    path.write_bytes(newline.join(lines).encode("latin-1") + body)
    return path


@given(clouds())
@in_one_folder
def test_what_is_written_is_read_again(tmp_path: Path, cloud: Cloud) -> None:
    path = tmp_path / "cloud.ply"
    write_ply(path, cloud)
    again = read_ply(path)
    if len(cloud) and np.abs(cloud.points).max() < 16:
        np.testing.assert_allclose(again.points, cloud.points, rtol=0, atol=0.5e-6)
    else:
        np.testing.assert_array_equal(again.points, cloud.points)
    for name in ("colors", "normals"):
        written, read = getattr(cloud, name), getattr(again, name)
        assert (written is None) == (read is None)
        if written is not None:
            np.testing.assert_array_equal(read, written)
    first = path.read_bytes()
    write_ply(path, cloud)
    assert path.read_bytes() == first


def test_points_that_fill_holes_are_marked(tmp_path: Path) -> None:
    path = tmp_path / "cloud.ply"
    write_ply(path, Cloud(np.ones((2, 3)), filled=np.array([True, False])))
    header, body = path.read_bytes().split(b"end_header\n")
    assert b"property float z\nproperty uchar filled\n" in header
    assert (len(body), body[12], body[25]) == (26, 1, 0)
    np.testing.assert_array_equal(read_ply(path).points, 1.0)


def test_ascii_with_faces_lists_comments_and_unknown_properties(tmp_path: Path) -> None:
    header = """
        comment made by hand
        format ascii 1.0
        obj_info anything at all
        element camera 1
        property float focal
        element vertex 2
        property double z
        property uchar red
        property uchar green
        property uchar blue
        property float confidence
        property float x
        property float y
        element face 1
        property list uchar int vertex_indices
    """
    path = ply(tmp_path, header, b"1200\n3 1 2 3 0.5 1 2\n\n6 4 5 6 0.25 4 5\n3 0 1 0\n")
    cloud = read_ply(path)
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(cloud.colors, [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_ascii_line_endings(tmp_path: Path, newline: str) -> None:
    header = "format ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z"
    path = ply(tmp_path, header, newline.join(["1 2 3", "4 5 6"]).encode(), newline=newline)
    np.testing.assert_array_equal(read_ply(path).points, [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize(("name", "order"), [("little", "<"), ("big", ">")])
def test_binary_of_both_byte_orders_with_other_elements(tmp_path: Path, name: str, order: str) -> None:
    header = f"""
        format binary_{name}_endian 1.0
        element camera 2
        property short k
        element vertex 2
        property int16 x
        property float64 y
        property float32 z
        property uint8 red
        property uint8 green
        property uint8 blue
        element face 1
        property list uchar int vertex_indices
    """
    body = struct.pack(order + "hh", 2, 5)
    body += struct.pack(order + "hdfBBB", -7, 1.25, 2.5, 1, 2, 3) + struct.pack(
        order + "hdfBBB", 8, -1.25, 3.5, 4, 5, 6
    )
    cloud = read_ply(ply(tmp_path, header, body))
    np.testing.assert_array_equal(cloud.points, [[-7, 1.25, 2.5], [8, -1.25, 3.5]])
    np.testing.assert_array_equal(cloud.colors, [[1, 2, 3], [4, 5, 6]])
    with pytest.raises(CloudError, match="ends before its 2 rows"):
        read_ply(ply(tmp_path, header, body[:-12]))


def test_rows_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    header = "format ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z"
    np.testing.assert_array_equal(read_ply(ply(tmp_path, header, b"1 2 3\nnan 0 0\n0 inf 0\n")).points, [[1, 2, 3]])


XYZ = "property float x\nproperty float y\nproperty float z"


@pytest.mark.parametrize(
    ("header", "body", "message"),
    [
        (f"format ascii 1.0\nelement vertex 3\n{XYZ}", b"1 2 3\n4 5 6\n", "ends before its 3 rows"),
        (f"format ascii 1.0\nelement vertex 2\n{XYZ}", b"1 2 3\n4 five 6\n", "row that cannot be read"),
        (f"format ascii 1.0\nelement vertex 2\n{XYZ}", b"1 2 3\n4   5\n", "row that cannot be read"),
        (f"format ascii 1.0\nelement vertex 999999999999999999\n{XYZ}", b"1 2 3\n", "ends before"),
        (f"format binary_little_endian 1.0\nelement vertex 999999999999999999\n{XYZ}", b"12345", "ends before"),
        (f"format binary_little_endian 1.0\nelement vertex -1\n{XYZ}", b"", "not a number of rows"),
        (f"format binary_little_endian 1.0\nelement vertex 1e3\n{XYZ}", b"", "not a number of rows"),
        (f"format morse 1.0\nelement vertex 1\n{XYZ}", b"", "unknown format"),
        (f"element vertex 0\n{XYZ}", b"", "no format"),
        ("format ascii 1.0\nelement vertex 1\nproperty float x", b"1\n", "no x, y and z"),
        ("format ascii 1.0\nelement face 0\nproperty float x", b"", "has no vertices"),
        (f"format ascii 1.0\nelement vertex 0\n{XYZ}\nproperty quaternion q", b"", "unknown property"),
        (f"format ascii 1.0\nelement vertex 0\n{XYZ}\nproperty float x", b"", "'x' is there twice"),
        (f"format ascii 1.0\nelement vertex 0\n{XYZ}\nelement vertex 0", b"", "there twice"),
        (f"format ascii 1.0\nelement vertex 0\n{XYZ}\nproperty list int int l", b"", "lists in or before its vertices"),
        ("format ascii 1.0\nproperty float x", b"", "unexpected line"),
        (
            "format binary_big_endian 1.0\nelement vertex 1\n" + XYZ.replace("float", "double"),
            struct.pack(">ddd", 1e300, 0, 0),
            "no place on Earth",
        ),
        (
            f"format binary_little_endian 1.0\nelement f 1\nproperty list char int l\nelement vertex 0\n{XYZ}",
            b"\xff" * 9,
            "lists in or before its vertices",
        ),
    ],
)
def test_damage_is_named_with_its_remedy(tmp_path: Path, header: str, body: bytes, message: str) -> None:
    path = ply(tmp_path, header, body)
    with pytest.raises(CloudError, match=message) as caught:
        read_ply(path)
    assert caught.value.path == path
    assert caught.value.remedy


ASCII_EXAMPLE = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    b"property uchar red\nproperty uchar green\nproperty uchar blue\n"
    b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    b"1 2 3 9 9 9\n4 5 6 8 8 8\n7 8 9 7 7 7\n3 0 1 2\n"
)
BINARY_EXAMPLE = (
    b"ply\nformat binary_big_endian 1.0\nelement camera 2\nproperty short k\n"
    b"element vertex 2\nproperty double x\nproperty double y\nproperty double z\n"
    b"property float nx\nproperty float ny\nproperty float nz\nend_header\n"
    + struct.pack(">hh", 0, 1)
    + 2 * struct.pack(">dddfff", 1, 2, 3, 0, 0, 1)
)
FRAGMENTS = [b"", b"0", b"-1", b"99999999999", b"\n", b"\r", b"vertex", b"list", b"ascii", b"\xff" * 8, b"nan", b"\x00"]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from([ASCII_EXAMPLE, BINARY_EXAMPLE]),
    st.lists(st.tuples(st.integers(0, 500), st.integers(0, 12), st.sampled_from(FRAGMENTS) | st.binary(max_size=4))),
    st.none() | st.integers(0, 500),
)
def test_damaged_files_give_a_cloud_or_a_cloud_error(tmp_path: Path, content: bytes, edits, length) -> None:
    for position, removed, inserted in edits:
        content = content[:position] + inserted + content[position + removed :]
    path = tmp_path / "fuzzed.ply"
    path.write_bytes(content[:length])
    try:
        cloud = read_ply(path)
    except CloudError as raised:
        error = raised
    else:
        error = None
        assert np.isfinite(cloud.points).all()
    assert error is None or (error.path == path and error.remedy)


@pytest.mark.parametrize(
    ("name", "count", "colored", "oriented"),
    [
        ("basil_rig/reference_cloud.ply", 31_189, False, True),
        ("meshes/maize_bonn_0313_cloud.ply", 338_874, False, False),
        ("meshes/sorghum_mccormick2_mesh.ply", 31_873, True, False),
    ],
)
def test_files_of_other_programs(data_folder: Path, name: str, count: int, colored: bool, oriented: bool) -> None:
    cloud = read_ply(data_folder / name)
    assert len(cloud) == count
    assert (cloud.colors is not None) == colored
    assert (cloud.normals is not None) == oriented
