"""Export of published results into a folder, a file or a bucket, atomically."""

from __future__ import annotations

import fcntl
import glob
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from catalogs.published import object_store
from catalogs.published.folders import Folder, join_path, local_run_folder, map_concurrently, remove_path
from catalogs.published.s3 import S3Path, folder_at
from facade_core.core.errors import InputError
from tasks.export.models import FACTORED
from tasks.publish.published_run import PublishedBlock, open_published_run

# Sources of an export and digests of its files: a new export may replace an unchanged one.
MARKER = "export.json"
# Name of the marker in formats whose tools read every .json file.
HIDDEN_MARKER = ".export.json"


@dataclass(frozen=True)
class ExportResult:
    """Finished export.

    Attributes
    ----------
    path : its folder, or its single file.
    files : files to open first.
    notes : remarks for the user, one line each.
    """

    path: Folder
    files: tuple[Folder, ...]
    notes: tuple[str, ...]


# Writes an export: (results, buildings, folder, **options) -> (files to open first, notes).
Writer = Callable[..., tuple[list[str], list[str]]]


def _writers() -> dict[str, Writer]:
    from tasks.export.city import write_cityjson, write_cityjson_lod3, write_cityjsonseq
    from tasks.export.citygml import write_citygml
    from tasks.export.facades import write_coco, write_geopackage, write_labelme
    from tasks.export.models import write_3dtiles, write_glb_models
    from tasks.export.orthophotos import write_cogs
    from tasks.export.usd import write_usd

    return {
        "glb": write_glb_models,
        "3dtiles": write_3dtiles,
        "cityjson": write_cityjson,
        "cityjsonseq": write_cityjsonseq,
        "lod3": write_cityjson_lod3,
        "citygml": write_citygml,
        "coco": write_coco,
        "labelme": write_labelme,
        "gpkg": write_geopackage,
        "cog": write_cogs,
        "usd": write_usd,
    }


FORMATS = ("glb", "3dtiles", "cityjson", "cityjsonseq", "lod3", "citygml", "coco", "labelme", "gpkg", "cog", "usd")

# Formats that accept an option; factored ones are listed separately.
FORMATS_BY_OPTION = {
    "textures": ("3dtiles", f"{FACTORED} 3dtiles", f"{FACTORED} glb"),
    "max_texture_mb": ("3dtiles",),
    "lit": ("glb", "3dtiles", "usd"),
    "night": ("glb", "3dtiles", "usd"),
}


def export_run(
    out: Folder | str,
    format: str,
    to: Path | str | None = None,
    buildings: Sequence[str] = (),
    *,
    textures: str | None = None,
    max_texture_mb: float | None = None,
    lit: bool | None = None,
    night: bool = False,
) -> ExportResult:
    """Export the published results of a run.

    The target appears whole or not at all. An earlier export of the format is replaced unless a file in it was added or
    changed since.

    A bucket receives OUT/exports/FORMAT/SNAPSHOT. The marker arrives last, and the newest earlier export stays for its
    readers.

    Parameters
    ----------
    out : folder of the run.
    format : one of FORMATS.
    to : target folder; None: OUT/exports/FORMAT. A path that ends in .gpkg is one new file.
    buildings : ids of buildings; empty: all.
    textures : encoding of 3dtiles pictures (jpeg if None, webp, ktx2); FACTORED, for glb too: an unlit model of few
        pictures.
    max_texture_mb : 3dtiles only: graphics memory of a view, MB; None: 300, for ktx2 120; infinity: full resolution.
    lit : glb, 3dtiles and usd: materials react to light.
    night : glb, 3dtiles and usd: windows emit light.

    Raises
    ------
    InputError : one line with the remedy.
    """
    if format not in FORMATS:
        raise InputError(f"--format {format}: not known; choose {', '.join(FORMATS)}")
    asked = {"textures": textures, "max_texture_mb": max_texture_mb, "lit": lit, "night": night or None}
    options = {name: value for name, value in asked.items() if value is not None}
    made = f"{FACTORED} {format}" if textures == FACTORED else format
    for name in options:
        if made not in FORMATS_BY_OPTION[name]:
            whose = " and ".join(FORMATS_BY_OPTION[name])
            raise InputError(f"--{name.replace('_', '-')}: is of {whose}; leave it out with {made}")
    as_file = format == "gpkg" and to is not None and Path(to).suffix.lower() == ".gpkg"
    if to is not None:
        _check_target(Path(to).resolve(), format, as_file)
    place = folder_at(out)
    if to is None and isinstance(place, S3Path):
        if buildings:
            raise InputError(f"{place}: only a whole block is exported into its bucket; name a folder here with --to")
        return _export_in_bucket(place, format, options)
    with open_published_run(place) as results:
        return _export(results, format, None if to is None else Path(to), buildings, as_file, options)


def marker_name(format: str) -> str:
    """Return the name of an export's marker file, which lists its sources and digests."""
    return HIDDEN_MARKER if format == "labelme" else MARKER


def _export(
    results: PublishedBlock,
    format: str,
    to: Path | None,
    buildings: Sequence[str],
    as_file: bool,
    options: Mapping[str, object],
) -> ExportResult:
    chosen = results.select_buildings(buildings)
    target = Path(str(results.snapshot.out)) / "exports" / format if to is None else to.resolve()
    if to is None:
        _check_target(target, format, as_file)
    try:
        with _hold_temporary_folder(target) as temporary:
            main, notes = _writers()[format](results, chosen, temporary, **options)
            if as_file:
                os.replace(temporary / main[0], target)
                return ExportResult(target, (target,), tuple(notes))
            about: dict[str, object] = {
                "format": format,
                "block": results.block,
                "snapshot": results.snapshot.id,
                "crs": results.crs,
            }
            about |= {"notes": notes, "files": main, "digests": _file_digests(temporary)}
            (temporary / marker_name(format)).write_text(json.dumps(about, indent=1) + "\n")
            replaced = temporary.with_suffix(".old.tmp")  # a kill never leaves half of the earlier export in its place
            if target.exists():
                os.replace(target, replaced)
            os.replace(temporary, target)
            shutil.rmtree(replaced, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); name another place with --to") from error
    return ExportResult(target, tuple(target / name for name in main), tuple(notes))


@contextmanager
def _hold_temporary_folder(target: Path) -> Iterator[Path]:
    """Create a folder next to a target and lock it; it is removed at the end, and so are those of killed exports."""
    for path in target.parent.glob(f".{glob.escape(target.name)}.*.tmp"):
        with _lock_exclusively(path) as is_locked:
            if is_locked:
                shutil.rmtree(path, ignore_errors=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    temporary.mkdir(parents=True)
    try:
        with _lock_exclusively(temporary):
            yield temporary
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def _lock_exclusively(folder: Path) -> Iterator[bool]:
    """Lock a folder; False if another process holds it."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_locked = True
        except BlockingIOError:
            is_locked = False
        yield is_locked
    finally:
        os.close(handle)


def _export_in_bucket(place: S3Path, format: str, options: Mapping[str, object]) -> ExportResult:
    here = local_run_folder(place) / "exports" / format
    try:
        with open_published_run(place) as results:
            target = join_path(place, f"exports/{format}/{results.snapshot.id}")
            written = _export(results, format, here, (), False, options)
        names = sorted(path.relative_to(here).as_posix() for path in here.rglob("*") if path.is_file())
        map_concurrently(
            lambda name: object_store.upload_object(join_path(target, name).path, join_path(here, name)),
            [n for n in names if n != marker_name(format)],
            target,
        )
        object_store.upload_object((target / marker_name(format)).path, here / marker_name(format))
    finally:
        shutil.rmtree(here, ignore_errors=True)
    _remove_old_exports(target)
    files = tuple(
        join_path(target, path.relative_to(here).as_posix()) for path in written.files if isinstance(path, Path)
    )
    return ExportResult(target, files, written.notes)


def _remove_old_exports(newest: S3Path) -> None:
    """Remove exports of a format from a bucket, except the newest and the one before it."""
    beside = {name: one for name, one in object_store.list_objects(newest.parent.path).items() if "/" in name}
    whole = {
        name.partition("/")[0]: one.written
        for name, one in beside.items()
        if name.endswith((f"/{MARKER}", f"/{HIDDEN_MARKER}"))
    }
    before = max(whole.keys() - {newest.name}, key=lambda name: whole[name], default=None)
    for name in {name.partition("/")[0] for name in beside} - {newest.name, before}:
        remove_path(newest.parent / name)


def _check_target(target: Path, format: str, as_file: bool) -> None:
    if as_file:
        if target.exists() or target.is_symlink():
            raise InputError(f"{target}: is there already; remove it, or name a new file with --to")
    elif target.is_dir():
        if any(target.iterdir()) and (why := _foreign_content(target, format)):
            raise InputError(f"{target}: {why}; name a new or empty folder with --to")
    elif target.exists():
        raise InputError(f"{target}: is a file, and an export of {format} is a folder; name a folder with --to")
    elif target.suffix.lower() in (
        ".glb",
        ".json",
        ".jsonl",
        ".gml",
        ".gpkg",
        ".tif",
        ".usda",
        ".usdz",
        ".zip",
        ".txt",
    ):
        if format == "gpkg":
            raise InputError(f"--to {target.name}: gpkg goes into a file, such as --to {target.stem}.gpkg, or a folder")
        raise InputError(
            f"--to {target.name}: an export of {format} is a folder (only gpkg can be one file); name one, without "
            f"{target.suffix}"
        )


def _foreign_content(folder: Path, format: str) -> str | None:
    """Explain why a folder must not be replaced; None if it is an unchanged export of the format."""
    try:
        hidden = folder / HIDDEN_MARKER
        about = json.loads((hidden if hidden.is_file() else folder / MARKER).read_text())
        digests = about["digests"]
        if about["format"] != format:
            return f"holds an export of {about['format']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "holds other files than an export"
    now = _file_digests(folder)
    touched = sorted(name for name in digests.keys() | now.keys() if digests.get(name) != now.get(name))
    return f"{touched[0]} was added or changed since the export" if touched else None


def _file_digests(folder: Path) -> dict[str, str]:
    """Compute a digest of every file below a folder except the marker."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path not in (folder / MARKER, folder / HIDDEN_MARKER):
            with path.open("rb") as file:
                found[path.relative_to(folder).as_posix()] = hashlib.file_digest(file, "sha256").hexdigest()
    return found
