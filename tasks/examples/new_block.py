"""Write a block file for a map extract and a folder of pictures, and say what was found in them."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from catalogs.block import Block, read_block
from catalogs.buildings.densest import densest_square
from catalogs.buildings.extents import Bounds
from catalogs.features import file_stem
from catalogs.readers.files import read_buildings
from catalogs.readers.pictures.folders import image_files
from catalogs.readers.pictures.panoramas import read_panoramas
from facade_core.errors import BlockFileError, InputError
from facade_core.geometry.walls import STREET
from tasks.examples.demo import paint_exemplars
from tasks.stages.planning import plan_of

# What the keys of the block file are called on the command line.
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


AS_TAKEN = (
    "photos as taken from the street, not straight on, want `rectified: false` beside their path in the block file"
)


@dataclass(frozen=True)
class Geometry:
    """The files that a city's geometry is in.

    Args:
        buildings: of any format that a block file names.
        streets: of any such; None: derived from the gaps between the buildings.
        crs: what the coordinates count in, where the files do not say it.
    """

    buildings: Path
    streets: Path | None
    crs: str | None = None

    def options(self) -> dict[str, str]:
        """What the block file's keys are called on the command line: one map has one option."""
        one = self.buildings == self.streets
        names = (
            {"buildings": "--osm", "streets": "--osm"} if one else {"buildings": "--buildings", "streets": "--streets"}
        )
        return names | {f"{key}.path": option for key, option in names.items()}


@dataclass(frozen=True)
class Found:
    """A new block, and its pictures by what they are of use for.

    Args:
        path: its block file.
        block: what that says.
        panoramas: pictures with a pose.
        photos: pictures named after a facade.
        unused: the others, each with the reason.
        facades: the ids that a photo can be named after.
    """

    path: Path
    block: Block
    panoramas: tuple[str, ...]
    photos: tuple[str, ...]
    unused: tuple[tuple[str, str], ...]
    facades: tuple[str, ...]

    def lines(self) -> list[str]:
        """What was found, one fact a line."""
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
            f"streets    {given}",
            f"facades    {len(self.facades)} seen from a street, such as {', '.join(self.facades[:3])}",
            f"pictures   {len(self.panoramas)} panoramas with a pose, {len(self.photos)} photos named after a facade, "
            f"{len(self.unused)} of no use yet",
            *(f"           {name}: {reason.removeprefix(f'{name} ')}" for name, reason in self.unused),
            *([f"           {AS_TAKEN}"] if self.photos else []),
            *(
                f"set aside  {fault.kind} {fault.id}: {fault.reason}"
                for fault in self.block.faults
                if fault.kind in ("building", "street")
            ),
            *(f"note       {note}" for note in self.block.notes),
        ]


def new_block(
    path: Path,
    geometry: Geometry,
    area: Sequence[float] | float,
    photos: Path | None,
    exemplars: Path | None,
    poses: Path | None = None,
    seed: int = 0,
    paint: Callable[[Path], None] = paint_exemplars,
) -> Found:
    """Write the block file `path` for a part of a city's geometry.

    Args:
        area: (west, south, east, north) in degrees, or the side in metres of the square that is built up most.
        photos: a folder of pictures; panoramas are told by their shape and pose, photos of a facade by its id as their name.
        exemplars: the style library; without it one is painted beside the file.
        poses: a file of the panoramas' poses, where they have none in themselves.
        paint: paints a style library into a folder.

    Raises InputError, and leaves nothing behind, where a block file is there already or the map holds no building there.
    """
    if path.exists():
        raise InputError(f"{path} is there already; name another file, or remove it")
    library = exemplars or path.parent / "exemplars"
    made = [folder for folder in (library, *path.parents) if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        if library in made:
            paint(library)
        return _written(path, geometry, area, photos, library, poses, seed)
    except BaseException:
        for folder in made:  # the library first, then parents from the inside out
            shutil.rmtree(folder, ignore_errors=True)
        raise


def _written(
    path: Path,
    geometry: Geometry,
    area: Sequence[float] | float,
    photos: Path | None,
    library: Path,
    poses: Path | None,
    seed: int,
) -> Found:
    bounds = _densest(geometry, area) if isinstance(area, float) else area
    imagery = {"exemplars": {"path": _beside(library, path)}}
    frame = {} if geometry.crs is None else {"crs": geometry.crs}
    keys = {
        "name": path.stem,
        "area": [round(float(value), 6) for value in bounds],
        "buildings": {"path": _beside(geometry.buildings, path)} | frame,
        **({} if geometry.streets is None else {"streets": {"path": _beside(geometry.streets, path)} | frame}),
        "imagery": imagery,
        "seed": seed,
    }
    draft = path.with_name(f".{path.name}.draft")
    options = _OPTIONS | geometry.options()
    try:
        block = _drafted(draft, keys, options)
        plan = plan_of(replace(block, texture=replace(block.texture, panorama_width=256)))
        ids = set(plan.facades.id)
        fronts = tuple(plan.facades.id[i] for i in np.flatnonzero(plan.facades.role == STREET).tolist())
        panoramas, named, unused = _sorted_pictures(photos, poses, block, ids) if photos else ((), (), ())
        if photos and panoramas:
            imagery["panoramas"] = {"path": _beside(photos, path)}
            if poses:
                imagery["panoramas"]["poses"] = _beside(poses, path)
        elif photos and named:
            imagery["photos"] = {"path": _beside(photos, path)}
        block = _drafted(draft, keys, options)
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
    return Found(path, block, panoramas, named, unused, fronts)


def _densest(geometry: Geometry, size: float) -> Bounds:
    option = geometry.options()["buildings.path"]
    try:
        source = read_buildings(geometry.buildings)
        crs = geometry.crs or source.crs
        if crs is None:
            raise InputError(f"{geometry.buildings} states no frame; give --crs EPSG:...")
        found = densest_square([replace(source, crs=crs)], size)
    except InputError as error:
        raise InputError(f"{option}: {error}") from error
    if found is None:
        raise InputError(f"{option}: {geometry.buildings} holds no buildings; give a file that does")
    return found


def _drafted(draft: Path, keys: dict, options: Mapping[str, str]) -> Block:
    draft.write_text(yaml.safe_dump(keys, sort_keys=False, allow_unicode=True), encoding="utf-8")
    try:
        return read_block(draft)
    except BlockFileError as error:  # the draft is nobody's file, and its keys are what the command was given
        key, _, problem = str(error).removeprefix(f"{draft}: ").partition(": ")
        raise InputError(f"{options.get(key, key)}: {problem}") from error


def _sorted_pictures(
    folder: Path, poses: Path | None, block: Block, facades: set[str]
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[tuple[str, str], ...]]:
    paths, broken = image_files(folder, "photo")
    stems = facades | set(map(file_stem, facades))
    try:
        found = read_panoramas(folder, poses, block.crs)
        posed = {panorama.path.name for panorama in found.items}
        reasons = {fault.id: fault.reason for fault in found.faults}
    except InputError:  # none can be used
        posed, reasons = set(), {}
    named = tuple(path.name for path in paths if path.stem in stems and path.name not in posed)
    without = "no pose, and not named after a facade"
    unused = [(path.name, reasons.get(path.name, without)) for path in paths if path.name not in {*posed, *named}]
    if posed and named:
        unused += [
            (name, "panoramas and photos of facades want a folder each; only panoramas are used") for name in named
        ]
    return tuple(sorted(posed)), named, tuple(unused + [(fault.id, fault.reason) for fault in broken])


def _beside(target: Path, block: Path) -> str:
    """A path as the block file writes it: relative where that is short."""
    relative = os.path.relpath(target.resolve(), block.parent.resolve())
    return str(target.resolve()) if relative.startswith(os.path.join("..", "..", "..")) else relative
