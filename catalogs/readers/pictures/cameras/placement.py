"""Placement of a local frame in the frame of a block: by GPS of the pictures, or by control points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catalogs.readers.settings import CAMERAS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError

_REMEDY = "give three control points (imagery.cameras.control), or the frame of the file (imagery.cameras.crs)"


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Similarity from a local frame to that of the block.

    Attributes
    ----------
    rotation : (3, 3).
    scale : metres per unit.
    shift : (3,) metres.
    note : what placed it, with its residual.
    """

    rotation: Float64Array
    scale: float
    shift: Float64Array
    note: str

    def apply(self, points: Float64Array) -> Float64Array:
        """Return points (n, 3) in the frame of the block."""
        placed: Float64Array = self.scale * points @ self.rotation.T + self.shift
        return placed


def place_by_gps(
    name: str,
    centres: Float64Array,
    rotations: Float64Array,
    places: Float64Array,
    remedy: str = _REMEDY,
) -> Placement:
    """Place cameras by the GPS of their pictures: level by the pictures themselves, the rest by the places.

    Parameters
    ----------
    name : file of the cameras, for messages.
    centres : (n, 3) positions in the local frame.
    rotations : (n, 3, 3) to camera axes.
    places : (n, 3) east, north and altitude in metres, NaN where unknown.
    remedy : what to do where they do not place it, for messages.

    Raises
    ------
    InputError
        Where the places are too few or too near each other, or contradict the cameras.
    """
    known = np.isfinite(places[:, :2]).all(axis=1)
    if known.sum() < CAMERAS.min_gps_pictures:
        raise InputError(
            f"{name} has a frame of its own, and {known.sum()} of its pictures have GPS, where {CAMERAS.min_gps_pictures} are "
            f"needed; {remedy}"
        )
    target = places[known, :2]
    span = float(np.linalg.norm(target.max(axis=0) - target.min(axis=0)))
    if span < CAMERAS.min_gps_span_m:
        raise InputError(
            f"{name} has a frame of its own, and the GPS of its pictures spans {span:.0f} m, where {CAMERAS.min_gps_span_m:g} "
            f"m are needed; {remedy}"
        )
    level = _level_rotation(name, rotations)
    source = centres[known] @ level.T
    mirrored, proper = (_fit_plan(flat, target) for flat in (source[:, :2] * [1, -1], source[:, :2]))
    factor, offset, residual = proper
    median = float(np.median(residual))
    if np.median(mirrored[2]) * CAMERAS.mirror_ratio < median and median > CAMERAS.gps_sigma_m:
        raise InputError(
            f"{name}: its cameras are the mirror image of their GPS (left-handed axes); export right-handed ones (x right, "
            "y down, z ahead)"
        )
    if median > CAMERAS.max_gps_residual_m or not 1e-4 < abs(factor) < 1e4:
        raise InputError(f"{name}: its cameras are {median:.0f} m off the GPS of their pictures at best; {remedy}")
    scale = float(abs(factor))
    turn = np.array([[factor.real, -factor.imag, 0], [factor.imag, factor.real, 0], [0, 0, scale]]) / scale
    rotation = turn @ level
    lifted = scale * (centres @ level.T)[:, 2]
    has_altitude = np.isfinite(places[:, 2])
    up = (
        float(np.median(places[has_altitude, 2] - lifted[has_altitude])) if has_altitude.any() else float(-lifted.min())
    )
    note = (
        f"cameras placed by the GPS of {known.sum()} pictures: median residual {median:.1f} m, largest {residual.max():.1f} m, "
        f"{scale:.4g} m a unit"
    )
    if not has_altitude.any():
        note += ", heights unknown"
    return Placement(rotation, scale, np.array([offset.real, offset.imag, up]), note)


def _level_rotation(name: str, rotations: Float64Array) -> Float64Array:
    """Return the rotation (3, 3) that makes z the vertical of pictures whose right axes are level."""
    right, ahead = rotations[:, 0], rotations[:, 2]
    moments = right.T @ right + CAMERAS.ahead_weight * ahead.T @ ahead
    up = np.linalg.eigh(moments)[1][:, 0]
    if np.median(rotations[:, 1] @ up) > 0:  # y is down
        up = -up
    if float(np.median(np.abs(right @ up))) > CAMERAS.max_tilt_sine:
        raise InputError(
            f"{name}: its pictures are tilted every way, so that none is upright; check the order of quaternions (w, x, y, z), "
            "and that rotations go from the world to the camera"
        )
    east = np.cross([0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0], up)
    east /= np.linalg.norm(east)
    return np.stack([east, np.cross(up, east), up])


def _fit_plan(source: Float64Array, target: Float64Array) -> tuple[complex, complex, Float64Array]:
    """Fit target = factor source + offset of plane points (n, 2) as complex numbers; returns also residuals (n,)."""
    a, b = source @ [1, 1j], target @ [1, 1j]
    weight = np.ones(len(a))
    factor, offset = 1.0 + 0j, 0j
    for _ in range(CAMERAS.placement_rounds):
        middle_a, middle_b = np.average(a, weights=weight), np.average(b, weights=weight)
        spread = float((weight * np.abs(a - middle_a) ** 2).sum())
        if spread == 0:
            break
        factor = complex((weight * np.conj(a - middle_a) * (b - middle_b)).sum() / spread)
        offset = complex(middle_b - factor * middle_a)
        weight = 1 / (1 + (np.abs(factor * a + offset - b) / CAMERAS.gps_sigma_m) ** 2)
    return factor, offset, np.abs(factor * a + offset - b)


def place_by_control_points(name: str, names: Sequence[str], source: Float64Array, target: Float64Array) -> Placement:
    """Place a frame by points known in both.

    Parameters
    ----------
    name : file of the points, for messages.
    names : their names.
    source, target : (n, 3) in the local frame and in that of the block, metres.

    Raises
    ------
    InputError
        Where they are too few, on a line, or contradict each other.
    """
    if len(source) < CAMERAS.min_control_points:
        raise InputError(
            f"{name} holds {len(source)} control points that can be used; {CAMERAS.min_control_points} are the least"
        )
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    for points, what in ((a, "in the model"), (b, "on the map")):
        size = np.linalg.svd(points, compute_uv=False)
        if size[1] < CAMERAS.min_control_width * size[0] or size[0] == 0:
            raise InputError(f"{name}: its points are on one line {what}; give one beside it")
    rotation, scale = _fit_rotation(a, b, mirror=False)
    residual = np.linalg.norm(scale * a @ rotation.T - b, axis=1)
    span, worst = float(np.linalg.norm(b, axis=1).max()), names[int(np.argmax(residual))]
    if residual.max() > CAMERAS.max_control_residual * span:
        other, other_scale = _fit_rotation(a, b, mirror=True)
        if np.linalg.norm(other_scale * a @ other.T - b, axis=1).max() * CAMERAS.mirror_ratio < residual.max():
            raise InputError(
                f"{name}: its points are mirrored between model and map (left-handed axes); export the model again"
            )
        raise InputError(
            f"{name}: its points contradict each other by {residual.max():.1f} m, most of all {worst}; check names and axes"
        )
    note = f"cameras placed by {len(a)} control points: largest residual {residual.max():.2f} m at {worst}"
    return Placement(rotation, scale, target.mean(axis=0) - scale * rotation @ source.mean(axis=0), note)


def _fit_rotation(a: Float64Array, b: Float64Array, *, mirror: bool) -> tuple[Float64Array, float]:
    """Fit b = scale rotation a of centred points (n, 3): rotation (3, 3), with a reflection where `mirror`, and scale."""
    left, size, right = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right)) * (-1 if mirror else 1)])
    rotation = left @ np.diag(sign) @ right
    return np.asarray(rotation), float((size * sign).sum() / (a**2).sum())
