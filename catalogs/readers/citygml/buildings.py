"""Buildings of CityGML 1.0, 2.0 and 3.0, read one at a time: shells with semantics and photo textures."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.features import BuildingModel, BuildingModels, Fault, Remark, make_unique_id
from catalogs.reader_errors import fault_reason
from catalogs.readers.axes import CoordinateAxes, resolve_crs_axes
from catalogs.readers.citygml.appearance import (
    CityGmlAppearance,
    add_material,
    add_parameterized_texture,
    appearance_remarks,
    face_texture,
    surface_colour,
)
from catalogs.readers.citygml.stream import gml_id, iterate_elements, local_name, parse_numbers
from catalogs.readers.citygml.surfaces import (
    CityGmlSurface,
    collect_building_units,
    polygon_rings,
    select_lod_surfaces,
)
from catalogs.readers.faces import PlanarFace, newell_normal, triangulate_faces
from catalogs.readers.material_colours import choose_finish
from catalogs.readers.settings import MODELS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import GeometryError, InputError
from facade_core.core.types import BuildingFinish

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

UNMATCHED_TEXTURES_REASON = (
    "files whose textures name no ring of a building (gml:id of its LinearRing), read without; export them again"
)
SURFACE_DATA = ("ParameterizedTexture", "X3DMaterial", "GeoreferencedTexture")
_METRE_NAMES = frozenset(("m", "metre", "meter", "metres", "meters"))

# rings by id, whether they are reversed, semantic
_SurfaceRings = tuple[dict[str, Float64Array], bool, str | None]


@dataclass(slots=True)
class _ReaderState:
    """State of the reader of a file: results of the first pass, updated by each building.

    axes: axes by the name of the coordinate system. passed_over: geometries that are not read by the name of their property.
    """

    path: Path
    appearance: CityGmlAppearance
    passed_over: Counter[str] = field(default_factory=Counter)
    frame: str | None = None
    axes: dict[str, CoordinateAxes] = field(default_factory=dict)
    ids: Counter[str] = field(default_factory=Counter)
    remarks: list[Remark] = field(default_factory=list)


def read_citygml(path: Path, lod: str | None = None) -> BuildingModels:
    """Read all buildings of a file (.gml, .xml, also gzipped) in document order.

    Building parts and outer installations are included.

    Parameters
    ----------
    path : file.
    lod : "1" to "4", else the nearest lower level of a building, else the nearest higher; None for the highest of each.

    Raises
    ------
    InputError
        Where the file is no well-formed CityGML.
    """
    if lod is not None and not re.fullmatch(r"[0-4](\.\d)?", lod):
        raise InputError(f"{path}: LoD {lod!r} is not known; give one of 1, 2, 3 and 4")
    reading = _scan_file(path)
    models: list[BuildingModel] = []
    faults: list[Fault] = []
    frame = None
    for number, building in enumerate(iterate_elements(path, ("Building",)), 1):
        id = make_unique_id(gml_id(building) or f"{path.stem}-{number}", reading.ids, reading.remarks, reading.path)
        try:
            axes, model = _read_building(building, id, None if lod is None else int(lod[0]), reading)
            frame = frame or axes
            if axes.horizontal_crs != frame.horizontal_crs:
                raise GeometryError(f"it is in {axes.crs}, the buildings before it in {frame.crs}; reproject it")
            models.append(model)
        except GeometryError as reason:
            faults.append(Fault(id, "building", f"{path.name}: {reason}", _approximate_location(building, reading)))
        except InputError:
            raise
        except Exception as error:  # the other buildings are read
            faults.append(Fault(id, "building", f"{path.name}: {fault_reason(error)}"))
    if models and reading.appearance.ring_textures and not reading.appearance.matched_count:
        reading.remarks.append(Remark(path.name, UNMATCHED_TEXTURES_REASON, None))
    reading.remarks += [
        Remark(f"{count} {name} of {path.name}", "geometries of buildings that are not read", None)
        for name, count in sorted(reading.passed_over.items())
    ]
    crs = frame.crs if frame else _building_axes(None, np.empty((0, 3)), reading).crs
    return BuildingModels(
        crs, tuple(models), tuple(reading.appearance.texture_indices), tuple(reading.remarks), tuple(faults)
    )


def _scan_file(path: Path) -> _ReaderState:
    """Read texture coordinates, which may follow the buildings, and the coordinate system, and check the root element."""
    reading = _ReaderState(path, CityGmlAppearance(path))
    known = False
    for element in iterate_elements(path, ("Envelope", *SURFACE_DATA, "CityModel", "Building")):
        match local_name(element):
            case "Envelope":
                if len(list(element.iterancestors())) == 2:
                    reading.frame = element.get("srsName")
            case "ParameterizedTexture":
                add_parameterized_texture(element, reading.appearance)
            case "X3DMaterial":
                add_material(element, reading.appearance)
            case "GeoreferencedTexture":
                reading.appearance.georeferenced_count += 1
            case "Building":
                known |= "citygml" in element.tag
            case _:
                known |= element.getparent() is None
    if not known:
        raise InputError(
            f"{path} is XML but not CityGML: it has no CityModel; give CityGML 1.0 to 3.0, or convert features with "
            "ogr2ogr OUT.gpkg IN"
        )
    reading.remarks += appearance_remarks(reading.appearance)
    return reading


def _read_building(
    building: Element, id: str, requested_lod: int | None, reading: _ReaderState
) -> tuple[CoordinateAxes, BuildingModel]:
    units, dangling, passed_over = collect_building_units(building)
    reading.passed_over.update(passed_over)
    if dangling:
        reading.remarks.append(Remark(id, "buildings with references that lead out of them, not followed", None))
    surfaces, lod = select_lod_surfaces(units, requested_lod)
    if requested_lod not in (None, lod):
        reading.remarks.append(Remark(id, f"buildings without LoD {requested_lod} read at LoD {lod}", None))
    outlines = [(polygon_rings(surface.polygon), surface.is_reversed, surface.semantic) for surface in surfaces]
    points = np.concatenate([np.empty((0, 3)), *(ring for rings, _, _ in outlines for ring in rings.values())])
    axes = _building_axes(building, points, reading)
    shell = triangulate_faces(_build_faces(outlines, axes, id, reading), axes.metres_per_unit)
    if shell is None:
        raise GeometryError("its surfaces enclose no area; repair or delete it")
    levels = _stated_number(building, "{*}storeysAboveGround")
    return axes, BuildingModel(
        id,
        shell,
        height=_stated_number(building, "{*}measuredHeight", "{*}Height", unit=axes.metres_per_height_unit),
        levels=levels if levels is not None and levels < MODELS.max_levels else None,
        name=building.findtext("{*}name", "").strip() or None,
        finish=_material_finish(surfaces, outlines, axes, id, reading),
    )


def _material_finish(
    surfaces: Sequence[CityGmlSurface],
    outlines: Sequence[_SurfaceRings],
    axes: CoordinateAxes,
    id: str,
    reading: _ReaderState,
) -> BuildingFinish:
    """Return the colours of materials that cover most of the walls and of the roof."""
    faces = []
    for surface, (rings, _, semantic) in zip(surfaces, outlines, strict=True):
        colour = surface_colour(surface.polygon, reading.appearance)
        if colour is None or not rings or semantic == "inside":
            continue
        ring = axes.to_east_north_up(next(iter(rings.values()))) * (*axes.metres_per_unit, 1.0)
        faces.append((semantic or "unknown", newell_normal(ring)[None], colour))
    return choose_finish(faces, id, reading.remarks)


def _build_faces(
    outlines: Sequence[_SurfaceRings], axes: CoordinateAxes, id: str, reading: _ReaderState
) -> list[PlanarFace]:
    """Return the faces in outward orientation, each once, with textures."""
    faces, misfit = [], False
    for named, turned, semantic in _outer_outlines(outlines, axes):
        rings = [axes.to_east_north_up(ring) for ring in named.values()]
        texture, uv = face_texture(named, reading.appearance)
        misfit |= texture is None
        step = -1 if turned else 1
        turned_uv = None if uv is None else [ring[::step] for ring in uv]
        index = -1 if texture is None else texture
        faces.append(PlanarFace([ring[::step] for ring in rings], semantic or "unknown", index, turned_uv))
    if misfit:
        reading.remarks.append(Remark(id, "buildings with texture coordinates that do not fit their rings", None))
    return faces


def _outer_outlines(outlines: Sequence[_SurfaceRings], axes: CoordinateAxes) -> Iterator[_SurfaceRings]:
    """Yield the surfaces that are not inside, each once: solids may repeat the surfaces of their boundary."""
    known = set()
    for outline in sorted(outlines, key=lambda outline: outline[2] is None):
        named, _, semantic = outline
        if not named:
            continue
        corners = (axes.to_east_north_up(next(iter(named.values()))) * (*axes.metres_per_unit, 1.0)).round(3) + 0.0
        key = corners[np.lexsort(corners.T)].tobytes()
        if semantic != "inside" and not (semantic is None and key in known):
            yield outline
        known.add(key)


def _stated_number(building: Element, *tags: str, unit: float = 1.0) -> float | None:
    """Return the largest positive number of the building, else of its parts; None without one in metres.

    unit: metres per unit of a number without a unit of measure.
    """
    own: list[float] = []
    parts: list[float] = []
    for element in building.iter(*tags):
        value = element if len(element) == 0 else element.find("{*}value")
        if value is None:
            continue
        numbers = parse_numbers(value.text)
        named = re.split("[#:/]", value.get("uom", ""))[-1].lower()
        if len(numbers) == 1 and 0 < numbers[0] < math.inf and named in {"", *_METRE_NAMES}:
            owner = next(element.iterancestors("{*}Building", "{*}BuildingPart"), None)
            (own if owner is building else parts).append(numbers[0] * (1.0 if named else unit))
    return max(own or parts, default=None)


def _building_axes(building: Element | None, points: Float64Array, reading: _ReaderState) -> CoordinateAxes:
    """Return the axes of a building; the first building of a coordinate system decides on their order."""
    own = "" if building is None else building.xpath("string((.//@srsName)[1])")
    reading.frame = reading.frame or own
    name = own or reading.frame or ""
    if name not in reading.axes:
        if len(points) == 0:
            return resolve_crs_axes(name, None, reading.path)[0]
        first, second = np.median(points[:, :2], axis=0).tolist()
        reading.axes[name], remark = resolve_crs_axes(name, (first, second), reading.path)
        if remark:
            reading.remarks.append(Remark(f"{name} of {reading.path.name}", remark, None))
    return reading.axes[name]


def _approximate_location(building: Element, reading: _ReaderState) -> shapely.Point | None:
    """Return the median of the readable positions of a building."""
    lists = [parse_numbers(positions.text)[:3] for positions in building.iter("{*}posList", "{*}pos")]
    points = np.array([numbers for numbers in lists if len(numbers) == 3 and np.isfinite(numbers).all()])
    if len(points) == 0:
        return None
    middle = np.median(points, axis=0)[None]
    return shapely.Point(_building_axes(building, points, reading).to_east_north_up(middle)[0, :2])
