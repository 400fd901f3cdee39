"""Export what a run published into the formats that others open."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facade_core.errors import InputError
from tasks.published import Published, published

# A folder that holds this file is an earlier export, which a new one may replace.
MARKER = "export.json"


@dataclass(frozen=True)
class Exported:
    """An export: its folder, or its one file; the files to open first; what the reader should know, one line each."""

    path: Path
    files: tuple[Path, ...]
    notes: tuple[str, ...]


# Writes buildings of a published block into a folder; returns the files to open first, and notes.
Writer = Callable[[Published, np.ndarray, Path], tuple[list[str], list[str]]]


def _writers() -> dict[str, Writer]:
    from tasks.export_city import write_cityjson, write_cityjsonseq, write_lod3
    from tasks.export_facades import write_coco, write_geopackage, write_labelme
    from tasks.export_models import write_3dtiles, write_models

    return {
        "glb": write_models,
        "3dtiles": write_3dtiles,
        "cityjson": write_cityjson,
        "cityjsonseq": write_cityjsonseq,
        "lod3": write_lod3,
        "coco": write_coco,
        "labelme": write_labelme,
        "gpkg": write_geopackage,
    }


FORMATS = ("glb", "3dtiles", "cityjson", "cityjsonseq", "lod3", "coco", "labelme", "gpkg")


def export(out: Path | str, format: str, to: Path | str | None = None, buildings: Sequence[str] = ()) -> Exported:
    """Write what the run in `out` published as `format` (one of FORMATS), all of it or the `buildings` named by id.

    The folder `to` (OUT/exports/FORMAT where it is None) appears whole or not at all; an earlier export there is replaced.
    Where it ends in .gpkg, that format is written as this one file. Raises InputError in one line with the remedy.
    """
    if format not in FORMATS:
        raise InputError(f"--format {format}: not known; choose {', '.join(FORMATS)}")
    found = published(Path(out))
    chosen = found.choose(buildings)
    target = found.folder.parent.parent / "exports" / format if to is None else Path(to)
    as_file = format == "gpkg" and target.suffix == ".gpkg"
    _check_target(target, as_file)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        temporary.mkdir(parents=True)
        main, notes = _writers()[format](found, chosen, temporary)
        if as_file:
            os.replace(temporary / main[0], target)
            return Exported(target, (target,), tuple(notes))
        about = {"format": format, "block": found.block, "snapshot": found.snapshot, "crs": found.crs, "notes": notes}
        (temporary / MARKER).write_text(json.dumps(about | {"files": main}, indent=1) + "\n")
        if target.exists():
            shutil.rmtree(target)
        os.replace(temporary, target)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); name another place with --to") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return Exported(target, tuple(target / name for name in main), tuple(notes))


def _check_target(target: Path, as_file: bool) -> None:
    if as_file:
        if target.is_dir():
            raise InputError(f"{target}: is a folder; name a file with --to")
    elif target.is_dir():
        if any(target.iterdir()) and not (target / MARKER).is_file():
            raise InputError(f"{target}: holds other files than an export; name a new or empty folder with --to")
    elif target.exists() or target.suffix in (".glb", ".json", ".jsonl"):
        raise InputError(f"{target}: an export of this format is a folder; name one with --to")
