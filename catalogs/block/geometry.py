"""Geometry that a block file names: frame, buildings, streets and ground."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from catalogs.block.block_file import BlockFileErrorContext
from catalogs.block.frame import choose_frame
from catalogs.block.geometry_sources import (
    NamedFiles,
    read_building_sources,
    read_ground_sources,
    read_named_centrelines,
)
from catalogs.block.ground import build_block_ground
from catalogs.block.keys import BlockFileSettings
from catalogs.block.likely_shops import likely_shop_positions
from catalogs.block.passages import open_passages, passage_ids
from catalogs.block.streets import build_block_streets, clip_centrelines
from catalogs.buildings.assembly import BlockBuildings, assemble_buildings
from catalogs.buildings.axis_mistakes import SWAPPED_AXES_NOTE, note_local_coordinates, swapped_places
from catalogs.buildings.extents import Bounds, check_area_span, locate_boxes, reject_stray_buildings
from catalogs.buildings.surface_heights import measure_assumed_heights
from catalogs.buildings.surroundings import find_neighbours, select_objects
from catalogs.crs import LONLAT, bounds_to_lonlat, coordinate_transform, have_heights_above_sea
from catalogs.features import CentrelinesAndGround, Fault, Remark, feature_ids_by_reason, format_reason_notes
from catalogs.printable_text import format_unit_reason
from catalogs.readers.vectors.points_of_interest import read_shops_and_entrances
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import BlockFileError
from facade_core.core.types import Building, MappedGround, Street

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

# Margin around the buildings for terrain; panoramas outside belong to another site.
SURROUNDINGS_MARGIN_M = 200.0
# Margin around the area for ground features: drawing inside the area depends on no more.
GROUND_MARGIN_M = 120.0
# Distance of streets from the buildings: beyond the surroundings, four times the largest visibility range.
MAX_STREET_DISTANCE_M = 1000.0
# Metres from the buildings within which notes name features of the streets' source.
NOTED_MARGIN_M = 40.0


@dataclass(frozen=True)
class BlockGeometry:
    """Geometry of a block.

    Attributes
    ----------
    crs : metric frame.
    extent : (xmin, ymin, xmax, ymax) around the buildings and their surroundings.
    notes : remarks for the user.
    faults : broken units.
    shops : (x, y) of mapped shops and of likely ones; None without a map.
    entrances : (x, y) of mapped entrances.
    has_heights_above_sea : whether the CRSs of all buildings say so.
    neighbours : buildings around the block's area, for views.
    """

    crs: CRS
    buildings: BlockBuildings
    streets: tuple[Street, ...]
    ground: MappedGround
    extent: Bounds
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]
    shops: tuple[tuple[float, float], ...] | None = None
    entrances: tuple[tuple[float, float], ...] = ()
    has_heights_above_sea: bool = False
    neighbours: tuple[Building, ...] = ()


class _BlockArea(NamedTuple):
    """Place of a block: metric frame, its area as a polygon in it if stated, and the extent of its surroundings."""

    frame: CRS
    area: Polygon | None
    extent: Bounds


def read_geometry(keys: BlockFileSettings, files: NamedFiles, file: BlockFileErrorContext) -> BlockGeometry:
    """Read the buildings, streets and ground that a block file names.

    Parameters
    ----------
    keys : checked keys of the block file.
    files : dotted key -> paths.
    file : block file, for messages.

    Raises
    ------
    BlockFileError : no usable building or street is left.
    """
    sources = read_building_sources(keys, files, file)
    centrelines = read_named_centrelines(keys, files, sources, file) if keys.streets else None
    if keys.area:
        file.call_reader("area", check_area_span, keys.area)
    sources, bounds = file.call_reader("buildings.path", reject_stray_buildings, sources, keys.area, centrelines)
    if not any(source.items for source in sources):
        raise _empty_error(
            "buildings", keys, files, bounds, [fault for source in sources for fault in source.faults], file
        )
    frame, area, notes = choose_frame(keys, sources, bounds, file)
    above_sea = have_heights_above_sea(source.crs for source in sources if source.items and source.crs)
    built = assemble_buildings(sources, frame, area=area, floor_height=keys.storey)
    if not built.items:
        raise _empty_error("buildings", keys, files, bounds, built.faults, file, built.notes)
    neighbours = () if keys.props == "off" else find_neighbours(sources, frame, area, built.items, keys.storey)
    extent = buildings_extent_with_margin(built.items)
    notes += note_local_coordinates(frame, extent)
    if keys.buildings.heights is not None:
        built, measured = _measure_heights(built, files, frame, extent, file)
        notes += measured
    shops, entrances = _shops_and_entrances(files, frame, extent)
    around = shapely.box(*extent) if area is None else area.buffer(GROUND_MARGIN_M, join_style="mitre")
    lying = read_ground_sources(keys, files, sources, file)
    notes += format_reason_notes(feature_ids_by_reason(remark for one in lying for remark in one.remarks))
    if centrelines is None:
        ground = file.call_reader("ground.path", build_block_ground, lying, frame, around, area)
        ground = select_objects(ground, keys.props)
        opened = open_passages(built.items, CentrelinesAndGround(None, ()), lying, frame)
        built, notes = replace(built, items=opened.buildings), notes + format_reason_notes(opened.reasons)
        return BlockGeometry(
            frame, built, (), ground, extent, notes, built.faults, shops, entrances, above_sea, neighbours
        )
    ground = file.call_reader("streets.path", build_block_ground, [centrelines, *lying], frame, around, area)
    ground = select_objects(ground, keys.props)
    if shops is not None:
        passages = passage_ids([centrelines, *lying])
        roads = [way for way in ground.ways if way.id not in passages]
        shops += tuple(likely_shop_positions(built.items, roads, shops))
    buildings, streets, cut, broken = _read_streets(
        keys, files, [centrelines, *lying], built.items, _BlockArea(frame, area, extent), file
    )
    built = replace(built, items=buildings)
    faults = (*built.faults, *broken)
    return BlockGeometry(
        frame, built, streets, ground, extent, notes + cut, faults, shops, entrances, above_sea, neighbours
    )


def _measure_heights(
    built: BlockBuildings, files: NamedFiles, frame: CRS, extent: Bounds, file: BlockFileErrorContext
) -> tuple[BlockBuildings, tuple[str, ...]]:
    """Return the buildings with heights measured on the raster that the block file names, and notes."""
    key = "buildings.heights.path"
    if "terrain.path" not in files:
        raise file.make_error(key, "the ground below is unknown; give terrain: {path: ...} too")
    from catalogs.readers.pictures.elevation import read_elevation

    surface, ground = (
        file.call_reader(name, read_elevation, files[name][0], frame, extent) for name in (key, "terrain.path")
    )
    items, notes = measure_assumed_heights(built.items, surface, ground, files[key][0].name)
    return replace(built, items=items), notes


def _read_streets(
    keys: BlockFileSettings,
    files: NamedFiles,
    sources: Sequence[CentrelinesAndGround],
    buildings: tuple[Building, ...],
    place: _BlockArea,
    file: BlockFileErrorContext,
) -> tuple[tuple[Building, ...], tuple[Street, ...], tuple[str, ...], tuple[Fault, ...]]:
    """Return the buildings with passages, the streets of the first source, notes about them, and broken streets."""
    frame, area, extent = place
    centrelines = sources[0]
    around = shapely.box(*extent).buffer(MAX_STREET_DISTANCE_M - SURROUNDINGS_MARGIN_M, join_style="mitre")
    near, cut = file.call_reader("streets.path", clip_centrelines, centrelines, frame, around, area)
    buildings, open_streets, passages = open_passages(buildings, near, sources, frame)
    streets, faults = build_block_streets(open_streets, frame, area=area)
    if area is None and not any(street.line.intersects(shapely.box(*extent)) for street in streets):
        lonlat = file.call_reader("streets.path", _lonlat_bounds, centrelines)
        _check_swapped_axes(lonlat, bounds_to_lonlat(frame.to_wkt(), extent), files, file)
    if not streets and not cut:
        far = note_local_coordinates(frame, extent)
        raise _empty_error("streets", keys, files, _lonlat_bounds(centrelines), faults, file, far)
    if not any(street.line.intersects(shapely.box(*extent)) for street in streets):
        span = ", ".join(f"{value:.4f}" for value in _lonlat_bounds(centrelines) or ())
        built_span = ", ".join(f"{value:.4f}" for value in bounds_to_lonlat(frame.to_wkt(), extent))
        raise file.make_error(
            "streets.path",
            f"no street comes within {SURROUNDINGS_MARGIN_M:g} m of a building (streets span [{span}], buildings "
            f"[{built_span}]); check streets.crs and buildings.crs, or leave streets out",
        )
    outside = {piece.id for piece in centrelines.items} - {piece.id for piece in near.items}
    to_frame = coordinate_transform(near.crs or LONLAT, frame)

    noted = shapely.box(*extent).buffer(NOTED_MARGIN_M - SURROUNDINGS_MARGIN_M, join_style="mitre")

    def is_near(remark: Remark) -> bool:
        if remark.geometry is None:
            return remark.id not in outside
        return bool(shapely.transform(remark.geometry, to_frame, interleaved=False).intersects(noted))

    reasons = feature_ids_by_reason(filter(is_near, near.remarks))
    reasons |= {reason: list(ids) for reason, ids in passages.items()}
    reasons[f"streets cut off over {MAX_STREET_DISTANCE_M:g} m from the buildings"] = list(cut)
    return buildings, streets, format_reason_notes(reasons), faults


def _check_swapped_axes(
    streets: Bounds | None, buildings: Bounds, files: NamedFiles, file: BlockFileErrorContext
) -> None:
    """Raise BlockFileError where streets and buildings meet once longitude and latitude of one are swapped."""
    if streets is not None and swapped_places(np.array(streets), np.array(buildings)):
        places = [f"{(box[0] + box[2]) / 2:.4f}, {(box[1] + box[3]) / 2:.4f}" for box in (streets, buildings)]
        raise file.make_error(
            "streets.path",
            f"longitude and latitude look swapped in one of two files: {files['streets.path'][0]} lies at {places[0]}, "
            f"{files['buildings.path'][0]} at {places[1]}; write longitude first in both",
        )


def _shops_and_entrances(
    files: NamedFiles, frame: CRS, extent: Bounds
) -> tuple[tuple[tuple[float, float], ...] | None, tuple[tuple[float, float], ...]]:
    """Return mapped shops and entrances as (x, y) in the frame; shops are None if no source is a map."""
    maps = [path for path in files["buildings.path"] if path.suffix == ".pbf"]
    found = [places for places in map(read_shops_and_entrances, maps) if places is not None]
    if not found:
        return None, ()

    def select_within_extent(places: list[Float64Array]) -> tuple[tuple[float, float], ...]:
        there = np.column_stack(coordinate_transform("EPSG:4326", frame)(*np.concatenate(places).T))
        kept = (there >= extent[:2]).all(axis=1) & (there <= extent[2:]).all(axis=1)
        return tuple((x, y) for x, y in there[kept].tolist())

    return select_within_extent([one.shops for one in found]), select_within_extent([one.entrances for one in found])


def _lonlat_bounds(centrelines: CentrelinesAndGround) -> Bounds | None:
    assert centrelines.crs is not None
    places = locate_boxes(centrelines.crs, centrelines.bounding_boxes())
    return places.lonlat_bounds(places.location_mask) if places.location_mask.any() else None


def _empty_error(
    key: str,
    keys: BlockFileSettings,
    files: NamedFiles,
    bounds: Bounds | None,
    faults: Sequence[Fault],
    file: BlockFileErrorContext,
    notes: Sequence[str] = (),
) -> BlockFileError:
    """Return the error for a block without usable buildings or streets; `notes` name the reason where known."""
    path = ", ".join(map(str, files[f"{key}.path"]))
    if faults:
        more = f" and {len(faults) - 1} more" if len(faults) > 1 else ""
        return file.make_error(
            f"{key}.path",
            f"{path} has no {key} that can be used: {format_unit_reason(faults[0].id, faults[0].reason)}{more}",
        )
    if keys.area:
        named = " of these names" if key == "streets" and keys.streets and keys.streets.names else ""
        span = f"; they span [{', '.join(f'{value:.4f}' for value in bounds)}]" if bounds else ""
        south, west, north, east = keys.area
        remedy = "choose an area within it" if bounds else "choose another area"
        if bounds and west <= bounds[2] and east >= bounds[0] and south <= bounds[3] and north >= bounds[1]:
            remedy = f"{SWAPPED_AXES_NOTE}: write {[west, south, east, north]}"
        elif key == "streets" and notes:
            remedy = notes[0]
        return file.make_error("area", f"{path} has no {key}{named} inside area {keys.area}{span}; {remedy}")
    reason = f" ({notes[0]})" if notes else ""
    return file.make_error(f"{key}.path", f"{path} has no {key} that can be used{reason}; give a file that does")


def buildings_extent_with_margin(buildings: Iterable[Building]) -> Bounds:
    """Return (xmin, ymin, xmax, ymax) of the buildings, widened by SURROUNDINGS_MARGIN_M on each side."""
    xmin, ymin, xmax, ymax = shapely.total_bounds([building.footprint for building in buildings]).tolist()
    return (
        xmin - SURROUNDINGS_MARGIN_M,
        ymin - SURROUNDINGS_MARGIN_M,
        xmax + SURROUNDINGS_MARGIN_M,
        ymax + SURROUNDINGS_MARGIN_M,
    )
