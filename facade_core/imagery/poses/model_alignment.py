"""Alignment of cameras and points of structure from motion to the walls of a block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array
from facade_core.geometry.charts import Charts
from facade_core.geometry.nearest_surface import NearestSurface
from facade_core.geometry.scene import Scene
from facade_core.imagery.poses.settings import ALIGNMENT


@dataclass(frozen=True, slots=True, eq=False)
class ModelAlignment:
    """Similarity x -> scale rotation x + shift that brings cameras and points to the model.

    Attributes
    ----------
    rotation : (3, 3).
    scale : factor.
    shift : (3,) metres.
    on_wall_share : share of the points within on_wall_m of a wall.
    """

    rotation: Float64Array
    scale: float
    shift: Float64Array
    on_wall_share: float

    def apply(self, points: Float64Array) -> Float64Array:
        """Return points (n, 3) aligned."""
        return np.asarray(self.scale * points @ self.rotation.T + self.shift)


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPoints:
    """Cameras and points as GPS places them.

    Attributes
    ----------
    centres : (n, 3) cameras, metres in the frame of the block.
    points : (m, 3) points.
    camera : (m,) a camera that shows the point.
    gps : (n, 2) measured places of the cameras, NaN where unknown.
    height : (n,) expected heights of the cameras, metres in the frame of the block.
    right : (n, 3) right axes of the pictures as shown, by which they are level.
    """

    centres: Float64Array
    points: Float64Array
    camera: Int32Array
    gps: Float64Array
    height: Float64Array
    right: Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """Charts of a model, and the search for its nearest points."""

    charts: Charts
    surface: NearestSurface


def align_to_model(scene: Scene, placed: PlacedPoints) -> ModelAlignment | None:
    """Align points to the nearest walls that face their cameras, with GPS, level and height as priors.

    Iterated closest points by Gauss and Newton, with weights that fall with the distance: parked cars and trees stand before
    walls. Starts from several headings and keeps the one whose points fit best. Along a plane GPS alone decides.

    Parameters
    ----------
    scene : scene that contains the model.
    placed : cameras and points.

    Returns
    -------
    The alignment; None where there are too few points, too few of them come to a wall, or walls and GPS contradict.
    """
    if len(placed.points) < ALIGNMENT.min_points:
        return None
    step = -(-len(placed.points) // ALIGNMENT.max_points)
    chosen = PlacedPoints(
        placed.centres, placed.points[::step], placed.camera[::step], placed.gps, placed.height, placed.right
    )
    model = _Model(scene.charts, NearestSurface(scene.mesh))
    best: tuple[float, Float64Array] | None = None
    for turn in ALIGNMENT.start_turns_deg:
        change = np.zeros(7)
        change[2] = np.radians(turn)
        for scale in ALIGNMENT.round_scales_m:
            change = _solve_round(model, chosen, change, scale)
        if _gps_misfit(chosen, change) > _gps_misfit(chosen, np.zeros(7)) + ALIGNMENT.max_gps_increase:
            continue
        cost = _cost(model, chosen, change)
        if best is None or cost < best[0]:
            best = (cost, change)
    if best is None:
        return None
    rotation, factor, shift = _similarity(chosen, best[1])
    aligned = ModelAlignment(rotation, factor, shift, 0.0)
    distance, _, _ = _wall_distances(model, chosen, aligned)
    share = float((np.abs(distance) <= ALIGNMENT.on_wall_m).mean())
    return ModelAlignment(rotation, factor, shift, share) if share >= ALIGNMENT.min_on_wall_share else None


def _similarity(placed: PlacedPoints, change: Float64Array) -> tuple[Float64Array, float, Float64Array]:
    """Return rotation, scale and shift of a change (7,): turn in radians, shift in metres, logarithm of the scale."""
    from scipy.spatial.transform import Rotation

    rotation = np.asarray(Rotation.from_rotvec(change[:3]).as_matrix())
    factor, middle = float(np.exp(change[6])), placed.centres.mean(axis=0)
    return rotation, factor, middle + change[3:6] - factor * rotation @ middle


def _wall_distances(
    model: _Model, placed: PlacedPoints, aligned: ModelAlignment
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return distances (m,) before the nearest wall, inf where none is, its normals and the aligned points (m, 3)."""
    points = aligned.apply(placed.points)
    nearest, chart = model.surface.find(points)
    normal = model.charts.normals()[chart]
    distance = ((points - nearest) * normal).sum(axis=1)
    beside = np.linalg.norm(points - nearest - distance[:, None] * normal, axis=1)
    centres = aligned.apply(placed.centres)[placed.camera]
    faces = ((centres - nearest) * normal).sum(axis=1) > 0
    is_wall = faces & (beside <= ALIGNMENT.on_wall_m) & (np.abs(normal[:, 2]) <= ALIGNMENT.max_wall_slope)
    return np.where(is_wall, distance, np.inf), normal, points


def _weights(distance: Float64Array, scale: float) -> Float64Array:
    """Return weights (m,): things stand before walls, and nothing behind them, so that points there keep their weight."""
    near = 1 / (1 + (distance / scale) ** 2)
    return np.asarray(np.where(distance > 0, near**2, near))


def _priors(placed: PlacedPoints, change: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return residuals (k,) of the priors in units of their errors, and their derivatives (k, 7)."""
    rotation, factor, shift = _similarity(placed, change)
    centres = factor * placed.centres @ rotation.T + shift
    middle = placed.centres.mean(axis=0) + change[3:6]
    slopes = _slopes(centres - middle)
    known = np.isfinite(placed.gps).all(axis=1)
    off = (centres[known, :2] - placed.gps[known]) / ALIGNMENT.gps_sigma_m
    weight = np.sqrt(1 / (1 + (off**2).sum(axis=1) / ALIGNMENT.gps_outlier_sigmas**2))[:, None]
    rows = [(weight * off).ravel()]
    derivatives = [(weight[..., None] * slopes[known, :2] / ALIGNMENT.gps_sigma_m).reshape(-1, 7)]
    rows.append(np.array([np.mean(centres[:, 2] - placed.height) / ALIGNMENT.height_sigma_m]))
    derivatives.append(slopes[:, 2].mean(axis=0, keepdims=True) / ALIGNMENT.height_sigma_m)
    # the surfaces alone would shrink the points into one of them
    span = float(np.linalg.norm(placed.centres[known, :2] - placed.centres[known, :2].mean(axis=0)))
    sigma = ALIGNMENT.gps_sigma_m / max(span, ALIGNMENT.gps_sigma_m)
    rows.append(change[[6]] / sigma)
    derivatives.append(np.eye(7)[[6]] / sigma)
    level = _level_precision(placed)
    rows.append(level @ change[:2])
    derivatives.append(level @ np.eye(7)[:2])
    return np.concatenate(rows), np.concatenate(derivatives)


def _level_precision(placed: PlacedPoints) -> Float64Array:
    """Return the root (2, 2) of the precision of the tilt: pictures of one heading do not tell their common pitch."""
    tilt = placed.right[:, [1, 0]] * [1.0, -1.0]  # of right axes, by a turn about east and north
    precision = 2 * tilt.T @ tilt / len(tilt) / np.radians(ALIGNMENT.level_sigma_deg) ** 2
    return np.asarray(np.linalg.cholesky(precision + np.eye(2) / np.radians(ALIGNMENT.pitch_sigma_deg) ** 2).T)


def _slopes(offset: Float64Array) -> Float64Array:
    """Return derivatives (n, 3, 7) of points by a change, at offsets (n, 3) from the middle."""
    x, y, z = offset.T
    zero = np.zeros_like(x)
    turn = np.stack([zero, z, -y, -z, zero, x, y, -x, zero], axis=1).reshape(-1, 3, 3)
    return np.concatenate([turn, np.broadcast_to(np.eye(3), turn.shape), offset[:, :, None]], axis=2)


def _solve_round(model: _Model, placed: PlacedPoints, change: Float64Array, scale: float) -> Float64Array:
    """Return the change (7,) after one step of Gauss and Newton."""
    rotation, factor, shift = _similarity(placed, change)
    distance, normal, points = _wall_distances(model, placed, ModelAlignment(rotation, factor, shift, 0.0))
    weight = _weights(distance, scale)
    sigma = max(scale / 2, ALIGNMENT.model_sigma_m)
    weight *= min(1.0, ALIGNMENT.independent_points / max(weight.sum(), 1e-9)) / sigma**2
    slope = np.einsum("mi,mij->mj", normal, _slopes(points - placed.centres.mean(axis=0) - change[3:6]))
    residual, derivative = _priors(placed, change)
    left = slope.T @ (weight[:, None] * slope) + derivative.T @ derivative
    right = slope.T @ (weight * np.where(weight > 0, distance, 0.0)) + derivative.T @ residual
    step = -np.linalg.solve(left + 1e-9 * np.eye(7), right)
    return _compose(change, step)


def _compose(change: Float64Array, step: Float64Array) -> Float64Array:
    """Return the change (7,) followed by a small step."""
    from scipy.spatial.transform import Rotation

    turn = (Rotation.from_rotvec(step[:3]) * Rotation.from_rotvec(change[:3])).as_rotvec()
    return np.concatenate([turn, change[3:] + step[3:]])


def _gps_misfit(placed: PlacedPoints, change: Float64Array) -> float:
    """Return the sum of squares of GPS in units of its error; outliers count max_gps_sigmas."""
    rotation, factor, shift = _similarity(placed, change)
    off = (factor * placed.centres @ rotation.T + shift)[:, :2] - placed.gps
    squares = (off[np.isfinite(off).all(axis=1)] ** 2).sum(axis=1) / ALIGNMENT.gps_sigma_m**2
    return float(np.minimum(squares, ALIGNMENT.max_gps_sigmas**2).sum())


def _cost(model: _Model, placed: PlacedPoints, change: Float64Array) -> float:
    """Return how badly a change fits points and priors, to compare starts."""
    rotation, factor, shift = _similarity(placed, change)
    distance, _, _ = _wall_distances(model, placed, ModelAlignment(rotation, factor, shift, 0.0))
    near = np.where(np.isfinite(distance), distance, 1e3) ** 2
    off = near / (near + ALIGNMENT.on_wall_m**2) * np.where(distance < 0, ALIGNMENT.behind_cost, 1.0)
    points = float(off.mean()) * ALIGNMENT.independent_points
    residual, _ = _priors(placed, change)
    return points + 0.5 * float(residual @ residual)
