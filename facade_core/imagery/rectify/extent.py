"""What part of a facade's plane a photo shows well: where lines along both of its axes lie."""

from __future__ import annotations

import numpy as np

from facade_core.imagery.rectify.vanishing import FacadeCamera, undistort

# Cells along the photo's diagonal, and over how many of them the facade goes on between two of its lines.
CELLS = 96
GAP = 9
# Where the lines of the wall's right are a smaller share of all that are not vertical, it is not this wall that is seen; parts
# of it (between trees) count if they have this share of the largest one's lines.
LEVEL_SHARE = 0.25
LEAST_PART = 0.05
# Share of all the photo's lines but the vertical that must be the wall's level ones: a street seen along its length has less.
LEAST_LEVEL = 0.05
LEAST_LINES = 12
# Share of the lines' length at each side that may lie outside the facade.
STRAY = 0.002
# Kept around the outermost lines, as a share of the extent: more above, where roofs and chimneys are poor in lines. A strip of
# the photo as narrow as NARROW is not cut off.
MARGIN, ROOF_MARGIN = 0.03, 0.08
NARROW = 0.06
# Degrees from the wall's normal beyond which its pixels are too stretched to be of use.
GRAZING = 77.0
# A photo whose corners move by less than this (half diagonals) is rectified already, and stays whole.
STILL = 0.07
# Provided that its lines cover this share of it; else it shows more than the facade.
COVERED = 0.6


def facade_extent(segments: np.ndarray, view: FacadeCamera, corners: np.ndarray) -> tuple[float, float, float, float] | None:
    """The facade's box (x0, y0, x1, y1) on its plane at distance 1, None where too few lines along both axes lie together.

    segments (n, 2, 2) as the view was found in; corners (4, 2) of the photo, clockwise from the upper left.
    """
    shown = project_to_plane(_grid(corners), view)
    shown = shown[np.isfinite(shown).all(axis=1)]
    if len(shown) < 4:
        return None
    limit = np.concatenate([shown.min(axis=0), shown.max(axis=0)])
    together = _together(segments, view)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    if lengths[together & (view.family == 0)].sum() < LEAST_LEVEL * lengths[view.family != 1].sum():
        return None
    supporting = segments[together]
    ends = project_to_plane(supporting, view)
    fine = np.isfinite(ends).all(axis=(1, 2))
    if fine.sum() < 4:
        return None
    weight = np.repeat(lengths[together][fine], 2)
    box = np.concatenate([_inner(ends[fine].reshape(-1, 2)[:, axis], weight) for axis in (0, 1)])[[0, 2, 1, 3]]
    size = box[2:] - box[:2]
    if (size <= 0).any():
        return None
    box += np.array([-MARGIN, -ROOF_MARGIN, MARGIN, MARGIN]) * np.tile(size, 2)
    box = np.where(np.abs(limit - box) < NARROW * np.tile(size, 2), limit, box)
    whole = _whole(view, corners)
    if whole is not None and np.prod(size) > COVERED * (whole[2] - whole[0]) * (whole[3] - whole[1]):
        return whole
    x0, y0 = np.maximum(box[:2], limit[:2]).tolist()
    x1, y1 = np.minimum(box[2:], limit[2:]).tolist()
    return x0, y0, x1, y1


def project_to_plane(points: np.ndarray, view: FacadeCamera) -> np.ndarray:
    """Points (..., 2) of the photo on the facade's plane at distance 1; NaN where it is not seen, or at a grazing angle."""
    straight = undistort(points, view.distortion)
    rays = np.concatenate([straight / view.focal, np.ones((*points.shape[:-1], 1))], axis=-1)
    facing = rays @ view.rotation
    depth = facing[..., 2:]
    seen = depth > np.cos(np.radians(GRAZING)) * np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.where(seen, facing[..., :2] / np.where(seen, depth, 1.0), np.nan)


def _whole(view: FacadeCamera, corners: np.ndarray) -> tuple[float, float, float, float] | None:
    """The box of all of a photo that is rectified already."""
    there = project_to_plane(corners, view)
    if not np.isfinite(there).all():
        return None
    # The scale and shift that bring the corners closest to where they were.
    centred, before = there - there.mean(axis=0), corners - corners.mean(axis=0)
    scale = (centred * before).sum() / (centred**2).sum()
    if np.linalg.norm(centred * scale - before, axis=1).max() > STILL:
        return None
    left, right = there[[0, 3], 0].mean(), there[[1, 2], 0].mean()
    top, bottom = there[[0, 1], 1].mean(), there[[2, 3], 1].mean()
    return float(left), float(top), float(right), float(bottom)


def _together(segments: np.ndarray, view: FacadeCamera) -> np.ndarray:
    """Which segments (n,) of the two families lie where both do, and where few others do."""
    import cv2

    low = segments.reshape(-1, 2).min(axis=0)
    cell = 2.0 / CELLS
    rows, columns = (np.ceil((segments.reshape(-1, 2).max(axis=0) - low) / cell).astype(int) + 1)[::-1]
    places = np.round((segments - low) / cell).astype(np.int32)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    middle = places.sum(axis=1) // 2
    near, total = [], []
    for family in (0, 1, -1):
        own = view.family == family
        lines = np.zeros((rows, columns), np.uint8)
        cv2.polylines(lines, list(places[own]), False, 1)
        near.append(cv2.dilate(lines, np.ones((GAP, GAP), np.uint8)))
        amount = np.zeros((rows, columns))
        np.add.at(amount, (middle[own, 1], middle[own, 0]), lengths[own])
        total.append(cv2.boxFilter(amount, -1, (GAP, GAP), normalize=False, borderType=cv2.BORDER_CONSTANT))
    # Walls of other directions share the vertical with this one, so it is the level lines that tell. A small facade before much
    # clutter has too few of them anywhere.
    shared = np.logical_and(near[0], near[1])
    found = np.zeros(len(segments), np.bool_)
    for share in (LEVEL_SHARE, 0.0):
        region = shared & (total[0] >= share * (total[0] + total[2]))
        count, labels, _, _ = cv2.connectedComponentsWithStats(region.astype(np.uint8))
        own = labels[middle[:, 1], middle[:, 0]]
        within = (view.family >= 0) & (own > 0)
        support = np.bincount(own, lengths * within, minlength=count)
        found = within & (support >= LEAST_PART * support.max())[own]
        if min(np.bincount(view.family[found], minlength=2)) >= LEAST_LINES:
            break
    return found


def _inner(values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Where the values (n,) begin and end, but for a stray share of the weight."""
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order]) / weight.sum()
    first, last = np.searchsorted(share, [STRAY, 1 - STRAY])
    return values[order[[first, min(last, len(values) - 1)]]]


def _grid(corners: np.ndarray) -> np.ndarray:
    """Points (k, 2) all over the photo."""
    (x0, y0), (x1, y1) = corners[0], corners[2]
    return np.stack(np.meshgrid(np.linspace(x0, x1, 65), np.linspace(y0, y1, 65)), axis=-1).reshape(-1, 2)
