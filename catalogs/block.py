"""Reading a block file: the YAML, the files it names, and what they hold, as one frozen value."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import shapely
from shapely import box

from catalogs.block_digest import block_digest
from catalogs.block_keys import BlockKeys, TextureSettings, check_keys
from catalogs.block_paths import named_paths
from catalogs.buildings import block_buildings
from catalogs.features import Centrelines, Fault, Footprints, Models, by_reason, notes_by_reason
from catalogs.frames import area_outline, block_frame, check_scale, known_frame, named_frame, outside, to_lonlat
from catalogs.readers.files import read_buildings, read_centrelines
from catalogs.readers.images import image_files, photos_by_facade, whole_picture
from catalogs.streets import block_streets
from catalogs.yaml_files import read_yaml
from facade_core.errors import BlockFileError, InputError
from facade_core.types import Building, Elevation, Street

if TYPE_CHECKING:
    from pyproj import CRS
    from shapely import Polygon

    from catalogs.readers.aerial import Aerial
    from catalogs.readers.panoramas import PosedPanorama

__all__ = ["Block", "TextureSettings", "read_block"]

T = TypeVar("T")
Files = Mapping[str, tuple[Path, ...]]
# A picture of a material, and its metres per pixel.
Material = tuple[Path, float]
# Ground is wanted this far around the buildings, and panoramas further away belong to another site.
SURROUNDINGS_M = 200.0


@dataclass(frozen=True)
class Block:
    """One city block, ready to be textured.

    crs is horizontal, projected and in metres (x east, y north); buildings, streets, panoramas and terrain are in it. Without
    streets they are derived from the gaps between the buildings when the block is ingested. photos: facade id -> file, as taken
    from the street unless photos_rectified; textures: the pictures that the buildings' own texture indices count; aerial: the
    block from straight above; roof_material: a picture of one, and its metres per pixel. notes says
    what was left out or assumed, one line each; faults are the units that are broken. digest is the sha256 of everything that
    determines the result: settings and contents of the files, not their places or dates.
    """

    name: str
    crs: CRS
    buildings: tuple[Building, ...]
    streets: tuple[Street, ...]
    terrain: Elevation | None
    exemplars: tuple[Path, ...]
    photos: dict[str, Path]
    photos_rectified: bool
    panoramas: tuple[PosedPanorama, ...]
    textures: tuple[Path, ...]
    aerial: Aerial | None
    roof_material: Material | None
    texture: TextureSettings
    storey: float
    geoid_separation: float | None
    seed: int
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]
    digest: str


@dataclass(frozen=True)
class _File:
    """The block file that is being read, for messages."""

    path: Path

    def fault(self, key: str, problem: str) -> BlockFileError:
        return BlockFileError(f"{self.path}: {key}: {problem}")

    def read(self, key: str, read: Callable[..., T], *arguments: Any) -> T:
        """Call a reader; what it raises names the block file and the key too."""
        try:
            return read(*arguments)
        except OSError as error:
            raise self.fault(
                key, f"{error.filename} cannot be read ({error.strerror}); check its permissions"
            ) from error
        except InputError as error:
            raise self.fault(key, str(error)) from error


def read_block(path: Path | str) -> Block:
    """Read and check a block file; the README of this package documents its keys.

    Raises BlockFileError: one line with the block file, the key, the file concerned and the remedy. A unit that is broken
    (a building, a street, a picture) is no reason to raise: it is in `faults`.
    """
    file = _File(Path(path))
    try:
        keys = check_keys(read_yaml(file.path))
        files = named_paths(keys, file.path)
    except ValueError as error:
        raise BlockFileError(f"{file.path}: {error}") from error
    if keys.texture.translator == "neural" and keys.texture.panorama_width % 8:
        raise file.fault(
            "texture.panorama_width", "the neural translator takes multiples of 8; 512 is what it learnt at"
        )

    exemplars, photos, broken_pictures = _pictures(keys, files, file)
    sources = _building_sources(keys, files, file)
    centrelines = _centrelines(keys, files, sources, file) if keys.streets else None
    frame, area, frame_notes = _frame(keys, sources, file)
    built = block_buildings(sources, frame, area=area, storey=keys.storey)
    if not built.items:
        raise _nothing("buildings", keys, files, _bounds(sources), built.faults, file)
    extent = _extent(built.items)
    streets, broken_streets = _streets(keys, files, centrelines, frame, area, extent, file)
    terrain = None
    if "terrain.path" in files:
        from catalogs.readers.elevation import read_elevation

        terrain = file.read("terrain.path", read_elevation, *files["terrain.path"], frame, extent)
    panoramas: tuple[PosedPanorama, ...] = ()
    broken_panoramas: tuple[Fault, ...] = ()
    far: tuple[str, ...] = ()
    if "imagery.panoramas.path" in files:
        from catalogs.readers.panoramas import read_panoramas

        poses = files.get("imagery.panoramas.poses", (None,))[0]
        found = file.read("imagery.panoramas", read_panoramas, *files["imagery.panoramas.path"], poses, frame, extent)
        panoramas, broken_panoramas = found.items, found.faults
        far = notes_by_reason(by_reason(found.remarks))
    return Block(
        name=keys.name,
        crs=frame,
        buildings=built.items,
        streets=streets,
        terrain=terrain,
        exemplars=exemplars,
        photos=photos,
        photos_rectified=keys.imagery.photos is None or keys.imagery.photos.rectified,
        panoramas=panoramas,
        textures=built.textures,
        aerial=_aerial(keys, files, frame, built.items, file),
        roof_material=_roof_material(keys, files, file),
        texture=keys.texture,
        storey=keys.storey,
        geoid_separation=keys.geoid_separation,
        seed=keys.seed,
        notes=frame_notes + built.notes + far,
        faults=(*built.faults, *broken_streets, *broken_pictures, *broken_panoramas),
        digest=block_digest(keys, frame, files, built, exemplars, photos, panoramas),
    )


def _pictures(
    keys: BlockKeys, files: Files, file: _File
) -> tuple[tuple[Path, ...], dict[str, Path], tuple[Fault, ...]]:
    exemplars: tuple[Path, ...] = ()
    photos: dict[str, Path] = {}
    faults: tuple[Fault, ...] = ()
    if "imagery.exemplars.path" in files:
        exemplars, broken = file.read(
            "imagery.exemplars.path", image_files, *files["imagery.exemplars.path"], "exemplar"
        )
        faults += broken
    if "imagery.photos.path" in files:
        photos = file.read("imagery.photos.path", photos_by_facade, *files["imagery.photos.path"])
    if keys.texture.walls == "exemplar" and not exemplars:
        raise file.fault("imagery.exemplars", "missing, but texture.walls is exemplar; write exemplars: {path: FOLDER}")
    return exemplars, photos, faults


def _aerial(keys: BlockKeys, files: Files, frame: CRS, buildings: Iterable[Building], file: _File) -> Aerial | None:
    if keys.imagery.aerial is None:
        return None
    from catalogs.readers.aerial import read_aerial

    crs = keys.imagery.aerial.crs
    if crs is not None:
        file.read("imagery.aerial.crs", known_frame, crs)
    places = shapely.get_coordinates([building.footprint for building in buildings])
    return file.read("imagery.aerial.path", read_aerial, *files["imagery.aerial.path"], crs, frame, places)


def _roof_material(keys: BlockKeys, files: Files, file: _File) -> Material | None:
    if keys.texture.roof_material is None:
        return None
    path = files["texture.roof_material.path"][0]
    file.read("texture.roof_material.path", whole_picture, path)
    return path.absolute(), keys.texture.roof_material.metres_per_pixel


def _building_sources(keys: BlockKeys, files: Files, file: _File) -> list[Footprints | Models]:
    """What each building file holds, where the block file says that it lies."""
    sources = []
    for path in files["buildings.path"]:
        source = file.read("buildings.path", read_buildings, path, keys.buildings.lod)
        crs = keys.buildings.crs or source.crs or keys.crs
        if crs is None:
            raise file.fault("buildings.crs", f"missing, and {path} states no frame; write crs: EPSG:...")
        file.read("buildings.crs", known_frame, crs)
        source = replace(source, crs=crs, faults=tuple(_located(fault, path) for fault in source.faults))
        sources.append(source.moved(keys.buildings.offset) if keys.buildings.offset else source)
    if not any(source.items or source.faults for source in sources):
        names = ", ".join(map(str, files["buildings.path"]))
        raise file.fault("buildings.path", f"{names} holds no buildings; give a file that does")
    return sources


def _centrelines(keys: BlockKeys, files: Files, sources: Sequence[Footprints | Models], file: _File) -> Centrelines:
    assert keys.streets is not None
    source = file.read("streets.path", read_centrelines, *files["streets.path"])
    faults = tuple(_located(fault, files["streets.path"][0]) for fault in source.faults)
    source = replace(source, crs=keys.streets.crs or source.crs or keys.crs or sources[0].crs, faults=faults)
    file.read("streets.crs", known_frame, source.crs)
    if not source.items and not source.faults:
        raise file.fault("streets.path", f"{files['streets.path'][0]} holds no streets; give a file that does")
    return _named_streets(source, keys.streets.names, file) if keys.streets.names else source


def _frame(
    keys: BlockKeys, sources: Sequence[Footprints | Models], file: _File
) -> tuple[CRS, Polygon | None, tuple[str, ...]]:
    """The metric frame, the area in it, and a note where the frame was chosen."""
    west, south, east, north = keys.area or _bounds(sources)
    middle = ((west + east) / 2, (south + north) / 2)
    notes: tuple[str, ...] = ()
    if keys.crs:
        frame = file.read("crs", named_frame, keys.crs)
        file.read("crs", check_scale, frame, *middle)
    else:
        frame = file.read("crs", block_frame, sources[0].crs, *middle)
        notes = (f"crs not given: {frame.to_string()} ({frame.name}) chosen",)
    notes += outside(frame, *middle)
    return frame, area_outline(keys.area, frame) if keys.area else None, notes


def _streets(
    keys: BlockKeys,
    files: Files,
    centrelines: Centrelines | None,
    frame: CRS,
    area: Polygon | None,
    extent: tuple[float, float, float, float],
    file: _File,
) -> tuple[tuple[Street, ...], tuple[Fault, ...]]:
    if centrelines is None:
        return (), ()
    streets, faults = block_streets(centrelines, frame, area=area)
    if not streets:
        raise _nothing("streets", keys, files, _bounds([centrelines]), faults, file)
    if not any(street.line.intersects(box(*extent)) for street in streets):
        span = ", ".join(f"{value:.4f}" for value in _bounds([centrelines]))
        raise file.fault(
            "streets.path",
            f"no street comes within {SURROUNDINGS_M:g} m of a building (streets span [{span}]); "
            "check streets.crs, or leave streets out",
        )
    return streets, faults


def _nothing(
    key: str, keys: BlockKeys, files: Files, bounds: Sequence[float], faults: Sequence[Fault], file: _File
) -> BlockFileError:
    """Why a block is left without buildings or streets."""
    path = ", ".join(map(str, files[f"{key}.path"]))
    if faults:
        more = f" and {len(faults) - 1} more" if len(faults) > 1 else ""
        return file.fault(
            f"{key}.path", f"{path} has no {key} that can be used: {faults[0].id}: {faults[0].reason}{more}"
        )
    if keys.area:
        named = " of these names" if key == "streets" and keys.streets and keys.streets.names else ""
        span = ", ".join(f"{value:.4f}" for value in bounds)
        return file.fault("area", f"{path} has no {key}{named} inside area {keys.area}; they span [{span}]")
    return file.fault(f"{key}.path", f"{path} has no {key} that can be used; give a file that does")


def _located(fault: Fault, path: Path) -> Fault:
    """A fault whose reason names the file."""
    return fault if path.name in fault.reason else replace(fault, reason=f"{path.name}: {fault.reason}")


def _named_streets(source: Centrelines, names: list[str], file: _File) -> Centrelines:
    known = sorted({piece.name for piece in source.items if piece.name})
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            remedy = f"did you mean {close[0]}?" if close else f"known are e.g. {', '.join(known[:5])}"
            raise file.fault("streets.names", f"no street is named {name!r}; {remedy}")
    return replace(source, items=tuple(piece for piece in source.items if piece.name in names))


def _bounds(sources: Sequence[Footprints | Models | Centrelines]) -> tuple[float, float, float, float]:
    """(west, south, east, north) in degrees of all that is finite in the sources."""
    import numpy as np

    boxes = [to_lonlat(source.crs, box) for source in sources if source.crs and (box := source.bounds()) is not None]
    if not boxes:
        return (0.0, 0.0, 0.0, 0.0)
    low, high = np.array(boxes)[:, :2].min(axis=0), np.array(boxes)[:, 2:].max(axis=0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _extent(buildings: Iterable[Building]) -> tuple[float, float, float, float]:
    """The buildings' surroundings in the frame: (xmin, ymin, xmax, ymax)."""
    xmin, ymin, xmax, ymax = shapely.total_bounds([building.footprint for building in buildings]).tolist()
    return xmin - SURROUNDINGS_M, ymin - SURROUNDINGS_M, xmax + SURROUNDINGS_M, ymax + SURROUNDINGS_M
