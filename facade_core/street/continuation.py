"""Differences of ground from its material, as pictures show them, continued along a street from viewpoint to viewpoint.

The material field gives the detail of ground that no picture shows, and pictures give what they differ by from it: exposure,
tint, wear. A viewpoint's partially textured panorama holds these differences where a picture shows the ground. Its other ground
takes their mean on its kind of surface, weighted by distance, and with the weight of some cells the mean of all that the
panorama shows, which little evidence draws towards no difference: the result lies between the material and what the pictures
show. A viewpoint that sees no picture goes on from what earlier ones decided.

References
----------
Street paper, 3. Shepard 1968, A two-dimensional interpolation function for irregularly-spaced data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array, IntArray, UInt8Array, UInt16Array
from facade_core.core.numba_cache import njit
from facade_core.core.provenance import Provenance
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.blend import blend_views
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer

# Value of a difference of 0 in a difference image: a byte holds -128 to 127.
NO_DIFFERENCE = 128


@dataclass(frozen=True)
class ContinuationSettings:
    """Settings of the continuation.

    Attributes
    ----------
    panorama_width : pixels; differences are smooth, so that few are enough.
    texels_per_metre : density at which a street holds differences; these are means over its texels.
    cell_m : side of the square cells in which a viewpoint averages differences.
    max_cells_across : cells across the panorama's reach; they are larger where it sees far.
    smoothing_m : distance within which cells weigh about the same.
    prior_cells : known cells nearby that weigh as much as the mean of all that a panorama shows; and of that mean, as no
        difference does.
    min_shown_share : share of a texel that pictures show, from which on it is known.
    """

    panorama_width: int = 512
    texels_per_metre: float = 4.0
    cell_m: float = 2.0
    max_cells_across: int = 40
    smoothing_m: float = 4.0
    prior_cells: float = 1.0
    min_shown_share: float = 0.5


CONTINUATION = ContinuationSettings()


class StreetView(NamedTuple):
    """Differences that a viewpoint decided.

    Attributes
    ----------
    viewpoint : position and direction of the panorama.
    difference : (h, w, 3) uint8 difference image.
    chart : (h, w) int32 ground chart of each pixel, -1 where nothing is decided.
    kind : (h, w) uint8 kind of ground of each pixel.
    """

    viewpoint: Viewpoint
    difference: UInt8Array
    chart: Int32Array
    kind: UInt8Array

    def with_viewpoint_id(self, number: int) -> StreetView:
        """Return the view with another id of its viewpoint."""
        return self._replace(viewpoint=replace(self.viewpoint, id=number))


class DecidedDifferences(NamedTuple):
    """Differences of the texels of a chart: (h, w, 3) uint8 difference image and (h, w) uint16 views that decided it."""

    difference: UInt8Array
    views: UInt16Array

    def apply(self, colour: UInt8Array, rows: IntArray, columns: IntArray) -> UInt8Array:
        """Return the colours (k, 3) of texels with their differences, where a view decided one."""
        difference = self.difference[rows, columns].astype(np.int16) - NO_DIFFERENCE
        difference[self.views[rows, columns] == 0] = 0
        changed: UInt8Array = np.clip(colour + difference, 0, 255).astype(np.uint8)
        return changed


def continue_street(
    scene: Scene,
    materials: MaterialField,
    viewpoints: Sequence[Viewpoint],
    seen: Sequence[IntArray],
    shown: Mapping[int, tuple[UInt8Array, BoolArray]],
    settings: ContinuationSettings = CONTINUATION,
) -> dict[int, StreetView]:
    """Continue what pictures show of a street's ground from viewpoint to viewpoint, in their order.

    Viewpoints before the first that sees a picture follow in reverse order.

    Parameters
    ----------
    scene : the block's geometry.
    materials : material field of the block.
    viewpoints : of the street, in their order.
    seen : ground charts (k,) that each of them sees.
    shown : by ground chart its colours (h, w, 3) and which texels (h, w) pictures show.

    Returns
    -------
    What each viewpoint decided, by its number; those that see no difference are left out.
    """
    coarse = scene.with_density(settings.texels_per_metre)
    layout, writable = TexelBuffer.plan_layout(coarse.placement, np.concatenate(seen).tolist(), ())
    difference, provenance = np.zeros((layout.total, 3), np.uint8), np.zeros(layout.total, np.uint8)
    kinds = np.empty(layout.total, np.uint8)
    for chart in writable.tolist():
        texels = layout.texel_slice(coarse.placement, chart)
        density = float(coarse.placement.texels_per_metre[chart])
        kind = materials.ground_kinds(chart, 0, density)
        kinds[texels] = kind.reshape(-1)
        if chart in shown:
            values, known = _shown_differences(scene, materials, chart, *shown[chart], kind, density, settings)
            difference[texels], provenance[texels] = values, np.where(known, Provenance.PHOTO, Provenance.UNSEEN)
    buffer = TexelBuffer.allocate(
        coarse.placement,
        layout,
        writable,
        difference,
        provenance,
        visibility_range=scene.visibility_range,
        kinds=kinds,
    )
    found: dict[int, StreetView] = {}
    has_differences = np.zeros(len(scene.charts), bool)
    has_differences[list(shown)] = True
    for numbers in (range(len(viewpoints)), reversed(range(len(viewpoints)))):
        for number in numbers:
            if number in found or not has_differences[seen[number]].any():
                continue
            view = _continue_view(coarse, buffer, viewpoints[number], settings)
            if view is not None:
                found[number] = view
                has_differences[np.unique(view.chart[view.chart != MISS])] = True
                _propagate(coarse, buffer, view)
    return dict(sorted(found.items()))


def _propagate(scene: Scene, buffer: TexelBuffer, view: StreetView) -> None:
    propagate_panorama(scene, buffer, view.viewpoint, view.difference, charts_seen=view.chart, kinds=view.kind)


def blend_street_views(
    scene: Scene, materials: MaterialField, chart: int, views: Sequence[StreetView]
) -> DecidedDifferences:
    """Blend the differences of a chart's texels by Eq. 1 over all views.

    Parameters
    ----------
    scene : the block's geometry.
    materials : material field of the block.
    chart : a ground chart.
    views : with viewpoints of ids that tell them apart; in any order.
    """
    placement = scene.placement
    layout, writable = TexelBuffer.plan_layout(placement, [chart], ())
    nothing = np.zeros((layout.total, 3), np.uint8), np.zeros(layout.total, np.uint8)
    kinds = materials.ground_kinds(chart, 0).reshape(-1)
    buffer = TexelBuffer.allocate(
        placement, layout, writable, *nothing, visibility_range=scene.visibility_range, kinds=kinds
    )
    for view in views:
        _propagate(scene, buffer, view)
    difference, count = blend_views(buffer.state)
    size = placement.shape(chart)
    return DecidedDifferences(difference.reshape(*size, 3), count.reshape(size))


def _shown_differences(
    scene: Scene,
    materials: MaterialField,
    chart: int,
    rgb: UInt8Array,
    is_shown: BoolArray,
    kind: UInt8Array,
    density: float,
    settings: ContinuationSettings,
) -> tuple[UInt8Array, BoolArray]:
    """Return the difference (t, 3) of a ground chart's coarse texels, and which (t,) are known.

    Each is the mean of what pictures show of its own kind (h, w) within it.
    """
    coarser = float(scene.placement.texels_per_metre[chart]) / density
    starts = [np.floor(np.arange(count) * coarser).astype(np.int64) for count in kind.shape]
    within = [
        np.searchsorted(at, np.arange(size), "right") - 1 for at, size in zip(starts, is_shown.shape, strict=True)
    ]
    is_own = materials.ground_kinds(chart, 0) == kind[np.ix_(*within)]

    def total(values: Int64Array) -> Int64Array:
        return np.add.reduceat(np.add.reduceat(values, starts[0], axis=0), starts[1], axis=1)

    count = total((is_shown & is_own).astype(np.int64))
    known = (count > 0) & (count >= settings.min_shown_share * total(is_own.astype(np.int64)))
    mean = total(np.where((is_shown & is_own)[..., None], rgb, 0).astype(np.int64))[known] / count[known][:, None]
    row, column = np.nonzero(known)
    points = scene.charts.points(chart, (column + 0.5) / density, (row + 0.5) / density)
    plain = materials.colour(np.full(len(points), chart), points, np.full(len(points), 1 / density))
    difference = np.full((*kind.shape, 3), NO_DIFFERENCE, np.uint8)
    difference[known] = np.clip(np.rint(mean - plain) + NO_DIFFERENCE, 1, 255)
    return difference.reshape(-1, 3), known.reshape(-1)


def _continue_view(
    scene: Scene,
    buffer: TexelBuffer,
    viewpoint: Viewpoint,
    settings: ContinuationSettings,
) -> StreetView | None:
    """Complete the partially textured panorama of differences of a viewpoint; None where it shows no difference."""
    from scipy.ndimage import map_coordinates

    size = (settings.panorama_width // 2, settings.panorama_width)
    panorama = render_panorama(scene, buffer, viewpoint, size, shaded=False)
    offset = buffer.layout.offset
    on = (panorama.chart != MISS) & (offset[panorama.chart] >= 0)
    chart, points = panorama.chart[on], panorama.points[on]
    row, column = scene.locate_texels(points, chart)
    texel = offset[chart] + row.astype(np.int64) * scene.placement.width[chart] + column
    source = np.where(panorama.textured[on], buffer.provenance[texel], Provenance.UNSEEN)
    if not (source > Provenance.UNSEEN).any():
        return None
    is_shown = source == Provenance.PHOTO
    cell = max(settings.cell_m, 2 * scene.visibility_range / settings.max_cells_across)
    side = 2 * int(np.ceil(scene.visibility_range / cell))
    place = (points[:, :2] - viewpoint.position[:2]) / cell + side / 2
    kind = buffer.kinds[texel].astype(np.int64)
    means = _cell_means(panorama.rgb[on], source, kind, place, side)
    filled = np.empty_like(means)
    _fill_cells(means, (settings.smoothing_m / cell) ** 2, settings.prior_cells, filled)
    at = np.stack([kind, place[:, 1] - 0.5, place[:, 0] - 0.5])
    values = np.stack([map_coordinates(filled[..., band], at, order=1, mode="nearest") for band in range(3)], axis=1)
    difference = np.full((*panorama.chart.shape, 3), NO_DIFFERENCE, np.uint8)
    difference[on] = np.where(is_shown[:, None], panorama.rgb[on], np.rint(values) + NO_DIFFERENCE).astype(np.uint8)
    ground, ground_kind = np.full(on.shape, MISS, np.int32), np.zeros(on.shape, np.uint8)
    ground[on], ground_kind[on] = chart, kind
    return StreetView(viewpoint, difference, ground, ground_kind)


def _cell_means(
    difference: UInt8Array, source: UInt8Array, kind: Int64Array, place: Float64Array, side: int
) -> Float64Array:
    """Average the known differences of each kind in each cell, (kinds, side, side, 3); NaN in cells without any.

    Known is what pictures show; where the panorama shows none, what earlier views decided.
    """
    is_shown = source == Provenance.PHOTO
    is_known = is_shown if is_shown.any() else source > Provenance.UNSEEN
    kinds = int(kind.max()) + 1
    cell = np.clip(place[is_known].astype(np.int64), 0, side - 1)
    index = (kind[is_known] * side + cell[:, 1]) * side + cell[:, 0]
    count = np.bincount(index, minlength=kinds * side * side)
    bands = difference[is_known].T - float(NO_DIFFERENCE)
    total = np.stack([np.bincount(index, band, minlength=len(count)) for band in bands], axis=1)
    means = np.full(total.shape, np.nan)
    np.divide(total, count[:, None], out=means, where=count[:, None] > 0)
    return means.reshape(kinds, side, side, 3)


@njit(cache=True)
def _fill_cells(means: Float64Array, smoothing: float, prior_cells: float, filled: Float64Array) -> None:
    """Fill every cell of each kind from its known cells and from the mean of all, in place."""
    kinds, side = means.shape[0], means.shape[1]
    weight = np.empty((side, side))
    for down in range(side):
        for right in range(side):
            squared = 1.0 + (down * down + right * right) / smoothing
            weight[down, right] = 1.0 / (squared * np.sqrt(squared))
    prior, total = np.zeros(3), prior_cells
    for kind in range(kinds):
        for row in range(side):
            for column in range(side):
                if not np.isnan(means[kind, row, column, 0]):
                    total += 1.0
                    for band in range(3):
                        prior[band] += means[kind, row, column, band]
    prior /= total
    for kind in range(kinds):
        rows, columns = np.nonzero(~np.isnan(means[kind, :, :, 0]))
        for row in range(side):
            for column in range(side):
                total = prior_cells
                red, green, blue = total * prior[0], total * prior[1], total * prior[2]
                for k in range(len(rows)):
                    share = weight[abs(rows[k] - row), abs(columns[k] - column)]
                    total += share
                    red += share * means[kind, rows[k], columns[k], 0]
                    green += share * means[kind, rows[k], columns[k], 1]
                    blue += share * means[kind, rows[k], columns[k], 2]
                filled[kind, row, column, 0] = red / total
                filled[kind, row, column, 1] = green / total
                filled[kind, row, column, 2] = blue / total
