"""Partition of a city into blocks, each written as a block file with a run of its own."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from catalogs.block.block_file import BlockFileErrorContext
from catalogs.block.building_corrections import apply_corrections_to_block, building_ids_by_correction
from catalogs.block.corrections import Corrections, read_corrections
from catalogs.block.declared_keys import PathKind
from catalogs.block.extract import write_city_part_file
from catalogs.block.keys import MAX_NAME_LENGTH
from catalogs.block.part import CityIndex, CityPartIds
from catalogs.block.paths import hide_variable_values, path_keys, resolve_path
from catalogs.block.reader import build_block, city_part_file_values, read_block, set_digest
from catalogs.block.settings import replace_settings
from catalogs.block.yaml_files import format_yaml, read_yaml
from catalogs.city.keys import CityFileSettings, validate_city_settings
from catalogs.city.partition import halo_radius, partition_city
from catalogs.printable_text import format_count
from facade_core.core.errors import BlockFileError, InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.name_hash import hash_name
from facade_core.plan.exemplar_choice import exemplar_choice_order
from facade_core.plan.exemplar_inputs import target_walls_from_outlines
from tasks.city.block_counts import NO_COUNTS, BlockCounts, block_counts_from_map
from tasks.city.places import BlockPlace, place_block
from tasks.city.source_digests import block_source_digest


@dataclass(frozen=True)
class CityBlock:
    """Block of a city: its name, block file, input digest, counts and place.

    Attributes
    ----------
    name : name of the block.
    file : its block file.
    digest : digest of its input; empty if it cannot be used.
    counts : counts from its map.
    source : digest of the sources of a block file that the user wrote; empty if it cannot be used.
    place : its place; None if its file cannot be used.
    """

    name: str
    file: Path
    digest: str
    counts: BlockCounts = NO_COUNTS
    source: str = ""
    place: BlockPlace | None = None


@dataclass(frozen=True)
class City:
    """City after reading: its blocks, rejected objects as (kind, id, reason), and notes on its inputs."""

    name: str
    blocks: tuple[CityBlock, ...]
    set_aside: tuple[tuple[str, str, str], ...]
    notes: tuple[str, ...] = ()


def partition_city_file(
    path: Path,
    out: Path,
    before: Mapping[str, CityBlock] | None = None,
    notify: Callable[[str], None] = lambda step: None,
) -> City:
    """Read a city file, partition the city and write its block files into out/input.

    Parameters
    ----------
    path : city file.
    out : local folder of the city.
    before : blocks of the previous reading; block files of the user with unchanged sources are not read again.
    notify : receives each step as it begins.

    Raises
    ------
    BlockFileError : the city file or a file that it names cannot be used.
    InputError : the folder of block files holds none.
    """
    values, city_keys = read_city_keys(path)
    notify("reading the city")
    if isinstance(city_keys, str):
        return _city_from_files(path, values, city_keys, before or {})
    keys = city_keys.block_keys
    file = BlockFileErrorContext(path)
    folder = out / "input"
    folder.mkdir(parents=True, exist_ok=True)
    corrections = file.call_reader("corrections", read_corrections, path)
    whole = CityIndex(build_block(keys, file))
    cuts = partition_indexed_city(whole, city_keys.block_size)
    notify(f"cutting {format_count(len(whole.block.buildings), 'building')} into {format_count(len(cuts), 'block')}")
    rest, city = _rebase_paths(city_keys.values, path.parent, folder), os.path.relpath(path, folder)
    blocks = []
    for chosen, cut in zip(select_city_part_ids(whole, cuts), cuts, strict=True):
        block_file, extract = folder / f"{cut.name}.yaml", f"{cut.name}.npz"
        named = rest | {"name": _block_name(keys.name, cut.name), "part": {"path": extract, "city": city}}
        part = whole.extract_part(chosen)
        write_city_part_file(folder / extract, city_part_file_values(part, whole.block))
        _write_if_changed(block_file, format_yaml(named))
        part = replace(part, settings=replace_settings(part.settings, name=named["name"]))
        block = set_digest(apply_corrections_to_block(part, corrections), file)
        counts, place = block_counts_from_map(block), place_block(block)
        blocks.append(CityBlock(cut.name, block_file, block.digest, counts, place=place))
    faults = tuple((one.kind, one.id, one.reason) for one in whole.block.faults)
    return City(keys.name, tuple(blocks), faults + tuple(_unused_corrections(whole, corrections)), whole.block.notes)


def _unused_corrections(whole: CityIndex, corrections: Corrections) -> Iterator[tuple[str, str, str]]:
    """List the corrections of objects outside every block: they are kept, and not used."""
    block = whole.block
    for id, owner in building_ids_by_correction(corrections, block.buildings, block.crs).items():
        if not owner:
            yield "correction", id, "corrected, and not in the city as it is: kept and not used"


def _block_name(city: str, block: str) -> str:
    """Name a block of a city within the maximum length of names."""
    return f"{city[: MAX_NAME_LENGTH - 1 - len(block)]}-{block}"


def partition_indexed_city(whole: CityIndex, metres: float) -> tuple[CityPartIds, ...]:
    """Partition a city into blocks of a size in metres."""
    texture = whole.block.texture
    reach = halo_radius(
        sun=texture.sun is not None, panoramas=bool(whole.block.panoramas), visibility_range=texture.visibility_range
    )
    return partition_city(whole.block.buildings, whole.segments, block_size=metres, halo=reach)


def select_city_part_ids(whole: CityIndex, cuts: Sequence[CityPartIds]) -> Iterator[CityPartIds]:
    """Yield the ids of each block: core, halo, and distant buildings that its style needs."""
    block = whole.block
    walls = target_walls_from_outlines(block.buildings, whole.front_streets, [-1] * len(block.buildings), block.storey)
    order = exemplar_choice_order(walls, seed=block.seed)
    numbers = {building.id: hash_name(building.whole_id) for building in block.buildings}
    numbered = defaultdict(list)
    for building, number in numbers.items():
        numbered[number].append(building)
    for cut in cuts:
        needed = order.dependencies(np.array([numbers[one] for one in cut.buildings], np.int64)).tolist()
        beyond = {building for number in needed for building in numbered[number]} - set(cut.buildings)
        yield replace(cut, distant_buildings=tuple(sorted(beyond)))


def read_city_keys(path: Path) -> tuple[JsonObject, CityFileSettings | str]:
    """Read a city file: its values, and its settings or the folder of its block files; raises BlockFileError."""
    try:
        values = read_yaml(path)
        # check_city refuses documents that are no mapping
        return cast(JsonObject, values), validate_city_settings(values, path)
    except ValueError as error:
        raise BlockFileError(hide_variable_values(f"{path}: {error}", path)) from error


def _city_from_files(path: Path, values: JsonObject, named: str, before: Mapping[str, CityBlock]) -> City:
    files = list_block_files(path, named)
    name = str(values.get("name", path.stem))
    return City(name, tuple(_read_user_block(file, before.get(file.stem)) for file in files), ())


def list_block_files(path: Path, named: str) -> list[Path]:
    """List the block files of the folder that a city file names.

    Raises
    ------
    BlockFileError : the folder's name cannot be used.
    InputError : the folder holds no block file.
    """
    try:
        folder = resolve_path("blocks.path", named, path, PathKind.FOLDER, file_kind="city file")
    except ValueError as error:
        raise BlockFileError(hide_variable_values(f"{path}: {error}", path)) from error
    files = sorted(folder.glob("*.yaml")) if folder.is_dir() else []
    if not files:
        raise InputError(f"{path}: blocks.path: {folder} holds no block file (*.yaml); name a folder that does")
    return files


def _read_user_block(block_file: Path, before: CityBlock | None) -> CityBlock:
    """Read a block file of the user; its run reports faults of the file."""
    source = block_source_digest(block_file)
    if before is not None and source and before.source == source:
        return replace(before, file=block_file)
    try:
        block = read_block(block_file)
    except BlockFileError:
        return CityBlock(block_file.stem, block_file, "")
    return CityBlock(
        block_file.stem, block_file, block.digest, block_counts_from_map(block), source, place_block(block)
    )


def _rebase_paths(values: Mapping[str, object], before_: Path, now: Path) -> JsonObject:
    """Rewrite relative paths of a block file for another folder."""
    paths = path_keys()

    def rebase(text: str) -> str:
        return text if text.startswith(("~", "$")) or Path(text).is_absolute() else os.path.relpath(before_ / text, now)

    def walk(value: object, key: str) -> object:
        if isinstance(value, Mapping):
            return {name: walk(one, f"{key}.{name}" if key else name) for name, one in value.items()}
        if key in paths:
            return [rebase(one) for one in value] if isinstance(value, list) else rebase(cast(str, value))
        return value

    return cast(JsonObject, walk(values, ""))


def _write_if_changed(path: Path, text: str) -> None:
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        temporary = path.with_suffix(".tmp")
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
