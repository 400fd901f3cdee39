"""The floors paper's own method, to compare with: clone a patch from whole floors away, or split it in two.

Konushin & Vezhnevets 2007, section 3: floor height by RANSAC (`benchmarks.papers.floor_pitch`), source by squared
differences in a band around the patch, seam by a graph cut. A patch with texture of a floor's height above or below is cloned
vertically only. A patch of MIN_SIDE_PX without a source is diffused.
"""

from __future__ import annotations

import cv2
import maxflow
import numpy as np

from benchmarks.papers.floor_pitch import estimate_floor_height

# Width of the band around a patch that is compared, h of the paper, and in which the seam may run.
BAND_PX = 8
# A patch this small is not split any more.
MIN_SIDE_PX = 8
# Capacity of edges to pixels whose side of the seam is fixed.
_FIXED = 1e9

# A patch of the hole: rows and columns of its rectangle.
Patch = tuple[slice, slice]


def clone_and_split(image: np.ndarray, mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Fill the hole `mask` (H, W) bool of an image (H, W, 3) uint8; returns (H, W, 3) uint8."""
    floor = estimate_floor_height(image, mask, rng)
    out, hidden, left = image.copy(), mask.copy(), mask.copy()
    patches = _tighten(hidden, (slice(0, mask.shape[0]), slice(0, mask.shape[1])))
    while patches:
        best = max(range(len(patches)), key=lambda k: int((_ring(hidden, patches[k], 1)).sum()))
        patch = patches.pop(best)
        shift = _find_source(out, hidden, patch, floor)
        if shift is not None:
            _clone(out, hidden, patch, shift)
            left[patch] = False
        elif min(patch[0].stop - patch[0].start, patch[1].stop - patch[1].start) > MIN_SIDE_PX:
            patches += [part for half in _split(patch) for part in _tighten(hidden, half)]
        else:
            hidden[patch] = False  # diffused in the end; neighbours see it as it is then
            out[patch] = cv2.inpaint(out, left.astype(np.uint8), 3, cv2.INPAINT_TELEA)[patch]
    return np.where(mask[..., None], out, image)


def _tighten(hidden: np.ndarray, patch: Patch) -> list[Patch]:
    """The rectangle around the hidden pixels of a patch, as a list; empty without any."""
    rows, columns = (np.flatnonzero(hidden[patch].any(axis)) for axis in (1, 0))
    if not len(rows):
        return []
    y, x = patch[0].start, patch[1].start
    return [(slice(y + int(rows[0]), y + int(rows[-1]) + 1), slice(x + int(columns[0]), x + int(columns[-1]) + 1))]


def _split(patch: Patch) -> tuple[Patch, Patch]:
    """Halves, across the longer side."""
    rows, columns = patch
    if columns.stop - columns.start > rows.stop - rows.start:
        middle = (columns.start + columns.stop) // 2
        return (rows, slice(columns.start, middle)), (rows, slice(middle, columns.stop))
    middle = (rows.start + rows.stop) // 2
    return (slice(rows.start, middle), columns), (slice(middle, rows.stop), columns)


def _window(shape: tuple[int, ...], patch: Patch, margin: int) -> Patch:
    """The rectangle with a margin, within the image."""
    rows, columns = (
        slice(max(0, part.start - margin), min(size, part.stop + margin))
        for part, size in zip(patch, shape[:2], strict=True)
    )
    return rows, columns


def _own(hidden: np.ndarray, patch: Patch, window: Patch) -> np.ndarray:
    """The hidden pixels of a patch, in a window around it."""
    own = np.zeros(hidden.shape, bool)
    own[patch] = hidden[patch]
    return own[window]


def _ring(hidden: np.ndarray, patch: Patch, width: int) -> np.ndarray:
    """Known pixels within a width of the patch's hidden ones, in the window of that margin."""
    window = _window(hidden.shape, patch, width)
    own = _own(hidden, patch, window).astype(np.uint8)
    near = cv2.dilate(own, np.ones((2 * width + 1, 2 * width + 1), np.uint8)) > 0
    return near & ~hidden[window]


def _find_source(image: np.ndarray, hidden: np.ndarray, patch: Patch, floor: int | None) -> tuple[int, int] | None:
    """The translation (down, right) of least squared difference in the band; None where none shows the whole patch."""
    window = _window(hidden.shape, patch, BAND_PX)
    top, left = window[0].start, window[1].start
    band = _ring(hidden, patch, BAND_PX)
    if not band.any():
        return None
    needed = (band | _own(hidden, patch, window)).astype(np.float32)
    missing = cv2.matchTemplate(hidden.astype(np.float32), needed, cv2.TM_CCORR)
    colours, compared = image.astype(np.float32), np.repeat(band[..., None], 3, axis=2).astype(np.float32)
    squares = cv2.matchTemplate(colours, colours[window], cv2.TM_SQDIFF, mask=compared)
    down, right = np.arange(len(squares)) - top, np.arange(squares.shape[1]) - left
    allowed = missing < 0.5
    if floor is not None:
        allowed &= (down % floor == 0)[:, None]
        if _has_floor_beside(hidden, patch, floor):
            allowed &= right == 0
    if not allowed.any():
        return None
    y, x = np.unravel_index(np.where(allowed, squares, np.inf).argmin(), squares.shape)
    return int(down[y]), int(right[x])


def _has_floor_beside(hidden: np.ndarray, patch: Patch, floor: int) -> bool:
    """Whether a floor's height above or below the patch is known."""
    rows, columns = patch
    above, below = (
        hidden[max(0, rows.start - floor) : rows.start, columns],
        hidden[rows.stop : rows.stop + floor, columns],
    )
    return any(len(part) == floor and not part.any() for part in (above, below))


def _clone(out: np.ndarray, hidden: np.ndarray, patch: Patch, shift: tuple[int, int]) -> None:
    """Copy the source into the patch and into as much of the band as the least visible seam takes, in place."""
    window = _window(hidden.shape, patch, BAND_PX)
    own, band = _own(hidden, patch, window), _ring(hidden, patch, BAND_PX)
    source = out[tuple(slice(part.start + by, part.stop + by) for part, by in zip(window, shift, strict=True))]
    differ = np.abs(source.astype(float) - out[window]).sum(axis=2)
    graph = maxflow.GraphFloat(own.size, 2 * own.size)
    nodes = graph.add_grid_nodes(own.shape)
    for axis, structure in ((1, [[0, 0, 0], [0, 0, 1], [0, 0, 0]]), (0, [[0, 0, 0], [0, 0, 0], [0, 1, 0]])):
        weight = np.zeros(own.shape)
        near = np.s_[:, :-1] if axis else np.s_[:-1]
        far = np.s_[:, 1:] if axis else np.s_[1:]
        weight[near] = differ[near] + differ[far] + 1e-3
        graph.add_grid_edges(nodes, weight, np.array(structure), symmetric=True)
    within = cv2.erode((own | band).astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1) > 0
    graph.add_grid_tedges(nodes, np.where(own, 0.0, np.where(within, 0.0, _FIXED)), np.where(own, _FIXED, 0.0))
    graph.maxflow()
    taken = (graph.get_grid_segments(nodes) & (own | band)) | own
    out[window][taken] = source[taken]
    hidden[patch] = False
