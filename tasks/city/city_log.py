"""What a city's run knows of its blocks, kept beside them: which stand, which failed, and what all of them come to."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from catalogs.city.keys import read_city_name
from catalogs.published.folders import Folder, join_path, local_folder, map_concurrently, move_folder, write_atomically
from catalogs.published.runs import CITY_FILE_NAME
from catalogs.published.s3 import S3Folder
from catalogs.published.snapshot import find_current_snapshot
from facade_core.atlas.journal import unit_key
from facade_core.core.errors import BlockFileError, InputError
from tasks.city.block_counts import BlockCounts
from tasks.city.blocks import City, CityBlock, read_city
from tasks.city.cost import COUNT_NAMES, load_cost_model
from tasks.city.source_digests import city_source_digest, block_code_version

# In a city's folder: the runs of its blocks; of which blocks it is and what they read; of what that which lies over all of them
# is; what all come to. In that of a block: how it ended last.
BLOCKS, ACCOUNT, OVER, SUMMARY, ENDED = "blocks", CITY_FILE_NAME, "over.json", "summary.json", "ended.json"
# Those of blocks that there were before it was cut otherwise: hidden from who looks for runs.
REMOVED_BLOCKS = ".gone"
# What of a block's summary is added up.
SUMMED_KEYS = ("facades_done", "facades_failed", "viewpoints", "units_done", "units_skipped")


@dataclass(frozen=True)
class BlockResult:
    """How the run of a block ended: by which code (None: it was not begun), what it was of (digest of the block, version of the
    code), which snapshot it published, and of which its 3D Tiles are; its summary, without paths and failures; why it
    failed, in a line; seconds of the clock, and of processors."""

    code: int | None = None
    digest: str = ""
    version: str = ""
    snapshot: str = ""
    tiles: str = ""
    summary: Mapping[str, Any] = field(default_factory=dict)
    reason: str = ""
    seconds: float = 0.0
    processor: float = 0.0


def block_tileset(block: Folder, snapshot: str) -> Folder:
    """A block's own 3D Tiles, in its folder; in a bucket those of each snapshot lie beside those before."""
    return join_path(block, f"exports/3dtiles/{f'{snapshot}/' if isinstance(block, S3Folder) else ''}tileset.json")


def is_up_to_date(out: Folder, name: str, ended: BlockResult, digest: str, *, tiles: bool = False) -> bool:
    """Whether a block is done and published as it is now, units that its input spoils aside: these fail again, as they did.

    tiles: whether its 3D Tiles are asked for too.
    """
    if ended.code not in (0, 1) or not digest or ended.digest != digest or ended.version != block_code_version():
        return False
    snapshot = find_current_snapshot(out / BLOCKS / name)
    if snapshot is None or snapshot.id != ended.snapshot:
        return False
    return not tiles or (ended.tiles == snapshot.id and block_tileset(out / BLOCKS / name, snapshot.id).is_file())


@dataclass(frozen=True)
class CityLog:
    """What is known of a city's blocks, by name; source: the digest of what they were cut from, sources: of those that are
    files of the user's; told: by the map of each, as `tasks.city.block_counts.BlockCounts` has it; over: which snapshots what lies over
    all was written of."""

    name: str
    source: str = ""
    blocks: Mapping[str, BlockResult] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)
    set_aside: Sequence[Sequence[str]] = ()
    told: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    over: str = ""

    def for_city(self, city: City, source: str) -> CityLog:
        """The same of a city as it was read now."""
        kept = {block.name: self.blocks.get(block.name, BlockResult()) for block in city.blocks}
        digests = {block.name: block.digest for block in city.blocks}
        told = {block.name: asdict(block.counts) for block in city.blocks}
        sources = {block.name: block.source for block in city.blocks if block.source}
        return CityLog(city.name, source, kept, digests, city.set_aside, told, sources, self.over)

    def estimate(
        self, names: Sequence[str], workers: int, at_once: int, planned: Mapping[str, Mapping[str, float]] | None = None
    ) -> dict[str, Any]:
        """What some blocks will take, by the model; planned: as of `Cost.estimate`, by name."""
        told = [BlockCounts(**self.told[name]) for name in names]
        return load_cost_model().estimate(told, workers, at_once, [planned[name] for name in names] if planned else ())

    def with_result(self, name: str, how: BlockResult) -> CityLog:
        return replace(self, blocks={**self.blocks, name: how})

    def pending_blocks(self, out: Folder, *, tiles: bool = False) -> list[str]:
        """The blocks that do not stand, in their order."""
        found = map_concurrently(
            lambda name: is_up_to_date(out, name, self.blocks[name], self.digests[name], tiles=tiles), self.blocks, out
        )
        return [name for name, standing in zip(self.blocks, found, strict=True) if not standing]

    def products_digest(self) -> str:
        """Of which snapshots what lies over all blocks would be, as a digest."""
        return unit_key([f"{name} {ended.snapshot} {ended.tiles}" for name, ended in sorted(self.blocks.items())])

    def summary(self, out: Folder) -> dict[str, Any]:
        """What all blocks come to."""
        found = [ended.summary for ended in self.blocks.values() if ended.summary]
        digests = [f"{name} {ended.summary.get('atlas_digest')}" for name, ended in sorted(self.blocks.items())]
        return {
            "city": self.name,
            "out": str(out),
            "blocks": len(self.blocks),
            "blocks_done": sum(ended.code in (0, 1) for ended in self.blocks.values()),
            **{key: sum(int(summary.get(key, 0)) for summary in found) for key in SUMMED_KEYS},
            "atlas_digest": unit_key(digests),
            "failures": [
                {"unit": f"block {name}", "reason": ended.reason or f"ended with {ended.code}", "code": ended.code}
                for name, ended in self.blocks.items()
                if ended.code not in (0, None)
            ],
            "left": [name for name, ended in self.blocks.items() if ended.code is None],
            "set_aside": [list(one) for one in self.set_aside],
        }


def prepare_city(city_file: Path, out: Folder) -> tuple[CityLog, dict[str, Path]]:
    """What is known of a city's blocks, and their block files; it is read and cut again where a file of it changed, or where
    this machine has not the block files of a city in a bucket.

    Raises InputError where the folder is another city's or a block's.
    """
    try:
        source = city_source_digest(city_file)
        name = read_city_name(city_file)
    except ValueError as error:
        raise BlockFileError(f"{city_file}: {error}") from error
    account = read_city_log(out)
    if (out / "store").is_dir():
        raise InputError(f"{out}: holds the run of a block; give city {name} a folder of its own with --out")
    if account.blocks and account.name != name:
        raise InputError(f"{out}: holds city {account.name}; give city {name} a folder of its own with --out")
    local = local_folder(out)
    files = {name: local / "input" / f"{name}.yaml" for name in account.blocks}
    counted = all(one.keys() == set(COUNT_NAMES) for one in account.told.values())
    whole = account.told.keys() == account.blocks.keys() and all(
        file.is_file() and file.with_suffix(".npz").is_file() for file in files.values()
    )
    if source and counted and whole and account.source == f"{source} {block_code_version()}":
        return account, files
    before = {
        one: CityBlock(one, Path(), account.digests[one], BlockCounts(**account.told[one]), of)
        for one, of in account.sources.items()
        if counted
    }
    found = read_city(city_file, local, before)
    account = account.for_city(found, f"{source} {block_code_version()}" if source else "")
    _hide_removed_blocks(out, account.blocks)  # before the new cut is known: after a kill it is cut again
    write_city_log(out, account)
    return account, {block.name: block.file for block in found.blocks}


def _hide_removed_blocks(out: Folder, names: Collection[str]) -> None:
    """Put the runs of blocks that the cut has no more where no query finds them: what they published is in other blocks now."""
    if (out / BLOCKS).is_dir():
        for folder in [one for one in (out / BLOCKS).iterdir() if one.name not in names and one.is_dir()]:
            move_folder(folder, out / REMOVED_BLOCKS / folder.name)


def read_city_log(out: Folder) -> CityLog:
    """What is known of the blocks in a city's folder: nothing where it cannot be read."""
    try:
        held = json.loads((out / ACCOUNT).read_text(encoding="utf-8"))
        names = list(held["digests"])
        blocks = dict(zip(names, map_concurrently(lambda name: _read_block_result(out, name), names, out), strict=True))
        return CityLog(**held, blocks=blocks, over=_read_products_digest(out))
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return CityLog("")


def _read_block_result(out: Folder, name: str) -> BlockResult:
    try:
        return BlockResult(**json.loads((out / BLOCKS / name / ENDED).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):  # it is run again, and finds what is done
        return BlockResult()


def _read_products_digest(out: Folder) -> str:
    try:
        return str(json.loads((out / OVER).read_text(encoding="utf-8"))["snapshots"])
    except (OSError, ValueError, TypeError, KeyError):  # it is written again
        return ""


def write_city_log(out: Folder, account: CityLog) -> None:
    """Keep of which blocks a city is and what they read."""
    _write(out / ACCOUNT, {key: value for key, value in asdict(account).items() if key not in ("blocks", "over")})


def write_block_result(out: Folder, name: str, ended: BlockResult) -> None:
    """Keep how a block ended, beside its run: that costs the same however many there are."""
    _write(out / BLOCKS / name / ENDED, asdict(ended))


def write_products_digest(out: Folder, account: CityLog) -> None:
    """Keep of which snapshots what lies over all blocks was written."""
    _write(out / OVER, {"snapshots": account.over})


def write_city_summary(out: Folder, summary: Mapping[str, Any]) -> None:
    _write(out / SUMMARY, summary)


def _write(path: Folder, value: Any) -> None:
    """In one step."""
    if isinstance(path, Path):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, (json.dumps(value, indent=1, ensure_ascii=False) + "\n").encode())
