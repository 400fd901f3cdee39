"""Geometry that a block file names: frame, buildings, streets and ground."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from catalogs.block.block_file import BlockFileErrorContext
from catalogs.block.ground import build_block_ground
from catalogs.block.keys import BlockFileSettings, BuildingsSection, GroundSection, StreetsSection
from catalogs.block.likely_shops import likely_shop_positions
from catalogs.block.passages import open_passages, passage_ids
from catalogs.block.streets import build_block_streets, clip_centrelines
from catalogs.buildings.assembly import BlockBuildings, assemble_buildings
from catalogs.buildings.axis_mistakes import (
    has_swapped_corners,
    looks_like_degrees,
    note_local_coordinates,
    swapped_places,
)
from catalogs.buildings.extents import Bounds, BuildingSource, check_area_span, locate_boxes, reject_stray_buildings
from catalogs.buildings.surface_heights import measure_assumed_heights
from catalogs.crs import (
    LONLAT,
    bounds_to_lonlat,
    check_block_crs,
    choose_block_crs,
    coordinate_transform,
    is_same_frame,
    note_outside_area_of_use,
    parse_crs,
    parse_metric_crs,
    project_lonlat_box,
)
from catalogs.features import (
    CentrelinesAndGround,
    Fault,
    Footprints,
    Remark,
    feature_ids_by_reason,
    format_reason_notes,
)
from catalogs.printable_text import format_unit_reason
from catalogs.readers.formats import read_buildings, read_centrelines, read_ground_features
from catalogs.readers.source_keys import UP_AXIS_SUFFIXES, SourceKeys
from catalogs.readers.vectors.points_of_interest import read_shops_and_entrances
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import BlockFileError, InputError
from facade_core.core.types import Building, MappedGround, Street

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

NamedFiles = Mapping[str, tuple[Path, ...]]
# Margin around the buildings for terrain; panoramas outside belong to another site.
SURROUNDINGS_MARGIN_M = 200.0
# Margin around the area for ground features: drawing inside the area depends on no more.
GROUND_MARGIN_M = 120.0
# Distance of streets from the buildings: beyond the surroundings, four times the largest visibility range.
MAX_STREET_DISTANCE_M = 1000.0
_UNSTATED_FRAME_REASON = (
    "files of buildings that state no frame taken in the block's crs; give buildings.crs where it is another"
)
# Remedy if the area holds buildings after swapping longitudes and latitudes.
SWAPPED_AXES_NOTE = "latitudes come first there"


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
    sources = _read_building_sources(keys, files, file)
    centrelines = _read_centrelines(keys, files, sources, file) if keys.streets else None
    if keys.area:
        file.call_reader("area", check_area_span, keys.area)
    sources, bounds = file.call_reader("buildings.path", reject_stray_buildings, sources, keys.area, centrelines)
    if not any(source.items for source in sources):
        raise _empty_error(
            "buildings", keys, files, bounds, [fault for source in sources for fault in source.faults], file
        )
    frame, area, notes = _choose_frame(keys, sources, bounds, file)
    built = assemble_buildings(sources, frame, area=area, floor_height=keys.storey)
    if not built.items:
        raise _empty_error("buildings", keys, files, bounds, built.faults, file, built.notes)
    extent = buildings_extent_with_margin(built.items)
    notes += note_local_coordinates(frame, extent)
    if keys.buildings.heights is not None:
        built, measured = _measure_heights(built, files, frame, extent, file)
        notes += measured
    shops, entrances = _shops_and_entrances(files, frame, extent)
    around = shapely.box(*extent) if area is None else area.buffer(GROUND_MARGIN_M, join_style="mitre")
    lying = _read_ground_sources(keys, files, sources, file)
    notes += format_reason_notes(feature_ids_by_reason(remark for one in lying for remark in one.remarks))
    if centrelines is None:
        ground = file.call_reader("ground.path", build_block_ground, lying, frame, around, area)
        opened = open_passages(built.items, CentrelinesAndGround(None, ()), lying, frame)
        built, notes = replace(built, items=opened.buildings), notes + format_reason_notes(opened.reasons)
        return BlockGeometry(frame, built, (), ground, extent, notes, built.faults, shops, entrances)
    ground = file.call_reader("streets.path", build_block_ground, [centrelines, *lying], frame, around, area)
    if shops is not None:
        passages = passage_ids([centrelines, *lying])
        roads = [way for way in ground.ways if way.id not in passages]
        shops += tuple(likely_shop_positions(built.items, roads, shops))
    buildings, streets, cut, broken = _read_streets(
        keys, files, [centrelines, *lying], built.items, _BlockArea(frame, area, extent), file
    )
    built = replace(built, items=buildings)
    faults = (*built.faults, *broken)
    return BlockGeometry(frame, built, streets, ground, extent, notes + cut, faults, shops, entrances)


def _read_building_sources(
    keys: BlockFileSettings, files: NamedFiles, file: BlockFileErrorContext
) -> list[BuildingSource]:
    """Read each building file, with the frame and offset that the block file states."""
    sources: list[BuildingSource] = []
    given = _source_keys("buildings", keys.buildings, files, file)
    for path in files["buildings.path"]:
        source = file.call_reader("buildings.path", read_buildings, path, keys.buildings.lod, given)
        is_unstated = source.crs is None and keys.buildings.crs is None
        crs = keys.buildings.crs or source.crs or keys.crs
        if crs is None:
            remedy = "write crs: EPSG:..."
            if looks_like_degrees(source.bounding_boxes()):
                remedy = "its coordinates look like degrees: write buildings: {path: ..., crs: EPSG:4326}"
            raise file.make_error("buildings.crs", f"missing, and {path} states no frame; {remedy}")
        file.call_reader("buildings.crs", parse_crs, crs)
        remarks = (*source.remarks, *_overruled_frame(path, source.crs, "buildings", keys.buildings.crs))
        faults = tuple(_name_file_in_fault(fault, path) for fault in source.faults)
        source = replace(source, crs=crs, faults=faults, remarks=remarks)
        if is_unstated:
            source = replace(source, remarks=(*source.remarks, Remark(path.name, _UNSTATED_FRAME_REASON, None)))
        sources.append(source.translate(keys.buildings.offset) if keys.buildings.offset else source)
    if not any(source.items or source.faults for source in sources):
        names = ", ".join(map(str, files["buildings.path"]))
        raise file.make_error("buildings.path", f"{names} holds no buildings; give a file that does")
    return sources


def _overruled_frame(path: Path, stated: str | None, section: str, given: str | None) -> tuple[Remark, ...]:
    """Return a remark if the block file gives another frame than a file states; none if the stated one is unknown."""
    try:
        if stated is None or given is None or is_same_frame(stated, given):
            return ()
    except InputError:  # the reason to give another
        return ()
    reason = (
        f"files that state {stated} taken in {given}, as {section}.crs says; remove that unless the files are wrong"
    )
    return (Remark(path.name, reason, None),)


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


def _source_keys(
    key: str, section: BuildingsSection | StreetsSection | GroundSection, files: NamedFiles, file: BlockFileErrorContext
) -> SourceKeys:
    """Return what a section of the block file states of its files."""
    if section.crs is not None:
        file.call_reader(f"{key}.crs", parse_crs, section.crs)
    paths = files[f"{key}.path"]
    if section.encoding is not None and not any(path.suffix.lower() == ".shp" for path in paths):
        raise file.make_error(
            f"{key}.encoding", f"is the code page of a Shapefile, which {paths[0].name} is not; remove it"
        )
    up = section.up if isinstance(section, BuildingsSection) else None
    if up is not None and not any(path.suffix.lower() in UP_AXIS_SUFFIXES for path in paths):
        raise file.make_error(f"{key}.up", f"is of OBJ and PLY files, which {paths[0].name} is not; remove it")
    return SourceKeys(section.crs, section.encoding, up)


def _read_centrelines(
    keys: BlockFileSettings, files: NamedFiles, sources: Sequence[BuildingSource], file: BlockFileErrorContext
) -> CentrelinesAndGround:
    assert keys.streets is not None
    given = _source_keys("streets", keys.streets, files, file)
    source = file.call_reader("streets.path", read_centrelines, files["streets.path"][0], given)
    path, crs = files["streets.path"][0], keys.streets.crs or source.crs or keys.crs or sources[0].crs
    faults = tuple(_name_file_in_fault(fault, path) for fault in source.faults)
    remarks = (*source.remarks, *_overruled_frame(path, source.crs, "streets", keys.streets.crs))
    source = replace(source, crs=crs, faults=faults, remarks=remarks)
    file.call_reader("streets.crs", parse_crs, source.crs)
    if not source.items and not source.faults:
        raise file.make_error("streets.path", f"{files['streets.path'][0]} holds no streets; give a file that does")
    return _select_named_streets(source, keys.streets.names, file) if keys.streets.names else source


def _read_ground_sources(
    keys: BlockFileSettings, files: NamedFiles, sources: Sequence[BuildingSource], file: BlockFileErrorContext
) -> list[CentrelinesAndGround]:
    """Read each ground file, with the frame that the block file states."""
    if keys.ground is None:
        return []
    given = _source_keys("ground", keys.ground, files, file)
    found = [file.call_reader("ground.path", read_ground_features, path, given) for path in files["ground.path"]]
    placed = [
        replace(
            one,
            crs=keys.ground.crs or one.crs or keys.crs or sources[0].crs,
            remarks=(*one.remarks, *_overruled_frame(path, one.crs, "ground", keys.ground.crs)),
        )
        for path, one in zip(files["ground.path"], found, strict=True)
    ]
    for one in placed:
        file.call_reader("ground.crs", parse_crs, one.crs)
    return placed


def _choose_frame(
    keys: BlockFileSettings, sources: Sequence[BuildingSource], bounds: Bounds | None, file: BlockFileErrorContext
) -> tuple[CRS, Polygon | None, tuple[str, ...]]:
    """Return the metric frame, the area in it, and notes about the choice."""
    west, south, east, north = keys.area or bounds or (0.0, 0.0, 0.0, 0.0)
    middle = (((west + east) / 2 + 180.0) % 360.0 - 180.0, (south + north) / 2)
    notes: tuple[str, ...] = ()
    if keys.crs:
        frame = file.call_reader("crs", parse_metric_crs, keys.crs)
        file.call_reader("crs", check_block_crs, frame, *middle)
    else:
        stated = sources[0].crs
        assert stated is not None, "sources have frames once they are read"
        if stated == LONLAT and isinstance(sources[0], Footprints) and not keys.area:
            _check_corners(sources[0], middle, file)
        frame = file.call_reader("crs", choose_block_crs, stated, *middle)
        notes = _frame_notes(frame, keys.buildings.crs, *(middle if stated == LONLAT else ()))
        if (given := parse_crs(stated)) != frame:
            notes += note_outside_area_of_use(given, *middle)
    notes += note_outside_area_of_use(frame, *middle)
    return frame, project_lonlat_box(keys.area, frame) if keys.area else None, notes


def _check_corners(source: Footprints, middle: tuple[float, float], file: BlockFileErrorContext) -> None:
    """Raise BlockFileError where buildings have right angles only once longitude and latitude are swapped."""
    if has_swapped_corners([footprint.outline for footprint in source.items]):
        raise file.make_error(
            "buildings.path",
            f"longitude and latitude look swapped (longitude {middle[0]:.4f}, latitude {middle[1]:.4f}): the corners of the "
            "buildings are right angles the other way round only; write longitude first, or give crs and area if this is right",
        )


def _frame_notes(frame: CRS, given: str | None, *middle: float) -> tuple[str, ...]:
    """Return a note about a chosen frame; none if it is the frame given for the buildings.

    middle: longitude and latitude of the block where its source counts in degrees, whose order it may have swapped.
    """
    shown = f"{frame.to_string()} ({frame.name})"
    if given is None:
        place = f", as the buildings lie at longitude {middle[0]:.4f}, latitude {middle[1]:.4f}" if middle else ""
        return (f"crs not given: {shown} chosen{place}",)
    stated = parse_crs(given)
    return (
        ()
        if stated == frame
        else (f"the block counts in {shown}, as {stated.to_string()} does not count in metres there",)
    )


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
        raise _empty_error("streets", keys, files, _lonlat_bounds(centrelines), faults, file)
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

    def is_near(remark: Remark) -> bool:
        if remark.geometry is None:
            return remark.id not in outside
        return bool(shapely.transform(remark.geometry, to_frame, interleaved=False).intersects(shapely.box(*extent)))

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
    """Return the error for a block without usable buildings or streets; `notes` name what was set aside."""
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
        return file.make_error("area", f"{path} has no {key}{named} inside area {keys.area}{span}; {remedy}")
    reason = f" ({notes[0]})" if notes else ""
    return file.make_error(f"{key}.path", f"{path} has no {key} that can be used{reason}; give a file that does")


def _name_file_in_fault(fault: Fault, path: Path) -> Fault:
    """Add the file's name to the reason of a fault."""
    return fault if path.name in fault.reason else replace(fault, reason=f"{path.name}: {fault.reason}")


def _select_named_streets(
    source: CentrelinesAndGround, names: list[str], file: BlockFileErrorContext
) -> CentrelinesAndGround:
    known = sorted({piece.name for piece in source.items if piece.name})
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            remedy = f"did you mean {close[0]}?" if close else f"known are e.g. {', '.join(known[:5])}"
            raise file.make_error("streets.names", f"no street is named {name!r}; {remedy}")
    return replace(source, items=tuple(piece for piece in source.items if piece.name in names))


def buildings_extent_with_margin(buildings: Iterable[Building]) -> Bounds:
    """Return (xmin, ymin, xmax, ymax) of the buildings, widened by SURROUNDINGS_MARGIN_M on each side."""
    xmin, ymin, xmax, ymax = shapely.total_bounds([building.footprint for building in buildings]).tolist()
    return (
        xmin - SURROUNDINGS_MARGIN_M,
        ymin - SURROUNDINGS_MARGIN_M,
        xmax + SURROUNDINGS_MARGIN_M,
        ymax + SURROUNDINGS_MARGIN_M,
    )
