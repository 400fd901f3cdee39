"""Matching of photos to the walls of a block by pose and content."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catalogs.block.reader import Block, read_block
from catalogs.features import Fault, Remark, feature_ids_by_reason, format_reason_notes
from catalogs.reader_errors import is_system_error
from catalogs.readers.pictures.embedded_poses import read_stated_poses
from catalogs.readers.pictures.folders import list_images
from catalogs.readers.pictures.panoramas import project_pose
from catalogs.readers.pictures.picture_matches import select_entries
from catalogs.readers.pictures.poses import PosesFile, read_poses_file
from catalogs.readers.pictures.source_poses import SourcePose, assemble_pose
from facade_core.core.errors import FacadeError, InputError
from facade_core.core.name_hash import hash_name
from facade_core.geometry.ground.terrain import Terrain, build_terrain
from facade_core.imagery.poses.photo_matching import WallLikelihoods, estimate_orientation, match_walls
from facade_core.plan.plan import Plan
from tasks.engine.outcome import error_reason
from tasks.engine.progress import begin_stage, report_progress
from tasks.matching.match_table import COLUMNS, FacadeCandidate, MatchTable, format_match_row
from tasks.matching.settings import MATCHING
from tasks.stages.facades.photos import rectify_photo
from tasks.stages.ingest.planning import make_plan
from tasks.stages.shared.images import read_photo

# Fault of a photo without a place.
MISSING_PLACE = "no place"
# View of a picture that is whole.
FULL_PANORAMA = (0.0, 0.0, 1.0, 1.0)


class PhotoMatches(NamedTuple):
    """Matches of the photos in a folder.

    Attributes
    ----------
    table : table of the photos; it is not written yet.
    faults : a fault for each photo that cannot be matched.
    notes : what is not used or assumed of the poses file.
    """

    table: MatchTable
    faults: list[Fault]
    notes: tuple[str, ...]


def match_photos(block_file: Path, folder: Path, path: Path, poses: Path | None = None) -> PhotoMatches:
    """Match the street photos in a folder to facades.

    Poses come from `poses`, else from EXIF.

    Parameters
    ----------
    block_file : block file.
    folder : folder of photos.
    path : path of the new table.
    poses : file of poses; None: EXIF only.

    Raises
    ------
    InputError : block, folder or poses cannot be read, no photo has a place, or the table exists and may be edited.
    """
    if path.exists():
        raise InputError(
            f"{path} is there and may have been mended; take its photos (--take), remove it, or name another with --out"
        )
    paths, unreadable = list_images(folder, "photo")
    file, entries = read_stated_places(poses, folder, paths)
    if not any(read_place(path, entries.get(path)) for path in paths):  # reading the block takes longer
        if poses and file.poses:
            names = ", ".join(sorted(file.poses)[:3])
            raise InputError(
                f"{poses}: names none of the {len(paths)} photos in {folder}; its names are such as {names}"
            )
        raise InputError(f"{folder}: none of its {len(paths)} photos says where it was taken; {place_remedy(poses)}")
    block = read_block(block_file)
    plan = make_plan(replace(block, panoramas=()))
    terrain = build_terrain(block.buildings, block.terrain)
    begin_stage("match", len(paths))
    found, faults = [], list(unreadable)
    for photo in paths:
        try:
            found.append(_match_photo(plan, terrain, block, photo, read_place(photo, entries.get(photo))))
        except (FacadeError, ValueError, OSError) as error:
            if is_system_error(error):
                raise
            faults.append(Fault(photo.name, "photo", error_reason(error)))
        report_progress("match", 1)
    return PhotoMatches(MatchTable(path, COLUMNS, tuple(found)), faults, poses_notes(file, entries))


def place_remedy(poses: Path | None) -> str:
    """Return the remedy for photos that state no place, by the poses file that was given for them."""
    given = f"add a line for each to {poses}" if poses else "give their places with --poses FILE.csv"
    return f"{given} (file,lon,lat,heading), or name each after its facade"


def read_stated_places(
    poses: Path | None, folder: Path, photos: Sequence[Path]
) -> tuple[PosesFile, dict[Path, SourcePose | str]]:
    """Read a poses file, if any, and return the entries of photos in a folder."""
    if poses is None:
        return PosesFile({}), {}
    file = read_poses_file(poses)
    return file, select_entries(file.poses, poses.name, folder, photos)


def poses_notes(file: PosesFile, entries: Mapping[Path, SourcePose | str]) -> tuple[str, ...]:
    """Return the notes on a poses file and on its entries for the photos."""
    of_entries = [
        Remark(path.name, reason, None)
        for path, place in entries.items()
        if isinstance(place, SourcePose)
        for _, reason in place.remarks
    ]
    return format_reason_notes(feature_ids_by_reason((*file.remarks, *of_entries)))


def read_place(path: Path, entry: SourcePose | str | None) -> SourcePose | str | None:
    """Read the place of a photo, or the fault in it; None if nothing states one."""
    try:
        if isinstance(entry, str):
            return entry
        pose, _ = assemble_pose(({} if entry is None else {"table": entry}) | read_stated_poses(path))
        return None if pose.x is None else pose
    except InputError as error:
        return str(error)


def _match_photo(
    plan: Plan, terrain: Terrain, block: Block, path: Path, place: SourcePose | str | None
) -> dict[str, str]:
    if place is None:
        raise InputError(MISSING_PLACE)
    if isinstance(place, str):
        raise InputError(place)
    pose = project_pose(place, FULL_PANORAMA, block.crs, {})
    picture = read_photo(path)
    photo, size = rectify_photo(picture, path.name), picture.hidden.shape
    taken = estimate_orientation(photo.image, photo.seen, photo.homography, photo.focal, size)
    (level,) = terrain.interpolate(np.array([[pose.x, pose.y]]))
    walls = plan.facades.chart
    found = match_walls(
        plan.scene,
        walls,
        taken,
        np.array([pose.x, pose.y, level]),
        None if place.heading is None else pose.heading,
        seed=hash_name(path.name),
    )
    best = np.argsort(-found.probability, kind="stable")[: MATCHING.max_candidates]
    candidates = [
        FacadeCandidate(
            plan.facades.id[i],
            round(float(found.probability[i]), 3),
            _reasons(found, i, plan.scene.charts.size[walls[i], 1]),
        )
        for i in best.tolist()
        if found.probability[i] >= MATCHING.min_probability
    ]
    facade = (
        candidates[0].facade if candidates and candidates[0].probability >= MATCHING.min_certain_probability else None
    )
    return format_match_row(path.name, facade, candidates, pose, has_heading=place.heading is not None)


def _reasons(found: WallLikelihoods, wall: int, height: float) -> str:
    """Describe the evidence for a wall in one line; `height`: height of the wall in the model, metres."""
    said = [f"before the camera from {100 * found.hit_share[wall]:.0f} % of the places near the stated one"]
    if np.isfinite(found.heading_offset_deg[wall]):
        said.append(f"{abs(found.heading_offset_deg[wall]):.0f} degrees off the stated heading")
    if np.isfinite(found.roof_height_m[wall]):
        said.append(f"its roof at {found.roof_height_m[wall]:.1f} m, {height:.1f} m by the model")
    return ", ".join(said)
