"""Keys of a city file: those of a block file and the partition, or a folder of block files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from catalogs.block.declared_keys import Effect, Key, PathKind, Section
from catalogs.block.key_faults import validate_block_settings, validate_section
from catalogs.block.keys import BlockFileSettings, Text
from catalogs.block.paths import resolve_path
from catalogs.block.yaml_files import read_yaml
from catalogs.city.tile_index import tile_files_in_area
from catalogs.printable_text import format_command
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject

# Keys of city files only.
CUT_KEY = "cut"
BLOCKS_KEY = "blocks"
# Key of `buildings`: an index of tiles in place of `path`.
TILES_KEY = "tiles"


class CutSection(Section):
    """Section `cut`."""

    metres: Annotated[
        float,
        Field(ge=20, le=20_000, allow_inf_nan=False),
        Key(
            "Side of the grid cells of the frame, whose borders follow the nearest streets: buildings enclosed by streets "
            "belong to one block. Each block also reads a halo of 120 m, so small blocks read much twice.",
            unit="m",
            effect=Effect.PLAN,
        ),
    ] = 400.0


# Side of a block where a city file states none.
DEFAULT_BLOCK_SIZE_M = CutSection().metres


class TiledBuildingsSection(Section):
    """Section `buildings` of a city, with an index in place of the path."""

    tiles: Annotated[
        Text,
        Key(
            "In place of `buildings.path`: an index of tiles. STAC (a catalogue, collection, item, or items in one file; the "
            "asset with the role `data`) or outlines in GeoParquet, GeoPackage or GeoJSON (the column `location`, as "
            "gdaltindex writes it, or `href`, `path`, `url`, `file`). Paths are relative to the file that states them. Tiles "
            "that do not meet `area` are not read. Nothing is downloaded: missing tiles are reported.",
            path=PathKind.FILE,
        ),
    ]


class BlocksSection(Section):
    """Section `blocks` of a city of existing block files."""

    path: Annotated[
        Text, Key("Folder of existing block files; the city holds only `name` beside it.", path=PathKind.FOLDER)
    ]


class CityOnlyKeys(Section):
    """Keys that a city file has in addition to those of a block file."""

    cut: Annotated[CutSection, Key("Partition of the city into blocks.")] = CutSection()
    buildings: Annotated[TiledBuildingsSection | None, Key("The building geometry.")] = None
    blocks: Annotated[BlocksSection | None, Key("Block files in place of the keys of a block file.")] = None


@dataclass(frozen=True)
class CityFileSettings:
    """Validated content of a city file that is to be partitioned.

    Attributes
    ----------
    block_keys : keys of the city as one block.
    values : the same keys as written in a block file.
    block_size : side of a block in metres.
    tile_indexes : indexes of tiles that the buildings were found in.
    """

    block_keys: BlockFileSettings
    values: JsonObject
    block_size: float
    tile_indexes: tuple[Path, ...] = ()


def uses_default_partition(path: Path) -> bool:
    """Return whether a city file has only keys of a block file. Raises ValueError."""
    values = read_yaml(path)
    return isinstance(values, Mapping) and not {CUT_KEY, BLOCKS_KEY} & set(values)


def read_city_name(path: Path) -> str:
    """Read the name of a city. Raises ValueError as `validate_city_settings`."""
    values = read_yaml(path)
    return str(values.get("name", path.stem)) if isinstance(values, Mapping) else path.stem


def validate_city_settings(values: object, path: Path) -> CityFileSettings | str:
    """Validate the content of a city file, and return its settings or the folder of its block files.

    Returns
    -------
    Keys of the city, or the folder of its block files.

    Raises
    ------
    ValueError : one line "key: problem; remedy".
    """
    if not isinstance(values, Mapping):
        raise ValueError("holds no keys; write the keys of a block file, or name and blocks: {path: FOLDER}")
    if BLOCKS_KEY in values:
        folder = values[BLOCKS_KEY]
        if set(values) - {"name", BLOCKS_KEY} or not isinstance(folder, Mapping) or set(folder) != {"path"}:
            raise ValueError(
                f"{BLOCKS_KEY}: a folder of block files is all that a city has then; write {BLOCKS_KEY}: {{path: FOLDER}}"
            )
        if not isinstance(folder["path"], str) or not folder["path"]:
            raise ValueError(f"{BLOCKS_KEY}.path: is no folder; write {BLOCKS_KEY}: {{path: FOLDER}}")
        return str(folder["path"])
    if "part" in values:
        raise ValueError(
            f"part: this is a block of a city that was cut; `{format_command('run', path)}` textures it alone; "
            "a city is run by the file from which it was cut"
        )
    rest, indexes = _resolve_tile_index({key: value for key, value in values.items() if key != CUT_KEY}, path)
    keys = validate_block_settings(rest)
    if keys.imagery.style is not None:
        raise ValueError(
            "imagery.style: each block would harvest the same pictures; "
            "run `streetloom harvest` once, and write exemplars: {path: FOLDER}"
        )
    if keys.streets is None:
        raise ValueError(
            "streets: missing, and a city is cut along its streets; write streets: {path: FILE}, or, where this is one block, "
            f"`{format_command('run', path)}`"
        )
    cut = validate_section(CityOnlyKeys, {CUT_KEY: values.get(CUT_KEY, {})}).cut
    return CityFileSettings(keys, rest, cut.metres, indexes)


def _resolve_tile_index(values: JsonObject, path: Path) -> tuple[JsonObject, tuple[Path, ...]]:
    """Replace an index of tiles with the files that it names, relative to the city file.

    Returns the new values, and the index.
    """
    buildings = values.get("buildings")
    if not isinstance(buildings, Mapping) or TILES_KEY not in buildings:
        return values, ()
    named = buildings[TILES_KEY]
    if "path" in buildings or not isinstance(named, str) or not named:
        raise ValueError("buildings.tiles: names an index of tiles in place of path; write buildings: {tiles: FILE}")
    index = resolve_path(f"buildings.{TILES_KEY}", named, path, PathKind.FILE, file_kind="city file")
    try:
        files = tile_files_in_area(index, values.get("area"))
    except InputError as error:
        raise ValueError(f"buildings.tiles: {error}") from error
    paths = [os.path.relpath(file, path.parent) for file in files]
    rest = {key: value for key, value in buildings.items() if key != TILES_KEY}
    return values | {"buildings": {"path": paths, **rest}}, (index,)
