"""What a simulated plot is asked to look like: plants, soil, weeds, neighbours and light, as values."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import Discriminator, PositiveFloat, Tag

from fieldkit.errors import SceneError
from fieldkit.scenes.scene import HAZE, Light
from fieldkit.vocabulary import Stage

GROWTH_STAGES: tuple[Stage, ...] = get_args(Stage)
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
SUFFIXES = (".obj", ".ply", ".glb", ".gltf", ".stl")
CONVERT = "Open it in MeshLab or Blender and export it as binary PLY or GLB."
SCATTER_M = 1.25
"""Half the side of the square on which stones and straw lie, metres."""
SoilKind = Literal["tilled", "crumb", "crusted", "printed"]
SCALE_RANGE = (0.9, 1.1)
"""BOSfM scales each plant within ±10 %."""


@dataclass(frozen=True)
class MaizeDescription:
    """One maize plant."""

    seed: int
    """Of its individual form and colour; no two leaves of a plant are alike."""
    x_m: float = 0.0
    """Where it stands, plot frame."""
    y_m: float = 0.0
    """Where it stands, plot frame."""
    yaw_deg: float = 0.0
    """Direction of the plane its leaves stand in, clockwise from north."""
    scale: float = 1.0
    """Of all lengths."""
    leaves: int | None = None
    """Draws the plain plant of the engine's benchmark with so many blades (5 to 12) instead of a plant at a ``stage``;
    kept so that those scenes stay as they were measured."""
    stage: Stage = "V8"
    """Growth stage."""
    markings: float = 0.5
    """How strong blotches, flecks, lesions, dust and grain are on its leaves and stem; 0 for none."""
    kind: Literal["maize"] = "maize"
    """Tells plants of different kinds apart in scene files."""

    def __post_init__(self) -> None:
        if self.leaves is not None and not 5 <= self.leaves <= 12:
            raise ValueError(f"a maize plant here has 5 to 12 leaves, not {self.leaves}")
        if not 0.2 <= self.scale <= 3.0:
            raise ValueError(f"a plant's scale is 0.2 to 3, not {self.scale}")
        if not 0.0 <= self.markings <= 1.5:
            raise ValueError(f"a plant's markings are 0 to 1.5, not {self.markings}")


@dataclass(frozen=True)
class MeshPlantDescription:
    """One plant from a mesh file."""

    file: Path
    """OBJ, PLY, GLB, glTF or STL."""
    seed: int = 0
    """Of the procedural colour, where the file has none."""
    x_m: float = 0.0
    """Where its foot stands, plot frame: the middle of its lowest hundredth."""
    y_m: float = 0.0
    """Where its foot stands, plot frame: the middle of its lowest hundredth."""
    yaw_deg: float = 0.0
    """Turned about the vertical by this, clockwise from above."""
    scale: PositiveFloat = 1.0
    """Of all lengths, beside ``unit_m``."""
    unit_m: PositiveFloat = 1.0
    """Metres per unit of the file; 0.001 for millimetres."""
    up: Axis = "z"
    """The file's axis that points upwards; y in most GLB files."""
    color: Literal["file", "leaf"] = "file"
    """"file" keeps the file's texture or colours where it has any, "leaf" paints over them (scans often hold labels in
    their colours)."""
    kind: Literal["mesh"] = "mesh"
    """Tells plants of different kinds apart in scene files."""


@dataclass(frozen=True)
class SoilDescription:
    """What the ground looks like."""

    seed: int = 0
    """Of everything random about it."""
    core_m: float = 1.2
    """Side of the square about the origin where the grid is finest."""
    spacing_m: float = 0.005
    """Grid spacing there; it widens outwards."""
    texture_px: int = 2048
    """Side of the colour texture."""
    clod_height_m: float = 0.030
    """Height of the largest clods of a tilled soil; the other kinds are flatter in proportion."""
    stones: int = 120
    """How many stones lie within `SCATTER_M` of the origin."""
    residues: int = 60
    """How many pieces of straw lie there."""
    contrast: float = 0.5
    """Of the colour, 1 as a dry tilled loam; what is seen beyond it is shading."""
    kind: SoilKind = "tilled"
    """"tilled" with clods, "crumb" a fine seedbed, "crusted" bare and sealed by rain with cracks; "printed" is the
    height field on a 5 mm grid under a contrasty colour texture of the engine's benchmark."""

    def __post_init__(self) -> None:
        if not (0.1 <= self.core_m <= 10.0 and 0.001 <= self.spacing_m <= 0.1 and self.spacing_m < self.core_m / 4):
            raise ValueError("the soil's core_m is 0.1 to 10, its spacing_m 0.001 to 0.1 and a small part of core_m")
        if not 64 <= self.texture_px <= 8192:
            raise ValueError(f"texture_px is 64 to 8192, not {self.texture_px}")
        if min(self.clod_height_m, self.stones, self.residues, self.contrast) < 0:
            raise ValueError("clod_height_m, stones, residues and contrast cannot be negative")


@dataclass(frozen=True)
class WeedsDescription:
    """What grows between the plants."""

    seed: int = 0
    """Of everything random about it."""
    cover_per_m2: float = 0.0
    """Small prostrate plants (clover-like, 1 to 3 cm high) per square metre where they grow densest."""
    weeds_per_m2: float = 0.0
    """Larger broad-leaved weeds (rosettes, 3 to 8 cm high) per square metre."""
    patchiness: float = 0.5
    """0 even cover, 1 patches with bare soil between them."""
    radius_m: float = 2.5
    """How far from the origin they grow."""

    def __post_init__(self) -> None:
        if not (0 <= self.cover_per_m2 <= 2000 and 0 <= self.weeds_per_m2 <= 200):
            raise ValueError("cover_per_m2 is 0 to 2000, weeds_per_m2 0 to 200")
        if not (0 <= self.patchiness <= 1 and 0 < self.radius_m <= 10):
            raise ValueError("patchiness is 0 to 1, radius_m above 0 and at most 10")


@dataclass(frozen=True)
class NeighboursDescription:
    """Plants that stand around the plot in its rows and beside them."""

    seed: int = 0
    """Of everything random about them."""
    rows: int = 0
    """On each side of the plot's rows; 0 for none."""
    row_spacing_m: float = 0.75
    """Between rows, and from the plot's bounds to the nearest one."""
    plant_spacing_m: float = 0.18
    """Within a row."""
    length_m: float = 3.0
    """Of a row."""
    heading_deg: float = 90.0
    """Direction of the rows, clockwise from north."""
    stage: Stage = "V8"
    """Growth stage of all of them."""

    def __post_init__(self) -> None:
        if not 0 <= self.rows <= 5:
            raise ValueError(f"0 to 5 neighbouring rows on each side, not {self.rows}")
        if not (0.2 <= self.row_spacing_m <= 3.0 and 0.05 <= self.plant_spacing_m <= 1.0 and 0 < self.length_m <= 20):
            raise ValueError("row_spacing_m is 0.2 to 3, plant_spacing_m 0.05 to 1, length_m above 0 and at most 20")


@dataclass(frozen=True)
class TrialDescription:
    """A block of a trial: plots side by side, each of a variety of its own, in ranges across the rows.

    The block's middle is the origin, rows run along x. Plot ``r2c5`` is the fifth column (along y) of the second range
    (along x).
    """

    seed: int = 0
    """Of everything random about it."""
    ranges: int = 4
    """Plots along the rows."""
    columns: int = 10
    """Plots across the rows."""
    rows: int = 2
    """Of a plot."""
    row_spacing_m: float = 0.75
    """Also from the last row of a plot to the first of the next."""
    plant_spacing_m: float = 0.18
    """Within a row."""
    length_m: float = 4.0
    """Of a row."""
    alley_m: float = 1.0
    """Bare ground between ranges."""
    stage: Stage = "V10"
    """Growth stage of most plants; some are one behind."""
    gaps: float = 0.05
    """Share of plants that are missing, alone or several side by side."""
    lodged: float = 0.03
    """Share of plants that lean by 12° and more."""
    detailed: tuple[str, ...] = ()
    """Ids of plots whose leaves and textures are twice as fine, for photographs from below 4 m."""

    def __post_init__(self) -> None:
        if not (1 <= self.ranges <= 40 and 1 <= self.columns <= 100 and 1 <= self.rows <= 8):
            raise ValueError("a block has 1 to 40 ranges, 1 to 100 columns, and plots of 1 to 8 rows")
        if not (0.2 <= self.row_spacing_m <= 3.0 and 0.05 <= self.plant_spacing_m <= 1.0):
            raise ValueError("row_spacing_m is 0.2 to 3, plant_spacing_m 0.05 to 1")
        if not (0.5 <= self.length_m <= 20.0 and 0.0 <= self.alley_m <= 5.0):
            raise ValueError("length_m is 0.5 to 20, alley_m 0 to 5")
        if not (0.0 <= self.gaps <= 0.5 and 0.0 <= self.lodged <= 1.0):
            raise ValueError("gaps are 0 to 0.5, lodged 0 to 1")

    @property
    def size_m(self) -> tuple[float, float]:
        """Of the block, along x and y."""
        width = self.columns * self.rows * self.row_spacing_m
        return self.ranges * self.length_m + (self.ranges - 1) * self.alley_m, width


PLANT_KINDS = ("maize", "mesh")


def _plant_kind(plant: Any) -> str | None:
    if isinstance(plant, dict):
        return str(plant.get("kind", "mesh" if "file" in plant else "maize"))
    return getattr(plant, "kind", None)


Plant = Annotated[
    Annotated[MaizeDescription, Tag("maize")] | Annotated[MeshPlantDescription, Tag("mesh")], Discriminator(_plant_kind)
]


@dataclass(frozen=True)
class PlotDescription:
    """Everything a scene is built from; the same description gives the same scene."""

    plants: tuple[Plant, ...]
    """Each with its seed and place."""
    soil: SoilDescription = field(default_factory=SoilDescription)
    """The ground."""
    light: Light = HAZE
    """Sun and sky; a hazy day where not given."""
    extent_m: float = 1.6
    """Side of the square that belongs to the plot; everything in it casts shadows."""
    weeds: WeedsDescription = field(default_factory=WeedsDescription)
    """Leafy ground cover and weeds between the plants; not part of the reference."""
    neighbours: NeighboursDescription = field(default_factory=NeighboursDescription)
    """Rows of maize around the plot; not part of the reference."""
    trial: TrialDescription | None = None
    """A block of plots; then the scene has neither plants nor neighbours of its own."""

    def __post_init__(self) -> None:
        if not 0.2 <= self.extent_m <= 20.0:
            raise ValueError(f"a plot's extent_m is 0.2 to 20, not {self.extent_m}")
        if self.trial is not None and (self.plants or self.neighbours.rows):
            raise ValueError("a trial has no plants and neighbours beside its plots'")


def check_mesh_file(path: Path) -> None:
    """Raise SceneError where a mesh file is not there or of no known kind."""
    if path.suffix.lower() not in SUFFIXES:
        kind = path.suffix or "a file without a suffix"
        raise SceneError(f"{kind} is not one of {', '.join(SUFFIXES)}", path=path, remedy=CONVERT)
    if not path.is_file():
        raise SceneError("there is no such mesh file", path=path, remedy="Check 'file' in the scene file.")
