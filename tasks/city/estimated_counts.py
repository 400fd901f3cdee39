"""Counts of a city or block before its first run: of its map, corrected by the plans of a sample of its parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from catalogs.block.block_file import BlockFileErrorContext
from catalogs.block.key_faults import read_block_settings
from catalogs.block.part import CityIndex, CityPartIds
from catalogs.block.reader import Block, build_block
from catalogs.city.keys import uses_default_partition
from catalogs.city.partition import partition_city
from catalogs.printable_text import format_count
from facade_core.core.arrays import Int64Array
from facade_core.core.errors import BlockFileError, GeometryError
from facade_core.core.name_hash import hash_name
from facade_core.geometry.ground.street_gaps import derive_streets
from tasks.city.block_counts import NO_COUNTS, BlockCounts, MapCounts, block_counts_from_map, block_counts_from_plan
from tasks.city.blocks import list_block_files, read_city_keys
from tasks.city.cost import load_cost_model

# Side of a part that is planned, metres: smaller parts vary more, larger ones take longer.
PART_SIZE_M = 200.0
# Surroundings of a planned part, metres: viewpoints up to 48 m away decide the density of a wall.
PART_HALO_M = 60.0
# Buildings that are planned, in parts as large as the mean; fewer and more parts are not.
MAX_PLANNED_BUILDINGS = 60
MIN_PLANNED_PARTS = 5
MAX_PLANNED_PARTS = 12
# Block files that are read.
MAX_READ_FILES = 12
# A block of fewer buildings is planned whole.
MAX_WHOLE_BUILDINGS = 60
# Share of intervals that hold the true value.
CONFIDENCE = 0.95

Notify = Callable[[str], None]


@dataclass(frozen=True)
class EstimatedCounts:
    """Counts of the blocks of a city, or of one block.

    Attributes
    ----------
    name : name of the city or block.
    blocks : counts of each block.
    planned, parts : parts that were planned, and parts in all.
    parts_are_files : whether the parts are block files, of which the others were not read.
    margin_s : half width of the interval that the sample leaves, in processor seconds of all blocks.
    is_city : False for a block file that `streetloom run` textures as it is.
    place, heights : place of a map that is read whole, and what its heights are, in words.
    """

    name: str
    blocks: tuple[BlockCounts, ...]
    planned: int
    parts: int
    margin_s: float
    is_city: bool
    parts_are_files: bool = False
    place: str = ""
    heights: str = ""


def estimate_counts(path: Path, notify: Notify = lambda step: None) -> EstimatedCounts:
    """Estimate the counts of a city file, of a city of block files, or of a block file.

    Parameters
    ----------
    path : city file or block file; a file without `cut` is one block.
    notify : receives each step.

    Raises
    ------
    BlockFileError : the file or a file that it names cannot be used.
    InputError : the folder of block files holds none.
    """
    try:
        is_block = uses_default_partition(path)
    except ValueError as error:
        raise BlockFileError(f"{path}: {error}") from error
    if is_block:
        notify("reading the map")
        return estimate_block_counts(_read_map(path), None, notify)
    values, keys = read_city_keys(path)
    if isinstance(keys, str):
        return _estimate_block_files(str(values.get("name", path.stem)), list_block_files(path, keys), notify)
    notify("reading the map")
    return estimate_block_counts(build_block(keys.block_keys, BlockFileErrorContext(path)), keys.block_size, notify)


def _read_map(path: Path) -> Block:
    """Read a block file without its corrections and digest, which hashes every picture."""
    try:
        keys = read_block_settings(path)
    except ValueError as error:
        raise BlockFileError(f"{path}: {error}") from error
    return build_block(keys, BlockFileErrorContext(path))


def estimate_block_counts(block: Block, block_size: float | None, notify: Notify) -> EstimatedCounts:
    """Estimate the counts of a map.

    Parameters
    ----------
    block_size : side of the blocks that it is cut into, metres; None for one block.
    """
    if block_size is None and (block.part is not None or len(block.buildings) <= MAX_WHOLE_BUILDINGS):
        notify(f"planning {format_count(len(block.buildings), 'building')}")
        counts = replace(block_counts_from_map(block), **block_counts_from_plan(block))
        place, heights = block.describe_place(), block.describe_heights()
        return EstimatedCounts(block.name, (counts,), 1, 1, 0.0, is_city=False, place=place, heights=heights)
    if not block.streets:
        notify("deriving the streets")
        block = replace(block, streets=derive_streets([building.footprint for building in block.buildings]))
    whole = CityIndex(block)
    notify(f"counting {format_count(len(block.buildings), 'building')}")
    on_map = MapCounts(block, whole.segments)
    parts = partition_city(block.buildings, whole.segments, block_size=PART_SIZE_M, halo=PART_HALO_M)
    counted = on_map.sum_by_block(*_owners(whole, parts), len(parts))
    wanted = MAX_PLANNED_BUILDINGS * len(parts) // len(block.buildings)
    most = min(max(wanted, MIN_PLANNED_PARTS), MAX_PLANNED_PARTS)
    chosen = choose_sample([_unit_seconds(one) for one in counted], most, block.seed)
    planned = []
    for number, index in enumerate(chosen, 1):
        notify(f"planning part {number} of {len(chosen)}")
        planned.append(replace(counted[index], **_plan_part(whole, parts[index])))
    sampled = [counted[index] for index in chosen]
    factors = _count_ratios(sampled, planned)
    margin = ratio_margin(
        [_unit_seconds(one) for one in sampled],
        [_unit_seconds(one) for one in planned],
        [_unit_seconds(one) for one in counted],
    )
    blocks: Sequence[BlockCounts]
    if block_size is None:
        blocks = on_map.sum_by_block(
            np.zeros(len(block.buildings), np.int64), np.zeros(len(whole.segments), np.int64), 1
        )
    else:
        cuts = partition_city(block.buildings, whole.segments, block_size=block_size, halo=0.0)
        blocks = on_map.sum_by_block(*_owners(whole, cuts), len(cuts))
    corrected = tuple(one.multiply(factors) for one in blocks)
    return EstimatedCounts(
        block.name,
        corrected,
        len(chosen),
        len(parts),
        margin,
        is_city=block_size is not None,
        place=block.describe_place(),
        heights=block.describe_heights(),
    )


def _estimate_block_files(name: str, files: Sequence[Path], notify: Notify) -> EstimatedCounts:
    """Estimate a city of block files from an evenly spaced sample of them; the others count as their mean."""
    chosen = choose_sample([1.0] * len(files), MAX_READ_FILES, hash_name(name))
    found = []
    for number, index in enumerate(chosen, 1):
        notify(f"block file {number} of {len(chosen)}: {files[index].name}")
        try:
            found.append(estimate_block_counts(_read_map(files[index]), None, lambda step: None))
        except BlockFileError:  # its run reports the error
            found.append(EstimatedCounts(name, (NO_COUNTS,), 0, 1, 0.0, is_city=False))
    counts = [one.blocks[0] for one in found]
    mean = sum(counts, NO_COUNTS).multiply(_constant_counts(1 / len(counts)))
    seconds = [_unit_seconds(one) for one in counts]
    between = ratio_margin([1.0] * len(chosen), seconds, [1.0] * len(files))
    within = len(files) / len(chosen) * float(np.linalg.norm([one.margin_s for one in found]))
    blocks = dict.fromkeys(range(len(files)), mean) | dict(zip(chosen, counts, strict=True))
    return EstimatedCounts(
        name,
        tuple(blocks[index] for index in range(len(files))),
        len(chosen),
        len(files),
        float(np.hypot(between, within)),
        is_city=True,
        parts_are_files=True,
    )


def choose_sample(sizes: Sequence[float], most: int, seed: int) -> list[int]:
    """Choose at most `most` items: one at random from each of as many strata of similar size; ascending indices.

    Parameters
    ----------
    sizes : size of each item.
    seed : seed of the choice.
    """
    if len(sizes) <= most:
        return list(range(len(sizes)))
    random = np.random.default_rng(seed)
    strata = np.array_split(np.argsort(np.asarray(sizes), kind="stable"), most)
    return sorted(int(random.choice(stratum)) for stratum in strata)


def ratio_margin(sampled: Sequence[float], found: Sequence[float], everything: Sequence[float]) -> float:
    """Return the half width of the interval of a ratio estimate of a total, at CONFIDENCE.

    Parameters
    ----------
    sampled : known values of the sampled items.
    found : their true values.
    everything : known values of all items.

    References
    ----------
    Cochran, Sampling Techniques, 3rd edition, Eq. 6.13.
    """
    from scipy.special import stdtrit

    known, true = np.asarray(sampled), np.asarray(found)
    count, number = len(known), len(everything)
    if count == number or count < 2:
        return 0.0
    residuals = true - true.sum() / max(known.sum(), 1e-9) * known
    variance = number**2 * (1 - count / number) / count * (residuals**2).sum() / (count - 1)
    return float(stdtrit(count - 1, 0.5 + CONFIDENCE / 2) * np.sqrt(variance))


def _unit_seconds(counts: BlockCounts) -> float:
    """Return the processor seconds of counts without what each block takes once."""
    return load_cost_model().processor_seconds(replace(counts, blocks=0.0, exemplars=0.0, exemplar_megapixels=0.0))


def _plan_part(whole: CityIndex, part: CityPartIds) -> dict[str, float]:
    block, own = whole.extract_part(part), set(part.buildings)
    # roofs of the surroundings take most of the time, and no count depends on them
    buildings = tuple(
        one if one.id in own or one.shell is not None else replace(one, roof=None) for one in block.buildings
    )
    try:
        return block_counts_from_plan(replace(block, buildings=buildings))
    except GeometryError:  # no building of it can be used
        return {}


def _owners(whole: CityIndex, parts: Sequence[CityPartIds]) -> tuple[Int64Array, Int64Array]:
    """Return the part of each building and of each segment."""
    buildings = {id: index for index, part in enumerate(parts) for id in part.buildings}
    streets = {id: index for index, part in enumerate(parts) for id in part.streets}
    return (
        np.array([buildings[one.id] for one in whole.block.buildings], np.int64),
        np.array([streets[one.id] for one in whole.segments], np.int64),
    )


def _count_ratios(sampled: Sequence[BlockCounts], planned: Sequence[BlockCounts]) -> BlockCounts:
    """Return the ratio of planned to mapped counts, 1 where the map has none."""
    before, after = sum(sampled, NO_COUNTS), sum(planned, NO_COUNTS)
    return BlockCounts(
        **{
            one.name: getattr(after, one.name) / getattr(before, one.name) if getattr(before, one.name) else 1.0
            for one in fields(BlockCounts)
        }
    )


def _constant_counts(value: float) -> BlockCounts:
    return BlockCounts(**{one.name: value for one in fields(BlockCounts)})
