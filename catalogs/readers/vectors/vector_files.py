"""Footprints, centrelines and ground features of vector files.

GeoPackage, GeoJSON, GeoParquet, Shapefile and FlatGeobuf.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeGuard

import numpy as np
import shapely
from pyproj import CRS
from shapely.geometry.base import BaseGeometry

from catalogs.crs import LONLAT, coordinate_transform
from catalogs.features import CentrelinesAndGround, Fault, Footprints, GroundFeature, Remark
from catalogs.reader_errors import fault_reason
from catalogs.readers.settings import LIMITS
from catalogs.readers.source_keys import NO_SOURCE_KEYS, SourceKeys
from catalogs.readers.vectors.centrelines import build_centrelines, finite_points
from catalogs.readers.vectors.column_names import CLASS_COLUMNS
from catalogs.readers.vectors.ground_classes import normalize_word, osm_ground_tags
from catalogs.readers.vectors.layers import LayerFeatures, read_layer_features, read_matching_layers
from catalogs.readers.vectors.lengths import parse_length
from catalogs.readers.vectors.osm import (
    is_building_part,
    is_street,
    parse_footprint,
    split_osmnx_values,
)
from catalogs.readers.vectors.solids import build_solid, is_open_walls
from facade_core.core.errors import InputError

_BUILDING_LAYERS = ("building", "pand", "footprint", "gebaeude", "gebäude", "batiment", "multipolygon")
# Columns of ground layers, and tags of ground features.
_GROUND_COLUMNS = frozenset(
    ("highway", "railway", "waterway", "place", "man_made", "area_highway", "barrier", *CLASS_COLUMNS)
)
_GROUND_TAGS = frozenset(
    (
        "highway", "railway", "natural", "leisure", "landuse", "waterway", "place", "amenity", "area:highway", "man_made",
        "barrier", "power",
    )
)  # fmt: skip
_OPEN_WALLS_REASON = (
    "buildings of walls without floor and roof set aside; export closed solids, or outlines with heights"
)
# Classes of lines that are no roads.
_OTHER_LINE_WORDS = frozenset(
    (
        "rail", "railway", "subway", "metro", "monorail", "funicular", "standard_gauge", "narrow_gauge", "water", "waterway",
        "ferry", "power", "power_line", "pipeline", "contour", "boundary", "fence", "wall",
    )
)  # fmt: skip
_STREET_LAYERS = ("street", "road", "highway", "centreline", "centerline", "strasse", "edges", "lines")


def read_vector_footprints(path: Path, lod: str | None = None, keys: SourceKeys = NO_SOURCE_KEYS) -> Footprints:
    """Read building outlines with height, floors, name and roof by columns of any known name.

    A height reaches to the ridge, as in OpenStreetMap: a stated roof is subtracted. The z of an outline is the height of the
    ground where the whole layer is 3D. A geometry with walls is a solid and keeps its faces. With OpenStreetMap's column
    `building` only marked outlines are read. The crs is None where the file states none, or degrees that its coordinates
    cannot be.

    Parameters
    ----------
    path : file.
    lod : ignored, since outlines have no level of detail.
    keys : what the block file states of the file.

    Raises
    ------
    InputError
        Where the file cannot be read or holds no outlines.
    """
    features = read_layer_features(path, "outlines", _BUILDING_LAYERS, keys)
    remarks = list(features.remarks)
    faults = []
    items = []
    degrees = features.crs == LONLAT
    bases = _base_heights(features)
    from_osm = any(tags.get("building") == "yes" for tags in features.tags)
    for id, geometry, tags, base in zip(features.ids, features.geometries, features.tags, bases, strict=True):
        if not _is_drawn(geometry):
            faults.append(Fault(id, "building", f"footprint {id} has no geometry, or a broken one; draw or remove it"))
            continue
        if not _is_building(tags, from_osm):
            remarks.append(Remark(id, "outlines that are not tagged as buildings set aside", geometry))
            continue
        if not (np.abs(shapely.get_coordinates(geometry)) < LIMITS.max_coordinate).all():
            reason = (
                f"footprint {id} has a coordinate that is no finite number, or absurdly far away; mend or remove it"
            )
            faults.append(Fault(id, "building", reason, finite_points(geometry)))
            continue
        if is_open_walls(geometry):
            remarks.append(Remark(id, _OPEN_WALLS_REASON, geometry))
            continue
        try:
            footprint = parse_footprint(id, _plan_outline(geometry), tags, remarks, is_lonlat=degrees)
            shell = build_solid(geometry, is_lonlat=degrees)
        except Exception as error:  # an error affects this footprint only
            faults.append(Fault(id, "building", f"footprint {id}: {fault_reason(error)}", finite_points(geometry)))
            continue
        if footprint is not None:
            if id in features.id_remarks:
                remarks.append(Remark(id, f"buildings of {path.name} {features.id_remarks[id]}", geometry))
            items.append(replace(footprint, base=base, shell=shell))
    return Footprints(features.crs, tuple(items), tuple(remarks), tuple(faults))


def _is_drawn(geometry: BaseGeometry | None) -> TypeGuard[BaseGeometry]:
    return geometry is not None and not geometry.is_empty


def _is_building(tags: Mapping[str, str], from_osm: bool) -> bool:
    """Return False for an outline that is tagged as none, or has no tag in a layer of OpenStreetMap's buildings."""
    return tags.get("building") != "no" and (not from_osm or "building" in tags or is_building_part(tags))


def read_vector_centrelines(path: Path, keys: SourceKeys = NO_SOURCE_KEYS) -> CentrelinesAndGround:
    """Read street centrelines and ground features.

    With OpenStreetMap's column `highway` only streets of catalogs.readers.vectors.osm.is_street are read: no footways, service
    roads or tunnels. The same holds for classes of other maps that are known. Of OpenDRIVE only roads outside junctions are
    read. Ground features are all lines and the features of other ground layers.

    Raises
    ------
    InputError
        Where the file cannot be read or holds no lines.
    """
    features = read_layer_features(path, "lines", _STREET_LAYERS, keys)
    opendrive = any(tags.get("junction") == "-1" for tags in features.tags)
    from_osm = any("highway" in tags for tags in features.tags)

    def streets() -> Iterator[tuple[str, BaseGeometry | None, str | None, Mapping[str, str]]]:
        for id, geometry, stated in zip(features.ids, features.geometries, features.tags, strict=True):
            if opendrive and stated.get("junction") != "-1":
                continue
            tags = stated if from_osm else osm_ground_tags(stated)
            if (from_osm and "highway" not in tags) or not _is_viewed_street(geometry, tags, stated):
                continue
            plain = {key: split_osmnx_values(value)[0] for key, value in tags.items() if key != "class"}
            yield id, geometry, plain.get("name"), plain

    found = build_centrelines(features.crs, streets())
    ground = [
        feature
        for feature, tags in zip(_ground_features(features, ""), features.tags, strict=True)
        if feature is not None and not (opendrive and tags.get("junction") != "-1")
    ]
    if features.other_layers:
        others = read_matching_layers(
            path, lambda layer, columns: layer != features.layer and _is_ground_layer(layer, columns), keys
        )
        ground += _project_ground_features(others, features.crs)
    remarks = (*features.remarks, *_id_remarks(found, features, path), *_width_remarks(features))
    return replace(found, remarks=remarks, ground=tuple(ground))


def _is_viewed_street(geometry: BaseGeometry | None, tags: Mapping[str, str], stated: Mapping[str, str]) -> bool:
    """Return True for a line of a street; lines without a geometry are reported later."""
    if "railway" in tags:
        return False
    if "highway" in tags:
        return not _is_drawn(geometry) or is_street(geometry, tags)
    return tags.get("tunnel") != "yes" and not _is_no_road(stated)


def _width_remarks(features: LayerFeatures) -> Iterator[Remark]:
    """Yield remarks on widths of streets that are no length."""
    for id, geometry, tags in zip(features.ids, features.geometries, features.tags, strict=True):
        text = split_osmnx_values(tags.get("width", "0"))[0]
        if parse_length(text) is None:
            yield Remark(f"{id} ({text[:40]})", "widths of streets not understood and ignored", geometry)


def _is_no_road(tags: Mapping[str, str]) -> bool:
    """Return True for a line of another class than roads, such as a railway or ferry."""
    return not _OTHER_LINE_WORDS.isdisjoint(map(normalize_word, tags.get("class", "").split("\n")))


def read_vector_ground(path: Path, keys: SourceKeys = NO_SOURCE_KEYS) -> CentrelinesAndGround:
    """Read the ground features of all layers: areas, ways and crossings, without viewpoints.

    Raises
    ------
    InputError
        Where the file cannot be read, or holds no ground features.
    """
    layers = read_matching_layers(path, _is_ground_layer, keys)
    frame = next((layer.crs for layer in layers if layer.crs is not None), None)
    if not (ground := _project_ground_features(layers, frame)):
        raise InputError(f"{path} holds nothing of the ground; give a file whose columns state what lies where")
    remarks = tuple(remark for layer in layers for remark in layer.remarks)
    return CentrelinesAndGround(frame, (), remarks=remarks, ground=tuple(ground))


def _is_ground_layer(layer: str, columns: Collection[str]) -> bool:
    """Return True where a layer may hold ground features, by its name and columns."""
    return not _GROUND_COLUMNS.isdisjoint(columns) or bool(
        osm_ground_tags({}, layer, is_area=True) or osm_ground_tags({}, layer)
    )


def _project_ground_features(layers: Sequence[LayerFeatures], frame: str | None) -> list[GroundFeature]:
    found = []
    for layer in layers:
        stated = _ground_features(layer, layer.layer)
        features = [one for one in stated if one is not None and not _GROUND_TAGS.isdisjoint(one.tags)]
        if layer.crs not in (frame, None) and frame is not None:
            moved = coordinate_transform(layer.crs, CRS(frame))
            features = [
                replace(one, geometry=shapely.transform(one.geometry, moved, interleaved=False)) for one in features
            ]
        found += features
    return found


def _ground_features(features: LayerFeatures, layer: str) -> Iterator[GroundFeature | None]:
    """Yield the ground feature of each row, None without a geometry.

    The name of the layer classifies features without a class.
    """
    for id, geometry, tags in zip(features.ids, features.geometries, features.tags, strict=True):
        if geometry is None:
            yield None
            continue
        plain = {key: value if key == "class" else split_osmnx_values(value)[0] for key, value in tags.items()}
        yield GroundFeature(id, geometry, osm_ground_tags(plain, layer, is_area="Polygon" in geometry.geom_type))


def _id_remarks(found: CentrelinesAndGround, features: LayerFeatures, path: Path) -> Iterator[Remark]:
    """Yield remarks on lines with changed ids; lines of one id and name are pieces of one street."""
    names = {id: tags.get("name") for id, tags in zip(features.ids, features.tags, strict=True)}
    for item in found.items:
        id = item.id if item.id in names else item.id.rpartition("-")[0]  # a part of a line is id-0, id-1, ...
        if id not in features.id_remarks:
            continue
        if names[id] is None or names[id] != names.get(id.rpartition("-")[0]):
            yield Remark(item.id, f"streets of {path.name} {features.id_remarks[id]}", None)


def _base_heights(features: LayerFeatures) -> list[float | None]:
    """Return the stated ground of each outline, else its lowest z; not z where one has none or all are zero."""
    drawn = list(filter(_is_drawn, features.geometries))
    lowest = [_lowest_z(geometry) for geometry in features.geometries]
    has_z = bool(drawn) and bool(shapely.has_z(drawn).all()) and any(lowest)
    stated = [tags.get("ground") for tags in features.tags]
    return [float(ground) if ground else z if has_z else None for ground, z in zip(stated, lowest, strict=True)]


def _lowest_z(geometry: BaseGeometry | None) -> float | None:
    """Return the lowest z; None where a corner has none, which may be the lowest."""
    parts = shapely.get_parts(geometry) if geometry is not None else np.empty(0, object)
    if (areas := [part for part in parts if part.geom_type in ("Polygon", "MultiPolygon")]) and len(areas) < len(parts):
        parts = np.array(areas, object)  # other parts of a collection are no outline
    heights = shapely.get_coordinates(parts, include_z=True)[:, 2]
    return float(heights.min()) if len(heights) and np.isfinite(heights).all() else None


def _plan_outline(geometry: BaseGeometry) -> BaseGeometry:
    """Return a geometry in plan: of a collection the polygons, of faces of a solid the covered area."""
    flat = shapely.force_2d(geometry)
    if geometry.geom_type == "GeometryCollection":
        polygons = [part for part in shapely.get_parts(flat) if "Polygon" in part.geom_type]
        return shapely.multipolygons(shapely.get_parts(polygons)) if polygons else flat
    if geometry.geom_type == "MultiPolygon" and shapely.has_z(geometry):
        parts = shapely.get_parts(flat)
        upright = parts[shapely.area(parts) > 0]
        if len(upright) < len(parts):
            return shapely.union_all(shapely.make_valid(upright))
    return flat
