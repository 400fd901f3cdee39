"""Blocks of a folder for the viewer: state, place and readable name of each, without opening their stores."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np

from catalogs.printable_text import format_command
from catalogs.published.folders import Folder, map_concurrently
from catalogs.published.runs import CITY_FILE_NAME, find_runs_with_store
from catalogs.published.s3 import S3Path
from catalogs.published.snapshot import find_current_snapshot
from facade_core.core.errors import FacadeError
from facade_core.core.json_types import JsonObject
from tasks.city.city_log import BLOCKS_FOLDER, BlockResult, read_city_log
from tasks.city.places import BlockPlace, main_streets, ring_around
from tasks.city.source_digests import block_code_version
from tasks.engine.commands import DEADLINE_EXIT_CODE
from tasks.viewing.run_view import RunReader, RunView

BlockState: TypeAlias = Literal["done", "running", "failed", "stale", "waiting"]

# The state is read again after this time, and after this multiple of the time that reading took, seconds.
MIN_REFRESH_S = 1.0
REFRESH_FACTOR = 20.0
# Time of one answer for places that only the store of a run holds, seconds; the next answer goes on.
MAX_PLACING_S = 1.0


@dataclass(frozen=True)
class _ListedBlock:
    """Block of the folder, as its log states it.

    Attributes
    ----------
    result : newest result in a city; None of a run that no city holds.
    digest : digest of the block's present input.
    counted : facades by the map, before the first run.
    """

    folder: Folder
    result: BlockResult | None = None
    digest: str = ""
    place: BlockPlace | None = None
    counted: int = 0


@dataclass(frozen=True)
class ViewedBlock:
    """Block as the viewer shows it.

    Attributes
    ----------
    number : number in addresses, the same as long as the viewer is open.
    name : name of the block; of several runs in a folder, the path of the run in it.
    folder : folder of its run.
    state : state of its run.
    reason : why it failed or is stale, one line.
    published : id of the newest published snapshot.
    place : its place; None where it is not known yet.
    facades, failed : facades, and those of them that failed.
    """

    number: int
    name: str
    folder: Folder
    state: BlockState
    reason: str
    published: str | None
    place: BlockPlace | None
    facades: int
    failed: int


@dataclass(frozen=True)
class ViewedCity:
    """Blocks of a folder at one time.

    Attributes
    ----------
    name : name of the city, or of the folder.
    under_way : a run of the city holds the folder.
    blocks : blocks by number.
    """

    name: str
    under_way: bool
    blocks: Mapping[int, ViewedBlock] = field(default_factory=dict)


class CityReader:
    """Reader of the blocks of a city, or of several runs in a folder; thread-safe.

    Parameters
    ----------
    out : folder of the city.
    is_running : reports whether a run holds a folder.
    """

    def __init__(self, out: Folder, is_running: Callable[[Folder], bool]) -> None:
        self.out = out
        self._is_running = is_running
        self._lock = threading.Lock()
        self._numbers: dict[str, int] = {}
        self._places: dict[str, BlockPlace | None] = {}
        self._origin: tuple[float, float] | None = None
        self._crs = ""
        self._city = ViewedCity("", under_way=False)
        self._expires = 0.0
        self._code = ""

    def read(self) -> ViewedCity:
        """Read the newest state of the blocks; repeated calls within a second share one reading."""
        with self._lock:
            if time.monotonic() >= self._expires:
                started = time.monotonic()
                is_first = not self._expires
                self._city = self._read()
                if is_first:  # it takes seconds to compute, for which the first page does not wait
                    threading.Thread(target=self._read_code_version, daemon=True, name="code version").start()
                took = time.monotonic() - started
                self._expires = time.monotonic() + max(MIN_REFRESH_S, REFRESH_FACTOR * took)
            return self._city

    def known_block(self, number: int) -> ViewedBlock | None:
        """Return the block with a number; None without such a block."""
        return self.read().blocks.get(number)

    @property
    def crs(self) -> str:
        """Return the CRS of the map: that of the first block with a place; empty before."""
        return self._crs

    @property
    def origin(self) -> tuple[float, float]:
        """Return the origin of the map [east, north] in metres; it does not move once there is a place."""
        return self._origin or (0.0, 0.0)

    def describe(self) -> JsonObject:
        """Return the blocks as JSON values; outlines are in metres from `origin`, y up."""
        city = self.read()
        others = [block for block in city.blocks.values() if block.place and block.place.crs != self.crs]
        return {
            "name": city.name,
            "under_way": city.under_way,
            "crs": self.crs,
            "origin": list(self.origin),
            "blocks": [_describe_block(block, self.origin, block not in others) for block in city.blocks.values()],
            "notes": [
                f"block {block.name} is in another CRS than the map ({self.crs}) and not on it; open it by itself: "
                f"{format_command('view', block.folder)}"
                for block in others
            ],
        }

    def _read_code_version(self) -> None:
        self._code = block_code_version()

    def _read(self) -> ViewedCity:
        name, listed = self._list_blocks()
        for block in listed:
            self._numbers.setdefault(block, len(self._numbers))
        under_way = self._is_running(self.out)
        # a lease in a bucket costs a request, and only a city's own run holds blocks there
        can_run = under_way or not isinstance(self.out, S3Path)
        found = map_concurrently(lambda one: self._view(*one, can_run=can_run), listed.items(), self.out)
        self._place_runs(found)
        blocks = {
            block.number: block if block.place else replace(block, place=self._places.get(block.name))
            for block in found
        }
        if self._origin is None:
            self._choose_origin([block.place for block in blocks.values() if block.place and block.place.outline])
        return ViewedCity(name, under_way, blocks)

    def _list_blocks(self) -> tuple[str, dict[str, _ListedBlock]]:
        log = read_city_log(self.out)
        if not log.blocks:
            runs = find_runs_with_store(self.out)
            return self.out.resolve().name, {name: _ListedBlock(folder) for name, folder in runs.items()}
        return log.name, {
            name: _ListedBlock(
                self.out / BLOCKS_FOLDER / name,
                result,
                log.digests[name],
                BlockPlace.from_json(place) if (place := log.places.get(name)) else None,
                int(log.told.get(name, {}).get("facades", 0)),
            )
            for name, result in log.blocks.items()
        }

    def _view(self, name: str, listed: _ListedBlock, *, can_run: bool) -> ViewedBlock:
        snapshot = find_current_snapshot(listed.folder)
        result = listed.result or BlockResult()
        state, reason = self._state(listed, snapshot.id if snapshot else None, can_run=can_run)
        summary = result.summary
        return ViewedBlock(
            self._numbers[name],
            name,
            listed.folder,
            state,
            reason,
            snapshot.id if snapshot else None,
            listed.place,
            int(summary.get("facades_done", listed.counted)) + int(summary.get("facades_failed", 0)),
            int(summary.get("facades_failed", 0)),
        )

    def _state(self, listed: _ListedBlock, published: str | None, *, can_run: bool) -> tuple[BlockState, str]:
        if can_run and self._is_running(listed.folder):
            return "running", ""
        result = listed.result
        if result is None:
            return ("done", "") if published else ("waiting", "not finished; run the block again to go on")
        if result.code in (None, DEADLINE_EXIT_CODE):
            return "waiting", result.reason
        if result.code not in (0, 1):
            return "failed", result.reason or f"ended with {result.code}"
        if result.digest != listed.digest or published != result.snapshot:
            return "stale", "its input or its folder changed since; run the city again"
        if self._code and result.version != self._code:
            return "stale", "another version of the program made it; run the city again"
        return "done", result.reason

    def _place_runs(self, blocks: list[ViewedBlock]) -> None:
        """Read the places of blocks without one in the log from their stores, for a limited time."""
        until = time.monotonic() + MAX_PLACING_S
        for block in blocks:
            if block.place or block.name in self._places:
                continue
            if time.monotonic() > until:
                break
            try:
                self._places[block.name] = _place_run(RunReader(block.folder).open_newest())
            except FacadeError:  # no store yet, or one of another version: listed, and not on the map
                if block.state not in ("running", "waiting"):
                    self._places[block.name] = None

    def _choose_origin(self, places: list[BlockPlace]) -> None:
        if not places:
            return
        self._crs = places[0].crs
        corners = np.concatenate([np.array(place.outline) for place in places if place.crs == self._crs])
        east, north = np.floor(corners.min(axis=0)).tolist()
        self._origin = east, north


def describe_run(reader: RunReader, is_running: Callable[[Folder], bool]) -> JsonObject:
    """Return one run as a city of one block, as `CityReader.describe` does, with the newest snapshot of its store.

    Raises
    ------
    StoreError : its block is not read yet.
    """
    view = reader.open_newest()
    published, running = view.newest_publication, is_running(reader.out)
    counts = Counter(record["status"] for record in view.records if record)
    state: BlockState = "running" if running else "done" if published == view.snapshot else "waiting"
    place = _place_run(view)
    origin = tuple(np.floor(np.array(place.outline).min(axis=0)).tolist()) if place.outline else (0.0, 0.0)
    name = str(view.group.attrs["block"])
    block = ViewedBlock(0, name, reader.out, state, "", published, place, len(view.tables.facades.id), counts["failed"])
    return {
        "name": name,
        "under_way": running,
        "crs": place.crs,
        "origin": list(origin),
        "blocks": [_describe_block(block, origin, True) | {"newest": view.snapshot}],
        "notes": [],
    }


def _describe_block(block: ViewedBlock, origin: tuple[float, ...], on_map: bool) -> JsonObject:
    place = block.place
    outline = np.array(place.outline).reshape(-1, 2) - origin if place and on_map else np.zeros((0, 2))
    return {
        "number": block.number,
        "name": block.name,
        "title": ", ".join(place.streets) if place else "",
        "state": block.state,
        "reason": block.reason,
        "facades": block.facades,
        "failed": block.failed,
        "published": block.published,
        "outline": outline.tolist(),
    }


def is_city(folder: Folder) -> bool:
    """Report whether a folder holds the log of a city with blocks."""
    return (folder / CITY_FILE_NAME).is_file() and bool(read_city_log(folder).blocks)


def _place_run(view: RunView) -> BlockPlace:
    """Return the place of a run by its plan."""
    tables = view.tables
    names = [tables.streets[index]["name"] for index in tables.facades.street.tolist()]
    return BlockPlace(str(view.group.attrs["crs"]), ring_around(tables.line.reshape(-1, 2)), main_streets(names))
