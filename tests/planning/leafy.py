"""Small plots for planners: bent leaves as points with normals, and a dense recorded set about them."""

from dataclasses import replace

import numpy as np

from fieldkit.clouds import Cloud, Volume
from fieldkit.geometry import Intrinsics
from fieldkit.planning.problem import PlanningProblem
from fieldkit.planning.score.geometric import expected_matches
from fieldkit.planning.space.cameras import Cameras
from fieldkit.planning.space.envelope import Envelope
from fieldkit.planning.space.plots import Plot

CAMERA = Intrinsics.pinhole(1000, 750, 850.0)


def leaves(count: int = 8, seed: int = 0) -> Cloud:
    """Strips of 0.4 × 0.05 m that rise and bend over, spread about two stems 0.4 m apart."""
    rng = np.random.default_rng(seed)
    along, across = (a.reshape(-1) for a in np.meshgrid(np.linspace(0, 1, 60), np.linspace(-1, 1, 9), indexing="ij"))
    points, normals = [], []
    for k in range(count):
        turn, base = rng.uniform(0, 2 * np.pi), np.array([0.4 * (k % 2) - 0.2, 0.0, rng.uniform(0.1, 0.4)])
        out, side = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])
        points.append(
            base
            + 0.35 * along[:, None] * out
            + 0.025 * across[:, None] * side
            + (0.5 * along - 0.45 * along**2)[:, None] * np.array([0.0, 0.0, 1.0])
        )
        slope = 0.35 * out + (0.5 - 0.9 * along)[:, None] * np.array([0.0, 0.0, 1.0])
        normal = np.cross(slope, side)
        normals.append(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    return Cloud(np.vstack(points), None, np.vstack(normals).astype(np.float32))


def problem(count: int = 6, *, normals: bool = True) -> PlanningProblem:
    """N cameras about `leaves`, in the default envelope."""
    plants = leaves()
    target = Volume.around(plants.points, margin_m=0.03)
    reference = plants if normals else Cloud(plants.points)
    return PlanningProblem(count, Envelope.around(plants, target), CAMERA, (Plot(reference, plants.points),))


def recorded(count: int = 6, views: int = 40) -> PlanningProblem:
    """The same plot with views on a ring at 1.5 m, all the way round."""
    plot, ring = problem(count), around(360.0 * np.arange(views) / views)
    matches = expected_matches(ring.positions, plot.center, np.ones((views, views)))
    return PlanningProblem(count, plot.envelope, CAMERA, (replace(plot.plots[0], matches=matches),), ring)


def around(azimuth_deg: np.ndarray, radius_m: float = 1.5, height_m: float = 1.2) -> Cameras:
    """Cameras at these azimuths that look at the plot's middle."""
    turn = np.radians(azimuth_deg)
    positions = np.column_stack([radius_m * np.sin(turn), radius_m * np.cos(turn), np.full(len(turn), height_m)])
    return Cameras.aimed(positions, (0.0, 0.0, 0.3))
