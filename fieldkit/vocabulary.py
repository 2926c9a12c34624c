"""The words and numbers that settings, commands and result files share. Imports nothing but types."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

MappingName = Literal["incremental", "global", "prior"]
"""How poses are found: blind, image by image or all at once, or from what is known of them."""
MappingChoice = Literal["auto", "incremental", "global", "prior"]
"""The same as a person chooses it; auto takes prior where enough positions are known."""
TiesName = Literal["sift", "learned"]
"""Whose matches tie photographs: SIFT's alone, or where these leave poses loose, networks', too."""
TiesChoice = Literal["sift", "auto", "learned"]
"""The same as a person chooses it; auto takes networks' where they are installed."""
Fidelity = Literal["draft", "standard", "fine", "full"]
"""Ground sampling distance of the depth maps."""
GSD_M: Mapping[Fidelity, float] = MappingProxyType({"draft": 0.004, "standard": 0.002, "fine": 0.0012, "full": 0.0})
"""At the plants, metres; never finer than the photographs' own, which `full` takes."""
SearchFidelity = Literal["draft", "standard", "fine"]
"""The same in a search, where photographs are never taken at their full size."""
BURST_INTERVAL_S = 0.7
"""Between the photographs of a burst at least: about what cameras such as the Mavic 3 Enterprise's keep up. Leaves
swing at 1 to 3 Hz about where gusts of seconds hold them: five photographs, 3 to 4 s, average most of the swing out."""
MissionFormat = Literal["plan", "waypoints", "wpml", "litchi"]
"""A ground station's or an app's file of a mission."""
Preset = Literal["outdoors", "paper"]
"""Conditions that a plan expects: a flight in a breeze, or the paper's exact poses in still air."""
PlanningMethod = Literal["ring", "score", "field", "bosfm", "circle", "uniform"]
"""What looks for cameras: planning/methods/registry.py has what each needs."""
Mask = Literal["exg", "none", "file"]
"""What counts as plants: what is green (excess green index), everything, or what masks show."""
Stage = Literal[
    "V4", "V5", "V6", "V7", "V8", "V9", "V10", "V11", "V12", "V13", "V14", "V15", "V16", "V17", "V18", "VT", "R1"
]
"""Growth stages by the leaf-collar method (Abendroth et al. 2011): Vn has n visible collars, VT a tassel, R1 silks."""

DRAWN_BY = "fieldkit"
"""What pictures of results name as their program: they are no photographs."""
DISTANCES_M = (0.002, 0.005, 0.010, 0.020)
"""Distances of precision, recall and F-score."""
NINE_IN_TEN = 1.645
"""Nine in ten draws of a normal distribution lie within so many standard deviations."""
SIGMA_OF_MEDIAN = 1.4826
"""Standard deviation of a normal distribution over the median of its absolute deviations."""
LEAST_POSITIONS = 3
"""Fewer positions give neither a scale nor an orientation."""
CAP_M = 0.10
"""Upper limit of distances that plans are judged by, metres; a reference point out of reach counts this much."""
BY_CHANCE = 12.0
"""Matches that a wrong relative pose has within half a pixel: it has five parameters, and the most of many tries."""
FREE_RAD = 1.0
"""Standard deviation of a camera's rotation that nothing is known of beforehand."""
WEIGHTS = (0.55, 1.1, 0.15)
"""Metres of value per metre of each term of the geometric score (gap, noise, tie), fitted on 24 sets outdoors and 12 in
still air about tuning-1 and tuning-2: used until a plot has its own results."""
