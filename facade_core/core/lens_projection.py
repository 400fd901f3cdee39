"""Projection of camera rays through a lens, and rays of pixels. Camera axes: x right, y down, z ahead."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.numba_cache import njit
from facade_core.core.types import Lens

# Coefficients of a lens: radial and denominator.
MAX_RADIAL = 4
MAX_DENOMINATOR = 3
# Values of a lens as an array: size, focal, centre, skew, fisheye, tangential, radial, denominator.
LENS_VALUES = 10 + MAX_RADIAL + MAX_DENOMINATOR
_RADIAL = 10
_DENOMINATOR = _RADIAL + MAX_RADIAL
_MAX_RADIUS2 = LENS_VALUES
# Largest radius of a point of a perspective lens (84 degrees from its axis), and largest angle of a fisheye, radians.
MAX_POINT_RADIUS = 10.0
MAX_FISHEYE_ANGLE = 1.9
# Steps of the search for the radius from which a polynomial folds back.
_RADIUS_STEPS = 2000
# Newton steps from a pixel to its ray, the step of the derivative, and the accepted error in units of the focal length.
_NEWTON_STEPS = 30
_DERIVATIVE_STEP = 1e-6
_MAX_RAY_ERROR = 1e-5


def lens_values(lens: Lens) -> list[float]:
    """Return the LENS_VALUES numbers of a lens, for tables and keys."""
    return [
        *map(float, lens.size), *lens.focal, *lens.centre, lens.skew, float(lens.fisheye), *lens.tangential,
        *lens.radial, *[0.0] * (MAX_RADIAL - len(lens.radial)),
        *lens.denominator, *[0.0] * (MAX_DENOMINATOR - len(lens.denominator)),
    ]  # fmt: skip


def lens_from_values(values: list[float]) -> Lens | None:
    """Return the lens of LENS_VALUES numbers; None for zeros, which panoramas have."""
    if not values[0]:
        return None
    radial, denominator = values[_RADIAL:_DENOMINATOR], values[_DENOMINATOR:LENS_VALUES]
    return Lens(
        (int(values[0]), int(values[1])),
        (values[2], values[3]),
        (values[4], values[5]),
        _without_trailing_zeros(radial),
        _without_trailing_zeros(denominator),
        (values[8], values[9]),
        values[6],
        bool(values[7]),
    )


def _without_trailing_zeros(values: list[float]) -> tuple[float, ...]:
    count = max((i + 1 for i, value in enumerate(values) if value), default=0)
    return tuple(values[:count])


@lru_cache(maxsize=256)
def lens_array(lens: Lens | None) -> Float64Array:
    """Return a lens as the kernels take it: its values, and the squared radius of its valid points; empty for None."""
    if lens is None:
        return np.zeros(0)
    values = np.array([*lens_values(lens), 0.0])
    radius = np.linspace(0.0, MAX_FISHEYE_ANGLE if lens.fisheye else MAX_POINT_RADIUS, _RADIUS_STEPS)
    square = radius**2
    bent = radius * _polynomial(values[_RADIAL:_DENOMINATOR], square)
    below = _polynomial(values[_DENOMINATOR:_MAX_RADIUS2], square)
    is_valid = below > 0
    bent = bent / np.where(is_valid, below, 1.0)
    is_valid[1:] &= np.diff(bent) > 0
    last = len(radius) - 1 if is_valid.all() else max(int(np.argmin(is_valid)) - 1, 0)
    values[_MAX_RADIUS2] = square[last]
    values.flags.writeable = False
    return values


def _polynomial(coefficients: Float64Array, square: Float64Array) -> Float64Array:
    value: Float64Array = 1.0 + sum(k * square ** (i + 1) for i, k in enumerate(coefficients))
    return value


@njit(cache=True, nogil=True)
def project_point(lens: Float64Array, x: float, y: float) -> tuple[float, float]:
    """Project a point of the lens (see `Lens`), of a fisheye after scaling, to shares of width and height."""
    square = x * x + y * y
    above, below, power = 1.0, 1.0, 1.0
    for i in range(MAX_RADIAL):
        power *= square
        above += lens[_RADIAL + i] * power
        if i < MAX_DENOMINATOR:
            below += lens[_DENOMINATOR + i] * power
    factor = above / below
    p1, p2 = lens[8], lens[9]
    u = factor * x + 2 * p1 * x * y + p2 * (square + 2 * x * x)
    v = factor * y + p1 * (square + 2 * y * y) + 2 * p2 * x * y
    return (lens[4] + lens[2] * u + lens[6] * v) / lens[0], (lens[5] + lens[3] * v) / lens[1]


@njit(cache=True, nogil=True)
def project_ray(lens: Float64Array, right: float, down: float, ahead: float) -> tuple[float, float]:
    """Project a camera ray to shares of width and height; NaN where the lens does not show it."""
    level = np.hypot(right, down)
    if lens[7] > 0:
        angle = np.arctan2(level, ahead)
        scale = angle / level if level > 1e-12 else 1.0
        if angle * angle > lens[_MAX_RADIUS2]:
            return np.nan, np.nan
    else:
        if ahead <= 1e-9 or level * level > lens[_MAX_RADIUS2] * ahead * ahead:
            return np.nan, np.nan
        scale = 1.0 / ahead
    return project_point(lens, right * scale, down * scale)


@njit(cache=True, nogil=True)
def _project_rays(lens: Float64Array, rays: Float64Array, shares: Float64Array) -> None:
    for i in range(len(rays)):
        shares[i, 0], shares[i, 1] = project_ray(lens, rays[i, 0], rays[i, 1], rays[i, 2])


def project_camera_rays(lens: Lens, rays: Float64Array) -> Float64Array:
    """Project camera rays (..., 3) to shares (..., 2) of the picture, from the top left; NaN where none shows."""
    flat = np.ascontiguousarray(rays, np.float64).reshape(-1, 3)
    shares = np.empty((len(flat), 2))
    _project_rays(lens_array(lens), flat, shares)
    return shares.reshape(*np.shape(rays)[:-1], 2)


@njit(cache=True, nogil=True)
def _unproject_shares(lens: Float64Array, shares: Float64Array, rays: Float64Array) -> None:
    for i in range(len(shares)):
        y = (shares[i, 1] * lens[1] - lens[5]) / lens[3]
        x = (shares[i, 0] * lens[0] - lens[4] - lens[6] * y) / lens[2]
        error = np.inf
        for _ in range(_NEWTON_STEPS):
            s, t = project_point(lens, x, y)
            es, et = s - shares[i, 0], t - shares[i, 1]
            error = np.hypot(es * lens[0] / lens[2], et * lens[1] / lens[3])
            if error < 1e-12:
                break
            sx, tx = project_point(lens, x + _DERIVATIVE_STEP, y)
            sy, ty = project_point(lens, x, y + _DERIVATIVE_STEP)
            a, b = (sx - s) / _DERIVATIVE_STEP, (sy - s) / _DERIVATIVE_STEP
            c, d = (tx - t) / _DERIVATIVE_STEP, (ty - t) / _DERIVATIVE_STEP
            scale = a * d - b * c
            if scale == 0:
                break
            x -= (d * es - b * et) / scale
            y -= (a * et - c * es) / scale
        radius = np.hypot(x, y)
        if not error < _MAX_RAY_ERROR or radius * radius > lens[_MAX_RADIUS2]:
            rays[i, :] = np.nan
        elif lens[7] > 0:
            side = np.sin(radius) / radius if radius > 1e-12 else 1.0
            rays[i, 0], rays[i, 1], rays[i, 2] = x * side, y * side, np.cos(radius)
        else:
            length = np.sqrt(1 + radius * radius)
            rays[i, 0], rays[i, 1], rays[i, 2] = x / length, y / length, 1 / length


def unproject_shares(lens: Lens, shares: Float64Array) -> Float64Array:
    """Return the unit camera rays (..., 3) of shares (..., 2) of the picture; NaN where the lens has none."""
    flat = np.ascontiguousarray(shares, np.float64).reshape(-1, 2)
    rays = np.empty((len(flat), 3))
    _unproject_shares(lens_array(lens), flat, rays)
    return rays.reshape(*np.shape(shares)[:-1], 3)


def picture_rays(lens: Lens, size: tuple[int, int]) -> Float64Array:
    """Return the unit camera rays (rows, columns, 3) through the pixel centres of a picture of a size (rows, columns)."""
    rows, columns = size
    shares = np.stack(np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows), axis=-1)
    return unproject_shares(lens, shares)
