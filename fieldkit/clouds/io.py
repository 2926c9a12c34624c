"""Reading a point cloud of any supported format, told apart by content."""

from __future__ import annotations

from pathlib import Path

from fieldkit.clouds.cloud import Cloud
from fieldkit.clouds.las import read_las, write_las
from fieldkit.clouds.ply import read_ply, write_ply
from fieldkit.errors import CloudError, UsageError
from fieldkit.regular_files import open_regular


def read_cloud(path: Path | str) -> Cloud:
    """Read a PLY, LAS or LAZ file, whatever its name ends in."""
    path = Path(path)
    try:
        with open_regular(path) as file:
            start = file.read(4)
    except OSError as error:
        reason = error.strerror or str(error)
        raise CloudError(f"cannot be read: {reason}", path=path, remedy="Check the path and permissions.") from error
    if start == b"LASF":
        return read_las(path).cloud
    if start.startswith(b"ply"):
        return read_ply(path)
    raise CloudError(
        "is empty" if not start else "is neither PLY, LAS nor LAZ",
        path=path,
        remedy="Give a point cloud as PLY, LAS or LAZ.",
    )


def write_cloud(path: Path, cloud: Cloud, *, crs_epsg: int | None = None) -> None:
    """Write a cloud in the format that the name's ending asks for: .ply, .las or .laz."""
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in (".las", ".laz"):
        write_las(path, cloud, crs_epsg=crs_epsg)
    elif suffix == ".ply":
        write_ply(path, cloud)
    else:
        raise UsageError("point clouds are written as .ply, .las or .laz", path=path, remedy="Choose one of them.")
