"""Buildings out of CityGML 1.0, 2.0 and 3.0 files, one at a time: shells with their semantics and photo textures.

Names are matched without their namespaces, so one reader serves GML 3.1.1 and 3.2 and every version of CityGML.
"""

from __future__ import annotations

import gzip
import re
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast
from urllib.parse import unquote

import numpy as np
import shapely

from catalogs.faces import Face, shell_of
from catalogs.features import Fault, Model, Models, Remark
from facade_core.errors import InputError

if TYPE_CHECKING:
    from lxml.etree import _Element as Element
    from pyproj import CRS

SURFACES = {
    "RoofSurface": "roof",
    "OuterFloorSurface": "roof",
    "WallSurface": "wall",
    "GroundSurface": "ground",
    "OuterCeilingSurface": "ceiling",
    "Window": "window",
    "WindowSurface": "window",
    "Door": "door",
    "DoorSurface": "door",
} | dict.fromkeys(("ClosureSurface", "InteriorWallSurface", "CeilingSurface", "FloorSurface"), "inside")
BOUNDARIES = frozenset(("boundedBy", "boundary", "opening", "fillingSurface"))
UNITS = {
    "consistsOfBuildingPart": "part",
    "buildingPart": "part",
    "outerBuildingInstallation": "installation",
    "buildingInstallation": "installation",
}
POLYGONS = frozenset(("Polygon", "PolygonPatch", "Triangle", "Rectangle"))
BOUNDS = ("{*}exterior", "{*}outerBoundaryIs", "{*}interior", "{*}innerBoundaryIs")
ID = ("{http://www.opengis.net/gml}id", "{http://www.opengis.net/gml/3.2}id")
HREF = "{http://www.w3.org/1999/xlink}href"
EARTH_RADIUS = 6_371_000.0  # m
_LOD = re.compile(r"lod([0-4])(?:Solid|MultiSurface|Geometry|FootPrint|RoofEdge)")
_CODE = re.compile(r"epsg(?:\.xml#|[:/]+(?:[\w.]*[:/])?)(\d{4,6})|^(\d{4,6})$", re.IGNORECASE)
ADV_CODES = {"ETRS89_UTM31": 25831, "ETRS89_UTM32": 25832, "ETRS89_UTM33": 25833} | {
    f"DE_DHDN_3GK{zone}": 31464 + zone for zone in range(2, 6)
}
_GML = {"g": "http://www.opengis.net/gml", "h": "http://www.opengis.net/gml/3.2", "x": "http://www.w3.org/1999/xlink"}


@dataclass(frozen=True, slots=True)
class _Axes:
    """A frame and how its coordinates are to be read; horizontal: pyproj's CRS without heights, None where none is known."""

    crs: str | None = None
    horizontal: Any = None
    north_first: bool = False
    vertical_unit: float = 1.0


@dataclass(slots=True)
class _File:
    """What a first pass finds, and what the reading of buildings adds to it.

    targets: ring id -> (rank of its theme, picture, texture coordinates as text).
    """

    path: Path
    frame: str | None = None
    targets: dict[str, tuple[tuple[bool, str], Path, str]] = field(default_factory=dict)
    pictures: dict[str, Path | None] = field(default_factory=dict)
    textures: dict[Path, int] = field(default_factory=dict)
    remarks: list[Remark] = field(default_factory=list)
    axes: dict[str, _Axes] = field(default_factory=dict)


# (polygon, turned over, semantic or None) by LoD
_Surfaces = dict[int, list[tuple["Element", bool, str | None]]]


class _Unusable(Exception):
    """Why a building is set aside."""


def read_citygml(path: Path, lod: str | None = None) -> Models:
    """Every building of a file (.gml, .xml, either gzipped), in document order, parts and outer installations included.

    lod: "1" to "4" picks a level of detail, else the nearest lower one that a building has, else the nearest higher; None
    takes each building's highest. Raises InputError where the file is no well-formed CityGML.
    """
    if lod is not None and not re.fullmatch(r"[0-4](\.\d)?", lod):
        raise InputError(f"{path}: LoD {lod!r} is not known; give one of 1, 2, 3 and 4")
    file = _survey(path)
    models: list[Model] = []
    faults: list[Fault] = []
    ids: Counter[str] = Counter()
    frame = None
    for number, building in enumerate(_elements(path, ("Building",)), 1):
        id = _id(building) or f"{path.stem}-{number}"
        ids[id] += 1
        if ids[id] > 1:
            id = f"{id}-{ids[id]}"
            file.remarks.append(Remark(id, "buildings numbered since another has their id", None))
        try:
            axes, model = _model(building, id, None if lod is None else int(lod[0]), file)
            frame = frame or axes
            if axes.horizontal != frame.horizontal:
                raise _Unusable(f"it is in {axes.crs}, the buildings before it in {frame.crs}; reproject it")
            models.append(model)
        except _Unusable as reason:
            faults.append(Fault(id, "building", f"{path.name}: {reason}", _place(building, file)))
    crs = frame.crs if frame else _axes(None, file, np.empty((0, 3))).crs
    return Models(crs, tuple(models), tuple(file.textures), tuple(file.remarks), tuple(faults))


# ---- the file


def _elements(path: Path, names: Collection[str]) -> Iterator[Element]:
    """Elements of these names as they end, each cleared when the next is asked for.

    Prefixes without a namespace are common in attributes that do not matter here, hence the recovery: every other flaw is an
    InputError.
    """
    from lxml import etree

    members = ("Building", "cityObjectMember", "featureMember", "appearanceMember")
    try:
        with _opened(path) as stream:
            events = etree.iterparse(
                stream,
                events=("end",),
                tag=[f"{{*}}{name}" for name in {*names, *members}],
                resolve_entities=False,
                no_network=True,
                huge_tree=True,
                recover=True,
            )
            for _, element in events:
                if _local(element) in names:
                    yield element
                if _local(element) in members:
                    element.clear()
                    parent = element.getparent()
                    while parent is not None and parent[0] is not element:
                        del parent[0]
    except (OSError, EOFError, zlib.error, etree.XMLSyntaxError) as error:
        raise InputError(f"{path} cannot be read ({' '.join(str(error).split())[:120]}); export it again") from error
    if events.root is not None and events.root.getroottree().docinfo.internalDTD is not None:
        raise InputError(f"{path} declares a DTD, which CityGML has no use for; delete its <!DOCTYPE ...>")
    for flaw in events.error_log.filter_from_fatals():
        raise InputError(f"{path} is no well-formed XML (line {flaw.line}: {flaw.message.strip()}); export it again")


def _opened(path: Path) -> IO[bytes]:
    with path.open("rb") as file:
        zipped = file.read(2) == b"\x1f\x8b"
    return cast("IO[bytes]", gzip.open(path)) if zipped else path.open("rb")


def _survey(path: Path) -> _File:
    """The first pass: texture coordinates (they may stand behind the buildings), the file's frame, and whether it is sound."""
    file = _File(path)
    root, buildings, generated = None, 0, 0
    for element in _elements(path, ("Envelope", "ParameterizedTexture", "CityModel", "Building")):
        match _local(element):
            case "Envelope":
                above = list(element.iterancestors())
                if len(above) == 2:
                    file.frame = element.get("srsName")
            case "ParameterizedTexture":
                generated += _texture_targets(element, file)
            case "Building":
                buildings += "citygml" in element.tag
            case _:
                root = element if element.getparent() is None else root
    if root is None and not buildings:
        raise InputError(f"{path} is XML but not CityGML: it has no CityModel; give a CityGML 1.0, 2.0 or 3.0 file")
    missing = [uri for uri, picture in file.pictures.items() if picture is None]
    if missing:
        text = f"{len(missing)} of {len(file.pictures)} of {path.name}, the first {missing[0]}"
        file.remarks.append(Remark(text, "texture pictures that are not there, surfaces left untextured", None))
    if generated:
        text = f"{generated} of {path.name}"
        file.remarks.append(Remark(text, "textures placed by a matrix instead of coordinates ignored", None))
    return file


def _texture_targets(texture: Element, file: _File) -> int:
    """Enter a texture's coordinates by ring; returns how many surfaces it covers by a matrix."""
    uri = (texture.findtext("{*}imageURI") or "").strip()
    if uri not in file.pictures:
        names = [file.path.parent / name.replace("\\", "/") for name in (uri, unquote(uri))]
        file.pictures[uri] = next((name for name in names if uri and name.is_file()), None)
    picture = file.pictures[uri]
    appearance = next(texture.iterancestors("{*}Appearance"), None)
    theme = "" if appearance is None else (appearance.findtext("{*}theme") or "").strip()
    rank = (theme.casefold() != "rgbtexture", theme)
    for coordinates in texture.iter("{*}TexCoordList") if picture else ():
        texts = coordinates.findall("{*}textureCoordinates")
        rings = [text.get("ring") for text in texts]
        if None in rings:  # CityGML 3.0 lists the rings after the coordinates
            rings = [ring.text for ring in coordinates.findall("{*}ring")]
        for ring, text in zip(rings, texts, strict=False):
            name = (ring or "").strip().rpartition("#")[2]
            if name not in file.targets or rank < file.targets[name][0]:
                file.targets[name] = (rank, cast(Path, picture), text.text or "")
    return sum(1 for _ in texture.iter("{*}TexCoordGen"))


# ---- a building


def _model(building: Element, id: str, lod: int | None, file: _File) -> tuple[_Axes, Model]:
    surfaces, chosen = _chosen(_units(building, id, file), lod)
    if lod not in (None, chosen):
        file.remarks.append(Remark(id, f"buildings without LoD {lod} read at LoD {chosen}", None))
    outlines = [(_rings(polygon), turned, semantic) for polygon, turned, semantic in surfaces]
    points = np.concatenate([ring for rings, _, _ in outlines for ring in rings.values()] or [np.empty((0, 3))])
    axes = _axes(building, file, points)
    order = [1, 0, 2] if axes.north_first else [0, 1, 2]
    scale = (1.0, 1.0)
    if axes.horizontal is not None and axes.horizontal.is_geographic and len(points):
        unit = axes.horizontal.axis_info[0].unit_conversion_factor
        scale = (EARTH_RADIUS * unit * float(np.cos(points[0, order[1]] * unit)), EARTH_RADIUS * unit)
    faces, misfit, known = [], False, set()
    for named, turned, semantic in sorted(outlines, key=lambda outline: outline[2] is None):
        rings = [ring[:, order] * (1.0, 1.0, axes.vertical_unit) for ring in named.values()]
        if not rings:
            continue
        corners = (rings[0] * (*scale, 1.0)).round(3) + 0.0
        key = corners[np.lexsort(corners.T)].tobytes()
        if semantic == "inside" or (semantic is None and key in known):
            known.add(key)
            continue  # the second: a solid that repeats the surfaces of its boundary instead of referring to them
        known.add(key)
        texture, uv = _texture(named, file)
        misfit |= texture is None
        step = -1 if turned else 1
        turned_uv = None if uv is None else [ring[::step] for ring in uv]
        faces.append(
            Face([ring[::step] for ring in rings], semantic or "unknown", -1 if texture is None else texture, turned_uv)
        )
    if misfit:
        file.remarks.append(Remark(id, "buildings with texture coordinates that do not fit their rings", None))
    shell = shell_of(faces, scale)
    if shell is None:
        raise _Unusable("its surfaces enclose no area; repair or delete it")
    levels = _stated(building, "{*}storeysAboveGround")
    return axes, Model(
        id,
        shell,
        height=_stated(building, "{*}measuredHeight", "{*}Height"),
        levels=levels if levels is not None and levels < 300 else None,  # 9999 is a code for unknown
        name=(building.findtext("{*}name") or "").strip() or None,
    )


def _units(building: Element, id: str, file: _File) -> list[tuple[str, _Surfaces]]:
    """The building, its parts and outer installations, each polygon in one of them."""
    references = building.xpath(".//@x:href", namespaces=_GML)
    ids = {_id(e): e for e in building.xpath(".//*[@g:id or @h:id]", namespaces=_GML)} if references else {}
    if any(name.startswith("#") and name[1:] not in ids for name in references):
        file.remarks.append(Remark(id, "buildings with references that lead out of them, not followed", None))
    units: list[tuple[str, _Surfaces]] = [("building", {})]
    features: list[tuple[Element, int, str | None]] = [(building, 0, None)]
    properties = []
    visited = set()
    for feature, unit, semantic in features:  # grows on the way
        inside = (feature.findtext("{*}relationToConstruction") or "").strip() == "inside"
        if inside or feature in visited:
            continue
        visited.add(feature)
        for member in feature.iterchildren("{*}*"):
            name = _local(member)
            if match := _LOD.fullmatch(name):
                properties.append((semantic is None, unit, int(match[1]), semantic, member))
            elif name in BOUNDARIES:
                features += [(s, unit, SURFACES.get(_local(s), "unknown")) for s in _targets(member, ids)]
            elif name in UNITS:
                for part in _targets(member, ids):
                    units.append((UNITS[name], {}))
                    features.append((part, len(units) - 1, None))
    semantics: dict[Element, str | None] = {}
    taken = set()
    # thematic surfaces before the solids that refer to their polygons
    for _, unit, lod, semantic, member in sorted(properties, key=lambda found: found[0]):
        for polygon, turned in _polygons(member, ids):
            if (lod, polygon) not in taken:
                taken.add((lod, polygon))
                semantics.setdefault(polygon, semantic)
                units[unit][1].setdefault(lod, []).append((polygon, turned, semantics[polygon]))
    return units


def _targets(member: Element, ids: dict[str, Element]) -> list[Element]:
    """What a property holds, or what of its building it refers to."""
    target = ids.get(member.get(HREF, "").removeprefix("#"))
    return [*member.iterchildren("{*}*")] if target is None else [target]


def _polygons(member: Element, ids: dict[str, Element]) -> Iterator[tuple[Element, bool]]:
    """Each polygon of a geometry once, and whether it is turned over; a solid's cavities are left out."""
    stack, visited = [(member, False)], set()
    while stack:
        element, turned = stack.pop()
        name = _local(element)
        if name in POLYGONS and element not in visited:
            yield element, turned
        elif name != "interior" and element not in visited:
            turned ^= name == "OrientableSurface" and element.get("orientation") == "-"
            stack += [(target, turned) for target in reversed(_targets(element, ids))]
        visited.add(element)


def _chosen(
    units: list[tuple[str, _Surfaces]], asked: int | None
) -> tuple[list[tuple[Element, bool, str | None]], int]:
    """The polygons to read and their LoD: parts without it at their nearest, installations at none above it."""
    lods = {lod for kind, surfaces in units for lod in surfaces if kind != "installation"}
    if not lods:
        raise _Unusable("it has no geometry; add a LoD 1 to 3 model or delete it")
    if lods == {0}:
        raise _Unusable("it has a footprint only (LoD 0); export it at LoD 1 or above")
    chosen = _nearest(lods, 4 if asked is None else asked)
    whole = chosen in units[0][1]
    found = []
    for kind, surfaces in units:
        lod = _nearest(surfaces, chosen)
        # a part's hull must not be added to a building that is there as a whole, nor the whole's hull to its parts
        if lod == chosen or (lod and kind == "part" and not whole) or (0 < lod < chosen and kind == "installation"):
            found += surfaces[lod]
    return found, chosen


def _nearest(lods: Collection[int], asked: int) -> int:
    """The LoD asked for, else the nearest lower, else the nearest higher; 0 where there is none."""
    lower = [lod for lod in lods if 0 < lod <= asked]
    return max(lower) if lower else min((lod for lod in lods if lod > 0), default=0)


def _rings(polygon: Element) -> dict[str, np.ndarray]:
    """Rings by id, the outer one first, (n, 3) as stated but for the closing point; none where it has no outer ring."""
    rings: dict[str, np.ndarray] = {}
    for number, boundary in enumerate(polygon.iterchildren(*BOUNDS)):
        positions = [_numbers(e.text) for e in boundary.iter("{*}posList", "{*}pos", "{*}coordinates")]
        values = np.array([value for position in positions for value in position])
        if not np.isfinite(values).all():
            raise _Unusable("its coordinates are not all finite numbers; repair or delete it")
        if len(values) % 3 or _dimension(boundary) == 2:
            raise _Unusable("its coordinates are not all x, y and z; export it with heights")
        ring = values.reshape(-1, 3)
        ring = ring[:-1] if len(ring) > 1 and (ring[0] == ring[-1]).all() else ring
        if len(ring) >= 3:
            rings[next((_id(e) for e in boundary), "") or f" {number}"] = ring
        elif number == 0:
            break
    return rings


def _dimension(boundary: Element) -> int:
    stated = boundary.xpath("(.//@srsDimension | ancestor::*/@srsDimension)[last()]")
    return int(stated[0]) if stated and stated[0].isdigit() else 3


def _numbers(text: str | None) -> list[float]:
    """Numbers of a list; NaN where one of them is none."""
    try:
        return [float(number) for number in (text or "").replace(",", " ").split()]
    except ValueError:
        return [float("nan")]


def _texture(rings: dict[str, np.ndarray], file: _File) -> tuple[int | None, list[np.ndarray] | None]:
    """A face's texture (-1 without, None where its coordinates do not fit) and its coordinates by ring, (n, 2) each."""
    targets = [file.targets.get(ring) for ring in rings]
    if targets[0] is None:
        return -1, None
    picture, uv = targets[0][1], []
    for ring, target in zip(rings.values(), targets, strict=True):
        numbers = _numbers(target[2]) if target and target[1] == picture else []
        if len(numbers) // 2 - len(ring) not in (0, 1) or not np.isfinite(numbers).all():
            return None, None
        uv.append(np.array(numbers[: 2 * len(ring)]).reshape(-1, 2))
    return file.textures.setdefault(picture, len(file.textures)), uv


def _stated(building: Element, *tags: str) -> float | None:
    """The greatest positive figure of the building, else of its parts; None where none is stated in metres."""
    own: list[float] = []
    parts: list[float] = []
    for element in building.iter(*tags):
        value = element if len(element) == 0 else element.find("{*}value")
        numbers = _numbers(None if value is None else value.text)
        unit = "" if value is None else re.split("[#:/]", value.get("uom", ""))[-1].lower()
        if (
            len(numbers) == 1
            and 0 < numbers[0] < float("inf")
            and unit in ("", "m", "metre", "meter", "metres", "meters")
        ):
            owner = next(element.iterancestors("{*}Building", "{*}BuildingPart"), None)
            (own if owner is building else parts).append(numbers[0])
    return max(own or parts, default=None)


def _id(element: Element) -> str:
    return next((id for key in ID if (id := element.get(key))), "")


def _local(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


# ---- frames


def _axes(building: Element | None, file: _File, points: np.ndarray) -> _Axes:
    """How to read a building's coordinates; the first building in a frame decides on the order of its axes."""
    own = "" if building is None else building.xpath("string((.//@srsName)[1])")
    file.frame = file.frame or own
    srs = own or file.frame or ""
    if srs not in file.axes:
        axes, swap, remark = _named_axes(srs), False, None
        if axes.horizontal is None:
            remark = "names of a CRS that are not understood" if srs else None
        elif axes.horizontal.is_geocentric:
            raise InputError(f"{file.path} is in geocentric {axes.crs}; reproject it to a projected CRS")
        elif len(points):
            first, second = np.median(points[:, :2], axis=0)
            stated, other = _covers(axes.horizontal, first, second), _covers(axes.horizontal, second, first)
            if axes.north_first:
                stated, other = other, stated
            if not stated:
                swap = other
                remark = "frames whose axes are swapped" if other else "frames far from the area they are made for"
            elif other and axes.north_first and re.fullmatch(r"EPSG:\d+", srs):
                remark = "frames whose first axis is taken to be north, as EPSG defines them"
        if remark:
            file.remarks.append(Remark(f"{srs} of {file.path.name}", remark, None))
        file.axes[srs] = replace(axes, north_first=axes.north_first != swap)
    return file.axes[srs]


def _named_axes(srs: str) -> _Axes:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    codes = [int(code or bare) for code, bare in _CODE.findall(srs)]
    codes = codes or [code for name, code in ADV_CODES.items() if name in srs] or [4326] * ("CRS84" in srs)
    try:
        frames = [CRS.from_epsg(code) for code in codes]
    except CRSError:
        return _Axes()
    flat = [part for frame in frames for part in frame.sub_crs_list or [frame]]
    horizontal = next((part for part in flat if not part.is_vertical), None)
    if horizontal is None:
        return _Axes()
    vertical = next((part.axis_info[0].unit_conversion_factor for part in flat if part.is_vertical), 1.0)
    north_first = horizontal.axis_info[0].direction == "north" and "CRS84" not in srs
    code = codes[0] if len(codes) == 1 else horizontal.to_epsg()
    return _Axes(f"EPSG:{code}", horizontal, north_first, vertical)


def _covers(crs: CRS, x: float, y: float) -> bool:
    """Whether a place lies in the area that a frame is made for, or not far from it; x is east."""
    from pyproj import Transformer

    area = crs.area_of_use
    if area is None or area.west > area.east:
        return True
    bounds = area.bounds
    if crs.is_projected:
        bounds = Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True).transform_bounds(*bounds)
    elif abs(y) > 90.0:
        return False
    west, south, east, north = bounds
    return bool(
        abs(x - (west + east) / 2) <= 0.8 * (east - west) and abs(y - (south + north) / 2) <= 0.8 * (north - south)
    )


def _place(building: Element, file: _File) -> shapely.Point | None:
    """Where a building is that is set aside: the median of the positions that can be read."""
    lists = [_numbers(positions.text)[:3] for positions in building.iter("{*}posList", "{*}pos")]
    points = np.array([numbers for numbers in lists if len(numbers) == 3 and np.isfinite(numbers).all()])
    if len(points) == 0:
        return None
    x, y = np.median(points[:, :2], axis=0)
    return shapely.Point(y, x) if _axes(building, file, points).north_first else shapely.Point(x, y)
