"""Perspective pictures of a folder with the poses and lenses of a file, in the frame of a block."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pyproj import CRS, Transformer

from catalogs.crs import EARTH_RADIUS_M, LONLAT, has_east_north_axes, parse_crs
from catalogs.features import Fault, Remark
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.json_text import parse_json
from catalogs.readers.pictures.camera_angles import camera_angles
from catalogs.readers.pictures.cameras.camera_file import CameraFile, SourceCamera
from catalogs.readers.pictures.cameras.camera_tables import read_camera_table
from catalogs.readers.pictures.cameras.colmap import read_colmap
from catalogs.readers.pictures.cameras.control_points import read_control_points
from catalogs.readers.pictures.cameras.metashape import read_metashape
from catalogs.readers.pictures.cameras.opensfm import read_opensfm
from catalogs.readers.pictures.cameras.placement import Placement, place_by_control_points, place_by_gps
from catalogs.readers.pictures.cameras.upright import upright_camera
from catalogs.readers.pictures.capture_dates import exif_capture_date
from catalogs.readers.pictures.decoding import open_picture
from catalogs.readers.pictures.embedded_poses import read_exif_gps, stated_poses
from catalogs.readers.pictures.folders import list_images
from catalogs.readers.pictures.panoramas import (
    PosedPanorama,
    PosedPanoramas,
    distance_outside,
    is_distant,
    outdated_remarks,
    panorama_fault,
)
from catalogs.readers.pictures.picture_matches import find_unmatched_names, picture_id, select_entries
from catalogs.readers.pictures.source_poses import degrees_from_dms
from catalogs.readers.settings import CAMERAS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject, JsonValue
from facade_core.core.regular_files import read_regular
from facade_core.core.types import Pose

_ORIENTATION_TAG = 0x0112
_NO_CAMERA = "has no camera in"
_FORMATS = (
    "COLMAP (images.txt or images.bin, or its folder), OpenSfM (reconstruction.json), Metashape (.xml) or a CSV with file, x, "
    "y, z, omega, phi, kappa or heading, pitch, roll, and focal_px"
)


class _Header(NamedTuple):
    """What a picture's file says of itself: stored size, EXIF orientation, GPS (lon, lat, altitude), day."""

    size: tuple[int, int]
    orientation: int
    gps: tuple[float, float, float] | None
    captured: str | None


def read_cameras(
    folder: Path,
    poses: Path,
    frame: CRS,
    bounds: tuple[float, float, float, float] | None = None,
    control: Path | None = None,
    crs: str | None = None,
) -> PosedPanoramas:
    """Read perspective pictures with the cameras of a file, in the frame of a block.

    A local frame is placed by control points, else by `crs`, else by the GPS of the pictures, else it is the block's own if
    all cameras are in it. Pictures whose EXIF turns them are read upright, and their camera is turned with them.

    Parameters
    ----------
    folder : folder of pictures.
    poses : file of cameras, or the folder of a COLMAP model.
    frame : frame of the block.
    bounds : (xmin, ymin, xmax, ymax) of the buildings in the frame, metres; None for no limit.
    control : table of control points.
    crs : frame of the positions in `poses`, None for the one it states, or the block's.

    Returns
    -------
    The pictures with poses and lenses; unusable pictures and cameras are faults, cameras without a picture are remarks.

    Raises
    ------
    InputError
        Where no picture has a camera, the file is none, or it cannot be placed.
    """
    paths, unreadable = list_images(folder, "panorama", with_subfolders=True)
    file = _read_camera_file(poses, _check_crs(crs))
    faults = list(unreadable)
    selected = select_entries(file.cameras, file.name, folder, paths)
    cameras: dict[Path, SourceCamera] = {}
    headers: dict[Path, _Header] = {}
    for path in paths:
        camera = selected.get(path, f"{_NO_CAMERA} {file.name}; add its pose there, or remove it")
        if isinstance(camera, str):
            faults.append(Fault(path.relative_to(folder).as_posix(), "panorama", camera))
            continue
        try:
            headers[path] = _read_header(path)
            cameras[path] = _fit_to_picture(camera, headers[path])
        except Exception as error:  # libraries raise errors of any class
            faults.append(panorama_fault(path, error, "mend its entry, or remove it"))
    if not cameras:
        reasons = sorted((fault.reason for fault in faults), key=lambda reason: reason.startswith(_NO_CAMERA))
        reason = next(iter(reasons), "its pictures cannot be used")
        raise InputError(f"{folder} holds no picture with a camera in {file.name}: {reason}")
    unmatched = find_unmatched_names(file.cameras, paths)
    remarks = [
        *file.remarks,
        *(Remark(name, f"cameras of {file.name} without a picture in {folder.name}", None) for name in unmatched),
    ]
    placed_headers = [headers[path] for path in cameras]
    to_block, note = _place(file, list(cameras.values()), placed_headers, frame, bounds, control, crs)
    if note:
        remarks.append(Remark(file.name, note, None))
    posed = {path: _block_pose(camera, to_block, headers[path].size) for path, camera in cameras.items()}
    _check_upright(file.name, np.array([rotation for _, rotation in posed.values()]))
    names = {path: picture_id(path, folder) for path in posed}
    items = []
    for path, (pose, _) in posed.items():
        if is_distant(pose, bounds):
            remarks.append(Remark(names[path], "cameras of another place skipped", None))
        else:
            items.append(PosedPanorama(names[path], path, pose, headers[path].captured))
    if not items and bounds:
        away = min(distance_outside(pose, bounds) for pose, _ in posed.values()) / 1000
        raise InputError(
            f"{file.name}: its cameras are {away:.1f} km or more from the buildings; name their frame (imagery.cameras.crs), "
            "or place them by control points (imagery.cameras.control)"
        )
    return PosedPanoramas(tuple(items), tuple(faults), (*remarks, *outdated_remarks(items)))


def _check_crs(crs: str | None) -> str | None:
    if crs is not None and not has_east_north_axes(parse_crs(crs)):
        raise InputError(f"crs {crs} has axes other than east and north; give one that has these")
    return crs


def _read_camera_file(path: Path, crs: str | None) -> CameraFile:
    """Read a file of any of the formats."""
    if path.is_dir() or path.suffix == ".bin" or path.name in ("images.txt", "cameras.txt", "points3D.txt"):
        return read_colmap(path)
    content = read_regular(path, CAMERAS.max_file_bytes)
    if path.suffix.lower() == ".xml" or content[:200].lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<"):
        return read_metashape(path.name, content)
    with wrap_reader_errors(path, "is no file of cameras", f"give {_FORMATS}"):
        text = content.decode("utf-8-sig")
        if text.lstrip().startswith(("{", "[")):
            return read_opensfm(path.name, _reconstruction_parts(parse_json(content, str(path))))
        return read_camera_table(path.name, text, crs)


def _reconstruction_parts(value: JsonValue) -> list[JsonObject]:
    listed = value if isinstance(value, list) else [value]
    parts = [part for part in listed if isinstance(part, dict) and isinstance(part.get("shots", {}), dict)]
    if len(parts) < len(listed):
        raise ValueError("its JSON is no reconstruction")
    return parts


def _read_header(path: Path) -> _Header:
    with open_picture(path) as image:
        tags = read_exif_gps(image)
        place = stated_poses({}, tags)["EXIF"]
        try:
            orientation = int(image.getexif().get(_ORIENTATION_TAG, 1))
        except Exception:  # damaged EXIF means no rotation
            orientation = 1
        size, captured = image.size, exif_capture_date(image)
    try:
        altitude = degrees_from_dms(tags["GPSAltitude"], None)
        below = tags.get("GPSAltitudeRef") in (1, b"\x01")
        altitude = -altitude if below else altitude
    except (KeyError, TypeError, ValueError, ArithmeticError):
        altitude = math.nan
    gps = None
    if place.x is not None and place.y is not None:
        gps = (place.x, place.y, altitude if abs(altitude) < 1e4 else math.nan)
    return _Header(size, orientation if 1 <= orientation <= 8 else 1, gps, captured)


def _fit_to_picture(camera: SourceCamera, header: _Header) -> SourceCamera:
    """Return a camera whose lens and axes are those of the upright picture; ValueError where it is of another picture."""
    lens = camera.lens(header.size)
    width, height = lens.size
    turned = header.orientation >= 5
    stored, upright = header.size, header.size[::-1] if turned else header.size
    ratio = width / height

    def fits(size: tuple[int, int]) -> bool:
        return abs(size[0] / size[1] / ratio - 1) <= CAMERAS.max_aspect_error

    if not fits(stored) and not (turned and fits(upright)):
        raise ValueError(
            f"is {stored[0]} x {stored[1]} pixels, and its camera is for {width} x {height}; give the picture that was posed"
        )
    rotation = camera.rotation
    if header.orientation > 1 and fits(stored):  # as stored, not as shown
        lens, rotation = upright_camera(lens, rotation, header.orientation)
    return replace(camera, rotation=rotation, lens=lambda _: lens)


ToBlock = Callable[[Float64Array, Float64Array], Float64Array]


def _place(
    file: CameraFile,
    cameras: Sequence[SourceCamera],
    headers: Sequence[_Header],
    frame: CRS,
    bounds: tuple[float, float, float, float] | None,
    control: Path | None,
    crs: str | None,
) -> tuple[ToBlock, str]:
    """Return the function from positions and offsets in metres (n, 3) to the frame of the block, and a note on it."""
    if control is not None:
        names, source, target = read_control_points(control, file.cameras, frame, crs)
        placement = place_by_control_points(control.name, names, source, target)
        return _by_placement(placement), placement.note
    if not file.is_local or crs is not None:
        return _by_frame(file.to_lonlat, file.crs or crs, frame), ""
    if any(header.gps is not None for header in headers):
        placement = _place_by_gps(file.name, cameras, headers, frame)
        return _by_placement(placement), placement.note
    if bounds and not any(
        is_distant(Pose(float(camera.centre[0]), float(camera.centre[1]), None, 0.0), bounds) for camera in cameras
    ):
        return _by_frame(None, None, frame), "cameras without GPS taken to be in the frame of the block, where they are"
    raise InputError(
        f"{file.name} has a frame of its own, and no picture has GPS; give three control points (imagery.cameras.control), or "
        "the frame of the file (imagery.cameras.crs)"
    )


def _place_by_gps(name: str, cameras: Sequence[SourceCamera], headers: Sequence[_Header], frame: CRS) -> Placement:
    places = np.full((len(headers), 3), np.nan)
    transformer = Transformer.from_crs(LONLAT, frame, always_xy=True)
    for place, header in zip(places, headers, strict=True):
        if header.gps is not None:
            place[:] = (*transformer.transform(*header.gps[:2]), header.gps[2])
    places[~np.isfinite(places[:, :2]).all(axis=1)] = np.nan
    centres = np.array([camera.centre for camera in cameras])
    return place_by_gps(name, centres, np.array([camera.rotation for camera in cameras]), places)


def _by_placement(placement: Placement) -> ToBlock:
    return lambda centre, offsets: placement.apply(centre + offsets / placement.scale)


def _by_frame(to_lonlat: Callable[[Float64Array], Float64Array] | None, crs: str | None, frame: CRS) -> ToBlock:
    if to_lonlat is None and crs is None:
        return lambda centre, offsets: centre + offsets
    origin = CRS.from_user_input(LONLAT if to_lonlat is not None or crs is None else crs)
    transformer = Transformer.from_crs(origin, frame, always_xy=True)

    def convert(centre: Float64Array, offsets: Float64Array) -> Float64Array:
        points = centre + offsets
        if to_lonlat is not None:
            points = to_lonlat(points)
        elif origin.is_geographic:
            degrees = math.degrees(1 / EARTH_RADIUS_M)
            points = centre + offsets * [degrees / max(math.cos(math.radians(centre[1])), 1e-6), degrees, 1.0]
        x, y = transformer.transform(points[:, 0], points[:, 1])
        return np.stack([x, y, points[:, 2]], axis=1)

    return convert


def _block_pose(camera: SourceCamera, to_block: ToBlock, size: tuple[int, int]) -> tuple[Pose, Float64Array]:
    """Return pose and rotation (3, 3) of a camera in the frame of the block: the axes of its frame turn with it."""
    step = 10.0
    placed = to_block(camera.centre, step * np.vstack([np.zeros(3), np.eye(3)]))
    x, y, z = placed[0].tolist()
    lens = camera.lens(size)
    if not np.isfinite(placed).all():
        return Pose(math.nan, math.nan, None, 0.0, lens=lens), camera.rotation
    left, _, right = np.linalg.svd((placed[1:] - placed[0]).T)
    rotation = camera.rotation @ (left @ right).T
    return Pose(x, y, z if camera.has_height else None, *camera_angles(rotation), lens=lens), rotation


def _check_upright(name: str, axes: Float64Array) -> None:
    """Raise InputError where rotations are of another convention: pictures upside down, to the sky, or tilted every way."""
    right, down, ahead = axes[:, 0, 2], axes[:, 1, 2], axes[:, 2, 2]
    remedy = (
        "rotations are from the world to camera axes x right, y down, z ahead: check the order of quaternions (w, x, y, z), "
        "the axes, the unit of angles, and that pitch is 0 at the horizon (Metashape's is 90 there)"
    )
    if (down > CAMERAS.upside_down_sine).mean() > CAMERAS.max_upside_down_share:
        raise InputError(f"{name}: most pictures are upside down; {remedy}")
    if (ahead > CAMERAS.skyward_sine).mean() > CAMERAS.max_upside_down_share:
        raise InputError(f"{name}: most pictures look at the sky; {remedy}")
    tilt = np.abs(right)
    if (
        len(axes) > 3
        and ((tilt > CAMERAS.tilted_sines[0]) & (tilt < CAMERAS.tilted_sines[1])).mean() > CAMERAS.max_tilted_share
    ):
        raise InputError(f"{name}: pictures are tilted every way; {remedy}")
