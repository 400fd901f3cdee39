"""Immutable values that stages exchange. Arrays in them must not be written to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from facade_core.core.arrays import BoolArray, Float32Array, Float64Array, Int32Array, UInt8Array

if TYPE_CHECKING:
    from pathlib import Path

    from shapely import LineString, MultiPolygon, Polygon
    from shapely.geometry.base import BaseGeometry


# Metres from the ceiling of a passage up to the eaves, and from the ground to the ceiling of the lowest passage.
MIN_WALL_OVER_PASSAGE_M = 0.5
MIN_PASSAGE_HEIGHT_M = 2.0
# Treatment of people and other occluders in pictures. blur: unreadable but recognisable; mask: removed; keep: unchanged.
Privacy = Literal["blur", "mask", "keep"]
# x0, y0, x1, y1 in pixels of a picture, half-open.
Box = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Element:
    """Axis-parallel rectangle of one class: pixels or metres, y down, half-open.

    Confidence and depth do not count in comparisons.

    Attributes
    ----------
    label : class name, one of ELEMENT_CLASSES.
    x0, y0, x1, y1 : left, top, right and bottom.
    confidence : certainty of the parser, 0 to 1; 1 where the rectangle is given.
    depth_m : metres before the wall, negative behind it; None where nothing is known.
    depth_source : "parallax" if pictures measure the depth, "assumed" if it follows from the class.
    """

    label: str
    x0: float
    y0: float
    x1: float
    y1: float
    confidence: float = field(default=1.0, compare=False)
    depth_m: float | None = field(default=None, compare=False)
    depth_source: str = field(default="", compare=False)

    @property
    def width(self) -> float:
        """Return the width."""
        return self.x1 - self.x0

    @property
    def height(self) -> float:
        """Return the height."""
        return self.y1 - self.y0


@dataclass(frozen=True, slots=True)
class Parsing:
    """Parsed facade.

    Attributes
    ----------
    labels : (height, width) class ids.
    confidence : (height, width, 7) class probabilities; they sum to 1.
    occluded : (height, width), True where something hides the facade.
    """

    labels: UInt8Array
    confidence: Float32Array
    occluded: BoolArray


@dataclass(frozen=True, slots=True)
class Lattice:
    """Irregular rectangular lattice: sorted split positions in pixels, both borders included."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Completion:
    """Completed layout and its score; higher is better."""

    elements: tuple[Element, ...]
    score: float


@dataclass(frozen=True, slots=True)
class Synthesis:
    """Facade assembled from the tiles of an exemplar.

    Attributes
    ----------
    image : (height, width, 3) RGB.
    labels : (height, width) class ids, moved along with the tiles.
    tiles : (rows, columns) exemplar tile at each node, row-major in the exemplar's lattice.
    energy : Eq. 4 of the tiles paper.
    """

    image: UInt8Array
    labels: UInt8Array
    tiles: Int32Array
    energy: float


# Semantics of a building's surfaces; "unknown" is decided by slope and place.
SEMANTICS = ("wall", "roof", "ground", "window", "door", "ceiling", "unknown")


@dataclass(frozen=True, slots=True, eq=False)
class BuildingShell:
    """Surface of a building as triangles, in the block's metric frame (z up).

    Attributes
    ----------
    vertices : (v, 3) metres.
    triangles : (t, 3) vertex indices, counter-clockwise from outside where the source complies.
    semantic : (t,) index into SEMANTICS.
    texture : (t,) index into the block's textures, -1 without.
    uv : (t, 3, 2) texture coordinates of the corners, 0 to 1, u right and v up; zeros without a texture.
    """

    vertices: Float64Array
    triangles: Int32Array
    semantic: UInt8Array
    texture: Int32Array
    uv: Float32Array


@dataclass(frozen=True, slots=True)
class Roof:
    """Roof above the eaves.

    Attributes
    ----------
    shape : value of OpenStreetMap's roof:shape; "flat" has height 0.
    height : metres from the eaves to the ridge.
    direction : degrees clockwise from grid north that a skillion roof falls towards.
    across : True where the ridge is parallel to the short side.
    pitch : known degrees of the slopes, of a mansard's steep part; slopes that reach `height` continue flat.
    confidence : certainty of the shape, 0 to 1; 1 where a source states it.
    """

    shape: str
    height: float
    direction: float | None = None
    across: bool = False
    pitch: float | None = None
    confidence: float = 1.0


@dataclass(frozen=True, slots=True)
class BuildingFinish:
    """Stated colours and materials of a building's walls and roof.

    Attributes
    ----------
    wall_colour, roof_colour : red, green, blue, 0 to 255; None where unknown.
    wall_material, roof_material : values of OpenStreetMap's building:material and roof:material; None where unknown.
    """

    wall_colour: tuple[int, int, int] | None = None
    roof_colour: tuple[int, int, int] | None = None
    wall_material: str | None = None
    roof_material: str | None = None


# Finish of a building without stated colours and materials.
PLAIN = BuildingFinish()


@dataclass(frozen=True, slots=True)
class Sun:
    """Direction of the sun: azimuth in degrees clockwise from grid north, elevation in degrees above the horizon."""

    azimuth: float
    elevation: float


@dataclass(frozen=True, slots=True)
class IngestSettings:
    """Settings of a block that its plan depends on.

    Attributes
    ----------
    texels_per_metre : density of the atlas near streets.
    viewpoint_spacing : metres between viewpoints on a street.
    viewpoint_height : metres above the ground.
    visibility_range : metres from a viewpoint to the farthest chart that it textures.
    walls : "exemplar" gives walls without pictures one; "translate" leaves them plain.
    panorama_width : pixels of a viewpoint's panorama.
    """

    texels_per_metre: float
    viewpoint_spacing: float
    viewpoint_height: float
    visibility_range: float
    walls: str
    panorama_width: int


@dataclass(frozen=True, slots=True)
class BuildingPassage:
    """Street through an extruded building, open below its ceiling.

    Attributes
    ----------
    corridor : area of the passage seen from above; it may reach beyond the building.
    height : metres from the ground to the ceiling, where the building is high enough.
    """

    corridor: Polygon
    height: float


@dataclass(frozen=True, slots=True)
class Building:
    """Building in the block's metric frame (metres, z up): a footprint to extrude, or a modelled shell.

    Attributes
    ----------
    id : unique id.
    footprint : outline seen from above; only a shell may have several parts.
    height : metres from the ground to the eaves, of a shell to its top.
    height_source : "height", "levels", "default" or "model".
    levels : stated number of floors.
    name : display name.
    base : ground height at the building; None where the terrain decides.
    roof : roof above the eaves; None for a flat one.
    shell : modelled surface, in place of the extrusion.
    finish : stated colours and materials.
    raised : metres from the ground to the underside, 0 for a building on the ground.
    part_of : id of the whole building; its parts share one ground height.
    passages : streets through the building; none for a modelled shell.
    facade_style : likeliest of `facade_core.core.facade_styles`, for walls without pictures.
    """

    id: str
    footprint: Polygon | MultiPolygon
    height: float
    height_source: str
    levels: int | None = None
    name: str | None = None
    base: float | None = None
    roof: Roof | None = None
    shell: BuildingShell | None = None
    finish: BuildingFinish = PLAIN
    raised: float = 0.0
    part_of: str | None = None
    passages: tuple[BuildingPassage, ...] = ()
    facade_style: str = "perimeter-block"

    @property
    def whole_id(self) -> str:
        """Return the id that all parts of one building share."""
        return self.part_of or self.id


# (left, top, right, bottom) as shares of a wall's width and height, y down.
Shares = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class FacadeCorrections:
    """Corrections of one facade, in shares of its wall's width and height, y down.

    Attributes
    ----------
    elements : all windows, doors, balconies and shops as (class, left, top, right, bottom); None keeps the parsed ones.
    hide : rectangles of occluders that the parser misses, such as a poster or a van.
    keep : rectangles of the facade that the parser takes for an occluder.
    facade : False makes it a plain wall of its material.
    """

    elements: tuple[tuple[str, float, float, float, float], ...] | None = None
    hide: tuple[Shares, ...] = ()
    keep: tuple[Shares, ...] = ()
    facade: bool = True


AS_FOUND = FacadeCorrections()


# Name of the layout network beside the JSON file of a layout model.
LAYOUT_NETWORK_NAME = "layout_network.onnx"


@dataclass(frozen=True, slots=True)
class TrainedModelFiles:
    """Files of trained models; None selects the shipped one, or none where none is shipped.

    Attributes
    ----------
    parser : an .onnx file, with a .json record of the same name.
    layout : a .json file of layouts, with or without a layout network beside it.
    segmentation : an .onnx file of semantic segmentation; it finds occluders in place of the parser. None is shipped.
    inpainting : an .onnx file of LaMa; it fills holes in place of repetitions. None is shipped.
    """

    parser: Path | None = None
    layout: Path | None = None
    segmentation: Path | None = None
    inpainting: Path | None = None

    @property
    def layout_network(self) -> Path | None:
        """Return the layout network beside the layout model, if there is one."""
        path = None if self.layout is None else self.layout.with_name(LAYOUT_NETWORK_NAME)
        return path if path is not None and path.is_file() else None

    @property
    def files(self) -> tuple[Path, ...]:
        """Return all files that are set."""
        return tuple(file for files in self.digest_content().values() for file in files)

    def digest_content(self) -> dict[str, tuple[Path, ...]]:
        """Return the files of each model that is set, by its key."""
        parser, network = (
            () if path is None else (path, path.with_suffix(".json")) for path in (self.parser, self.layout_network)
        )
        layout, segmentation, inpainting = (
            () if path is None else (path,) for path in (self.layout, self.segmentation, self.inpainting)
        )
        files = {"parser": parser, "layout": network + layout, "segmentation": segmentation, "inpainting": inpainting}
        return {name: paths for name, paths in files.items() if paths}


SHIPPED_MODELS = TrainedModelFiles()


@dataclass(frozen=True, slots=True, eq=False)
class ElevationRaster:
    """Raster of ground heights in the block's metric frame.

    Attributes
    ----------
    x, y : centre of the first (north-western) cell.
    step : metres between cells, both ways.
    heights : (rows, columns) metres, row 0 north, NaN where unknown.
    """

    x: float
    y: float
    step: float
    heights: Float32Array


@dataclass(frozen=True, slots=True)
class Lens:
    """Lens of a perspective or fisheye picture, in pixels of its size; the centre of the first pixel is at 0.5, 0.5.

    A camera ray (X, Y, Z), x right, y down and z ahead, has the point x = X / Z, y = Y / Z, which a fisheye scales to the
    angle from the axis. With r2 = x x + y y and f = (1 + radial) / (1 + denominator), polynomials in r2 without constant,
    its pixel is centre + (focal[0] u + skew v, focal[1] v) for
    u = f x + 2 p1 x y + p2 (r2 + 2 x x), v = f y + p1 (r2 + 2 y y) + 2 p2 x y.

    Attributes
    ----------
    size : width and height.
    focal : focal lengths across and down.
    centre : principal point.
    radial : at most four coefficients.
    denominator : at most three coefficients.
    tangential : p1, p2.
    skew : pixels across for one unit down.
    fisheye : whether the point is scaled to the angle.
    """

    size: tuple[int, int]
    focal: tuple[float, float]
    centre: tuple[float, float]
    radial: tuple[float, ...] = ()
    denominator: tuple[float, ...] = ()
    tangential: tuple[float, float] = (0.0, 0.0)
    skew: float = 0.0
    fisheye: bool = False


# A lens that looks down more steeply may be above the roofs.
AERIAL_PITCH_DEG = -20.0


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of a panorama, or of a perspective picture, in the block's metric frame.

    Attributes
    ----------
    x, y : metres.
    z : metres; None puts the camera above the terrain.
    heading : degrees clockwise from grid north to the centre of the full panorama, or to the axis of the lens.
    pitch, roll : degrees, upwards and clockwise.
    view : (left, top, width, height) of the picture as shares of the full panorama.
    lens : lens of a perspective picture; None for an equirectangular panorama.
    """

    x: float
    y: float
    z: float | None
    heading: float
    pitch: float = 0.0
    roll: float = 0.0
    view: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    lens: Lens | None = None

    @property
    def is_aerial(self) -> bool:
        """Return True for a picture of a lens that looks down, which may be from above the roofs."""
        return self.lens is not None and self.pitch < AERIAL_PITCH_DEG


@dataclass(frozen=True, slots=True)
class Street:
    """Street centreline in the block's metric frame (metres)."""

    id: str
    name: str | None
    line: LineString


@dataclass(frozen=True, slots=True)
class GroundWay:
    """Way on the ground, mapped or assumed, in the block's metric frame; carries no camera.

    Attributes
    ----------
    id : unique id; not part of digests.
    line : centreline.
    kind : "road", "path", "cycle", "steps", "tram" or "crossing" (the line along which people cross).
    width : metres from edge to edge; gauge of a tram's track.
    surface : one of SURFACES.
    assumed : True where the width follows from the class.
    lanes : number of marked lanes, 0 without.
    oneway : True for one-way traffic.
    pavement, parking : metres to the left and right of the line, 0 without; parking is within the width.
    rank : priority at junctions; the surface of the larger rank continues.
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


# Materials with grain, for which a block may bring pictures.
MATERIALS = (
    "asphalt", "gravel", "grass", "slabs", "setts", "plaster-fine", "plaster-rough", "bricks", "metal", "roof-tiles",
    "slate", "boards",
)  # fmt: skip
# Surfaces of the ground.
SURFACES = ("gravel", "asphalt", "slabs", "setts", "grass", "water", "track")


@dataclass(frozen=True, slots=True)
class GroundObject:
    """Object on the ground that a map states or makes likely, in the block's metric frame.

    Attributes
    ----------
    id : unique id.
    geometry : point, line or outline.
    kind : name in `facade_core.core.street_objects.OBJECT_KINDS`.
    height, width : metres, 0 where not stated; the width is that of a crown or hedge.
    direction : degrees clockwise from north that its front faces; None where not stated.
    is_stated : the map states the object; else that the road of the same id has such, and the line is that road's.
    """

    id: str
    geometry: BaseGeometry
    kind: str
    height: float = 0.0
    width: float = 0.0
    direction: float | None = None
    is_stated: bool = True


@dataclass(frozen=True, slots=True)
class GroundArea:
    """Area of ground with one surface of SURFACES, in the block's metric frame."""

    id: str
    outline: Polygon | MultiPolygon
    surface: str


@dataclass(frozen=True, slots=True)
class MappedGround:
    """Mapped ground of a block; outline is the border of the block, None where unknown."""

    ways: tuple[GroundWay, ...] = ()
    areas: tuple[GroundArea, ...] = ()
    outline: Polygon | None = None
    objects: tuple[GroundObject, ...] = ()
