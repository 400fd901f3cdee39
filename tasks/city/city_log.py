"""Log of a city's run, kept in its folder: the result of each block, and the totals."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from catalogs.city.keys import read_city_name
from catalogs.published.folders import (
    Folder,
    join_path,
    local_run_folder,
    map_concurrently,
    move_folder,
    write_atomically,
)
from catalogs.published.runs import CITY_BLOCKS_FOLDER, CITY_FILE_NAME
from catalogs.published.s3 import S3Path
from catalogs.published.snapshot import find_current_snapshot
from facade_core.atlas.journal import unit_key
from facade_core.core.errors import BlockFileError, InputError
from facade_core.core.json_types import JsonObject
from tasks.city.block_counts import BlockCounts
from tasks.city.blocks import City, CityBlock, partition_city_file
from tasks.city.cost import COUNT_NAMES, load_cost_model
from tasks.city.places import BlockPlace
from tasks.city.source_digests import block_code_version, city_source_digest

# Folder of the runs of blocks, in the city's folder.
BLOCKS_FOLDER = CITY_BLOCKS_FOLDER
# Log of the city without results.
CITY_LOG_FILE = CITY_FILE_NAME
# Digest of the snapshots that the city's products show.
PRODUCTS_FILE = "over.json"
SUMMARY_FILE = "summary.json"
# Result of a block, in the block's folder.
RESULT_FILE = "ended.json"
# Folder of removed blocks, which a search for runs skips.
REMOVED_BLOCKS = ".gone"
# Keys of the blocks' summaries that the city's summary adds up.
SUMMED_KEYS = ("facades_done", "facades_failed", "viewpoints", "units_done", "units_skipped")


@dataclass(frozen=True)
class BlockResult:
    """Result of the newest run of a block.

    Attributes
    ----------
    code : exit code; None before the first run.
    digest : digest of the block that was run.
    version : version of the code that ran it.
    snapshot : snapshot that the run published.
    tiles : snapshot that the block's 3D Tiles show.
    summary : summary of the run without paths and failures.
    reason : why the run failed, one line.
    seconds : wall-clock seconds.
    processor : processor seconds.
    """

    code: int | None = None
    digest: str = ""
    version: str = ""
    snapshot: str = ""
    tiles: str = ""
    summary: JsonObject = field(default_factory=dict)
    reason: str = ""
    seconds: float = 0.0
    processor: float = 0.0


def block_tileset_path(block: Folder, snapshot: str) -> Folder:
    """Return the path of a block's tileset.json; a bucket has one for each snapshot."""
    return join_path(block, f"exports/3dtiles/{f'{snapshot}/' if isinstance(block, S3Path) else ''}tileset.json")


def is_block_up_to_date(out: Folder, name: str, result: BlockResult, digest: str, *, tiles: bool = False) -> bool:
    """Report whether a block is finished and published in its present form.

    Units that failed because of their input do not count: they would fail again.

    Parameters
    ----------
    out : folder of the city.
    name : name of the block.
    ended : its newest result.
    digest : digest of the block's present input; empty if it cannot be used.
    tiles : require 3D Tiles of the newest snapshot too.
    """
    if result.code not in (0, 1) or not digest or result.digest != digest or result.version != block_code_version():
        return False
    snapshot = find_current_snapshot(out / BLOCKS_FOLDER / name)
    if snapshot is None or snapshot.id != result.snapshot:
        return False
    return not tiles or (
        result.tiles == snapshot.id and block_tileset_path(out / BLOCKS_FOLDER / name, snapshot.id).is_file()
    )


@dataclass(frozen=True)
class CityLog:
    """State of a city's blocks.

    Attributes
    ----------
    name : name of the city.
    source : digest of the city file, of its inputs and of the code.
    blocks : newest result of each block by name.
    digests : digest of each block's input by name.
    set_aside : rejected objects as (kind, id, reason).
    notes : what of the whole city's inputs was left out or assumed, one line each.
    told : counts of each block from the map, the fields of `BlockCounts`.
    sources : source digest of each block file that the user wrote.
    places : place of each block by name, as `BlockPlace.to_json` returns it; empty where its file cannot be used.
    over : digest of the snapshots that the city's products show.
    """

    name: str
    source: str = ""
    blocks: Mapping[str, BlockResult] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)
    set_aside: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()
    told: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    places: Mapping[str, JsonObject] = field(default_factory=dict)
    over: str = ""

    def adapt_to_city(self, city: City, source: str) -> CityLog:
        """Return the log for a newly read city, with the results of blocks that still exist."""
        kept = {block.name: self.blocks.get(block.name, BlockResult()) for block in city.blocks}
        digests = {block.name: block.digest for block in city.blocks}
        told = {block.name: asdict(block.counts) for block in city.blocks}
        sources = {block.name: block.source for block in city.blocks if block.source}
        places = {block.name: block.place.to_json() if block.place else {} for block in city.blocks}
        return CityLog(city.name, source, kept, digests, city.set_aside, city.notes, told, sources, places, self.over)

    def estimate(self, names: Sequence[str], workers: int, at_once: int) -> JsonObject:
        """Predict the cost of some blocks from their maps.

        Parameters
        ----------
        names : names of the blocks.
        workers : workers that the blocks share.
        at_once : blocks that run at the same time.
        """
        model = load_cost_model()
        counts = [model.correct_map_counts(BlockCounts(**self.told[name])) for name in names]
        return model.estimate(counts, workers, at_once)

    def with_result(self, name: str, result: BlockResult) -> CityLog:
        """Return a copy with the result of one block replaced."""
        return replace(self, blocks={**self.blocks, name: result})

    def pending_blocks(self, out: Folder, *, tiles: bool = False) -> list[str]:
        """List the blocks that are not up to date, in their order."""
        up_to_date = map_concurrently(
            lambda name: is_block_up_to_date(out, name, self.blocks[name], self.digests[name], tiles=tiles),
            self.blocks,
            out,
        )
        return [name for name, is_current in zip(self.blocks, up_to_date, strict=True) if not is_current]

    def products_digest(self) -> str:
        """Compute the digest of the snapshots that the city's products show when written now."""
        return unit_key([f"{name} {ended.snapshot} {ended.tiles}" for name, ended in sorted(self.blocks.items())])

    def summary(self, out: Folder) -> JsonObject:
        """Sum up the results of all blocks."""
        summaries = [ended.summary for ended in self.blocks.values() if ended.summary]
        digests = [f"{name} {ended.summary.get('atlas_digest')}" for name, ended in sorted(self.blocks.items())]
        return {
            "city": self.name,
            "out": str(out),
            "blocks": len(self.blocks),
            "blocks_done": sum(ended.code in (0, 1) for ended in self.blocks.values()),
            **{key: sum(int(summary.get(key, 0)) for summary in summaries) for key in SUMMED_KEYS},
            "atlas_digest": unit_key(digests),
            "failures": [
                {"unit": f"block {name}", "reason": ended.reason or f"ended with {ended.code}", "code": ended.code}
                for name, ended in self.blocks.items()
                if ended.code not in (0, None)
            ],
            "left": [name for name, ended in self.blocks.items() if ended.code is None],
            "set_aside": [list(one) for one in self.set_aside],
            "notes": list(self.notes),
        }


def load_or_partition_city(
    city_file: Path, out: Folder, notify: Callable[[str], None] = lambda step: None
) -> tuple[CityLog, dict[str, Path]]:
    """Load the log of a city, and partition the city again if its inputs changed.

    The city is partitioned again too if this machine lacks the block files of a city in a bucket.

    Parameters
    ----------
    city_file : city file.
    out : folder of the city.
    notify : receives each step of a partition as it begins.

    Returns
    -------
    log : state of the blocks.
    files : block files by block name.

    Raises
    ------
    InputError : the folder belongs to another city or to a block.
    """
    try:
        source = city_source_digest(city_file)
        name = read_city_name(city_file)
    except ValueError as error:
        raise BlockFileError(f"{city_file}: {error}") from error
    log = read_city_log(out)
    if (out / "store").is_dir():
        raise InputError(f"{out}: holds the run of a block; give city {name} a folder of its own with --out")
    if log.blocks and log.name != name:
        raise InputError(f"{out}: holds city {log.name}; give city {name} a folder of its own with --out")
    local = local_run_folder(out)
    files = {name: local / "input" / f"{name}.yaml" for name in log.blocks}
    counted = all(one.keys() == set(COUNT_NAMES) for one in log.told.values()) and log.places.keys() == log.told.keys()
    whole = log.told.keys() == log.blocks.keys() and all(
        file.is_file() and file.with_suffix(".npz").is_file() for file in files.values()
    )
    if source and counted and whole and log.source == f"{source} {block_code_version()}":
        return log, files
    before = {
        one: CityBlock(one, Path(), log.digests[one], BlockCounts(**log.told[one]), of, _logged_place(log, one))
        for one, of in log.sources.items()
        if counted
    }
    city = partition_city_file(city_file, local, before, notify)
    log = log.adapt_to_city(city, f"{source} {block_code_version()}" if source else "")
    _hide_removed_blocks(out, log.blocks)  # before the log is written: after a kill the city is partitioned again
    write_city_log(out, log)
    return log, {block.name: block.file for block in city.blocks}


def _logged_place(log: CityLog, name: str) -> BlockPlace | None:
    return BlockPlace.from_json(log.places[name]) if log.places[name] else None


def _hide_removed_blocks(out: Folder, names: Collection[str]) -> None:
    """Move the runs of removed blocks out of reach of queries; other blocks publish their content now."""
    if (out / BLOCKS_FOLDER).is_dir():
        for folder in [one for one in (out / BLOCKS_FOLDER).iterdir() if one.name not in names and one.is_dir()]:
            move_folder(folder, out / REMOVED_BLOCKS / folder.name)


def read_city_log(out: Folder) -> CityLog:
    """Load the log in a city's folder; an empty one if it cannot be read."""
    try:
        values = json.loads((out / CITY_LOG_FILE).read_text(encoding="utf-8"))
        names = list(values["digests"])
        blocks = dict(zip(names, map_concurrently(lambda name: _read_block_result(out, name), names, out), strict=True))
        return CityLog(**values, blocks=blocks, over=_read_products_digest(out))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return CityLog("")


def _read_block_result(out: Folder, name: str) -> BlockResult:
    try:
        return BlockResult(**json.loads((out / BLOCKS_FOLDER / name / RESULT_FILE).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):  # the block runs again, and resumes
        return BlockResult()


def _read_products_digest(out: Folder) -> str:
    try:
        return str(json.loads((out / PRODUCTS_FILE).read_text(encoding="utf-8"))["snapshots"])
    except (OSError, ValueError, TypeError, KeyError):  # the products are written again
        return ""


def write_city_log(out: Folder, log: CityLog) -> None:
    """Write the city's log without the results of its blocks."""
    _write(out / CITY_LOG_FILE, {key: value for key, value in asdict(log).items() if key not in ("blocks", "over")})


def write_block_result(out: Folder, name: str, result: BlockResult) -> None:
    """Write a block's result into the block's folder, so that the cost does not grow with their number."""
    _write(out / BLOCKS_FOLDER / name / RESULT_FILE, asdict(result))


def write_products_digest(out: Folder, log: CityLog) -> None:
    """Record which snapshots the city's products show."""
    _write(out / PRODUCTS_FILE, {"snapshots": log.over})


def write_city_summary(out: Folder, summary: JsonObject) -> None:
    """Write the summary of the city."""
    _write(out / SUMMARY_FILE, summary)


def _write(path: Folder, value: object) -> None:
    """Write a value as JSON atomically."""
    if isinstance(path, Path):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, (json.dumps(value, indent=1, ensure_ascii=False) + "\n").encode())
