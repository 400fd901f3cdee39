"""Depth of a wall's elements by parallax between rectified pictures of the wall.

A plane before or behind the wall is, in a picture that is rectified on the wall, scaled about the camera's foot point. For each
depth on a grid the texels of an element are matched between the picture that the element was found in and every other one.
Pictures are first registered on what surrounds the elements, so that a depth is relative to the wall that is pictured, not to
the model's. Matches of elements of one type are summed before the best depth is taken: single windows are noisy.

References
----------
Collins (1996), A space-sweep approach to true multi-image matching.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float32Array, Float64Array, IntArray, UInt8Array
from facade_core.core.fixed_order import solve_least_squares
from facade_core.core.types import Element
from facade_core.imagery.rectify.fusion import ChartView
from facade_core.imagery.rectify.pictured_plane import CameraFrame
from facade_core.imagery.rectify.settings import PARALLAX


@dataclass(frozen=True, slots=True, eq=False)
class GreyView:
    """Wall as one picture shows it.

    Attributes
    ----------
    grey : (h, w) uint8 brightness, 0 where the wall is not seen or occluded.
    camera : camera in the wall's frame.
    """

    grey: UInt8Array
    camera: CameraFrame


def grey_where_clear(view: ChartView) -> UInt8Array:
    """Return the brightness (h, w) uint8 of a view, 0 where it does not show the wall."""
    import cv2

    grey = np.maximum(cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY), 1)
    return np.where(view.clear, grey, 0).astype(np.uint8)


class MeasuredDepth(NamedTuple):
    """Depth of the elements of one type.

    Attributes
    ----------
    outward_m : metres before the wall, negative behind it.
    error_m : standard error, metres.
    members : indices of the elements.
    correlation : agreement of the pictures at this depth, -1 to 1.
    margin : agreement above the best other depth, of a recessed opening the best farther out.
    margin_error : standard error of the margin.
    """

    outward_m: float
    error_m: float
    members: tuple[int, ...]
    correlation: float
    margin: float
    margin_error: float

    @property
    def is_reliable(self) -> bool:
        """Report whether the depth is distinct and its error small."""
        return (
            self.correlation >= PARALLAX.min_correlation
            and self.margin >= max(PARALLAX.min_margin, PARALLAX.min_margin_errors * self.margin_error)
            and self.error_m <= min(PARALLAX.max_error_m, max(abs(self.outward_m) / 3, PARALLAX.max_error_m / 3))
        )


def measure_element_depths(
    elements: Sequence[Element], views: Sequence[GreyView], source: IntArray, texels_per_metre: float
) -> list[MeasuredDepth]:
    """Measure the depth of each type of element of one wall.

    Parameters
    ----------
    elements : elements in metres, y down.
    views : pictures of the wall, of equal size.
    source : (n,) index of the view in which each element was found.
    texels_per_metre : density of the views.

    Returns
    -------
    One depth for each type that two pictures show from places far enough apart.
    """
    gradients = [_limited_gradients(view.grey) for view in views]
    # the panes of shops show the room behind them
    groups = [group for group in group_elements(elements) if elements[group[0]].label != "shop"]
    shown = [[k for k in group if source[k] >= 0] for group in groups]
    matched = {k for own in shown for k in own[:: -(-len(own) // PARALLAX.max_matched) or 1]}
    sweeps: list[_ElementSweep] = []
    for reference, view in enumerate(views):
        own = [(k, elements[k]) for k in sorted(matched) if source[k] == reference]
        for other in _near_cameras(views, reference, texels_per_metre) if own else ():
            cameras = view.camera, views[other].camera
            pair = _PicturePair(gradients[reference], gradients[other], *cameras, texels_per_metre)
            sweeps += _sweep_pair(pair, own, elements)
    found = (_pool_sweeps(sweeps, group, is_recessed=is_opening(elements[group[0]])) for group in groups)
    return [one for one in found if one is not None]


def _near_cameras(views: Sequence[GreyView], reference: int, texels_per_metre: float) -> list[int]:
    """Return the views from places beside that of a reference, the nearest first: pictures from afar look different."""
    own = views[reference].camera
    apart = [float(np.hypot(v.camera.right - own.right, v.camera.down - own.down)) for v in views]
    near = [k for k in np.argsort(apart, kind="stable").tolist() if k != reference]
    least = PARALLAX.min_texels_per_metre / texels_per_metre * own.before
    return [k for k in near if apart[k] >= least][: PARALLAX.max_pairs]


def group_elements(elements: Sequence[Element]) -> list[tuple[int, ...]]:
    """Group elements of one class and about one size, small groups with the largest of their class; returns indices."""
    found: list[tuple[int, ...]] = []
    for label in sorted({element.label for element in elements}):
        groups: list[list[int]] = []
        for k, element in enumerate(elements):
            if element.label == label:
                own = next((group for group in groups if _is_like(element, elements[group[0]])), None)
                own.append(k) if own is not None else groups.append([k])
        groups.sort(key=len, reverse=True)
        large = [group for group in groups[1:] if len(group) >= PARALLAX.min_members]
        small = [k for group in groups[1:] if len(group) < PARALLAX.min_members for k in group]
        found += [tuple(sorted(group)) for group in (groups[0] + small, *large)]
    return found


def _is_like(one: Element, other: Element) -> bool:
    ratios = one.width / other.width, one.height / other.height
    return max(*ratios, *(1 / ratio for ratio in ratios)) <= PARALLAX.max_size_ratio


def _limited_gradients(grey: UInt8Array) -> Float32Array:
    """Return gradients of log brightness to the right and down, soft-limited, and 1 where they are known, (h, w, 3)."""
    import cv2

    tone = np.log(cv2.GaussianBlur(grey, (0, 0), PARALLAX.blur_texels).astype(np.float32) + 16)
    known = cv2.erode((grey > 0).astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0).astype(np.float32)
    right, down = (cv2.Sobel(tone, cv2.CV_32F, *axes, scale=0.125) * known for axes in ((1, 0), (0, 1)))
    size = np.hypot(right, down) + np.float32(PARALLAX.limited_gradient)
    return np.stack([right / size, down / size, known], axis=-1)


class _PicturePair(NamedTuple):
    """Gradients (h, w, 3) and cameras of two pictures of a wall, and their texels per metre."""

    reference: Float32Array
    other: Float32Array
    camera: CameraFrame
    other_camera: CameraFrame
    density: float

    def shift_per_metre(self, place: Float64Array) -> Float64Array:
        """Return the shift (2,) in the other picture of a place (2,) of the reference per metre of depth, metres."""
        (one, near), (two, other_near) = _foot(self.camera), _foot(self.other_camera)
        return (place - two) / other_near - (place - one) / near

    def place_at_depth(self, place: Float64Array, axis: int, depth: float) -> tuple[Float64Array, Float64Array]:
        """Return what coordinates (n,) of the reference show at a depth: those on that plane, and in the other picture."""
        (one, near), (two, other_near) = _foot(self.camera), _foot(self.other_camera)
        on_plane = one[axis] + (place - one[axis]) * ((near - depth) / near)
        return on_plane, two[axis] + (on_plane - two[axis]) * (other_near / (other_near - depth))


def _foot(camera: CameraFrame) -> tuple[Float64Array, float]:
    """Return the place (2,) on the wall before a camera, and the camera's distance to it."""
    return np.array([camera.right, camera.down]), camera.before


class _Registration(NamedTuple):
    """Affine map (3, 2) of places (x, y, 1) to the shift of the other picture in metres, and its standard error."""

    shift: Float64Array
    error_m: float


class _ElementSweep(NamedTuple):
    """Agreement (parts, depths) of the parts of an element between two pictures over DEPTHS, and the weight (parts, depths)."""

    element: int
    agreement: Float64Array
    weight: Float64Array
    registration_error_m: float


DEPTHS = np.arange(PARALLAX.depths_m[0], PARALLAX.depths_m[1] + 1e-9, PARALLAX.depth_step_m)


def _sweep_pair(
    pair: _PicturePair, elements: Sequence[tuple[int, Element]], every: Sequence[Element]
) -> list[_ElementSweep]:
    speed = {k: float(np.linalg.norm(pair.shift_per_metre(_middle(element)))) for k, element in elements}
    apart = [(k, element) for k, element in elements if speed[k] * pair.density >= PARALLAX.min_texels_per_metre]
    registration = _register(pair, [element for _, element in apart], every)
    if registration is None:
        return []
    balconies = [element for element in every if not is_opening(element)]
    return [
        _ElementSweep(k, *_sweep_element(pair, element, balconies, registration.shift), registration.error_m / speed[k])
        for k, element in apart
    ]


def is_opening(element: Element) -> bool:
    """Return True for an element that is set back, False for one that stands out."""
    return element.label != "balcony"


def _middle(element: Element) -> Float64Array:
    return np.array([element.x0 + element.x1, element.y0 + element.y1]) / 2


def _texels_within(raster: Float32Array, element: Element, margin: float, density: float) -> tuple[slice, slice]:
    """Return the rows and columns of the texels of an element less a margin."""
    low, high = np.array([element.y0, element.x0]) + margin, np.array([element.y1, element.x1]) - margin
    first = np.maximum(np.rint(low * density), 0).astype(int).tolist()
    last = np.minimum(np.rint(high * density), raster.shape[:2]).astype(int).tolist()
    return slice(first[0], max(first[0], last[0])), slice(first[1], max(first[1], last[1]))


def _register(pair: _PicturePair, elements: Sequence[Element], every: Sequence[Element]) -> _Registration | None:
    """Register two pictures on the surroundings of elements; None if these do not agree."""
    reach = round(PARALLAX.max_shift_m * pair.density)
    surfaces, middles = [], []
    for element in elements:
        surface = _surroundings_agreement(pair, element, every, reach)
        if surface is not None:
            surfaces.append(surface)
            middles.append([*_middle(element).tolist(), 1.0])
    if not surfaces:
        return None
    total = np.mean(surfaces, axis=0)
    best = np.unravel_index(int(total.argmax()), total.shape)
    if total[best] < PARALLAX.min_registration or not all(0 < at < 2 * reach for at in best):
        return None
    shifts = np.array([_local_peak(surface, best) for surface in surfaces]) - reach
    design, middle = np.array(middles), np.median(shifts, axis=0)
    fit = np.zeros((3, 2))
    fit[2] = middle
    for _ in range(4):
        residual = np.hypot(*(shifts - design @ fit).T)
        weight = 1 / np.maximum(residual, 0.3)[:, None] ** 0.5
        if len(shifts) >= 6:
            fit = solve_least_squares(weight * design, weight * shifts)
    spread = 1.48 * float(np.median(np.hypot(*(shifts - design @ fit).T))) / np.sqrt(2)
    return _Registration(fit / pair.density, max(spread, 0.1) / np.sqrt(len(shifts)) / pair.density)


def _surroundings_agreement(
    pair: _PicturePair, element: Element, others: Sequence[Element], reach: int
) -> Float64Array | None:
    """Correlate the surroundings of an element over shifts (2 reach + 1, 2 reach + 1); None if too little is known."""
    import cv2

    rows, columns = _texels_within(pair.reference, element, -PARALLAX.surroundings_m, pair.density)
    own = pair.reference[rows, columns]
    is_wall = own[..., 2].copy()
    for other in others:
        inside = _texels_within(pair.reference, other, 0.0 if is_opening(other) else -2 * PARALLAX.edge_m, pair.density)
        down, right = (
            slice(max(0, at.start - of.start), max(0, at.stop - of.start))
            for at, of in zip(inside, (rows, columns), strict=True)
        )
        is_wall[down, right] = 0
    if not is_wall.size or is_wall.mean() < PARALLAX.min_known_share:
        return None
    around: AnyArray = np.pad(pair.other, ((reach, reach), (reach, reach), (0, 0)))[
        rows.start : rows.stop + 2 * reach, columns.start : columns.stop + 2 * reach
    ]
    gradient, there = own[..., :2] * is_wall[..., None], around[..., :2]

    def correlate(raster: AnyArray, template: AnyArray) -> Float64Array:
        found = cv2.matchTemplate(np.ascontiguousarray(raster), np.ascontiguousarray(template), cv2.TM_CCORR)
        return np.asarray(found, np.float64)

    product = correlate(there[..., 0], gradient[..., 0]) + correlate(there[..., 1], gradient[..., 1])
    power = correlate(around[..., 2], (gradient**2).sum(axis=-1)) * correlate((there**2).sum(axis=-1), is_wall)
    scores: Float64Array = np.where(power > 1e-3, product / np.sqrt(np.maximum(power, 1e-3)), 0.0)
    return scores


def _local_peak(surface: Float64Array, near: Sequence[np.intp]) -> tuple[float, float]:
    """Return column and row of the peak of a surface within two cells of a place, between cells."""
    rows, columns = (
        slice(max(1, int(at) - 2), min(size - 1, int(at) + 3)) for at, size in zip(near, surface.shape, strict=True)
    )
    part = surface[rows, columns]
    down, right = np.unravel_index(int(part.argmax()), part.shape)
    row, column = int(down) + rows.start, int(right) + columns.start
    return (
        column + _vertex(surface[row, column - 1 : column + 2]),
        row + _vertex(surface[row - 1 : row + 2, column]),
    )


def _vertex(three: Float64Array) -> float:
    """Return the vertex of the parabola through three values, -0.5 to 0.5 from the middle one."""
    low, middle, high = three.tolist()
    bend = low - 2 * middle + high
    return 0.0 if bend >= -1e-12 else float(np.clip((low - high) / (2 * bend), -0.5, 0.5))


def _sweep_element(
    pair: _PicturePair, element: Element, balconies: Sequence[Element], shift: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Correlate an element between two pictures over DEPTHS, its parts apart: agreement and weight, (parts, depths)."""
    import cv2

    recessed = is_opening(element)
    margin = PARALLAX.edge_m if recessed else -PARALLAX.edge_m
    rows, columns = _texels_within(pair.reference, element, margin, pair.density)
    parts = np.array_split(np.arange(rows.stop - rows.start), PARALLAX.parts)
    agreement, weights = np.zeros((2, PARALLAX.parts, len(DEPTHS)))
    if min(len(parts[-1]), columns.stop - columns.start) < 2:
        return agreement, weights
    direction = pair.shift_per_metre(_middle(element))
    direction = (direction / np.linalg.norm(direction)).astype(np.float32)
    y, x = ((np.arange(at.start, at.stop) + 0.5) / pair.density for at in (rows, columns))
    own, known = pair.reference[rows, columns, :2] @ direction, pair.reference[rows, columns, 2].copy()
    for balcony in balconies if recessed else ():
        known[np.ix_(*_inside(y, x, balcony, -PARALLAX.edge_m))] = 0
    drift = [shift[0, axis] * x + (shift[1, axis] * y + shift[2, axis])[:, None] for axis in (0, 1)]
    for k, depth in enumerate(DEPTHS.tolist()):
        if (depth < 0) != recessed and abs(depth) > PARALLAX.max_other_side_m:
            continue
        (plane_x, there_x), (plane_y, there_y) = (
            pair.place_at_depth(at, axis, depth) for axis, at in enumerate((x, y))
        )
        at = [
            (part * pair.density - 0.5).astype(np.float32) for part in (there_x + drift[0], there_y[:, None] + drift[1])
        ]
        seen = np.asarray(cv2.remap(pair.other, at[0], at[1], cv2.INTER_LINEAR, borderValue=0), np.float32)
        weight = known * seen[..., 2]
        if recessed:  # what both pictures see past the edges of the opening
            in_y, in_x = (
                one & two
                for one, two in zip(
                    _inside(there_y, there_x, element, margin), _inside(plane_y, plane_x, element, 0.0), strict=True
                )
            )
            weight *= in_y[:, None] & in_x
        values = seen[..., :2] @ direction
        products = [(weight * pair_product).sum(axis=1) for pair_product in (own * values, own * own, values * values)]
        for part, of in enumerate(parts):
            product, *power = (float(one[of].sum()) for one in products)
            if min(power) > 1e-6 and weight[of].mean() >= PARALLAX.min_known_share:
                agreement[part, k] = product / np.sqrt(power[0] * power[1])
                weights[part, k] = np.sqrt(min(power))
    return agreement, weights


def _inside(y: Float64Array, x: Float64Array, element: Element, margin: float) -> tuple[BoolArray, BoolArray]:
    """Report which rows and which columns at places (n,) are in an element less a margin."""
    rows: BoolArray = (y >= element.y0 + margin) & (y <= element.y1 - margin)
    columns: BoolArray = (x >= element.x0 + margin) & (x <= element.x1 - margin)
    return rows, columns


def _pool_sweeps(
    sweeps: Sequence[_ElementSweep], members: tuple[int, ...], *, is_recessed: bool
) -> MeasuredDepth | None:
    """Pool the sweeps of the elements of a type; the error follows from leaving out one part at a time."""
    own = [sweep for sweep in sweeps if sweep.element in members]
    if not own:
        return None
    agreement = np.concatenate([sweep.agreement for sweep in own])
    weight = np.concatenate([sweep.weight for sweep in own])
    used = weight.max(axis=1) > 0
    agreement, weight = agreement[used], weight[used]
    n = len(agreement)
    total = _pooled(agreement, weight)
    best = _find_peak(total, is_recessed=is_recessed)
    if n < 2 or best is None:
        return None
    # behind a recessed frame is a room, but a peak at the wall may be the opening's surround
    is_frame = is_recessed and DEPTHS[best] <= -PARALLAX.min_recess_m
    gap = DEPTHS - DEPTHS[best] if is_frame else np.abs(DEPTHS - DEPTHS[best])
    rivals = np.flatnonzero(gap > PARALLAX.peak_width_m)
    rival = int(rivals[total[rivals].argmax()])
    left_out = [_pooled(np.delete(agreement, k, 0), np.delete(weight, k, 0)) for k in range(n)]
    depths = np.array([_peak_depth(one, _nearest_peak(one, best)) for one in left_out])
    margins = np.array([one[best] - one[rival] for one in left_out])
    registration = float(np.median([sweep.registration_error_m for sweep in own]))
    return MeasuredDepth(
        _peak_depth(total, best),
        float(np.hypot(_jackknife_error(depths), registration)),
        members,
        float(total[best]),
        float(total[best] - total[rival]),
        _jackknife_error(margins),
    )


def _find_peak(total: Float64Array, *, is_recessed: bool) -> int | None:
    """Return the index of the best peak, of an opening the outermost: a room behind glass may match better than its frame."""
    from scipy.signal import find_peaks

    peaks, _ = find_peaks(total, height=PARALLAX.min_peak_share * total.max(), prominence=PARALLAX.min_prominence)
    if not len(peaks):
        return None
    return int(peaks[-1] if is_recessed else peaks[total[peaks].argmax()])


def _nearest_peak(total: Float64Array, place: int) -> int:
    """Return the index of the largest value within the width of a peak."""
    reach = round(PARALLAX.peak_width_m / PARALLAX.depth_step_m)
    first = max(0, place - reach)
    return first + int(total[first : place + reach + 1].argmax())


def _jackknife_error(values: Float64Array) -> float:
    return float(np.sqrt((len(values) - 1) / len(values) * ((values - values.mean()) ** 2).sum()))


def _pooled(agreement: Float64Array, weight: Float64Array) -> Float64Array:
    sums = weight.sum(axis=0)
    pooled: Float64Array = (agreement * weight).sum(axis=0) / np.maximum(sums, 1e-9)
    # depths at which little of the elements is left do not count
    return np.where(sums >= 0.5 * sums.max(), pooled, 0.0)


def _peak_depth(total: Float64Array, best: int) -> float:
    if not 0 < best < len(total) - 1:
        return float(DEPTHS[best])
    return float(DEPTHS[best] + PARALLAX.depth_step_m * _vertex(total[best - 1 : best + 2]))
