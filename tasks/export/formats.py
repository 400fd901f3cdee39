"""Export of published results into a folder, a file or a bucket, atomically."""

from __future__ import annotations

import fcntl
import glob
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from catalogs.published import object_store
from catalogs.published.folders import Folder, join_path, local_run_folder, map_concurrently, remove_path
from catalogs.published.geopackage_digest import write_geopackage_stamp
from catalogs.published.runs import CITY_FILE_NAME
from catalogs.published.s3 import S3Path, folder_at
from facade_core.core.errors import InputError
from tasks.export.code_digest import export_key
from tasks.export.earth import NATIVE_CRS
from tasks.export.registry import FACTORED, FORMATS, list_formats_with
from tasks.export.relief import ELEMENTS, OFF
from tasks.export.targets import (
    HIDDEN_MARKER,
    MARKER,
    ExportResult,
    check_target,
    export_folder_name,
    marker_name,
    replace_file,
    replace_folder,
    write_block_marker,
)
from tasks.publish.published_run import PublishedBlock, open_published_run


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
    crs: str | None = None,
    relief: str | None = None,
) -> ExportResult:
    """Export the published results of a run, or of all blocks of a city.

    The target appears whole or not at all. An earlier export of the format is replaced unless a file in it was added or
    changed since.

    A bucket receives OUT/exports/FORMAT/SNAPSHOT. The marker arrives last, and the newest earlier export stays for its
    readers.

    Parameters
    ----------
    out : folder of the run, or of the city.
    format : one of FORMATS; of a city, one that holds it.
    to : target folder; None: OUT/exports/FORMAT, with crs OUT/exports/FORMAT-CRS. A path that ends in .gpkg is one new file.
    buildings : ids of buildings; empty: all.
    textures : encoding of 3dtiles pictures (jpeg if None, webp, ktx2); FACTORED, for glb too: an unlit model of few
        pictures.
    max_texture_mb : 3dtiles only: graphics memory of a view, MB; None: 300, for ktx2 120; infinity: full resolution.
    lit : glb, 3dtiles and usd: materials react to light.
    night : glb, 3dtiles and usd: windows emit light.
    crs : 3dtiles only: "native" gives coordinates in the block's CRS; None: earth-centred (EPSG:4978).
    relief : glb, 3dtiles, obj and usd: "elements" gives windows, doors, shops and balconies as geometry; "off" leaves walls
        flat; None: as the block key `texture.relief` states.

    Raises
    ------
    InputError : one line with the remedy.
    """
    if format not in FORMATS:
        raise InputError(f"--format {format}: not known; choose {', '.join(FORMATS)}")
    if crs not in (None, NATIVE_CRS):
        raise InputError(f"--crs {crs}: is not written; use {NATIVE_CRS}, the block's own, or leave it out")
    if relief not in (None, OFF, ELEMENTS):
        raise InputError(f"--relief {relief}: is not known; use {ELEMENTS} or {OFF}")
    asked = {
        "textures": textures,
        "max_texture_mb": max_texture_mb,
        "lit": lit,
        "night": night or None,
        "crs": crs,
        "relief": relief,
    }
    options = {name: value for name, value in asked.items() if value is not None}
    entry = FORMATS[format]
    made = f"{FACTORED} {format}" if textures == FACTORED else format
    for name in options:
        if made not in (formats := list_formats_with(name)):
            raise InputError(f"--{name.replace('_', '-')}: is of {' and '.join(formats)}; leave it out with {made}")
    as_file = entry.can_be_file and to is not None and Path(to).suffix.lower() == entry.suffix
    if to is not None:
        check_target(Path(to).resolve(), format, as_file)
    place = folder_at(out)
    if (place / CITY_FILE_NAME).is_file():
        from tasks.export.whole_city.city_export import export_city

        return export_city(place, format, None if to is None else Path(to), buildings, as_file, options)
    if to is None and isinstance(place, S3Path):
        if buildings:
            raise InputError(f"{place}: only a whole block is exported into its bucket; name a folder here with --to")
        return _export_in_bucket(place, format, options)
    with open_published_run(place) as results:
        return _export(results, format, None if to is None else Path(to), buildings, as_file, options)


def _export(
    results: PublishedBlock,
    format: str,
    to: Path | None,
    buildings: Sequence[str],
    as_file: bool,
    options: Mapping[str, object],
) -> ExportResult:
    chosen = results.select_buildings(buildings)
    default = Path(str(results.snapshot.out)) / "exports" / export_folder_name(format, options)
    target = default if to is None else to.resolve()
    if to is None:
        check_target(target, format, as_file)
    try:
        with _hold_temporary_folder(target) as temporary:
            main, notes = FORMATS[format].write(results, chosen, temporary, **options)
            key = export_key(format, results.snapshot.id, buildings, options)
            if as_file:
                write_geopackage_stamp(temporary / main[0], key)
                replace_file(temporary / main[0], target)
                return ExportResult(target, (target,), tuple(notes))
            write_block_marker(temporary, results, format, key, main, notes)
            replace_folder(temporary, target)
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
    name = export_folder_name(format, options)
    here = local_run_folder(place) / "exports" / name
    try:
        with open_published_run(place) as results:
            target = join_path(place, f"exports/{name}/{results.snapshot.id}")
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
