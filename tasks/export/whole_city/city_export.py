"""Export of a whole city, block by block: in the memory of one block, resumable, and atomic."""

from __future__ import annotations

import gc
import hashlib
import json
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from catalogs.features import natural_sort_key
from catalogs.printable_text import format_command
from catalogs.published.folders import Folder
from catalogs.published.geopackage_digest import read_geopackage_stamp, write_geopackage_stamp
from catalogs.published.s3 import S3Path
from catalogs.published.snapshot import SnapshotFolder, current_snapshot, find_current_snapshot
from facade_core.atlas.store import open_root
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import merge_attributions
from tasks.city.city_log import BLOCKS_FOLDER, CityLog, read_city_log
from tasks.engine.progress import begin_stage, report_progress
from tasks.export.city_objects import model_origin
from tasks.export.code_digest import export_key
from tasks.export.registry import FORMATS, CityFormat
from tasks.export.targets import (
    MARKER,
    ExportResult,
    check_target,
    export_folder_name,
    file_digests,
    read_marker,
    replace_file,
    replace_folder,
    write_block_marker,
)
from tasks.export.whole_city.notes import PartNotes, list_names
from tasks.export.whole_city.parts import CityFacts, Part, Staging
from tasks.publish.published_run import PublishedBlock, open_published_snapshot

# Source of a block that was cut from a city.
CITY_PART_KEY = "part.path"
# Stage of the progress over blocks.
STAGE = "blocks"


def export_city(
    out: Folder, format: str, to: Path | None, buildings: Sequence[str], as_file: bool, options: Mapping[str, object]
) -> ExportResult:
    """Export the published blocks of a city; see `tasks.export.formats.export_run`.

    Blocks are written one after the other into a hidden folder beside the target, where a killed export is resumed. A
    finished block is written again only if its snapshot, the options or the code changed.

    Parameters
    ----------
    out : folder of the city.
    format : name of the format.
    to : target; None: exports/FORMAT in the folder of the city, with a CRS exports/FORMAT-CRS.
    buildings : ids of buildings; empty: all.
    as_file : the target is one GeoPackage.
    options : options of the format.

    Raises
    ------
    InputError : one line with the remedy.
    """
    if to is None and isinstance(out, S3Path):
        raise InputError(f"{out}: a city in a bucket is exported to this machine; name a folder here with --to")
    log = read_city_log(out)
    kind = FORMATS[format].city
    if not isinstance(kind, CityFormat):
        raise InputError(
            f"--format {format}: holds one block, and {out} is a city; use {' or '.join(kind)}, or export a block of it, "
            f"such as {out}/{BLOCKS_FOLDER}/{next(iter(log.blocks), 'NAME')}"
        )
    blocks, notes = _list_published_blocks(out, log)
    if buildings:
        blocks = _list_owners(out, blocks, buildings)
    default = Path(str(out)).resolve() / "exports" / export_folder_name(format, options)
    target = default if to is None else to.resolve()
    check_target(target, format, as_file)
    city = _read_city_facts(out, log, blocks, kind, in_block_crs="crs" in options)
    gc.collect()  # an opened block is in cycles of references: several of them would stay in memory
    staging = Staging(target.with_name(f".{target.name}.part"), kind.keeps_folders)
    job = _CityExport(out, format, kind, city, staging, tuple(buildings), dict(options))
    try:
        with staging.lock():
            return job.run(blocks, target, as_file, notes)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); name another place with --to") from error


@dataclass(frozen=True)
class _CityExport:
    """One export of a city: its parts, and what joins them."""

    out: Folder
    format: str
    kind: CityFormat
    city: CityFacts
    staging: Staging
    buildings: tuple[str, ...]
    options: JsonObject

    def run(self, blocks: Sequence[str], target: Path, as_file: bool, notes: list[str]) -> ExportResult:
        """Write the missing parts, join them, and put the export in its place."""
        parts = [self.staging.part(block) for block in blocks]
        current = (self._part_key(part, current_snapshot(self._block_folder(part)).id) for part in parts)
        if (done := _finished_export(target, as_file, self._whole_key(current))) is not None:
            shutil.rmtree(self.staging.root)
            return ExportResult(target, done, tuple(notes))
        self.staging.remove_other_parts(parts)
        begin_stage(STAGE, len(parts))
        for part in parts:
            self._write_part(part, target)
        notes += self._part_notes(parts)
        root, key = self.staging.root, self._whole_key(marker["key"] for marker in self._markers(parts))
        attribution = merge_attributions(map(_attribution_without_extract, self._markers(parts)))
        main = self.kind.join(root, parts, self._markers(parts), self.city, attribution)
        if as_file:
            write_geopackage_stamp(root / main[0], key)
            replace_file(root / main[0], target)
            shutil.rmtree(root)
            return ExportResult(target, (target,), tuple(notes))
        self.staging.finish()
        about = {
            "format": self.format,
            "city": self.city.name,
            "crs": self.city.crs,
            "key": key,
            "attribution": attribution.to_json(),
            "notes": notes,
            "files": main,
            "digests": file_digests(root),
        }
        (root / MARKER).write_text(json.dumps(about, indent=1) + "\n")
        replace_folder(root, target)
        return ExportResult(target, tuple(target / name for name in main), tuple(notes))

    def _write_part(self, part: Part, target: Path) -> None:
        """Write the part of a block, unless it is there or can be copied from an earlier export."""
        with current_snapshot(self._block_folder(part)).hold_for_reading() as snapshot:
            key = self._part_key(part, snapshot.id)
            if self.staging.read_part_marker(part).get("key") == key or self._copy_part(part, target, key):
                report_progress(STAGE, earlier=1)
                return
            self._write_new_part(part, snapshot, key)
        gc.collect()
        report_progress(STAGE, 1)

    def _write_new_part(self, part: Part, snapshot: SnapshotFolder[Folder], key: str) -> None:
        """Write the part of a block from its snapshot."""
        results = open_published_snapshot(snapshot)
        chosen = results.select_buildings([one for one in self.buildings if one in _own_buildings(results)])
        with self.staging.write_part(part) as temporary:
            facts: JsonObject = {}
            if self.kind.write_part is None:
                files, notes = FORMATS[self.format].write(results, chosen, temporary.folder, **self.options)
            else:
                files, notes, facts = self.kind.write_part(results, chosen, temporary, self.city, self.options)
            marked = self.staging.marked_folder(temporary)
            write_block_marker(marked, results, self.format, key, files, notes, facts)

    def _copy_part(self, part: Part, target: Path, key: str) -> bool:
        """Copy a part from the export that is replaced, or from the export of the block alone."""
        if self.kind.joins_pieces:
            return False
        sources = [target / part.uri]
        block = self._block_folder(part)
        if self.kind.write_part is None and isinstance(block, Path):
            sources.append(block / "exports" / export_folder_name(self.format, self.options))
        return any(self.staging.copy_part(part, source, key) for source in sources)

    def _block_folder(self, part: Part) -> Folder:
        return self.out / BLOCKS_FOLDER / part.block

    def _part_key(self, part: Part, snapshot: str) -> str:
        """Compute the key of a part; that of the export of the block alone where the files are the same."""
        if self.kind.write_part is None:
            return export_key(self.format, snapshot, self.buildings, self.options)
        city = [part.block, self.city.name, self.city.crs, self.city.origin.tolist(), self.city.has_unique_ids]
        return export_key(self.format, snapshot, self.buildings, {**self.options, "city": city})

    def _whole_key(self, keys: Iterable[str]) -> str:
        """Compute the key of the export from those of its parts."""
        digest = hashlib.sha256(f"{self.format} {self.city.name}".encode())
        for key in keys:
            digest.update(key.encode())
        return digest.hexdigest()[:32]

    def _markers(self, parts: Sequence[Part]) -> Iterator[JsonObject]:
        return map(self.staging.read_part_marker, parts)

    def _part_notes(self, parts: Sequence[Part]) -> list[str]:
        """Return the notes of the parts; one that several have is stated once."""
        found = PartNotes()
        for part, marker in zip(parts, self._markers(parts), strict=True):
            found.add(part.block, marker["notes"])
        return found.lines(len(parts))


def _attribution_without_extract(marker: JsonObject) -> JsonObject:
    """Return the attribution of a part without the extract of the city, whose sources are named too."""
    attribution: JsonObject = marker["attribution"]
    return attribution | {"sources": [one for one in attribution["sources"] if one["key"] != CITY_PART_KEY]}


def _finished_export(target: Path, as_file: bool, key: str) -> tuple[Path, ...] | None:
    """Return the files of an export that has the key already; None if there is none. Its files are checked before."""
    if as_file:
        stamp = read_geopackage_stamp(target) if target.is_file() else None
        return (target,) if stamp is not None and stamp.key == key else None
    about = read_marker(target) if target.is_dir() else None
    return tuple(target / name for name in about["files"]) if about is not None and about.get("key") == key else None


def _list_published_blocks(out: Folder, log: CityLog) -> tuple[list[str], list[str]]:
    """Return the blocks that have published, in natural order, and notes on those that have not or have failed since."""
    again = f"`{format_command('city', 'CITY.yaml', '--out', out)}`"
    if not log.blocks:
        raise InputError(f"{out}: its list of blocks cannot be read; {again} writes it")
    names = sorted(log.blocks, key=natural_sort_key)
    published = [name for name in names if find_current_snapshot(out / BLOCKS_FOLDER / name) is not None]
    if not published:
        raise InputError(f"{out}: none of its {len(names)} blocks has published; {again} goes on")
    notes = []
    if missing := [name for name in names if name not in set(published)]:
        notes.append(f"{list_names(missing)}: left out, nothing is published of them; {again} goes on")
    if failed := [name for name in published if log.blocks[name].code not in (0, 1)]:
        notes.append(
            f"{list_names(failed)}: exported as published before, their last run did not finish; {again} goes on"
        )
    return published, notes


def _list_owners(out: Folder, blocks: Sequence[str], buildings: Sequence[str]) -> list[str]:
    """Return the blocks that own some buildings.

    Raises
    ------
    InputError : no block owns one of them.
    """
    owners, missing = [], dict.fromkeys(buildings)
    for block in blocks:
        with current_snapshot(out / BLOCKS_FOLDER / block).hold_for_reading() as snapshot:
            own = _own_buildings(open_published_snapshot(snapshot)) & set(buildings)
        gc.collect()
        if own:
            owners.append(block)
            missing = {name: None for name in missing if name not in own}
    if missing:
        raise InputError(f"--building {next(iter(missing))}: no published block of {out} has such a building")
    return owners


def _own_buildings(results: PublishedBlock) -> set[str]:
    return {results.names[building] for building in results.select_buildings(()).tolist()}


def _read_city_facts(
    out: Folder, log: CityLog, blocks: Sequence[str], kind: CityFormat, *, in_block_crs: bool
) -> CityFacts:
    """Read what the parts share: the origin of the first block, and the CRS of all."""
    with current_snapshot(out / BLOCKS_FOLDER / blocks[0]).hold_for_reading() as snapshot:
        first = open_published_snapshot(snapshot)
        facts = CityFacts(log.name, first.crs, model_origin(first), has_unique_ids=not log.sources)
    if (
        kind.shares_crs or in_block_crs
    ) and log.sources:  # block files of the user; blocks cut from one city have its CRS
        for block in blocks[1:]:
            with current_snapshot(out / BLOCKS_FOLDER / block).hold_for_reading() as snapshot:
                crs = str(open_root(snapshot.open_session()).attrs["crs"])
            if crs != facts.crs:
                raise InputError(
                    f"{out}: block {blocks[0]} is in {facts.crs} and {block} in {crs}, and the format has one frame; "
                    f"{'leave --crs out' if in_block_crs else 'use 3dtiles or cog'}, or export the blocks one by one"
                )
    return facts
