"""A city's blocks: cut, and written as block files, each a run of its own."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from catalogs.block.file import BlockFile
from catalogs.block.keys import PartKeys
from catalogs.block.part import fronts_of, restricted
from catalogs.block.reading import Block, block_of, read_block, with_digest
from catalogs.block.segments import segments
from catalogs.block.yaml_files import read_yaml
from catalogs.city.cutting import Cut, cut_city, reach_of
from catalogs.city.keys import CUT, check_city
from facade_core.errors import BlockFileError, InputError
from facade_core.fronts import outlines_as_walls
from facade_core.naming import number_of
from facade_core.style import order_of
from tasks.city.counting import NOTHING, Counts, counts_of

# Keys of a block file that name paths, dotted.
_PATHS = (
    "buildings.path", "streets.path", "terrain.path", "imagery.exemplars.path", "imagery.photos.path",
    "imagery.panoramas.path", "imagery.panoramas.poses", "imagery.aerial.path", "texture.roof_material.path",
    "texture.materials",
)  # fmt: skip


@dataclass(frozen=True)
class CityBlock:
    """A block of a city: its name, its block file, the digest of all that it reads, and how much its map
    tells of."""

    name: str
    file: Path
    digest: str
    told: Counts = NOTHING


@dataclass(frozen=True)
class City:
    """A city as it was read: its blocks by name, and what could not be used of its files, as (kind, id, reason)."""

    name: str
    blocks: tuple[CityBlock, ...]
    set_aside: tuple[tuple[str, str, str], ...]


def read_city(path: Path, out: Path) -> City:
    """Read a city file, cut the city, and write the block files of which it is made into out/input.

    Raises BlockFileError, as for a block file; InputError where its folder of block files holds none.
    """
    values, asked = _asked(path)
    if isinstance(asked, str):
        return _of_files(path, values, asked)
    keys, metres = asked
    file = BlockFile(path)
    whole = block_of(keys, file)
    cuts = cut_whole(whole, metres)
    folder = out / "input"
    folder.mkdir(parents=True, exist_ok=True)
    blocks = []
    for cut, part in zip(cuts, parts_of_city(whole, cuts), strict=True):
        block_file = folder / f"{cut.name}.yaml"
        rest = {key: value for key, value in values.items() if key != CUT}
        named = _moved(rest, path.parent, folder) | {"name": f"{keys.name}-{cut.name}", "part": part.model_dump()}
        _write(block_file, yaml.safe_dump(named, sort_keys=False, allow_unicode=True))
        block = with_digest(restricted(whole, part), file)
        blocks.append(CityBlock(cut.name, block_file, block.digest, counts_of(block)))
    return City(keys.name, tuple(blocks), tuple((one.kind, one.id, one.reason) for one in whole.faults))


def cut_whole(whole: Block, metres: float) -> tuple[Cut, ...]:
    """A city, read as one block, cut into blocks of so many metres a side."""
    texture = whole.texture
    reach = reach_of(
        sun=texture.sun is not None, panoramas=bool(whole.panoramas), visibility_range=texture.visibility_range
    )
    return cut_city(whole.buildings, segments(whole.streets), metres=metres, reach=reach)


def parts_of_city(whole: Block, cuts: Sequence[Cut]) -> list[PartKeys]:
    """What the block files of a city say of its parts: with the buildings beyond, on which the choice of exemplars stands."""
    fronts = fronts_of(whole.buildings, segments(whole.streets))
    walls = outlines_as_walls(whole.buildings, fronts, [-1] * len(whole.buildings), whole.storey)
    order = order_of(walls, seed=whole.seed)
    numbers = {building.id: number_of(building.house) for building in whole.buildings}
    parts = []
    for cut in cuts:
        mine = np.array([numbers[one] for one in cut.buildings], np.int64)
        needed = set(order.needed(mine).tolist())
        beyond = sorted({one for one, number in numbers.items() if number in needed} - set(cut.buildings))
        parts.append(
            PartKeys(
                buildings=list(cut.buildings),
                streets=list(cut.streets),
                context=list(cut.context),
                passing=list(cut.passing),
                beyond=beyond,
            )
        )
    return parts


def _asked(path: Path) -> tuple[Mapping[str, Any], Any]:
    try:
        values = read_yaml(path)
        return values, check_city(values)
    except ValueError as error:
        raise BlockFileError(f"{path}: {error}") from error


def _of_files(path: Path, values: Mapping[str, Any], named: str) -> City:
    folder = path.parent / Path(named).expanduser()
    files = sorted(folder.glob("*.yaml")) if folder.is_dir() else []
    if not files:
        raise InputError(f"{path}: blocks.path: {folder} holds no block file (*.yaml); name a folder that does")
    name = str(values.get("name", path.stem))
    return City(name, tuple(map(_of_file, files)), ())


def _of_file(block_file: Path) -> CityBlock:
    """A block file of the user's; what is wrong with one its run will say."""
    try:
        block = read_block(block_file)
    except BlockFileError:
        return CityBlock(block_file.stem, block_file, "")
    return CityBlock(block_file.stem, block_file, block.digest, counts_of(block))


def _moved(values: Mapping[str, Any], before_: Path, now: Path) -> dict[str, Any]:
    """The keys of a block file in another folder: relative paths lead where they led."""

    def moved(text: str) -> str:
        return text if text.startswith(("~", "$")) or Path(text).is_absolute() else os.path.relpath(before_ / text, now)

    def walk(value: Any, key: str) -> Any:
        if isinstance(value, Mapping):
            return {name: walk(one, f"{key}.{name}" if key else name) for name, one in value.items()}
        if key in _PATHS:
            return [moved(one) for one in value] if isinstance(value, list) else moved(value)
        return value

    return walk(values, "")


def _write(path: Path, text: str) -> None:
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        temporary = path.with_suffix(".tmp")
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
