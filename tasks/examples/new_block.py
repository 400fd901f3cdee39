"""Write a block file for a map extract and a folder of pictures, and say what was found in them."""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from catalogs.block import Block, read_block
from catalogs.features import file_stem
from catalogs.readers.pictures.folders import image_files
from catalogs.readers.pictures.panoramas import read_panoramas
from facade_core.errors import BlockFileError, InputError
from facade_core.geometry.walls import STREET
from tasks.examples.demo import paint_exemplars
from tasks.stages.planning import plan_of

# What the keys of the block file are called on the command line.
_OPTIONS = {
    "area": "--bbox",
    "buildings": "--osm",
    "buildings.path": "--osm",
    "streets": "--osm",
    "streets.path": "--osm",
    "imagery.exemplars": "--exemplars",
    "imagery.exemplars.path": "--exemplars",
    "imagery.panoramas": "--photos",
    "imagery.panoramas.path": "--photos",
    "imagery.panoramas.poses": "--poses",
    "imagery.photos": "--photos",
    "imagery.photos.path": "--photos",
}


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
            *(
                f"set aside  {fault.kind} {fault.id}: {fault.reason}"
                for fault in self.block.faults
                if fault.kind in ("building", "street")
            ),
            *(f"note       {note}" for note in self.block.notes),
        ]


def new_block(
    path: Path,
    osm: Path,
    bbox: Sequence[float],
    photos: Path | None,
    exemplars: Path | None,
    poses: Path | None = None,
    seed: int = 0,
    paint: Callable[[Path], None] = paint_exemplars,
) -> Found:
    """Write the block file `path` for the part of the map file `osm` inside `bbox` (west, south, east, north in degrees).

    Args:
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
        return _written(path, osm, bbox, photos, library, poses, seed)
    except BaseException:
        for folder in made:  # the library first, then parents from the inside out
            shutil.rmtree(folder, ignore_errors=True)
        raise


def _written(
    path: Path, osm: Path, bbox: Sequence[float], photos: Path | None, library: Path, poses: Path | None, seed: int
) -> Found:
    imagery = {"exemplars": {"path": _beside(library, path)}}
    keys = {
        "name": path.stem,
        "area": [float(value) for value in bbox],
        "buildings": {"path": _beside(osm, path)},
        "streets": {"path": _beside(osm, path)},
        "imagery": imagery,
        "seed": seed,
    }
    draft = path.with_name(f".{path.name}.draft")
    try:
        block = _drafted(draft, keys)
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
        block = _drafted(draft, keys)
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)
    return Found(path, block, panoramas, named, unused, fronts)


def _drafted(draft: Path, keys: dict) -> Block:
    draft.write_text(yaml.safe_dump(keys, sort_keys=False, allow_unicode=True), encoding="utf-8")
    try:
        return read_block(draft)
    except BlockFileError as error:  # the draft is nobody's file, and its keys are what the command was given
        key, _, problem = str(error).removeprefix(f"{draft}: ").partition(": ")
        raise InputError(f"{_OPTIONS.get(key, key)}: {problem}") from error


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
