"""Reader of the perspective shots of OpenSfM reconstructions; equirectangular ones are panoramas."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from typing import cast

import numpy as np

from catalogs.features import Remark
from catalogs.reader_errors import short_message, to_single_line
from catalogs.readers.pictures.cameras.camera_file import (
    CameraFile,
    SourceCamera,
    ToLonLat,
    build_camera,
    check_lens,
    check_position,
)
from catalogs.readers.pictures.source_poses import topocentric_transformer
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.core.types import Lens

_PANORAMA_TYPES = ("equirectangular", "spherical")
_PANORAMA_REASON = "equirectangular shots of {file} left out; name the file under imagery.panoramas for them"


def read_opensfm(name: str, parts: list[JsonObject]) -> CameraFile:
    """Read the shots of the reconstructions of a file; only the first has a frame that the others share.

    Raises
    ------
    InputError
        Where it has no shots, or several local parts.
    """
    cameras: dict[str, SourceCamera | str] = {}
    panoramas = []
    reference = _shared_reference(name, parts)
    for part in parts:
        lenses = {key: _lens(camera) for key, camera in part.get("cameras", {}).items()}
        for picture, shot in part.get("shots", {}).items():
            lens = lenses.get(str(shot.get("camera")), "its camera is not listed")
            if lens is None:
                panoramas.append(picture)
            else:
                cameras[picture] = build_camera(name, picture, lens, partial(_pose, shot))
    remarks = tuple(Remark(to_single_line(one[:80]), _PANORAMA_REASON.format(file=name), None) for one in panoramas)
    to_lonlat = None if reference is None else topocentric_to_lonlat(name, reference)
    return CameraFile(name, cameras, is_local=to_lonlat is None, to_lonlat=to_lonlat, remarks=remarks)


def _shared_reference(name: str, parts: list[JsonObject]) -> JsonObject | None:
    """Return the reference_lla that all parts with shots state; None for a single part without one."""
    references = [part.get("reference_lla") for part in parts if part.get("shots")]
    if not references:
        raise InputError(f"{name} holds no shots; give a reconstruction of OpenSfM")
    if any(reference != references[0] for reference in references):
        raise InputError(
            f"{name} holds {len(references)} parts in frames of their own; keep the one that shows the block"
        )
    if references[0] is None and len(references) > 1:
        raise InputError(
            f"{name} holds {len(references)} parts without reference_lla; keep the one that shows the block"
        )
    return references[0]


def _pose(shot: JsonObject) -> tuple[Float64Array, Float64Array]:
    rotation = rotation_from_vector(shot["rotation"])
    return check_position(-rotation.T @ check_position(shot["translation"])), rotation


def rotation_from_vector(vector: Iterable[float]) -> Float64Array:
    """Return the rotation (3, 3) of an axis-angle vector in radians; ValueError for one of more than a turn."""
    from scipy.spatial.transform import Rotation

    values = check_position([float(value) for value in vector])
    if (angle := float(np.linalg.norm(values))) > 2 * math.pi + 1e-3:
        raise ValueError(f"its rotation of {angle:g} radians is more than a turn (OpenSfM has radians, not degrees)")
    return np.asarray(Rotation.from_rotvec(values).as_matrix())


def topocentric_to_lonlat(name: str, reference: JsonObject) -> ToLonLat:
    """Return the conversion of east, north and up around a reference_lla."""
    try:
        transformer = topocentric_transformer(reference)
    except (ValueError, AttributeError) as error:
        raise InputError(f"{name}: its reference_lla is none ({short_message(error)}); mend it") from error
    return lambda points: np.stack(transformer.transform(points[:, 0], points[:, 1], points[:, 2]), axis=1)


def _lens(camera: JsonObject) -> Lens | str | None:
    """Return the lens of a camera, why it has none, or None for a panorama."""
    kind = str(camera.get("projection_type", "perspective"))
    if kind in _PANORAMA_TYPES:
        return None
    try:
        width, height = int(camera["width"]), int(camera["height"])

        def value(*keys: str, default: float | None = None) -> float:
            found = next((camera[key] for key in keys if key in camera), default)
            if found is None:
                raise ValueError(f"its camera states no {keys[0]}")
            return float(cast(float, found))

        longest = max(width, height)
        focal = (longest * value("focal_x", "focal"), longest * value("focal_y", "focal", "focal_x"))
        # the first pixel of OpenSfM has its centre at 0
        centre = (width / 2 + longest * value("c_x", default=0.0), height / 2 + longest * value("c_y", default=0.0))
        k = tuple(value(f"k{i}", default=0.0) for i in range(1, 5))
        if kind in ("fisheye", "fisheye_opencv"):
            return check_lens(Lens((width, height), focal, centre, k, fisheye=True))
        if kind in ("perspective", "brown", "simple_radial", "radial"):
            tangential = (value("p1", default=0.0), value("p2", default=0.0))
            return check_lens(Lens((width, height), focal, centre, k[:3], (), tangential))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        return short_message(error)
    return f"its projection_type {kind[:40]} is not read; undistort the pictures (opensfm undistort), and give these"
