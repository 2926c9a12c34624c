"""Architecture of a maize plant by growth stage: how many leaves, how long, where, at which angle.

Published:

- stages by visible leaf collars, 1 to 18, then VT (tassel) and R1 (silks); the growing point rises above the ground at
  about V6 (Abendroth, Elmore, Boyer and Marlay 2011, *Corn growth and development*, Iowa State University, PMR 1009);
- areas of the leaves along the stem are a bell, A = A0 exp(b (n - n0)² + c (n - n0)³) (Dwyer and Stewart 1986, Agronomy
  Journal 78); the largest leaf stands at about two thirds of their number (Birch, Hammer and Rickert 1998, Field Crops
  Research 55);
- a blade's area is 0.75 of its length times its width (Montgomery 1911);
- internodes elongate one after the other from the bottom, a few of them at a time, a leaf's internode as its collar
  appears (Fournier and Andrieu 2000, Annals of Botany 86);
- the midrib's inclination falls along the blade (Prévot, Aries and Monestiez 1991, Agronomie 11), and plants are put
  together phytomer by phytomer (Fournier and Andrieu 1999, ADEL-maize, Agronomie 19); leaves stand in two ranks.

By eye, for the usual field hybrid: all absolute sizes and angles, their spread, the bell's breadth, how far tips are
ahead of collars and how long lower leaves last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fieldkit.arrays import FloatArray
from fieldkit.vocabulary import Stage
from fieldkit_sim.maize.organs import Leaf

_LARGEST_M2 = 0.0600  # area of the largest leaf
_BREADTH = -10.2  # of the bell, per squared share of the leaf number


@dataclass(frozen=True, eq=False)
class Architecture:
    """A plant before scaling, standing at the origin, its leaves in the x-z plane; metres."""

    line: FloatArray
    """(n, 3) centre line of the stem."""
    radii: FloatArray
    """(n,) of the stem with its sheaths."""
    nodes: FloatArray
    """(k,) heights of the nodes above the ground."""
    leaves: tuple[Leaf, ...]
    """Lowest first."""
    tassel_m: float
    """Length of the tassel, 0 without one."""
    ear: bool
    """Whether an ear with silks stands at the middle of the stem."""

    def at(self, height: float) -> FloatArray:
        """(3,) point of the centre line at a height."""
        return np.array([np.interp(height, self.line[:, 2], self.line[:, axis]) for axis in range(3)])


def leaf_number(stage: Stage, final: int) -> tuple[int, int]:
    """Leaves with a collar, and leaves whose tip is out of the whorl, of ``final`` in all."""
    if stage in ("VT", "R1"):
        return final, final
    collars = min(int(stage[1:]), final)
    return collars, min(final, collars + 2 + collars // 5)


def leaf_size(rank: int, final: int) -> tuple[float, float]:
    """Length and width in metres of the full-grown blade number ``rank`` (1 the lowest) of ``final``."""
    area = _LARGEST_M2 * np.exp(_BREADTH * ((rank - 2 / 3 * final) / final) ** 2)
    slender = np.interp(rank / final, [0.05, 0.2, 0.4, 1.0], [5.0, 8.0, 9.2, 7.5])
    length = float(np.sqrt(area * slender / 0.75))
    return length, float(area / 0.75 / length)


def internode_length(rank: int, final: int) -> float:
    """Metres of the full-grown internode below leaf ``rank``: nearly none below ground, then longer to the ear."""
    return float(np.interp(rank / final, [0.0, 0.26, 0.32, 0.52, 0.65, 1.0], [0.004, 0.012, 0.05, 0.155, 0.17, 0.16]))


def grow(stage: Stage, rng: np.random.Generator) -> Architecture:
    """A plant at a stage, individual by ``rng``."""
    final = int(rng.integers(18, 21))
    collars, tips = leaf_number(stage, final)
    vigour = rng.uniform(0.90, 1.10)
    grown = np.array([np.clip((collars - k + 1.5) / 4.0, 0.0, 1.0) for k in range(1, final + 1)])
    mature = stage in ("VT", "R1")
    if mature:
        grown[:] = 1.0
    lengths = vigour * np.array([internode_length(k, final) for k in range(1, final + 1)]) * grown
    nodes = np.cumsum(lengths * rng.uniform(0.93, 1.07, final))
    sheaths = vigour * (0.030 + 0.145 * np.clip((np.arange(final)) / 9.0, 0, 1)) * rng.uniform(0.93, 1.07, final)
    heights = np.maximum.accumulate(nodes + sheaths + 0.004 * np.arange(final))
    top = heights[collars - 1]
    tassel = 0.36 * vigour if mature else 0.0
    end = top + (0.10 if tassel else 0.02 + 0.006 * collars)
    line, radii = _stem(end, heights[:collars], nodes[:collars], vigour, collars, rng)
    first = max(1, round(collars / 3.2) - 1) if collars > 6 else 1  # the lowest leaves are torn off as the stem widens
    if collars >= 12:
        first += 1
    leaves = []
    for k in range(first, tips + 1):
        folded = float(np.clip((k - collars + 1.5) / 3.5, 0.0, 1.0)) if tips > collars else 0.0
        emerged = 1.0 if k <= collars else 1.0 - (k - collars) / (tips - collars + 1.2)
        height = heights[k - 1] if k <= collars else top + 0.012 * (k - collars)
        collar = np.array([np.interp(height, line[:, 2], line[:, i]) for i in range(3)])
        leaves.append(_leaf(k, final, collars, collar, folded, emerged, vigour, rng))
    return Architecture(line, radii, nodes[nodes < end], tuple(leaves), tassel, stage == "R1")


def _stem(
    end: float, collars: FloatArray, nodes: FloatArray, vigour: float, number: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    lean, bow = rng.normal(0, 0.045, 2), rng.normal(0, 0.02, 2)
    z = np.arange(-0.03, end + 0.004, 0.004)
    t = np.clip(z / end, 0.0, 1.0)
    sway = 0.004 * np.sin(z[:, None] * rng.uniform(9, 14, 2) + rng.uniform(0, 6, 2))
    line = np.column_stack([lean * z[:, None] + bow * (t**2)[:, None] * end + sway * t[:, None], z])
    thick = 0.0055 + 0.0090 * np.clip(number / 12.0, 0.3, 1.0)
    radii = vigour * thick * (1.0 - 0.55 * t**1.4)
    for collar in collars:  # a sheath widens to its collar and ends there
        radii += vigour * 0.0018 * np.exp(-((np.maximum(collar - z, 0) / 0.025) ** 2)) * (z <= collar)
        radii += vigour * 0.0006 * np.exp(-((np.maximum(collar - z, 0) / 0.10) ** 2)) * (z <= collar)
    for node in nodes:
        radii += vigour * 0.0013 * np.exp(-(((z - node) / 0.006) ** 2))
    radii *= np.clip((z[-1] - z) / 0.03, 0.12, 1.0)
    return line, radii


def _leaf(
    k: int,
    final: int,
    collars: int,
    collar: FloatArray,
    folded: float,
    emerged: float,
    vigour: float,
    rng: np.random.Generator,
) -> Leaf:
    length, width = leaf_size(k, final)
    upper = k / final
    age = float(np.clip(1.0 - 2.6 * (k - 1) / max(collars, 5) + rng.normal(0, 0.08), 0.0, 1.0))
    # Long blades arch over; short ones, and the stiff ones below the tassel, stand.
    arch = rng.normal(112, 20) * (1 - 0.78 * folded) * np.interp(length, [0.1, 0.45, 0.9], [0.45, 0.9, 1.1])
    return Leaf(
        rank=(k - 1) / (final - 1),
        age=age,
        collar=collar,
        azimuth=np.pi * (k % 2) + rng.normal(0, np.radians(17)),
        length=vigour * length * (0.25 + 0.75 * emerged) * rng.uniform(0.93, 1.07),
        width=vigour * width * (0.35 + 0.65 * emerged) * rng.uniform(0.93, 1.07),
        elevation=np.radians(min(86.0, rng.normal(56, 6) + 28 * folded + 8 * upper)),
        droop=np.radians(max(8.0, arch + 20 * age)),
        bend=float(rng.uniform(1.0, 1.9)),
        sweep=rng.normal(0, 0.24),
        twist=rng.normal(0, 0.60),
        fold=np.radians(rng.uniform(16, 34) + 30 * folded),
        ruffle=float(rng.uniform(0.5, 1.4) * (1 - 0.7 * folded) * np.interp(width, [0.02, 0.08], [0.4, 1.0])),
        seed=int(rng.integers(1 << 30)),
        taper=1.6 if k > 2 else 4.5,
    )
