"""Poses of unposed photos of a block: structure from motion, placed by GPS and aligned to the walls of the model."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catalogs.block.reader import read_block
from catalogs.block.yaml_edits import format_imagery_entry
from catalogs.features import Fault
from catalogs.published.folders import write_atomically
from catalogs.readers.pictures.camera_angles import camera_angles
from catalogs.readers.pictures.cameras.placement import place_by_gps
from catalogs.readers.pictures.cameras.upright import upright_camera
from catalogs.readers.pictures.folders import list_images
from catalogs.readers.pictures.panoramas import project_pose
from catalogs.readers.settings import CAMERAS
from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.errors import FacadeError, InputError
from facade_core.core.types import Lens, Pose
from facade_core.geometry.ground.terrain import Terrain, build_terrain
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.group_outlines import align_to_outlines
from facade_core.imagery.poses.model_alignment import PlacedPoints, align_to_model
from facade_core.imagery.poses.settings import ALIGNMENT
from tasks.engine.outcome import error_reason
from tasks.matching.photo_matches import FULL_PANORAMA, poses_notes, read_place, read_stated_places
from tasks.matching.settings import MATCHING
from tasks.matching.structure_from_motion import PhotoGroup, read_small_copy, reconstruct_photos, require_pycolmap
from tasks.stages.ingest.planning import make_plan

COLUMNS = (
    "file", "x", "y", "z", "heading", "pitch", "roll", "focal_px", "cx", "cy", "k1", "width", "height",
)  # fmt: skip
_NO_OVERLAP = "overlaps no other photo enough; take photos that share half of what they show"
_REMEDY = "give their places with --poses FILE.csv (file,lon,lat), or place them by control points"


class PhotoCamera(NamedTuple):
    """Camera of a photo as stored.

    Attributes
    ----------
    centre : (3,) metres in the frame of the block.
    rotation : (3, 3) to camera axes x right, y down, z ahead.
    lens : its lens, in pixels of a smaller copy.
    """

    centre: Float64Array
    rotation: Float64Array
    lens: Lens


def camera_pose(centre: Float64Array, rotation: Float64Array, lens: Lens) -> Pose:
    """Return the pose of a camera with fields as of `PhotoCamera`."""
    x, y, z = centre.tolist()
    return Pose(x, y, z, *camera_angles(rotation), lens=lens)


class PosedPhotos(NamedTuple):
    """Photos with cameras.

    Attributes
    ----------
    cameras : camera by the name of its photo.
    faults : a fault for each photo that could not be placed.
    notes : one on each group of photos that overlap.
    """

    cameras: Mapping[str, PhotoCamera]
    faults: tuple[Fault, ...]
    notes: tuple[str, ...]


def pose_block_photos(block_file: Path, folder: Path, path: Path, poses: Path | None = None) -> PosedPhotos:
    """Find the poses of the photos in a folder, in the frame of a block.

    Parameters
    ----------
    block_file : block file.
    folder : folder of photos.
    path : file of cameras that will be written.
    poses : file of places; None: EXIF only.

    Raises
    ------
    InputError : block, folder or places cannot be read, pycolmap is missing or fails, or no photo can be placed.
    """
    require_pycolmap()
    if path.exists():
        raise InputError(f"{path} is there; remove it, or name another with --cameras")
    photos, unreadable = list_images(folder, "photo")
    file, entries = read_stated_places(poses, folder, photos)
    stated = {photo: read_place(photo, entries.get(photo)) for photo in photos}
    if not any(stated.values()):
        raise InputError(f"{folder}: none of its {len(photos)} photos says where it was taken; {_REMEDY}")
    block = read_block(block_file)
    notes = list(poses_notes(file, entries))
    places = np.full((len(photos), 2), np.nan)
    for place, (photo, source) in zip(places, stated.items(), strict=True):
        try:
            if isinstance(source, str):
                raise InputError(source)
            if source is not None:
                pose = project_pose(source, FULL_PANORAMA, block.crs, {})
                place[:] = pose.x, pose.y
        except (FacadeError, ValueError) as error:
            notes.append(f"{photo.name}: its place does not count: {error_reason(error)}")
    scene = make_plan(replace(block, panoramas=())).scene
    found = pose_photos(scene, build_terrain(block.buildings, block.terrain), photos, places)
    result = PosedPhotos(found.cameras, (*unreadable, *found.faults), (*notes, *found.notes))
    if not result.cameras:
        raise InputError(f"{folder}: none of its {len(photos)} photos can be placed: {found.faults[0].reason}")
    return result


def pose_photos(scene: Scene, terrain: Terrain, photos: Sequence[Path], places: Float64Array) -> PosedPhotos:
    """Find the poses of photos of a scene.

    Parameters
    ----------
    scene, terrain : the block.
    photos : photos in the order of their names.
    places : (n, 2) measured places in the frame of the block, NaN where unknown.
    """
    groups, faults = reconstruct_photos(photos, places)
    found = place_groups(scene, terrain, groups, photos, places)
    unread = {fault.id for fault in faults}
    rest = tuple(fault for fault in found.faults if fault.id not in unread)
    return PosedPhotos(found.cameras, (*faults, *rest), found.notes)


def place_groups(
    scene: Scene, terrain: Terrain, groups: Sequence[PhotoGroup], photos: Sequence[Path], places: Float64Array
) -> PosedPhotos:
    """Place groups of photos in a scene; the other parameters are those of `pose_photos`. Photos of none are faults."""
    by_path = dict(zip(photos, places, strict=True))
    cameras: dict[str, PhotoCamera] = {}
    faults: list[Fault] = []
    notes = []
    for group in groups:
        own = np.array([by_path[path] for path in group.paths])
        try:
            placed, note = _place_group(scene, terrain, group, own)
        except InputError as error:
            faults += [Fault(path.name, "photo", error_reason(error)) for path in group.paths]
        else:
            cameras |= placed
            notes.append(note)
    known = cameras.keys() | {fault.id for fault in faults}
    faults += [Fault(path.name, "photo", _NO_OVERLAP) for path in photos if path.name not in known]
    return PosedPhotos(cameras, tuple(faults), tuple(notes))


def _place_group(
    scene: Scene, terrain: Terrain, group: PhotoGroup, places: Float64Array
) -> tuple[dict[str, PhotoCamera], str]:
    """Place a group by GPS, then by the walls; returns also a note. InputError where its GPS does not do."""
    name = f"the group of {len(group.paths)} overlapping photos from {group.paths[0].name} to {group.paths[-1].name}"
    known = np.asarray(np.isfinite(places).all(axis=1))
    _check_places(name, places, known)
    upright = _upright_rotations(group)
    gps = place_by_gps(name, group.centres, upright, np.column_stack([places, np.full(len(places), np.nan)]), _REMEDY)
    centres, points = gps.apply(group.centres), gps.apply(group.points)
    height = terrain.interpolate(centres[:, :2]) + MATCHING.hand_height_m
    lift = np.array([0.0, 0.0, float(np.median(height - centres[:, 2]))])
    centres, points, rotations = centres + lift, points + lift, group.rotations @ gps.rotation.T
    aligned = align_to_model(
        scene, PlacedPoints(centres, points, group.camera, places, height, upright[:, 0] @ gps.rotation.T)
    )
    if aligned is None:
        turn = float(np.degrees(ALIGNMENT.gps_sigma_m / np.linalg.norm(places[known] - places[known].mean(axis=0))))
        if turn > MATCHING.max_gps_turn_deg:
            raise InputError(
                f"{name} fits no walls of the block, and GPS turns it to {turn:.0f} degrees only; take more photos along the "
                "street, each of which overlaps the next by half"
            )
        how = f"placed by GPS alone, to {turn:.0f} degrees, as it fits no walls of the block"
    else:
        centres, rotations = aligned.apply(centres), rotations @ aligned.rotation.T
        how = f"aligned to walls, on which {100 * aligned.on_wall_share:.0f} % of its points are"
        outlines = align_to_outlines(
            scene,
            [camera_pose(*each) for each in zip(centres, rotations, group.lenses, strict=True)],
            lambda number: read_small_copy(group.paths[number], group.lenses[number].size),
            places,
            height,
        )
        if outlines is not None:
            centres, rotations = outlines.centres, rotations @ outlines.rotation.T
            how += f", then to outlines, which fit {outlines.given_fit:.2f} before and {outlines.fit:.2f} after"
    off = float(np.median(np.linalg.norm(centres[known, :2] - places[known], axis=1)))
    cameras = {
        path.name: PhotoCamera(centre, rotation, lens)
        for path, centre, rotation, lens in zip(group.paths, centres, rotations, group.lenses, strict=True)
    }
    return cameras, f"{name}: {how}; GPS is {off:.1f} m off at the median"


def _check_places(name: str, places: Float64Array, known: BoolArray) -> None:
    if known.sum() < CAMERAS.min_gps_pictures:
        raise InputError(f"{known.sum()} of {name} have GPS, where {CAMERAS.min_gps_pictures} are needed; {_REMEDY}")
    span = float(np.linalg.norm(np.ptp(places[known], axis=0)))
    if span < CAMERAS.min_gps_span_m:
        raise InputError(
            f"{name} spans {span:.0f} m, where {CAMERAS.min_gps_span_m:g} m are needed to turn it by GPS; take photos "
            "between these and the others, so that all overlap"
        )


def _upright_rotations(group: PhotoGroup) -> Float64Array:
    """Return the rotations (n, 3, 3) of the photos as shown, by which the group is levelled."""
    turned = []
    for rotation, lens, orientation, path in zip(
        group.rotations, group.lenses, group.orientations, group.paths, strict=True
    ):
        try:
            turned.append(upright_camera(lens, rotation, orientation)[1])
        except ValueError as error:
            raise InputError(f"{path.name} {error}") from error
    return np.array(turned)


def format_camera_table(cameras: Mapping[str, PhotoCamera]) -> str:
    """Format cameras as the table that `imagery.cameras.poses` reads."""
    text = io.StringIO(newline="")
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for name, camera in sorted(cameras.items()):
        lens = camera.lens
        pixels = (lens.focal[0], *lens.centre)
        rows.writerow(
            [
                name,
                *(f"{value:.3f}" for value in camera.centre.tolist()),
                *(f"{value:.4f}" for value in camera_angles(camera.rotation)),
                *(f"{value:.3f}" for value in pixels),
                f"{lens.radial[0]:.6f}",
                *lens.size,
            ]
        )
    return text.getvalue()


def write_camera_table(path: Path, cameras: Mapping[str, PhotoCamera]) -> None:
    """Write cameras to a new file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, format_camera_table(cameras).encode())


def format_cameras_entry(block_file: Path, folder: Path, path: Path) -> str:
    """Return the line of the block file that names photos and their cameras."""
    base = block_file.resolve().parent
    values = {key: os.path.relpath(each.resolve(), base) for key, each in (("path", folder), ("poses", path))}
    return f"imagery: {{{format_imagery_entry('cameras', values)}}}"
