"""What a site and the plants of a plan take from a flight, in the site's local frame."""

from __future__ import annotations

import numpy as np

from fieldkit.missions.obstacles import Obstacles, Volume
from fieldkit.missions.placement import PlotFrame, SiteFrame
from fieldkit.missions.plan import Plan
from fieldkit.missions.plants import no_fly_bands
from fieldkit.missions.site import Site


def site_obstacles(site: Site, clearance_m: float, plan: Plan | None = None) -> Obstacles:
    """Obstacles, no-fly zones, fence and ceiling of a site, and the plants of a plan on every plot.

    Args:
        site: the fence and the zones are kept to their edges.
        clearance_m: kept to obstacles and plants.
        plan: whose plants stand on every plot; none where it does not say where they are.

    Raises:
        MetadataError: a plot's height cannot be connected with home's.
        MissionError: a polygon is of no use.
    """
    frame = SiteFrame(site.home)
    volumes = [
        Volume.cylinder(o.name, _place(frame, o.latitude_deg, o.longitude_deg), o.radius_m, o.top_m, clearance_m)
        for o in site.obstacles
    ]
    volumes += [Volume.no_fly(zone.name, frame.outline(zone.corners)) for zone in site.no_fly]
    bands = () if plan is None or plan.plants is None else no_fly_bands(plan.plants, clearance_m)
    outlines = np.array([(x, y, 0.0) for band in bands for x, y in band.corners]).reshape(-1, 3)
    ends = np.cumsum([len(band.corners) for band in bands])
    for plot in site.plots if bands else ():
        to_plot = PlotFrame.of(site, plot)
        local = frame.to_local(*to_plot.to_geodetic(outlines))[:, :2].tolist()
        for band, end in zip(bands, ends.tolist(), strict=True):
            corners = tuple((x, y) for x, y in local[end - len(band.corners) : end])
            volumes.append(Volume(plot.name, corners, to_plot.ground_m + band.top_m, kind="plants"))
    fence = tuple(frame.outline(corners) for corners in site.fence)
    return Obstacles(tuple(volumes), fence, ceiling_m=site.ceiling_m)


def _place(frame: SiteFrame, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    east, north, _ = frame.to_local(latitude_deg, longitude_deg, 0.0)[0]
    return float(east), float(north)
