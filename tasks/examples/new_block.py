"""Generation of a block file from a map extract and a folder of pictures."""

from __future__ import annotations

import errno
import os
import re
import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.block.geometry import buildings_extent_with_margin
from catalogs.block.keys import suggest_name
from catalogs.block.reader import Block, read_block
from catalogs.block.settings import replace_settings
from catalogs.block.terrain_checks import find_terrain
from catalogs.block.yaml_files import format_yaml
from catalogs.buildings.axis_mistakes import SWAPPED_AXES_NOTE, format_numbers, reject_metres
from catalogs.buildings.densest_square import densest_building_square, square_bounds
from catalogs.buildings.extents import Bounds
from catalogs.crs import parse_crs
from catalogs.features import safe_file_stem
from catalogs.printable_text import format_command, format_count, format_unit_reason
from catalogs.readers.formats import read_buildings, read_centrelines
from catalogs.readers.pictures.folders import list_images
from catalogs.readers.pictures.panoramas import read_panoramas
from facade_core.core.errors import BlockFileError, InputError
from facade_core.core.json_types import JsonObject
from facade_core.geometry.walls import WallRole
from tasks.examples.demo import copy_painted_exemplars
from tasks.stages.ingest.planning import make_plan

if TYPE_CHECKING:
    from pyproj import CRS

# Command-line options by key of the block file.
_OPTIONS = {
    "area": "--bbox",
    "buildings.crs": "--crs",
    "streets.crs": "--crs",
    "imagery.exemplars": "--exemplars",
    "imagery.exemplars.path": "--exemplars",
    "imagery.panoramas": "--photos",
    "imagery.panoramas.path": "--photos",
    "imagery.panoramas.poses": "--poses",
    "imagery.photos": "--photos",
    "imagery.photos.path": "--photos",
}


RECTIFIED_NOTE = (
    "photos as taken from the street, not straight on, need `rectified: false` beside their path in the block file"
)


@dataclass(frozen=True)
class MapFiles:
    """Files of a city's geometry.

    Attributes
    ----------
    buildings : file of buildings.
    streets : file of streets; None: derived from the gaps between buildings.
    crs : CRS of the coordinates if the files state none.
    """

    buildings: Path
    streets: Path | None
    crs: str | None = None

    def option_by_key(self) -> dict[str, str]:
        """Return the command-line option of each block-file key."""
        one = self.buildings == self.streets
        names = (
            {"buildings": "--osm", "streets": "--osm"} if one else {"buildings": "--buildings", "streets": "--streets"}
        )
        return names | {f"{key}.path": option for key, option in names.items()}


@dataclass(frozen=True)
class SquareArea:
    """Square around a position in degrees, with its side in metres."""

    longitude: float
    latitude: float
    size: float

    def axis_order_message(self, reason: str) -> str:
        """Return the error message for swapped longitude and latitude."""
        swapped = format_numbers((self.latitude, self.longitude))
        return f"--around: {reason}; longitude comes first: write --around {swapped}"


@dataclass(frozen=True)
class NewBlock:
    """New block, and its pictures by use.

    Attributes
    ----------
    path : block file.
    block : its content.
    panoramas : pictures with a pose.
    photos : pictures named after a facade.
    unused : unusable pictures with the reason.
    without_pose : pictures with neither a pose nor the name of a facade.
    facades : ids of facades at streets.
    wall_count : walls that a run textures, at streets or not.
    folder : folder of the pictures.
    painted : folder that received the painted exemplars; None with others.
    terrain : raster of the ground that was found beside the map or the block file.
    """

    path: Path
    block: Block
    panoramas: tuple[str, ...]
    photos: tuple[str, ...]
    unused: tuple[tuple[str, str], ...]
    without_pose: tuple[str, ...]
    facades: tuple[str, ...]
    wall_count: int
    folder: Path | None
    painted: Path | None = None
    terrain: Path | None = None

    def lines(self) -> list[str]:
        """Format the result, one line for each fact."""
        heights = Counter(building.height_source for building in self.block.buildings)
        length = sum(street.line.length for street in self.block.streets)
        stated = ", ".join(f"{count} from {source}" for source, count in heights.most_common())
        given = (
            f"{len(self.block.streets)} of {length:.0f} m"
            if self.block.streets
            else "none given, derived from the gaps"
        )
        return [
            f"frame      {self.block.crs.to_string()} ({self.block.crs.name})",
            f"buildings  {len(self.block.buildings)}, heights: {stated}",
            *([f"terrain    {self.terrain}, found beside the map"] if self.terrain else []),
            f"streets    {given}",
            f"facades    {len(self.facades)} seen from a street, such as {', '.join(self.facades[:3])}; with side and back "
            f"walls a run textures {self.wall_count}",
            f"pictures   {format_count(len(self.panoramas), 'panorama')} with a pose, "
            f"{format_count(len(self.photos), 'photo')} named after a facade, "
            f"{len(self.unused) + len(self.without_pose)} not usable yet",
            *self._unplaced(),
            *self._unused(),
            *([f"           {RECTIFIED_NOTE}"] if self.photos else []),
            *(
                [f"exemplars  painted ones in {self.painted}; --exemplars takes facades of the city"]
                if self.painted
                else []
            ),
            *(
                f"set aside  {fault.kind} {format_unit_reason(fault.id, fault.reason)}"
                for fault in self.block.faults
                if fault.kind in ("building", "street")
            ),
            *(f"note       {note}" for note in self.block.notes),
        ]

    def _unplaced(self) -> list[str]:
        """Format a line for the pictures without a pose or name, with the remedy."""
        if not self.without_pose:
            return []
        return [
            f"           {_shorten_list(self.without_pose)}: no pose, and not named after a facade; for photos run "
            f"`{format_command('match', self.path, self.folder)}`, for panoramas give --poses"
        ]

    def _unused(self) -> list[str]:
        """Format a line for each reason of unusable pictures."""
        by_reason: dict[str, list[str]] = {}
        for name, reason in self.unused:
            by_reason.setdefault(reason.removeprefix(f"{name} "), []).append(name)
        return [f"           {_shorten_list(names)}: {reason}" for reason, names in by_reason.items()]


def _shorten_list(names: Sequence[str]) -> str:
    """Join at most three names; longer lists are cut and counted."""
    return ", ".join(names) if len(names) <= 3 else f"{len(names)} pictures ({', '.join(names[:3])}, ...)"


def write_new_block(
    path: Path,
    map_files: MapFiles,
    area: Sequence[float] | SquareArea | float,
    photos: Path | None,
    exemplars: Path | None,
    poses: Path | None = None,
    seed: int = 0,
    write_library: Callable[[Path], None] = copy_painted_exemplars,
    notify: Callable[[str], None] = lambda step: None,
) -> NewBlock:
    """Write the block file `path` for a part of a city's geometry.

    Parameters
    ----------
    path : new block file.
    map_files : geometry of the city.
    area : (west, south, east, north) in degrees, a square, or the side of the most built-up square, metres.
    photos : folder of pictures: panoramas by shape and pose, photos by the id of a facade as their name.
    exemplars : style library; None: a painted one in the block file's folder.
    poses : file of the panoramas' poses.
    seed : random seed of the block.
    write_library : writes the painted style library into a folder.
    notify : receives each step.

    Raises
    ------
    InputError : the file exists, or the map has no building in the area; no file is left.
    """
    if path.exists():
        raise InputError(f"{path} is there already; name another file, or remove it")
    library = exemplars or path.parent / "exemplars"
    made = [folder for folder in path.parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    own = False
    try:
        if not library.exists():
            own = write_style_library(library, write_library)
        options = _OPTIONS | map_files.option_by_key()
        if exemplars is None:  # the option was not given
            options = {key: option for key, option in options.items() if option != "--exemplars"}
        if isinstance(area, SquareArea):
            options["area"] = "--around"
        elif isinstance(area, float):  # a square of buildings: only streets can be elsewhere
            options["area"] = options["streets"]
        found = _write_block_file(path, map_files, area, photos, library, poses, seed, options, notify)
        return replace(found, painted=library if own else None)
    except BaseException:
        if own:
            shutil.rmtree(library, ignore_errors=True)
        for folder in made:  # innermost first; files that others wrote meanwhile stay
            with suppress(OSError):
                folder.rmdir()
        raise


def write_style_library(library: Path, write: Callable[[Path], None] = copy_painted_exemplars) -> bool:
    """Write a style library atomically; return False if another process created it first."""
    draft = library.with_name(f".{library.name}.{os.getpid()}.draft")
    try:
        write(draft)
        draft.rename(library)
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
        return False
    else:
        return True
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _write_block_file(
    path: Path,
    geometry: MapFiles,
    area: Sequence[float] | SquareArea | float,
    photos: Path | None,
    library: Path,
    poses: Path | None,
    seed: int,
    options: Mapping[str, str],
    notify: Callable[[str], None],
) -> NewBlock:
    notify(f"reading {geometry.buildings}")
    bounds = _bounds(geometry, area)
    imagery = {"exemplars": {"path": path_in_block_file(library, path)}}
    frame = {} if geometry.crs is None else {"crs": geometry.crs}
    keys = {
        "name": suggest_name(path.stem) or path.stem,
        "area": [round(float(value), 6) for value in bounds],
        "buildings": {"path": path_in_block_file(geometry.buildings, path)} | frame,
        **(
            {}
            if geometry.streets is None
            else {"streets": {"path": path_in_block_file(geometry.streets, path)} | given_streets_frame(geometry)}
        ),
        "imagery": imagery,
        "seed": seed,
    }
    draft = path.with_name(f".{path.name}.draft")
    try:
        try:
            block = _read_draft(draft, keys, options)
        except InputError as error:
            if SWAPPED_AXES_NOTE not in str(error):
                raise
            if isinstance(area, SquareArea):
                raise InputError(area.axis_order_message("no buildings are there")) from error
            if isinstance(area, float):  # the area is that of the buildings: nobody wrote it
                raise InputError(_swapped_file_message(geometry, bounds)) from error
            raise
        folders = {geometry.buildings.parent.resolve(), path.parent.resolve()}
        terrain = find_terrain(folders, block.crs, block.buildings, buildings_extent_with_margin(block.buildings))
        if terrain:
            keys["terrain"] = {"path": path_in_block_file(terrain, path)}
            notify(f"reading {terrain}")
            block = _read_draft(draft, keys, options)
        notify(
            f"planning {format_count(len(block.buildings), 'building')} and {format_count(len(block.streets), 'street')}"
        )
        plan = make_plan(replace(block, settings=replace_settings(block.settings, panorama_width=256)))
        ids = set(plan.facades.id)
        fronts = tuple(plan.facades.id[i] for i in np.flatnonzero(plan.facades.role == WallRole.STREET).tolist())
        panoramas, named, unused, unplaced = (
            _classify_pictures(photos, poses, block, ids) if photos else ((), (), (), ())
        )
        if photos and panoramas:
            imagery["panoramas"] = {"path": path_in_block_file(photos, path)}
            if poses:
                imagery["panoramas"]["poses"] = path_in_block_file(poses, path)
        elif photos and named:
            imagery["photos"] = {"path": path_in_block_file(photos, path)}
        if photos:
            notify("reading the block with its pictures")
            block = _read_draft(draft, keys, options)
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
    return NewBlock(path, block, panoramas, named, unused, unplaced, fronts, len(ids), photos, terrain=terrain)


def given_streets_frame(geometry: MapFiles) -> dict[str, str]:
    """Return the CRS key of the streets: the given one if their file states none, as files of one block may differ."""
    if geometry.crs is None or geometry.streets is None:
        return {}
    try:
        stated = read_centrelines(geometry.streets).crs
    except InputError as error:
        raise InputError(f"{geometry.option_by_key()['streets.path']}: {error}") from error
    return {"crs": geometry.crs} if stated is None else {}


def _swapped_file_message(geometry: MapFiles, bounds: Sequence[float]) -> str:
    """Return the error message for buildings and streets in different axis orders."""
    west, south = bounds[:2]
    return (
        f"--streets: one of {geometry.buildings} and {geometry.streets} has longitude and latitude swapped: buildings at "
        f"longitude {west:.4f}, latitude {south:.4f}, streets the other way round; export that file again, longitude first"
    )


def _bounds(geometry: MapFiles, area: Sequence[float] | SquareArea | float) -> Sequence[float]:
    if isinstance(area, SquareArea):
        reject_metres("--around", (area.longitude, area.latitude), partial(_stated_frame, geometry))
        if abs(area.latitude) >= 90.0:
            raise InputError(area.axis_order_message(f"{format_numbers([area.latitude])} is no latitude"))
        return square_bounds(area.longitude, area.latitude, area.size)
    if isinstance(area, float):
        return _densest_bounds(geometry, area)
    reject_metres("--bbox", area, partial(_stated_frame, geometry))
    return area


def _stated_frame(geometry: MapFiles) -> CRS | None:
    """Return the frame of the buildings; None for map extracts, which are in degrees."""
    stated = geometry.crs
    with suppress(InputError):
        if stated is None and geometry.streets != geometry.buildings:
            stated = read_buildings(geometry.buildings).crs
        return parse_crs(stated) if stated else None
    return None


def _densest_bounds(geometry: MapFiles, size: float) -> Bounds:
    option = geometry.option_by_key()["buildings.path"]
    try:
        source = read_buildings(geometry.buildings)
        crs = geometry.crs or source.crs
        if crs is None:
            raise InputError(f"{geometry.buildings} states no frame; give --crs EPSG:...")
        found = densest_building_square([replace(source, crs=crs)], size)
    except InputError as error:
        raise InputError(f"{option}: {error}") from error
    if found is None and source.items:
        raise InputError(
            f"{option}: none of {format_count(len(source.items), 'building')} of {geometry.buildings} can be of {crs}; give "
            "what its coordinates count in as --crs EPSG:..."
        )
    if found is None:
        raise InputError(f"{option}: {geometry.buildings} holds no buildings; give a file that does")
    return found


def _read_draft(draft: Path, keys: JsonObject, options: Mapping[str, str]) -> Block:
    draft.write_text(format_yaml(keys), encoding="utf-8")
    try:
        return read_block(draft)
    except BlockFileError as error:  # users know the command's options, not the draft's keys
        fault = re.sub(r"^line \d+: ", "", str(error).removeprefix(f"{draft}: "))  # of the draft, which is gone then
        key, _, problem = fault.partition(": ")
        raise InputError(f"{options.get(key, key)}: {problem}") from error


def _classify_pictures(
    folder: Path, poses: Path | None, block: Block, facades: set[str]
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Split pictures into panoramas with a pose, photos of facades, unusable ones, and the rest."""
    paths, broken = list_images(folder, "photo")
    stems = facades | set(map(safe_file_stem, facades))
    try:
        found = read_panoramas(folder, poses, block.crs)
        posed = {panorama.path.name for panorama in found.items}
        reasons = {fault.id: fault.reason for fault in found.faults}
    except InputError:  # no picture is usable
        posed, reasons = set(), {}
    named = tuple(path.name for path in paths if path.stem in stems and path.name not in posed)
    others = [path.name for path in paths if path.name not in {*posed, *named}]
    unused = [(name, reasons[name]) for name in others if name in reasons]
    unplaced = tuple(name for name in others if name not in reasons)
    if posed and named:
        unused += [
            (name, "panoramas and photos of facades need a folder each; only panoramas are used") for name in named
        ]
    return tuple(sorted(posed)), named, tuple(unused + [(fault.id, fault.reason) for fault in broken]), unplaced


def path_in_block_file(target: Path, block: Path) -> str:
    """Format a path for the block file: relative if that is short."""
    relative = os.path.relpath(target.resolve(), block.parent.resolve())
    return str(target.resolve()) if relative.startswith(os.path.join("..", "..", "..")) else relative
