"""Extent of a facade on its plane: the region with lines along both of its axes."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, IntArray
from facade_core.core.fixed_order import multiply_matrices
from facade_core.imagery.rectify.corner import Corner
from facade_core.imagery.rectify.settings import EXTENT
from facade_core.imagery.rectify.vanishing import FacadeCamera, undistort


def facade_extent(
    segments: Float64Array, view: FacadeCamera, corners: Float64Array, corner: Corner | None = None
) -> tuple[float, float, float, float] | None:
    """Compute the facade's box on its plane at distance 1.

    Parameters
    ----------
    segments : (n, 2, 2) lines from which the camera was found.
    view : camera that sees the facade.
    corners : (4, 2) of the photo, clockwise from the upper left.
    corner : corner at which the facade ends, if it is seen.

    Returns
    -------
    x0, y0, x1, y1; None if too few lines along both axes are close together.
    """
    grid = project_to_plane(_photo_grid(corners), view)
    grid = grid[np.isfinite(grid).all(axis=1)]
    if len(grid) < 4:
        return None
    limit = np.concatenate([grid.min(axis=0), grid.max(axis=0)])
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    is_clustered = _clustered_segments(segments, view.family)
    if lengths[is_clustered & (view.family == 0)].sum() < EXTENT.min_level_line_share * lengths[view.family != 1].sum():
        return None
    ends = project_to_plane(segments, view)
    box = _trimmed_box(ends[is_clustered], lengths[is_clustered])
    if box is None:
        return None
    families = _include_nearly_level(view.family, ends, box)
    is_clustered = _clustered_segments(segments, families) & _is_between(ends, box)
    higher = _trimmed_box(ends[is_clustered], lengths[is_clustered])
    if higher is not None:
        box[1], box[3] = min(box[1], higher[1]), max(box[3], higher[3])
    size = box[2:] - box[:2]
    if (size <= 0).any():
        return None
    box += np.array([-EXTENT.margin, -EXTENT.roof_margin, EXTENT.margin, EXTENT.margin]) * np.tile(size, 2)
    box = np.where(np.abs(limit - box) < EXTENT.min_cut_share * np.tile(size, 2), limit, box)
    full = _full_extent(view, corners)
    if full is not None and np.prod(size) > EXTENT.min_covered_share * (full[2] - full[0]) * (full[3] - full[1]):
        x0, y0, x1, y1 = full
    else:
        x0, y0 = np.maximum(box[:2], limit[:2]).tolist()
        x1, y1 = np.minimum(box[2:], limit[2:]).tolist()
    if corner is not None and x0 < corner.column < x1:
        x0, x1 = (x0, corner.column) if corner.side == "right" else (corner.column, x1)
    return x0, y0, x1, y1


def project_to_plane(points: Float64Array, view: FacadeCamera) -> Float64Array:
    """Project photo points to the facade's plane at distance 1.

    Parameters
    ----------
    points : (..., 2) in the photo.
    view : camera that sees the facade.

    Returns
    -------
    (..., 2), NaN where the plane is not seen or at a grazing angle.
    """
    straight = undistort(points, view.distortion)
    rays = np.concatenate([straight / view.focal, np.ones((*points.shape[:-1], 1))], axis=-1)
    facing = multiply_matrices(rays, view.rotation)
    depth = facing[..., 2:]
    seen = depth > np.cos(np.radians(EXTENT.max_obliquity_deg)) * np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.where(seen, facing[..., :2] / np.where(seen, depth, 1.0), np.nan)


def _full_extent(view: FacadeCamera, corners: Float64Array) -> tuple[float, float, float, float] | None:
    """Box of a whole photo that is already rectified, else None."""
    projected = project_to_plane(corners, view)
    if not np.isfinite(projected).all():
        return None
    # scale and shift that move the corners closest to their original positions
    centred, original = projected - projected.mean(axis=0), corners - corners.mean(axis=0)
    scale = (centred * original).sum() / (centred**2).sum()
    if np.linalg.norm(centred * scale - original, axis=1).max() > EXTENT.max_rectified_shift:
        return None
    left, right = projected[[0, 3], 0].mean(), projected[[1, 2], 0].mean()
    top, bottom = projected[[0, 1], 1].mean(), projected[[2, 3], 1].mean()
    return float(left), float(top), float(right), float(bottom)


def _trimmed_box(ends: Float64Array, lengths: Float64Array) -> Float64Array | None:
    """Box (4,) of lines on the plane (n, 2, 2) without strays, by their lengths (n,); None for too few."""
    is_projected = np.isfinite(ends).all(axis=(1, 2))
    if is_projected.sum() < 4:
        return None
    weight = np.repeat(lengths[is_projected], 2)
    (x0, x1), (y0, y1) = (_trimmed_range(ends[is_projected].reshape(-1, 2)[:, axis], weight) for axis in (0, 1))
    return np.array([x0, y0, x1, y1])


def _is_between(ends: Float64Array, box: Float64Array) -> BoolArray:
    """Whether lines on the plane (n, 2, 2) lie within the columns of a box."""
    columns = ends[..., 0]
    return np.asarray(((columns >= box[0]) & (columns <= box[2])).all(axis=1))


def _include_nearly_level(families: IntArray, ends: Float64Array, box: Float64Array) -> IntArray:
    """Families of lines (n,), with those between the sides of a box that are nearly level on the plane.

    The camera is less exact towards the photo's border: lines of the topmost storeys may miss the vanishing point.
    """
    across, down = np.abs(ends[:, 1] - ends[:, 0]).T
    is_level = down < np.tan(np.radians(EXTENT.max_level_deg)) * across
    return np.where((families == -1) & is_level & _is_between(ends, box), 0, families)


def _clustered_segments(segments: Float64Array, families: IntArray) -> BoolArray:
    """Segments (n,) bool of both families in places where both families are dense and others are not."""
    import cv2

    low = segments.reshape(-1, 2).min(axis=0)
    cell = 2.0 / EXTENT.grid_cells
    rows, columns = (np.ceil((segments.reshape(-1, 2).max(axis=0) - low) / cell).astype(int) + 1)[::-1]
    places = np.round((segments - low) / cell).astype(np.int32)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    middle = places.sum(axis=1) // 2
    near, total = [], []
    for family in (0, 1, -1):
        in_family = families == family
        lines = np.zeros((rows, columns), np.uint8)
        cv2.polylines(lines, list(places[in_family]), False, 1)
        near.append(cv2.dilate(lines, np.ones((EXTENT.max_gap_cells, EXTENT.max_gap_cells), np.uint8)))
        amount = np.zeros((rows, columns))
        np.add.at(amount, (middle[in_family, 1], middle[in_family, 0]), lengths[in_family])
        total.append(
            cv2.boxFilter(
                amount,
                -1,
                (EXTENT.max_gap_cells, EXTENT.max_gap_cells),
                normalize=False,
                borderType=cv2.BORDER_CONSTANT,
            )
        )
    # Walls of other directions share the vertical with this one: only level lines distinguish them. A small facade in
    # clutter has too few of them anywhere.
    shared = np.logical_and(near[0], near[1])
    is_clustered = np.zeros(len(segments), np.bool_)
    for share in (EXTENT.min_level_share, 0.0):
        region = shared & (total[0] >= share * (total[0] + total[2]))
        count, labels, _, _ = cv2.connectedComponentsWithStats(region.astype(np.uint8))
        in_family = labels[middle[:, 1], middle[:, 0]]
        within = (families >= 0) & (in_family > 0)
        support = np.bincount(in_family, lengths * within, minlength=count)
        is_clustered = within & (support >= EXTENT.min_part_share * support.max())[in_family]
        if min(np.bincount(families[is_clustered], minlength=2)) >= EXTENT.min_lines:
            break
    return is_clustered


def _trimmed_range(values: Float64Array, weight: Float64Array) -> Float64Array:
    """Range of the values (n,) without a stray share of the weight at each end."""
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order]) / weight.sum()
    first, last = np.searchsorted(share, [EXTENT.stray_share, 1 - EXTENT.stray_share])
    return values[order[[first, min(last, len(values) - 1)]]]


def _photo_grid(corners: Float64Array) -> Float64Array:
    """Grid of points (k, 2) over the photo."""
    (x0, y0), (x1, y1) = corners[0], corners[2]
    return np.stack(np.meshgrid(np.linspace(x0, x1, 65), np.linspace(y0, y1, 65)), axis=-1).reshape(-1, 2)
