"""Coordinate systems: what their way to WGS 84 is good to without grids, which pyproj's wheels do not have."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fieldkit.captures.crs import parse_crs, to_wgs84
from fieldkit.captures.geo_txt import parse_geo_txt
from fieldkit.errors import MetadataError


@pytest.mark.parametrize(
    ("code", "x", "y", "message", "remedy"),
    [
        # OSGeo/PROJ#3079: 3.2 m beside its place by OSTN15.
        ("EPSG:27700", 624161.0, 308459.6, "without the grid uk_os_OSTN15", "pyproj sync --file uk_os_OSTN15"),
        ("EPSG:4267", -106.720118, 41.087658, "only to 7 m", "PROJ_NETWORK=ON"),  # 3.9 m beside, by NGS NCAT
        ("+proj=tmerc +lon_0=9 +x_0=500000 +ellps=bessel", 5e5, 5.5e6, "whose datum PROJ cannot take", "EPSG code"),
        ("EPSG:32632", 1e9, 5e6, "do not lie in WGS 84 / UTM zone 32N", "x is east"),
    ],
)
def test_what_lies_metres_off_is_refused(code: str, x: float, y: float, message: str, remedy: str) -> None:
    with pytest.raises(MetadataError, match=re.escape(message)) as caught:
        to_wgs84(np.array([[x, y, 0.0]]), parse_crs(code))
    assert remedy in caught.value.remedy


@pytest.mark.parametrize(
    ("code", "x", "y", "said"),
    [
        ("EPSG:32632", 5e5, 5.5e6, None),
        ("EPSG:4978", 4e6, 6e5, None),
        ("EPSG:28354", 5e5, 6.2e6, "GDA94 / MGA zone 54 to WGS 84 to 3 m"),
        ("EPSG:26915", 5e5, 5e6, "NAD83 / UTM zone 15N to WGS 84 to 4 m"),
        ("EPSG:4490", 116.0, 40.0, "an accuracy that it does not know"),
    ],
)
def test_other_datums_are_told_with_their_metres(code: str, x: float, y: float, said: str | None) -> None:
    text = to_wgs84(np.array([[x, y, 4.9e6]]), parse_crs(code))[1]
    findings = parse_geo_txt(f"{code}\na.jpg {x} {y} 4.9e6\n")[1]
    assert (said or "") in text
    assert [(f.code, f.message) for f in findings] == ([("gps-datum", text)] if said else [])
