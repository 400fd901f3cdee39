"""Values that travel between the stages. All are frozen; arrays in them are not to be written to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from shapely import LineString, MultiPolygon, Polygon


# What is kept of things in front of facades, people among them. blur: unreadable, but a thing can still be told; mask:
# nothing is left of it; keep: as the picture shows it.
Privacy = Literal["blur", "mask", "keep"]
# x0, y0, x1, y1 in pixels of a picture, half-open.
Box = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Element:
    """An axis-parallel rectangle of one class: pixels (or metres), y down, half-open.

    confidence, 0 to 1: how sure the parser is of it; 1 where the rectangle is given. Equal rectangles are equal
    elements, however sure.
    """

    label: str
    x0: float
    y0: float
    x1: float
    y1: float
    confidence: float = field(default=1.0, compare=False)

    @property
    def width(self) -> float:
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        return self.y1 - self.y0


@dataclass(frozen=True, slots=True)
class Parsing:
    """A parsed facade: labels (H, W) uint8; confidence (H, W, 7) float32, rows sum to 1; occluded (H, W) bool."""

    labels: np.ndarray
    confidence: np.ndarray
    occluded: np.ndarray


@dataclass(frozen=True, slots=True)
class Lattice:
    """An irregular rectangular lattice: sorted split positions in pixels, both borders included."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Completion:
    """A completed layout and its score; higher is better."""

    elements: tuple[Element, ...]
    score: float


@dataclass(frozen=True, slots=True)
class Synthesis:
    """A facade put together from an exemplar's tiles.

    image (H, W, 3) uint8; labels (H, W) uint8, carried along with the tiles; tiles (rows, columns) int32, the
    exemplar tile shown at each node, row-major in the exemplar's lattice; energy, Eq. 4 of the tiles paper.
    """

    image: np.ndarray
    labels: np.ndarray
    tiles: np.ndarray
    energy: float


# What a building's surfaces can be. "unknown" is told from its slope and place.
SEMANTICS = ("wall", "roof", "ground", "window", "door", "ceiling", "unknown")


@dataclass(frozen=True, slots=True, eq=False)
class Shell:
    """A building's surface as triangles, in the block's metric frame (z up).

    vertices (v, 3) float64 metres; triangles (t, 3) int32, counter-clockwise seen from outside where the source keeps to it;
    semantic (t,) uint8, an index into SEMANTICS; texture (t,) int32, an index into the block's own textures, -1 without;
    uv (t, 3, 2) float32, texture coordinates of the corners, 0 to 1, u right and v up; zeros without texture.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    semantic: np.ndarray
    texture: np.ndarray
    uv: np.ndarray


@dataclass(frozen=True, slots=True)
class Roof:
    """A roof over the eaves: shape as in OpenStreetMap's roof:shape; height in metres from the eaves to the ridge.

    direction: degrees clockwise from grid north that a skillion roof faces (falls towards); across: the ridge runs along the
    short side. pitch: degrees of the slopes (of a mansard's steep part) where that is known: where they would rise above
    `height` the roof is flat. A flat roof is "flat" and 0 high. confidence, 0 to 1: how sure the shape is, 1 where it is
    stated, less where it is assumed.
    """

    shape: str
    height: float
    direction: float | None = None
    across: bool = False
    pitch: float | None = None
    confidence: float = 1.0


@dataclass(frozen=True, slots=True)
class Finish:
    """What the walls and the roof of a building are of, as a source states it: colours as red, green, blue, 0 to 255; materials
    as in OpenStreetMap's building:material and roof:material."""

    wall_colour: tuple[int, int, int] | None = None
    roof_colour: tuple[int, int, int] | None = None
    wall_material: str | None = None
    roof_material: str | None = None


# Nothing is stated.
PLAIN = Finish()


@dataclass(frozen=True, slots=True)
class Sun:
    """Where the sun stands: azimuth, degrees clockwise from the grid's north; elevation, degrees over the horizon."""

    azimuth: float
    elevation: float


@dataclass(frozen=True, slots=True)
class Building:
    """A building in the block's metric frame (metres, z up): a footprint to extrude, or a shell, which may stand in parts.

    height is from the ground to the eaves (of a shell: to its top); height_source says where it is from: "height", "levels",
    "default" or "model". levels is the number of storeys where the source states it. base is the height of the ground at the
    building, None where the terrain decides. raised: from the ground to its underside, 0 of what stands on the ground. part_of:
    the id that the source gives the whole of which it is a part, None of a whole one; parts of one stand on one ground.
    """

    id: str
    footprint: Polygon | MultiPolygon
    height: float
    height_source: str
    levels: int | None = None
    name: str | None = None
    base: float | None = None
    roof: Roof | None = None
    shell: Shell | None = None
    finish: Finish = PLAIN
    raised: float = 0.0
    part_of: str | None = None

    @property
    def house(self) -> str:
        """The id that all parts of one building share: of the whole."""
        return self.part_of or self.id


# (left, top, right, bottom) as shares of a wall's width and height, y down.
Shares = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Corrected:
    """What is said of one facade, in shares of its wall's width and height, y down.

    Args:
        elements: its windows, doors, balconies and shops as (class, left, top, right, bottom), all of them; None: as found.
        hide: what a picture of it shows that is not of it, such as a poster or a van.
        keep: what is of it although the parser takes it for something in front.
        facade: whether it is one; else a wall of its material.
    """

    elements: tuple[tuple[str, float, float, float, float], ...] | None = None
    hide: tuple[Shares, ...] = ()
    keep: tuple[Shares, ...] = ()
    facade: bool = True


AS_FOUND = Corrected()


@dataclass(frozen=True, slots=True)
class Models:
    """Files of trained models by which facades are made; None: what is shipped.

    Args:
        parser: an .onnx with its .json beside it.
        layout: a .json of layouts.
    """

    parser: Path | None = None
    layout: Path | None = None

    @property
    def files(self) -> tuple[Path, ...]:
        """All that are named."""
        parser = () if self.parser is None else (self.parser, self.parser.with_suffix(".json"))
        return (*parser, *(() if self.layout is None else (self.layout,)))


SHIPPED_MODELS = Models()


@dataclass(frozen=True, slots=True, eq=False)
class Elevation:
    """A raster of ground heights in the block's metric frame.

    x, y: the centre of the first (north-western) cell; step: metres between cells, both ways; heights (rows, columns)
    float32 metres, row 0 north, NaN where unknown.
    """

    x: float
    y: float
    step: float
    heights: np.ndarray


@dataclass(frozen=True, slots=True)
class Pose:
    """Where an equirectangular picture was taken, in the block's metric frame.

    z is None where only the place is known: the camera then stands on the terrain. heading: degrees clockwise from grid north
    of the centre of the full panorama; pitch (up) and roll (clockwise) in degrees. view: the part of the full panorama
    that the picture holds, (left, top, width, height) as shares of it.
    """

    x: float
    y: float
    z: float | None
    heading: float
    pitch: float = 0.0
    roll: float = 0.0
    view: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Street:
    """A street centreline in the block's metric frame (metres)."""

    id: str
    name: str | None
    line: LineString


@dataclass(frozen=True, slots=True)
class Way:
    """A way on the ground in the block's metric frame, metres: what lies there, not where a camera travels.

    kind: "road", "path", "cycle", "steps", "tram" or "crossing" (the line along which people cross). width: from edge to edge,
    of a tram's track its gauge; assumed: whether that is by its class. surface: one of SURFACES. lanes: that are marked; 0:
    none. pavement, parking: to the left and right of its line, 0 where there is none; parking lies within the width. rank:
    whose surface goes through where roads meet, the larger.
    """

    id: str
    line: LineString
    kind: str
    width: float
    surface: str
    assumed: bool = True
    lanes: int = 0
    oneway: bool = False
    pavement: tuple[float, float] = (0.0, 0.0)
    parking: tuple[float, float] = (0.0, 0.0)
    rank: int = 0


# What has grain; a block may bring pictures of it.
MATERIALS = (
    "asphalt", "gravel", "grass", "slabs", "setts", "plaster-fine", "plaster-rough", "bricks", "metal", "roof-tiles",
    "slate", "boards",
)  # fmt: skip
# What ground is made of.
SURFACES = ("gravel", "asphalt", "slabs", "setts", "grass", "water", "track")


@dataclass(frozen=True, slots=True)
class Area:
    """A piece of ground of one surface, of SURFACES, in the block's metric frame."""

    id: str
    outline: Polygon | MultiPolygon
    surface: str


@dataclass(frozen=True, slots=True)
class Ground:
    """What a map says of the ground; outline: where the block ends, None where nothing says so."""

    ways: tuple[Way, ...] = ()
    areas: tuple[Area, ...] = ()
    outline: Polygon | None = None
