"""Photos without names matched to the walls of a block: which facade each shows, told in a table that a person may mend."""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from catalogs.block import Block, read_block
from catalogs.block.adding import add_imagery, imagery_line
from catalogs.broken import is_machines
from catalogs.features import Fault
from catalogs.file_digest import file_digest
from catalogs.readers.pictures.folders import image_files
from catalogs.readers.pictures.panoramas import in_frame, stated_place
from catalogs.readers.pictures.poses import SourcePose, read_poses
from facade_core.errors import FacadeError, InputError
from facade_core.geometry.terrain import Terrain, terrain_of
from facade_core.naming import number_of
from facade_core.plan import Plan
from facade_core.rectify.matching import likely_walls, taken_by
from tasks.outcome import reason_of
from tasks.progress import advance, begin_stage
from tasks.stages.planning import plan_of
from tasks.units.evidence import rectified_photo

# A photo is of the wall that it shows with this probability; else a person decides.
SURE = 0.8
# So many walls are told of each, which have at least this probability.
CANDIDATES, LEAST = 3, 0.02
COLUMNS = ("photo", "facade", "probability", "candidates")
# Where photos go that are taken, beside a block file that names no folder.
FOLDER = "photos"
_FULL = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True)
class Match:
    """A photo, and the facades that it may show, the likeliest first, with their probabilities."""

    photo: Path
    candidates: tuple[tuple[str, float], ...]

    @property
    def facade(self) -> str | None:
        """The facade that it shows, where that is sure."""
        return self.candidates[0][0] if self.candidates and self.candidates[0][1] >= SURE else None


def match_photos(block_file: Path, folder: Path, poses: Path | None = None) -> tuple[list[Match], list[Fault]]:
    """Which facades the photos in a folder show, as taken from the street; and a fault for each that cannot be told.

    Where a photo was taken, and its heading, are read in `poses`, else in its EXIF. Raises InputError where the block, the
    folder or the poses cannot be read.
    """
    block = read_block(block_file)
    plan = plan_of(replace(block, panoramas=()))
    terrain = terrain_of(block.buildings, block.terrain)
    paths, unreadable = image_files(folder, "photo")
    stated = read_poses(poses) if poses else {}
    begin_stage("match", len(paths))
    found, faults = [], list(unreadable)
    for path in paths:
        try:
            named = stated.get(path.name) or stated.get(path.stem)
            found.append(Match(path, _candidates(plan, terrain, block, path, named)))
        except (FacadeError, ValueError, OSError) as error:
            if is_machines(error):
                raise
            faults.append(Fault(path.name, "photo", reason_of(error)))
        advance("match", 1)
    return found, faults


def _candidates(
    plan: Plan, terrain: Terrain, block: Block, path: Path, stated: SourcePose | str | None
) -> tuple[tuple[str, float], ...]:
    if isinstance(stated, str):
        raise InputError(stated)
    place = stated or stated_place(path)
    if place is None:
        raise InputError(
            "it does not say where it was taken; name where with --poses (file,lon,lat,heading), or name it after its facade"
        )
    pose = in_frame(place, _FULL, block.crs, {})
    photo, size = rectified_photo(path)
    taken = taken_by(photo.image, photo.seen, photo.homography, photo.focal, size)
    (level,) = terrain.height(np.array([[pose.x, pose.y]]))
    likely = likely_walls(
        plan.scene,
        plan.facades.chart,
        taken,
        np.array([pose.x, pose.y, level]),
        None if place.heading is None else pose.heading,
        seed=number_of(path.name),
    )
    order = np.argsort(-likely, kind="stable")[:CANDIDATES]
    return tuple((plan.facades.id[i], round(float(likely[i]), 3)) for i in order.tolist() if likely[i] >= LEAST)


def check_new(table: Path) -> None:
    """Raise InputError where a table is there already, which a person may have mended."""
    if table.exists():
        raise InputError(
            f"{table} is there and may have been mended; take its photos (--take), remove it, or name another with --out"
        )


def write_matches(matches: Sequence[Match], path: Path) -> None:
    """A table of them, in one step; `facade` is empty where a person is to decide."""
    temporary = path.with_name(f".{path.name}.tmp")
    with temporary.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        for match in matches:
            told = "; ".join(f"{facade} {probability:.2f}" for facade, probability in match.candidates)
            sure = f"{match.candidates[0][1]:.2f}" if match.candidates else ""
            rows.writerow([match.photo.name, match.facade or "", sure, told])
    os.replace(temporary, path)


def take_matches(block_file: Path, folder: Path, table: Path) -> tuple[int, str | None]:
    """Copy the photos of a table of matches that have a facade to where a block has its photos, under their facades' names.

    Returns how many there are then, and what is to be written into the block file by hand where it could not be. Raises
    InputError, before anything is copied, for a photo that is not there, a facade that the block has not, one that has two
    photos, or another photo already; and for a block whose photos are rectified.
    """
    block = read_block(block_file)
    if block.photos and block.photos_rectified:
        raise InputError(
            f"{block_file}: its photos are rectified, these are as taken, and a block has one kind; rectify them, or set "
            "imagery.photos.rectified: false and take all as they are"
        )
    wanted = _read_table(table, folder, set(plan_of(replace(block, panoramas=())).facades.id))
    there = next(iter(block.photos.values())).parent if block.photos else block_file.parent / FOLDER
    for facade, photo in wanted.items():
        old = block.photos.get(facade)
        if old is not None and file_digest(old) != file_digest(photo):
            raise InputError(f"{table}: {photo.name}: {facade} has the photo {old}; remove one of both")
    there.mkdir(exist_ok=True)
    for facade, photo in wanted.items():
        if facade in block.photos:
            continue
        arriving = there / f".{facade}{photo.suffix.lower()}.tmp"
        shutil.copyfile(photo, arriving)
        os.replace(arriving, there / f"{facade}{photo.suffix.lower()}")
    values = {"path": FOLDER, "rectified": False}
    named = bool(block.photos) or (bool(wanted) and add_imagery(block_file, "photos", values))
    return len(wanted), None if named or not wanted else f"imagery: {{{imagery_line('photos', values)}}}"


def _read_table(table: Path, folder: Path, known: set[str]) -> dict[str, Path]:
    """Photos by the facade that a table names for them."""
    try:
        with table.open(encoding="utf-8-sig", newline="") as file:
            lines = file.readlines()
        # spreadsheets save with what their country separates by
        separator = max(",;\t", key=lines[0].count) if lines else ","
        table_rows = csv.DictReader(lines, delimiter=separator)
        rows = list(table_rows)
        if not {"photo", "facade"} <= set(table_rows.fieldnames or ()):
            raise InputError(
                f"{table} has no columns `photo` and `facade`; give the table that `streetloom match` wrote"
            )
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{table} cannot be read ({error}); give the table that `streetloom match` wrote") from error
    found: dict[str, Path] = {}
    for line, row in enumerate(rows, 2):
        name, facade = (row.get("photo") or "").strip(), (row.get("facade") or "").strip()
        if not facade:
            continue
        photo = folder / name
        if name != Path(name).name or not photo.is_file():
            raise InputError(f"{table}: line {line}: there is no photo {name!r} in {folder}; mend that line")
        if facade not in known:
            raise InputError(f"{table}: line {line}: the block has no facade {facade!r}; take one of its candidates")
        if Path(facade).name != facade:
            raise InputError(
                f"{table}: line {line}: no file can be named {facade!r}; give the building an id of letters and digits"
            )
        if facade in found:
            raise InputError(
                f"{table}: line {line}: {found[facade].name} shows {facade} already; empty one of both lines"
            )
        found[facade] = photo
    return found
