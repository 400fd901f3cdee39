"""Reader of block files: the YAML, the files that it names, and their contents."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import shapely

from catalogs.block.block_file import BlockFileErrorContext
from catalogs.block.building_corrections import apply_corrections_to_block
from catalogs.block.camera_heights import correct_camera_heights
from catalogs.block.corrections import NO_CORRECTIONS, Corrections, read_corrections
from catalogs.block.digest import block_digest
from catalogs.block.geoid import resolve_geoid_separation
from catalogs.block.geometry import buildings_extent_with_margin, read_geometry
from catalogs.block.geometry_sources import NamedFiles
from catalogs.block.key_faults import read_block_settings
from catalogs.block.keys import BlockFileSettings, TextureSettings
from catalogs.block.part import CityPart
from catalogs.block.passages import note_closed_passages
from catalogs.block.paths import hide_variable_values, resolve_paths
from catalogs.block.settings import WithSettings
from catalogs.block.terrain_checks import note_terrain_doubts
from catalogs.buildings.buried_feet import cut_buried_feet
from catalogs.buildings.extents import Bounds
from catalogs.crs import middle_to_lonlat, parse_crs
from catalogs.features import Fault, feature_ids_by_reason, format_reason_notes
from catalogs.readers.pictures.folders import check_picture, list_images, photos_by_facade
from catalogs.readers.pictures.materials import MaterialPicture, RoofPicture, read_material_pictures
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.errors import BlockFileError
from facade_core.core.types import (
    SHIPPED_MODELS,
    Building,
    ElevationRaster,
    MappedGround,
    Street,
    TrainedModelFiles,
)

if TYPE_CHECKING:
    from pyproj import CRS

    from catalogs.readers.pictures.aerial import Orthophoto

__all__ = ["Block", "TextureSettings", "read_block"]


@dataclass(frozen=True, kw_only=True)
class Block(WithSettings):
    """City block, ready to be textured.

    Attributes
    ----------
    crs : horizontal, projected, in metres (x east, y north); all geometry is in it.
    streets : if empty, derived at ingest from the gaps between buildings.
    shops : (x, y) of mapped and likely shops, None without a map.
    entrances : (x, y) of mapped entrances.
    ground : ways and areas that a map states.
    style : unposed street pictures, from which a run harvests more exemplars.
    photos : facade id -> file.
    textures : pictures that the texture indices of shells refer to.
    aerial : orthophoto of the block.
    roof_material : picture of a roof material, and its metres per pixel.
    materials : pictures that replace shipped materials.
    geoid_separation : metres of the geoid above the ellipsoid in the middle of the block; None where heights stay as given.
    notes : what was left out or assumed, one line each.
    faults : units that are broken.
    digest : sha256 of all values read but notes; independent of file names and dates.
    corrections : corrections of people, from the file next to the block file.
    part : the block's own part of a city, None if it is not a part.
    models : model files that replace shipped ones.
    neighbours : buildings around the area, which views show in plain colours; none of a part of a city.
    """

    crs: CRS
    buildings: tuple[Building, ...]
    streets: tuple[Street, ...]
    shops: tuple[tuple[float, float], ...] | None
    entrances: tuple[tuple[float, float], ...]
    ground: MappedGround
    terrain: ElevationRaster | None
    exemplars: tuple[Path, ...]
    photos: dict[str, Path]
    panoramas: tuple[PosedPanorama, ...]
    textures: tuple[Path, ...]
    aerial: Orthophoto | None
    roof_material: RoofPicture | None
    materials: tuple[MaterialPicture, ...]
    geoid_separation: float | None
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]
    digest: str
    corrections: Corrections = NO_CORRECTIONS
    part: CityPart | None = None
    models: TrainedModelFiles = SHIPPED_MODELS
    style: tuple[Path, ...] = ()
    neighbours: tuple[Building, ...] = ()

    @property
    def name(self) -> str:
        """Return the name of the block."""
        return self.settings.name

    @property
    def photos_rectified(self) -> bool:
        """Return whether photos of facades are rectified; else they are as taken from the street."""
        return self.settings.imagery.photos is None or self.settings.imagery.photos.rectified

    def describe_place(self) -> str:
        """Return the place of the buildings in degrees, and the CRS."""
        longitude, latitude = middle_to_lonlat(self.crs.to_wkt(), buildings_extent_with_margin(self.buildings))
        north, east = "N" if latitude >= 0.0 else "S", "E" if longitude >= 0.0 else "W"
        name = f"{self.crs.to_string()}, {self.crs.name}" if self.crs.to_authority() else self.crs.name
        return f"{abs(latitude):.4f} {north}, {abs(longitude):.4f} {east} ({name})"

    def describe_heights(self) -> str:
        """Return where the heights of the ground and of the buildings come from, and how they count from the ellipsoid."""
        terrain, stated = self.settings.terrain, Counter(one.height_source for one in self.buildings)
        ground = "ground by the feet of the buildings" if _have_feet(self.buildings) else "flat ground"
        if terrain is not None:
            ground = f"ground of {Path(terrain.path).name}"
        buildings = ", ".join(f"{count} from {source}" for source, count in stated.most_common())
        geoid = "as given, also for globes (key geoid_separation)"
        if self.geoid_separation is not None:
            geoid = f"above a geoid {self.geoid_separation:.2f} m over the ellipsoid"
        return f"{ground}; buildings: {buildings}; {geoid}"


def read_block(path: Path | str) -> Block:
    """Read and check a block file; the README of this package documents its keys.

    A broken unit (building, street, picture) is no error: it is listed in `faults`.

    Raises
    ------
    BlockFileError : one line with the block file, the key, the file concerned and the remedy.
    """
    file = BlockFileErrorContext(Path(path))
    try:
        keys = read_block_settings(file.path)
    except ValueError as error:
        raise BlockFileError(f"{file.path}: {error}") from error
    block = build_block(keys, file)
    corrections = file.call_reader("corrections", read_corrections, file.path)
    block = apply_corrections_to_block(block, corrections)
    closed = note_closed_passages(block.buildings, block.terrain)
    return set_digest(replace(block, notes=(*block.notes, *closed)), file)


def read_model_files(path: Path) -> TrainedModelFiles:
    """Read which models a block file names, without reading its data.

    Raises
    ------
    BlockFileError : as `read_block`.
    """
    try:
        return _model_files(resolve_paths(read_block_settings(path), path))
    except ValueError as error:
        raise BlockFileError(hide_variable_values(f"{path}: {error}", path)) from error


def build_block(keys: BlockFileSettings, file: BlockFileErrorContext) -> Block:
    """Build a block from checked keys, without corrections and digest.

    Raises
    ------
    BlockFileError : as `read_block`.
    """
    try:
        files = resolve_paths(keys, file.path)
    except ValueError as error:
        raise BlockFileError(hide_variable_values(f"{file.path}: {error}", file.path)) from error
    if keys.part is not None:
        return _read_part(keys, files, file)
    pictures = _read_pictures(keys, files, file)
    geometry = read_geometry(keys, files, file)
    frame, built, extent = geometry.crs, geometry.buildings, geometry.extent
    terrain = _read_terrain(files, frame, extent, file)
    buildings, cut = cut_buried_feet(built.items, terrain)
    stated = "auto" if keys.geoid_separation is None and geometry.has_heights_above_sea else keys.geoid_separation
    separation, geoid_notes = resolve_geoid_separation(stated, frame.to_wkt(), extent)
    height = keys.texture.viewpoint_height
    correct = partial(correct_camera_heights, buildings=buildings, elevation=terrain, camera_height=height)
    panoramas, broken_panoramas, far = _read_posed_pictures(keys, files, frame, extent, correct, file)
    aerial, colour_notes = _read_aerial(keys, files, frame, built.items, file)
    return Block(
        crs=frame,
        buildings=buildings,
        streets=geometry.streets,
        shops=geometry.shops,
        entrances=geometry.entrances,
        ground=geometry.ground,
        neighbours=geometry.neighbours,
        terrain=terrain,
        exemplars=pictures.exemplars,
        style=pictures.style,
        photos=pictures.photos,
        panoramas=panoramas,
        textures=built.textures,
        aerial=aerial,
        notes=geometry.notes
        + built.notes
        + cut
        + far
        + _flat_terrain_notes(built.items, terrain)
        + _raster_notes(files, file)
        + colour_notes
        + (() if terrain is None else note_terrain_doubts(terrain, built.items, files["terrain.path"][0].name))
        + geoid_notes,
        faults=(*geometry.faults, *pictures.faults, *broken_panoramas),
        digest="",
        settings=keys,
        roof_material=_find_roof_material(keys, files, file),
        materials=_read_materials(files, file),
        geoid_separation=separation,
        models=_model_files(files),
    )


CorrectHeights = Callable[[Sequence[PosedPanorama]], tuple[tuple[PosedPanorama, ...], tuple[str, ...]]]


def _read_posed_pictures(
    keys: BlockFileSettings,
    files: NamedFiles,
    frame: CRS,
    extent: Bounds,
    correct: CorrectHeights,
    file: BlockFileErrorContext,
) -> tuple[tuple[PosedPanorama, ...], tuple[Fault, ...], tuple[str, ...]]:
    """Return panoramas and perspective pictures with poses, faults, and notes."""
    pictures: tuple[PosedPanorama, ...] = ()
    faults: tuple[Fault, ...] = ()
    notes: tuple[str, ...] = ()
    if "imagery.panoramas.path" in files:
        from catalogs.readers.pictures.panoramas import read_panoramas

        poses = files.get("imagery.panoramas.poses", (None,))[0]
        assert keys.imagery.panoramas is not None
        found = file.call_reader(
            "imagery.panoramas",
            read_panoramas,
            files["imagery.panoramas.path"][0],
            poses,
            frame,
            extent,
            keys.imagery.panoramas.since,
        )
        pictures, heights = correct(found.items)
        faults = found.faults
        notes = format_reason_notes(feature_ids_by_reason(found.remarks)) + heights
    if keys.imagery.cameras is not None:
        from catalogs.readers.pictures.cameras.cameras import read_cameras

        posed = file.call_reader(
            "imagery.cameras",
            read_cameras,
            files["imagery.cameras.path"][0],
            files["imagery.cameras.poses"][0],
            frame,
            extent,
            files.get("imagery.cameras.control", (None,))[0],
            keys.imagery.cameras.crs,
        )
        taken = {one.id for one in pictures}
        twice = tuple(
            Fault(one.path.name, "panorama", f"a panorama is named {one.id} too; rename one of them")
            for one in posed.items
            if one.id in taken
        )
        cameras, heights = correct([one for one in posed.items if one.id not in taken])
        pictures += cameras
        faults += posed.faults + twice
        notes += format_reason_notes(feature_ids_by_reason(posed.remarks)) + heights
    return pictures, faults, notes


def city_part_file_values(part: Block, whole: Block) -> dict[str, object]:
    """Return the values that the file of a part of a city holds (see `catalogs.block.extract`)."""
    from catalogs.block.extract import PartContents

    return {
        "crs": part.crs.to_string(),
        "extent": buildings_extent_with_margin(whole.buildings),
        **{name: getattr(part, name) for name in PartContents.__annotations__},
    }


def _read_part(keys: BlockFileSettings, files: NamedFiles, file: BlockFileErrorContext) -> Block:
    """Read the part of a city that a block file names, with the settings of the block file."""
    from catalogs.block.extract import read_city_part

    values = file.call_reader("part.path", read_city_part, files["part.path"][0])
    frame = file.call_reader("part.path", parse_crs, values.crs)
    terrain = _read_terrain(files, frame, values.extent, file)
    return Block(
        crs=frame,
        shops=None,
        terrain=terrain,
        notes=(),
        digest="",
        **values.contents,
        settings=keys,
        roof_material=_find_roof_material(keys, files, file),
        materials=_read_materials(files, file),
        models=_model_files(files),
    )


def _have_feet(buildings: Iterable[Building]) -> bool:
    """Return whether a source states the height of the ground at a building."""
    return any(building.base is not None or building.shell is not None for building in buildings)


def _flat_terrain_notes(buildings: Iterable[Building], terrain: ElevationRaster | None) -> tuple[str, ...]:
    """Return a note if no source states the height of the ground."""
    if terrain is not None or _have_feet(buildings):
        return ()
    return ("no source states the height of the ground, so it is flat; for a slope give terrain: {path: ...}",)


def _raster_notes(files: NamedFiles, file: BlockFileErrorContext) -> tuple[str, ...]:
    """Return notes on rasters of heights whose unit is assumed."""
    from catalogs.readers.pictures.elevation import note_assumed_unit

    keys = [key for key in ("terrain.path", "buildings.heights.path") if key in files]
    return tuple(note for key in keys for note in file.call_reader(key, note_assumed_unit, files[key][0]))


def _read_terrain(files: NamedFiles, frame: CRS, extent: Bounds, file: BlockFileErrorContext) -> ElevationRaster | None:
    if "terrain.path" not in files:
        return None
    from catalogs.readers.pictures.elevation import read_elevation

    return file.call_reader("terrain.path", read_elevation, files["terrain.path"][0], frame, extent)


def _read_materials(files: NamedFiles, file: BlockFileErrorContext) -> tuple[MaterialPicture, ...]:
    found = files.get("texture.materials")
    return file.call_reader("texture.materials", read_material_pictures, found[0]) if found else ()


def _model_files(files: NamedFiles) -> TrainedModelFiles:
    named = {one.name: files.get(f"models.{one.name}") for one in fields(TrainedModelFiles)}
    return TrainedModelFiles(**{name: paths[0].absolute() for name, paths in named.items() if paths})


def set_digest(block: Block, file: BlockFileErrorContext) -> Block:
    """Return a copy of the block with its computed digest."""
    return replace(block, digest=file.call_reader("imagery", block_digest, block))


class _UnposedPictures(NamedTuple):
    exemplars: tuple[Path, ...]
    style: tuple[Path, ...]
    photos: dict[str, Path]
    faults: tuple[Fault, ...]


def _read_pictures(keys: BlockFileSettings, files: NamedFiles, file: BlockFileErrorContext) -> _UnposedPictures:
    photos: dict[str, Path] = {}
    faults: tuple[Fault, ...] = ()
    listed: dict[str, tuple[Path, ...]] = {}
    for key in ("imagery.exemplars.path", "imagery.style.path"):
        listed[key] = ()
        if key in files:
            listed[key], broken = file.call_reader(key, list_images, files[key][0], "exemplar")
            faults += broken
    if "imagery.photos.path" in files:
        photos, absent = file.call_reader("imagery.photos.path", photos_by_facade, files["imagery.photos.path"][0])
        faults += absent
    exemplars, style = listed.values()
    if keys.texture.walls == "exemplar" and not (exemplars or style):
        raise file.make_error(
            "imagery.exemplars", "missing, but texture.walls is exemplar; write exemplars: {path: FOLDER}"
        )
    return _UnposedPictures(exemplars, style, photos, faults)


def _read_aerial(
    keys: BlockFileSettings, files: NamedFiles, frame: CRS, buildings: Iterable[Building], file: BlockFileErrorContext
) -> tuple[Orthophoto | None, tuple[str, ...]]:
    """Return the orthophoto, None without one, and notes on it."""
    if keys.imagery.aerial is None:
        return None, ()
    from catalogs.readers.pictures.aerial import note_assumed_colours, open_orthophoto

    key, crs, [path] = "imagery.aerial.path", keys.imagery.aerial.crs, files["imagery.aerial.path"]
    if crs is not None:
        file.call_reader("imagery.aerial.crs", parse_crs, crs)
    places = shapely.get_coordinates([building.footprint for building in buildings])
    photo = file.call_reader(key, open_orthophoto, path, crs, frame, places)
    return photo, file.call_reader(key, note_assumed_colours, photo)


def _find_roof_material(keys: BlockFileSettings, files: NamedFiles, file: BlockFileErrorContext) -> RoofPicture | None:
    if keys.texture.roof_material is None:
        return None
    path = files["texture.roof_material.path"][0]
    file.call_reader("texture.roof_material.path", check_picture, path)
    return RoofPicture(path.absolute(), keys.texture.roof_material.metres_per_pixel)
