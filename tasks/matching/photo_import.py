"""Import of matched photos into a block's photo folder, named after their facades."""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from catalogs.block.reader import read_block
from catalogs.block.yaml_edits import add_imagery_entry, format_imagery_entry
from catalogs.file_digest import file_digest
from catalogs.printable_text import normal_form
from facade_core.core.errors import InputError
from tasks.matching.match_table import MatchTable
from tasks.stages.ingest.planning import make_plan

# Default folder of photos, in the block file's folder.
FOLDER = "photos"


@dataclass(frozen=True)
class PhotoImportPlan:
    """Checked plan of a photo import: copies and removals.

    Attributes
    ----------
    block : block file.
    count : photos with a facade.
    folder : target folder.
    copies : photos to copy by facade.
    removals : earlier copies under another facade, to remove.
    is_named_in_block : the block file names the folder.
    faults : faults of rows outside the request, whose photos do not change.
    """

    block: Path
    count: int
    folder: Path
    copies: Mapping[str, Path]
    removals: tuple[Path, ...]
    is_named_in_block: bool
    faults: tuple[str, ...] = ()


# Photos of faulty rows, and the fault in one line.
_Fault = tuple[set[str], str]


def plan_photo_import(
    block_file: Path, folder: Path, table: MatchTable, requested: Collection[str] | None = None
) -> PhotoImportPlan:
    """Plan the import of a table's photos that have a facade.

    Removes a copy, never the photo itself, if the table assigns that photo otherwise now.

    Parameters
    ----------
    block_file : block file.
    folder : folder of the photos.
    table : table of matches.
    requested : photos whose rows must be valid; None: all. Faults of other rows are listed in the result.

    Raises
    ------
    InputError : a requested photo is missing, its facade is unknown, or the facade has another photo; the block has
        rectified photos, would have no photo left, or takes its photos from its city.
    """
    block = read_block(block_file)
    if block.part is not None:
        raise InputError(
            f"{block_file}: it is a part of a city and has the photos of that; name a folder in the city's file, "
            "imagery.photos, and copy them there under their facades' names"
        )
    if block.photos and block.photos_rectified:
        raise InputError(
            f"{block_file}: its photos are rectified, these are as taken, and a block has one kind; rectify them, or set "
            "imagery.photos.rectified: false and take all as they are"
        )
    faults: list[_Fault] = []
    wanted = _photos_by_facade(table, folder, set(make_plan(replace(block, panoramas=())).facades.id), faults)
    outdated = _outdated_copies(block.photos, folder, table, faults)
    target = next(iter(block.photos.values())).parent if block.photos else block_file.parent / FOLDER
    for facade, photo in list(wanted.items()):
        if reason := _conflict(block.photos, outdated, target, facade, photo):
            faults.append(({photo.name}, f"{table.path}: {photo.name}: {reason}"))
            del wanted[facade]
    for photos, reason in faults:
        if requested is None or photos & set(requested):
            raise InputError(reason)
    if block.photos and not wanted and len(outdated) == len(block.photos):
        raise InputError(
            f"{block_file}: no photo would be left; remove imagery.photos from it, and the folder {target}"
        )
    copied = {facade: photo for facade, photo in wanted.items() if facade not in block.photos or facade in outdated}
    messages = tuple(reason for _, reason in faults)
    return PhotoImportPlan(
        block_file, len(wanted), target, copied, tuple(outdated.values()), bool(block.photos), messages
    )


def _conflict(
    photos: Mapping[str, Path], gone: Mapping[str, Path], there: Path, facade: str, photo: Path
) -> str | None:
    """Describe the conflict between a photo and another photo of its facade; None without one."""
    old, at = photos.get(facade), _copy_path(there, facade, photo)
    if old is not None and facade not in gone and file_digest(old) != file_digest(photo):
        return f"{facade} has the photo {old}; remove one of both"
    if at.is_file() and at not in gone.values() and file_digest(at) != file_digest(photo):
        return f"{at} is there and is another photo; remove one of both"
    return None


def import_photos(done: PhotoImportPlan) -> str | None:
    """Copy the photos; return the entry for the block file if it could not be added automatically."""
    if done.copies:
        done.folder.mkdir(exist_ok=True)
    arriving = {}
    for facade, photo in done.copies.items():
        arriving[facade] = done.folder / f".{facade}{photo.suffix.lower()}.tmp"
        shutil.copyfile(photo, arriving[facade])
    earlier = {normal_form(path.stem): path for path in done.removals}
    for facade, photo in done.copies.items():
        target = _copy_path(done.folder, facade, photo)
        if facade in earlier:  # a facade never has two photos, nor the folder none: such a block cannot be read
            os.replace(earlier.pop(facade), target)
        os.replace(arriving[facade], target)
    for path in earlier.values():
        path.unlink()
    values = {"path": FOLDER, "rectified": False}
    if done.is_named_in_block or not done.copies or add_imagery_entry(done.block, "photos", values):
        return None
    return f"imagery: {{{format_imagery_entry('photos', values)}}}"


def _copy_path(folder: Path, facade: str, photo: Path) -> Path:
    """Return the path of the copy of a facade's photo."""
    return folder / f"{facade}{photo.suffix.lower()}"


def _outdated_copies(
    photos: Mapping[str, Path], folder: Path, table: MatchTable, faults: list[_Fault]
) -> dict[str, Path]:
    """Find the block's photos that are copies of photos with another facade in the table, by facade.

    A photo of the block that is the original itself is a fault.
    """
    said: dict[int, list[tuple[Path, str]]] = {}
    for match in table.matches():
        path = folder / match.photo
        if match.is_decided and match.photo == Path(match.photo).name and path.is_file():
            said.setdefault(path.stat().st_size, []).append((path, match.facade))
    found = {}
    for facade, path in photos.items():
        alike = said.get(path.stat().st_size, [])
        same = [(photo, name) for photo, name in alike if file_digest(photo) == file_digest(path)]
        if not same or facade in {name for _, name in same}:
            continue
        if originals := [photo for photo, _ in same if photo.samefile(path)]:
            reason = f"{path} is the block's own photo, of which no copy is kept; match a copy of {folder}"
            faults.append(({photo.name for photo in originals}, reason))
            continue
        found[facade] = path
    return found


def _photos_by_facade(table: MatchTable, folder: Path, known: set[str], faults: list[_Fault]) -> dict[str, Path]:
    """Map each facade that the table names to its photo; two photos of one facade are both faults."""
    found: dict[str, list[str]] = {}
    for line, row in enumerate(table.rows, 2):
        name, facade = row["photo"], row["facade"]
        if not facade:
            continue
        reason = None
        if name != Path(name).name or not (folder / name).is_file():
            reason = f"there is no photo {name!r} in {folder}; mend that line"
        elif facade not in known:
            reason = f"the block has no facade {facade!r}; take one of its candidates"
        elif Path(facade).name != facade:
            reason = f"no file can be named {facade!r}; give the building an id of letters and digits"
        else:
            names = found.setdefault(facade, [])
            names.append(name)
            if len(names) > 1:
                reason = f"{names[0]} shows {facade} already; empty one of both lines"
        if reason:
            faults.append(({name, *found.get(facade, [])}, f"{table.path}: line {line}: {reason}"))
    return {facade: folder / names[0] for facade, names in found.items() if len(names) == 1}
