"""Export what a run published into the formats that others open."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catalogs.published import object_store
from catalogs.published.folders import Folder, join_path, local_folder, map_concurrently, remove_path
from catalogs.published.s3 import S3Folder, folder_at
from facade_core.core.errors import InputError
from tasks.export.models import FACTORED
from tasks.publish.opened import Published, published

# What an export was made of, and a digest of each of its files: what nobody has touched since, a new export may replace.
MARKER = "export.json"
# Its name among files that tools of others read each .json of.
HIDDEN_MARKER = ".export.json"


@dataclass(frozen=True)
class Exported:
    """An export: its folder, or its one file; the files to open first; what the reader should know, one line each."""

    path: Folder
    files: tuple[Folder, ...]
    notes: tuple[str, ...]


# Writes buildings of a published block into a folder, (published, buildings, folder, options by name); returns the files to
# open first, and notes.
Writer = Callable[..., tuple[list[str], list[str]]]


def _writers() -> dict[str, Writer]:
    from tasks.export.city import write_cityjson, write_cityjsonseq, write_lod3
    from tasks.export.citygml import write_citygml
    from tasks.export.facades import write_coco, write_geopackage, write_labelme
    from tasks.export.models import write_3dtiles, write_models
    from tasks.export.orthophotos import write_cogs
    from tasks.export.usd import write_usd

    return {
        "glb": write_models,
        "3dtiles": write_3dtiles,
        "cityjson": write_cityjson,
        "cityjsonseq": write_cityjsonseq,
        "lod3": write_lod3,
        "citygml": write_citygml,
        "coco": write_coco,
        "labelme": write_labelme,
        "gpkg": write_geopackage,
        "cog": write_cogs,
        "usd": write_usd,
    }


FORMATS = ("glb", "3dtiles", "cityjson", "cityjsonseq", "lod3", "citygml", "coco", "labelme", "gpkg", "cog", "usd")

# Of which formats options are, factored ones apart.
OF_OPTION = {
    "textures": ("3dtiles", f"{FACTORED} 3dtiles", f"{FACTORED} glb"),
    "max_texture_mb": ("3dtiles",),
    "lit": ("glb", "3dtiles", "usd"),
    "night": ("glb", "3dtiles", "usd"),
}


def export(
    out: Folder | str,
    format: str,
    to: Path | str | None = None,
    buildings: Sequence[str] = (),
    *,
    textures: str | None = None,
    max_texture_mb: float | None = None,
    lit: bool | None = None,
    night: bool = False,
) -> Exported:
    """Write what the run in `out` published as `format` (one of FORMATS), all of it or the `buildings` named by id.

    The folder `to` (OUT/exports/FORMAT where it is None) appears whole or not at all; an earlier export of the format there is
    replaced unless something in it was added or changed since. Where it ends in .gpkg, that format is written as this one
    new file. Of a run in a bucket that is exported whole it is OUT/exports/FORMAT/SNAPSHOT where it is None; the marker
    arrives last, and of earlier exports the newest stays, as somebody may read it. textures: of 3dtiles how its pictures are
    encoded (jpeg where it is None, webp, ktx2); of glb and 3dtiles FACTORED, a model of few pictures, which is unlit.
    max_texture_mb is of 3dtiles alone: what the pictures of a view may take of a graphics card (where it is None, 300, of ktx2
    120; infinity: all of them as they are). lit and night are of glb, 3dtiles and usd: whether materials take light, and
    windows give it. Raises InputError in one line with the remedy.
    """
    if format not in FORMATS:
        raise InputError(f"--format {format}: not known; choose {', '.join(FORMATS)}")
    asked = {"textures": textures, "max_texture_mb": max_texture_mb, "lit": lit, "night": night or None}
    options = {name: value for name, value in asked.items() if value is not None}
    made = f"{FACTORED} {format}" if textures == FACTORED else format
    for name in options:
        if made not in OF_OPTION[name]:
            whose = " and ".join(OF_OPTION[name])
            raise InputError(f"--{name.replace('_', '-')}: is of {whose}; leave it out with {made}")
    as_file = format == "gpkg" and to is not None and Path(to).suffix.lower() == ".gpkg"
    if to is not None:
        _check_target(Path(to).resolve(), format, as_file)
    place = folder_at(out)
    if to is None and isinstance(place, S3Folder):
        if buildings:
            raise InputError(f"{place}: only a whole block is exported into its bucket; name a folder here with --to")
        return _export_in_bucket(place, format, options)
    with published(place) as found:
        return _export(found, format, None if to is None else Path(to), buildings, as_file, options)


def marker_of(format: str) -> str:
    """The name of the file that says of an export what it was made of."""
    return HIDDEN_MARKER if format == "labelme" else MARKER


def _export(
    found: Published,
    format: str,
    to: Path | None,
    buildings: Sequence[str],
    as_file: bool,
    options: Mapping[str, Any],
) -> Exported:
    chosen = found.choose(buildings)
    target = Path(str(found.snapshot.out)) / "exports" / format if to is None else to.resolve()
    if to is None:
        _check_target(target, format, as_file)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        temporary.mkdir(parents=True)
        main, notes = _writers()[format](found, chosen, temporary, **options)
        if as_file:
            os.replace(temporary / main[0], target)
            return Exported(target, (target,), tuple(notes))
        about: dict[str, Any] = {
            "format": format,
            "block": found.block,
            "snapshot": found.snapshot.id,
            "crs": found.crs,
        }
        about |= {"notes": notes, "files": main, "digests": _digests(temporary)}
        (temporary / marker_of(format)).write_text(json.dumps(about, indent=1) + "\n")
        if target.exists():
            shutil.rmtree(target)
        os.replace(temporary, target)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); name another place with --to") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return Exported(target, tuple(target / name for name in main), tuple(notes))


def _export_in_bucket(place: S3Folder, format: str, options: Mapping[str, Any]) -> Exported:
    here = local_folder(place) / "exports" / format
    try:
        with published(place) as found:
            target = join_path(place, f"exports/{format}/{found.snapshot.id}")
            written = _export(found, format, here, (), False, options)
        names = sorted(path.relative_to(here).as_posix() for path in here.rglob("*") if path.is_file())
        map_concurrently(
            lambda name: object_store.upload_object(join_path(target, name).path, join_path(here, name)),
            [n for n in names if n != marker_of(format)],
            target,
        )
        object_store.upload_object((target / marker_of(format)).path, here / marker_of(format))
    finally:
        shutil.rmtree(here, ignore_errors=True)
    _forget_exports(target)
    files = tuple(
        join_path(target, path.relative_to(here).as_posix()) for path in written.files if isinstance(path, Path)
    )
    return Exported(target, files, written.notes)


def _forget_exports(newest: S3Folder) -> None:
    """Remove what lies beside the newest export of a format in a bucket, but for the one before it."""
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
        if any(target.iterdir()) and (why := _not_ours(target, format)):
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


def _not_ours(folder: Path, format: str) -> str | None:
    """Why a folder must not be replaced, None where it is an export of the format as it was written."""
    try:
        hidden = folder / HIDDEN_MARKER
        about = json.loads((hidden if hidden.is_file() else folder / MARKER).read_text())
        digests = about["digests"]
        if about["format"] != format:
            return f"holds an export of {about['format']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "holds other files than an export"
    now = _digests(folder)
    touched = sorted(name for name in digests.keys() | now.keys() if digests.get(name) != now.get(name))
    return f"{touched[0]} was added or changed since the export" if touched else None


def _digests(folder: Path) -> dict[str, str]:
    """A digest of every file below a folder, but for the marker."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path not in (folder / MARKER, folder / HIDDEN_MARKER):
            with path.open("rb") as file:
                found[path.relative_to(folder).as_posix()] = hashlib.file_digest(file, "sha256").hexdigest()
    return found
