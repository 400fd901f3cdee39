"""Cameras of a file: what each of its formats is read to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from catalogs.features import Remark
from catalogs.printable_text import short_repr
from catalogs.reader_errors import short_message, to_single_line
from catalogs.readers.settings import CAMERAS
from facade_core.core.arrays import Float64Array
from facade_core.core.types import Lens

# A lens for the stored size (width, height) of its picture, which some formats do not state.
LensOfSize = Callable[[tuple[int, int]], Lens]
# World points (n, 3) as longitude, latitude, metres over the ellipsoid.
ToLonLat = Callable[[Float64Array], Float64Array]


@dataclass(frozen=True, slots=True)
class SourceCamera:
    """Camera in the frame of its file.

    Attributes
    ----------
    centre : (3,) position.
    rotation : (3, 3) to camera axes x right, y down, z ahead.
    lens : its lens.
    has_height : whether the file states the height.
    """

    centre: Float64Array
    rotation: Float64Array
    lens: LensOfSize
    has_height: bool = True


@dataclass(frozen=True, slots=True)
class CameraFile:
    """Cameras of a file.

    Attributes
    ----------
    name : name of the file in messages.
    cameras : camera by the name of its picture; a text with the defect replaces an unusable one.
    is_local : whether the frame is the program's own, without a place on earth.
    to_lonlat : conversion of a frame of the Earth that has none by name; None else.
    crs : frame of positions x east, y north; None for the block's.
    remarks : remarks on the file.
    """

    name: str
    cameras: dict[str, SourceCamera | str]
    is_local: bool = False
    to_lonlat: ToLonLat | None = None
    crs: str | None = None
    remarks: tuple[Remark, ...] = field(default=())


def build_camera(
    file: str, picture: str, lens: Lens | str, read_pose: Callable[[], tuple[Float64Array, Float64Array]]
) -> SourceCamera | str:
    """Return the camera of an entry with the centre and rotation that `read_pose` gives, or why it cannot be used."""
    try:
        if isinstance(lens, str):
            raise ValueError(lens)
        centre, rotation = read_pose()
    except (ValueError, TypeError, KeyError) as error:
        return entry_reason(file, picture, error)
    return SourceCamera(centre, rotation, lambda _: lens)


def entry_reason(file: str, picture: str, error: Exception) -> str:
    """Return the reason why the entry of a picture cannot be used."""
    return f"{file}: {to_single_line(picture[:80])}: {short_message(error)}; mend that entry"


def check_lens(lens: Lens) -> Lens:
    """Return a lens that a camera can have.

    Raises
    ------
    ValueError
        For another.
    """
    width, height = lens.size
    numbers = (*lens.focal, *lens.centre, *lens.radial, *lens.denominator, *lens.tangential, lens.skew)
    if not np.isfinite(numbers).all():
        raise ValueError("its calibration has a number that is not finite")
    if not (1 <= width <= CAMERAS.max_side_px and 1 <= height <= CAMERAS.max_side_px):
        raise ValueError(f"its calibration is for {width} x {height} pixels, which no picture has")
    if not all(CAMERAS.min_focal_widths * width <= focal <= CAMERAS.max_focal_widths * width for focal in lens.focal):
        raise ValueError(f"its focal length of {lens.focal[0]:g} pixels is none for a picture {width} pixels wide")
    if not (-width <= lens.centre[0] <= 2 * width and -height <= lens.centre[1] <= 2 * height):
        raise ValueError(f"its principal point {short_repr(lens.centre)} is far outside of the picture")
    if max(map(abs, (*lens.radial, *lens.denominator, *lens.tangential)), default=0.0) > CAMERAS.max_coefficient:
        raise ValueError("its distortion is larger than any lens has")
    return lens


def check_position(values: Sequence[float] | Float64Array) -> Float64Array:
    """Return a position (3,); ValueError for none."""
    position = np.asarray(values, np.float64)
    if position.shape != (3,) or not (np.abs(position) <= CAMERAS.max_position).all():
        raise ValueError(f"{short_repr(np.ravel(position).tolist())} is no position")
    return position


def check_rotation(matrix: Float64Array) -> Float64Array:
    """Return the nearest rotation to a matrix (3, 3); ValueError where it is none, or mirrors."""
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
        raise ValueError("its rotation is not finite")
    left, scale, right = np.linalg.svd(matrix)
    if np.abs(scale - 1).max() > CAMERAS.max_axis_error:
        raise ValueError(
            "its rotation matrix is none: its axes have other lengths than 1, or other angles than 90 degrees"
        )
    if np.linalg.det(matrix) < 0:
        raise ValueError("its rotation mirrors the picture (left-handed axes); export right-handed ones")
    return np.asarray(left @ right)


def rotation_from_quaternion(w: float, x: float, y: float, z: float) -> Float64Array:
    """Return the rotation (3, 3) of a unit quaternion; ValueError for one of another length."""
    from scipy.spatial.transform import Rotation

    length = float(np.linalg.norm([w, x, y, z]))
    if not abs(length - 1) <= CAMERAS.max_axis_error:
        raise ValueError(f"its quaternion has length {length:g}, and 1 is that of a rotation")
    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def rotation_from_omega_phi_kappa(omega: float, phi: float, kappa: float) -> Float64Array:
    """Return the rotation (3, 3) to camera axes x right, y down, z ahead of photogrammetric angles in degrees.

    The rotations about x, y and z turn the axes of the world to those of the picture, x right, y up, z back.
    """
    o, p, k = np.radians([omega, phi, kappa])
    about_x = np.array([[1, 0, 0], [0, np.cos(o), np.sin(o)], [0, -np.sin(o), np.cos(o)]])
    about_y = np.array([[np.cos(p), 0, -np.sin(p)], [0, 1, 0], [np.sin(p), 0, np.cos(p)]])
    about_z = np.array([[np.cos(k), np.sin(k), 0], [-np.sin(k), np.cos(k), 0], [0, 0, 1]])
    return np.asarray(np.diag([1.0, -1.0, -1.0]) @ about_z @ about_y @ about_x)


def rotation_from_heading(heading: float, pitch: float, roll: float) -> Float64Array:
    """Return the rotation (3, 3) to camera axes of a heading clockwise from north, a pitch up and a clockwise roll, degrees."""
    h, p, r = np.radians([heading, pitch, roll])
    level = np.array([np.cos(h), -np.sin(h), 0.0])
    ahead = np.array([np.cos(p) * np.sin(h), np.cos(p) * np.cos(h), np.sin(p)])
    down = np.cross(ahead, level)
    return np.stack([np.cos(r) * level + np.sin(r) * down, np.cos(r) * down - np.sin(r) * level, ahead])
