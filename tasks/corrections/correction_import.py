"""Import of corrections from an export or from the viewer.

Differences from the published results go into the corrections file of the block, or of the city that it is part of.
"""

from __future__ import annotations

import io
import threading
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from catalogs.block.corrections import (
    BUILDING_CORRECTION_KINDS,
    FACADE_CORRECTION_KINDS,
    Correction,
    append_corrections_to_file,
    city_or_block_file,
    corrections_file,
    read_corrections,
)
from catalogs.printable_text import format_command, format_count
from catalogs.published.folders import Folder
from catalogs.published.runs import CITY_FILE_NAME, find_runs
from catalogs.published.snapshot import current_snapshot
from catalogs.readers.annotations import (
    Annotation,
    facades_by_picture_name,
    parse_correction_annotations,
    read_correction_annotations,
)
from facade_core.core.errors import InputError
from tasks.corrections.correction_diff import CorrectionDiff
from tasks.corrections.unaffected_walls import find_unaffected_walls
from tasks.engine.store.status import read_run_block_file
from tasks.publish.published_run import PublishedBlock, open_published_run, open_published_snapshot


@dataclass(frozen=True)
class ImportResult:
    """Result of an import.

    Attributes
    ----------
    files : corrections files that were written.
    command : command that runs the affected units again.
    facades : corrected facades.
    buildings : corrected buildings, without those whose visible surfaces do not change.
    notes : replaced corrections of other people, ignored values, and corrections without effect.
    """

    files: tuple[Path, ...]
    command: str
    facades: int
    buildings: int
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Format the result, one line for each fact."""
        if not self.files:
            return ["nothing differs from what was published; nothing was written"]
        where = self.files[0] if len(self.files) == 1 else f"{len(self.files)} files beside those of the blocks"
        return [
            f"{format_count(self.facades, 'facade')} and {format_count(self.buildings, 'building')} corrected in {where}",
            f"what depends on them is due: {self.command}",
        ]


def import_corrections(out: Folder, path: Path, *, who: str, why: str = "") -> ImportResult:
    """Import corrections of a run, or of the runs of a city's blocks, from a file; all or none.

    Parameters
    ----------
    out : folder of the run or of the city.
    path : file of corrections.
    who : author of the corrections.
    why : their reason.

    Raises
    ------
    InputError : the file has another format, an id is unknown, or a value is not possible.
    """
    by = _correction_author(who, why)
    if (out / CITY_FILE_NAME).is_file():
        return _import_into_city(out, path, by)
    with open_published_run(out) as results:
        said = read_correction_annotations(path, facades_by_picture_name(list(results.plan.facades.id)))
        run = results.snapshot.out
        return _write_diffs(run, [_diff_block(run, results, said, str(path), by)])


class CorrectionImporter:
    """Importer for one run that keeps the published snapshot open between imports; thread-safe."""

    def __init__(self, out: Folder) -> None:
        self.out = out
        self._lock = threading.Lock()
        self._found: PublishedBlock | None = None

    def add(self, corrections: Sequence[Mapping[str, object]], named: str, *, who: str, why: str = "") -> ImportResult:
        """Import a list of corrections in streetloom's own JSON form; all or none.

        Parameters
        ----------
        corrections : corrections as JSON objects.
        named : name of their source in error messages.
        who : author of the corrections.
        why : their reason.

        Raises
        ------
        InputError : as `import_corrections`.
        """
        with self._lock, current_snapshot(self.out).hold_for_reading() as snapshot:
            if self._found is None or self._found.snapshot.id != snapshot.id:
                self._found = open_published_snapshot(snapshot)
            return _write_diffs(
                self.out,
                [
                    _diff_block(
                        self.out,
                        self._found,
                        parse_correction_annotations(corrections, named),
                        named,
                        _correction_author(who, why),
                    )
                ],
            )


def find_run_block_file(out: Folder) -> Path:
    """Return the block file of a run, whose folder holds its corrections.

    Raises
    ------
    InputError : the block file does not exist any more.
    """
    block = read_run_block_file(out)
    if block is None or not block.is_file():
        raise InputError(f"{out}: its block file {block or ''} is not there any more; corrections are kept beside it")
    return block


class _BlockDiff(NamedTuple):
    """New corrections of a block, notes, and buildings whose visible surfaces do not change."""

    block: Path
    corrections: list[Correction]
    notes: list[str]
    unchanged: frozenset[str]


def _correction_author(who: str, why: str) -> Correction:
    return Correction("", "", None, who=who, when=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"), why=why)


def _diff_block(
    out: Folder, results: PublishedBlock, said: Sequence[Annotation], named: str, by: Correction
) -> _BlockDiff:
    block = find_run_block_file(out)
    diff = CorrectionDiff(results, read_corrections(block))
    new = diff.compute(named, said, by)
    notes, unchanged = find_unaffected_walls(results, new)
    return _BlockDiff(block, new, [*diff.notes, *notes], unchanged)


def _write_diffs(out: Folder, of_blocks: Sequence[_BlockDiff]) -> ImportResult:
    """Write the new corrections of the blocks of one folder."""
    by_file: dict[Path, tuple[Path, list[Correction]]] = {}
    for block, new, *_ in of_blocks:
        if new:
            by_file.setdefault(corrections_file(block), (block, []))[1].extend(new)
    for block, new in by_file.values():
        append_corrections_to_file(block, new)
    effective = [
        one
        for diff in of_blocks
        for one in diff.corrections
        if one.id not in diff.unchanged or one.kind in FACADE_CORRECTION_KINDS
    ]
    facades, buildings = (
        len({one.id for one in effective if one.kind in kind})
        for kind in (FACADE_CORRECTION_KINDS, BUILDING_CORRECTION_KINDS)
    )
    notes = tuple(note for diff in of_blocks for note in diff.notes)
    return ImportResult(tuple(by_file), _rerun_command(out, of_blocks[0].block), facades, buildings, notes)


def _rerun_command(out: Folder, block: Path) -> str:
    """Return the command that runs the affected units of a block again."""
    home = city_or_block_file(block)
    if (out / CITY_FILE_NAME).is_file():
        return format_command("city", home if home != block else "CITY.yaml", "--out", out)
    if home != block:
        return format_command("city", home, "--out", out.parent.parent)
    return format_command("run", block, "--out", out)


def _import_into_city(out: Folder, path: Path, by: Correction) -> ImportResult:
    """Import the corrections of a file into the blocks that own their targets."""
    runs = {run.name: run.folder for run in find_runs(out)[0]}
    run_by_id: dict[str, str] = {}
    facades: list[str] = []
    for name, folder in runs.items():
        with current_snapshot(folder).hold_for_reading() as snapshot:
            mine, buildings = _read_ids(snapshot.items)
        facades += mine
        run_by_id |= dict.fromkeys((*mine, *buildings), name)
    said = read_correction_annotations(path, facades_by_picture_name(facades))
    if any(id not in run_by_id for id, _, _ in said):  # the catalogue lacks buildings without a facade
        for name, folder in runs.items():
            with open_published_run(folder) as results:
                run_by_id |= {results.names[index]: name for index in results.select_buildings(()).tolist()}
    by_block = defaultdict(list)
    for one in said:
        if one[0] not in run_by_id:
            near = get_close_matches(one[0], run_by_id, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known are e.g. {', '.join(list(run_by_id)[:3])}"
            raise InputError(f"{path}: no block of the city in {out} has {one[0]}; {hint}")
        by_block[run_by_id[one[0]]].append(one)
    diffs = []
    for name, some in by_block.items():
        with open_published_run(runs[name]) as results:
            diffs.append(_diff_block(runs[name], results, some, str(path), by))
    return _write_diffs(out, diffs) if diffs else ImportResult((), "", 0, 0, ())


def _read_ids(items: Folder) -> tuple[list[str], list[str]]:
    """Read the ids of a catalogue's facades, and of their buildings."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        rows = pq.read_table(io.BytesIO(items.read_bytes()), columns=["id", "kind", "building"]).to_pylist()
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{items}: cannot be read; `streetloom city` publishes again") from error
    rows = [row for row in rows if row["kind"] == "facade"]
    return [row["id"] for row in rows], list({row["building"]: None for row in rows})
