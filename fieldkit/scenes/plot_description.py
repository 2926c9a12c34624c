"""What a simulated plot is asked to look like: plants, soil, weeds, neighbours and light, as values."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import Field, PositiveFloat
from pydantic.dataclasses import dataclass

from fieldkit.results.fields import STRICT, Count, Length, Share
from fieldkit.scenes.scene import HAZE, Light
from fieldkit.vocabulary import Stage

GROWTH_STAGES: tuple[Stage, ...] = get_args(Stage)
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
SCATTER_M = 1.25
"""Half the side of the square on which stones and straw lie, metres."""
SoilKind = Literal["tilled", "crumb", "crusted", "printed"]
SCALE_RANGE = (0.9, 1.1)
"""BOSfM scales each plant within ±10 %."""
RowSpacing = Annotated[float, Field(ge=0.2, le=3.0)]
PlantSpacing = Annotated[float, Field(ge=0.05, le=1.0)]


@dataclass(frozen=True, config=STRICT)
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
    scale: Annotated[float, Field(ge=0.2, le=3.0)] = 1.0
    """Of all lengths."""
    leaves: Annotated[int, Field(ge=5, le=12)] | None = None
    """Draws the plain plant of the engine's benchmark with so many blades (5 to 12) instead of a plant at a ``stage``;
    kept so that those scenes stay as they were measured."""
    stage: Stage = "V8"
    """Growth stage."""
    markings: Annotated[float, Field(ge=0, le=1.5)] = 0.5
    """How strong blotches, flecks, lesions, dust and grain are on its leaves and stem; 0 for none."""
    kind: Literal["maize"] = "maize"
    """Tells plants of different kinds apart in scene files."""


@dataclass(frozen=True, config=STRICT)
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


Plant = MaizeDescription | MeshPlantDescription


@dataclass(frozen=True, config=STRICT)
class SoilDescription:
    """What the ground looks like."""

    seed: int = 0
    """Of everything random about it."""
    core_m: Annotated[float, Field(ge=0.1, le=10.0)] = 1.2
    """Side of the square about the origin where the grid is finest."""
    spacing_m: Annotated[float, Field(ge=0.001, le=0.1)] = 0.005
    """Grid spacing there; it widens outwards."""
    texture_px: Annotated[int, Field(ge=64, le=8192)] = 2048
    """Side of the colour texture."""
    clod_height_m: Length = 0.030
    """Height of the largest clods of a tilled soil; the other kinds are flatter in proportion."""
    stones: Count = 120
    """How many stones lie within `SCATTER_M` of the origin."""
    residues: Count = 60
    """How many pieces of straw lie there."""
    contrast: Length = 0.5
    """Of the colour, 1 as a dry tilled loam; what is seen beyond it is shading."""
    kind: SoilKind = "tilled"
    """"tilled" with clods, "crumb" a fine seedbed, "crusted" bare and sealed by rain with cracks; "printed" is the
    height field on a 5 mm grid under a contrasty colour texture of the engine's benchmark."""

    def __post_init__(self) -> None:
        if self.spacing_m >= self.core_m / 4:
            raise ValueError("the soil's spacing_m has to be a small part of its core_m")


@dataclass(frozen=True, config=STRICT)
class WeedsDescription:
    """What grows between the plants."""

    seed: int = 0
    """Of everything random about it."""
    cover_per_m2: Annotated[float, Field(ge=0, le=2000)] = 0.0
    """Small prostrate plants (clover-like, 1 to 3 cm high) per square metre where they grow densest."""
    weeds_per_m2: Annotated[float, Field(ge=0, le=200)] = 0.0
    """Larger broad-leaved weeds (rosettes, 3 to 8 cm high) per square metre."""
    patchiness: Share = 0.5
    """0 even cover, 1 patches with bare soil between them."""
    radius_m: Annotated[float, Field(gt=0, le=10)] = 2.5
    """How far from the origin they grow; in a trial all over the block and a metre beside it."""


@dataclass(frozen=True, config=STRICT)
class NeighboursDescription:
    """Plants that stand around the plot in its rows and beside them."""

    seed: int = 0
    """Of everything random about them."""
    rows: Annotated[int, Field(ge=0, le=5)] = 0
    """On each side of the plot's rows; 0 for none."""
    row_spacing_m: RowSpacing = 0.75
    """Between rows, and from the plot's bounds to the nearest one."""
    plant_spacing_m: PlantSpacing = 0.18
    """Within a row."""
    length_m: Annotated[float, Field(gt=0, le=20)] = 3.0
    """Of a row."""
    heading_deg: float = 90.0
    """Direction of the rows, clockwise from north."""
    stage: Stage = "V8"
    """Growth stage of all of them."""


@dataclass(frozen=True, config=STRICT)
class TrialDescription:
    """A block of a trial: plots side by side, each of a variety of its own, in ranges across the rows.

    The block's middle is the origin, rows run along x. Plot ``r2c5`` is the fifth column (along y) of the second range
    (along x).
    """

    seed: int = 0
    """Of everything random about it."""
    ranges: Annotated[int, Field(ge=1, le=40)] = 4
    """Plots along the rows."""
    columns: Annotated[int, Field(ge=1, le=100)] = 10
    """Plots across the rows."""
    rows: Annotated[int, Field(ge=1, le=8)] = 2
    """Of a plot."""
    row_spacing_m: RowSpacing = 0.75
    """Also from the last row of a plot to the first of the next."""
    plant_spacing_m: PlantSpacing = 0.18
    """Within a row."""
    length_m: Annotated[float, Field(ge=0.5, le=20)] = 4.0
    """Of a row."""
    alley_m: Annotated[float, Field(ge=0, le=5)] = 1.0
    """Bare ground between ranges."""
    stage: Stage = "V10"
    """Growth stage of most plants; some are one behind."""
    gaps: Annotated[float, Field(ge=0, le=0.5)] = 0.05
    """Share of plants that are missing, alone or several side by side."""
    lodged: Share = 0.03
    """Share of plants that lean by 12° and more."""
    detailed: tuple[str, ...] = ()
    """Ids of plots whose leaves and textures are twice as fine, for photographs from below 4 m."""

    @property
    def size_m(self) -> tuple[float, float]:
        """Of the block, along x and y."""
        width = self.columns * self.rows * self.row_spacing_m
        return self.ranges * self.length_m + (self.ranges - 1) * self.alley_m, width


@dataclass(frozen=True, config=STRICT)
class PlotDescription:
    """Everything a scene is built from; the same description gives the same scene."""

    plants: tuple[Annotated[Plant, Field(discriminator="kind")], ...]
    """Each with its seed and place."""
    soil: SoilDescription = field(default_factory=SoilDescription)
    """The ground."""
    light: Light = HAZE
    """Sun and sky; a hazy day where not given."""
    extent_m: Annotated[float, Field(ge=0.2, le=20)] = 1.6
    """Side of the square that belongs to the plot; everything in it casts shadows."""
    weeds: WeedsDescription = field(default_factory=WeedsDescription)
    """Leafy ground cover and weeds between the plants; not part of the reference."""
    neighbours: NeighboursDescription = field(default_factory=NeighboursDescription)
    """Rows of maize around the plot; not part of the reference."""
    trial: TrialDescription | None = None
    """A block of plots; then the scene has neither plants nor neighbours of its own."""

    def __post_init__(self) -> None:
        if self.trial is not None and (self.plants or self.neighbours.rows):
            raise ValueError("a trial has no plants and neighbours beside its plots'")
