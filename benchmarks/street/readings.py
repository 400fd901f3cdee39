"""Other readings of Eq. 1 than the one that textures streets (docs/decisions/0010), from what each view shows of the texels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.propagation.blend import MAX_WEIGHT, MIN_WEIGHT
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer


@dataclass(frozen=True)
class Reading:
    """Which reading of Eq. 1 blends the views.

    gated: a view is proper only within 1.5 viewpoint spacings along the street;
    clamp: "mapped", clamped weights are mapped from [0.3, 0.7] to [0, 1]; "sum", they are only divided by their sum; "none",
    the plain average;
    resolution: weights are also multiplied by the share of the texel's resolution that the view has, which falls with its
    range and its grazing angle.
    """

    gated: bool = True
    clamp: Literal["mapped", "sum", "none"] = "mapped"
    resolution: bool = False


class View(NamedTuple):
    """What one panorama shows of a window's texels.

    id: the viewpoint's;
    texel (k,): which it shows, ascending;
    distance (k,): d in mm;
    proper (k,): whether d is within the gate;
    rgb (k, 3) uint8: their colours;
    quality (k,): the share of the texel's resolution that it has, 1 to 255.
    """

    id: int
    texel: np.ndarray
    distance: np.ndarray
    proper: np.ndarray
    rgb: np.ndarray
    quality: np.ndarray


def view_of(scene: Scene, empty: TexelBuffer, viewpoint: Viewpoint, rgb: np.ndarray, *, seen: np.ndarray) -> View:
    """What a panorama shows of a window that has no view yet; it has this one afterwards."""
    propagate_panorama(scene, empty, viewpoint, rgb, charts_seen=seen)
    texel = np.flatnonzero(empty.provenance)
    state = empty.state
    share = _resolution(scene, empty, viewpoint, texel, rgb.shape[1])
    return View(
        viewpoint.id,
        texel,
        state.top_distance[texel, 0].astype(np.int64),
        state.views[texel] > 0,
        state.top_colour[texel, 0],
        np.maximum(1, (255 * np.minimum(1.0, share)).astype(np.int64)),
    )


def blended(views: Sequence[View], texels: int, reading: Reading) -> tuple[np.ndarray, np.ndarray]:
    """A reading of Eq. 1 of `texels` texels: colour (t, 3) uint8 and how many views made it (t,)."""
    views = sorted(views, key=lambda view: view.id)
    number, distance = np.zeros(texels, np.int64), np.zeros(texels, np.int64)
    for view, counted in _counted(views, reading):
        number[view.texel[counted]] += 1
        distance[view.texel[counted]] += view.distance[counted]
    total, colour = np.zeros(texels), np.zeros((texels, 3))
    for view, counted in _counted(views, reading):
        texel = view.texel[counted]
        weight = _weight(view.distance[counted], distance[texel], number[texel], reading)
        weight *= view.quality[counted] if reading.resolution else 1
        total[texel] += weight
        colour[texel] += weight[:, None] * view.rgb[counted]
    out = np.floor(colour / np.maximum(total, 1e-12)[:, None] + 0.5).astype(np.uint8)
    nearest = np.full(texels, np.iinfo(np.int64).max)
    for view, counted in _counted(views, reading):
        stands_in = ~counted & (number[view.texel] == 0) & (view.distance < nearest[view.texel])
        nearest[view.texel[stands_in]] = view.distance[stands_in]
        out[view.texel[stands_in]] = view.rgb[stands_in]
    return out, np.where(nearest < np.iinfo(np.int64).max, 1, number)


def _counted(views: Sequence[View], reading: Reading) -> Iterator[tuple[View, np.ndarray]]:
    for view in views:
        yield view, view.proper if reading.gated else np.ones(len(view.texel), bool)


def _weight(d: np.ndarray, whole: np.ndarray, number: np.ndarray, reading: Reading) -> np.ndarray:
    """Weights (k,) of views at d of texels whose views' distances add up to `whole`."""
    weight = np.clip(1 - d / np.maximum(whole, 1), MIN_WEIGHT, MAX_WEIGHT)
    if reading.clamp == "mapped":
        weight = (weight - MIN_WEIGHT) / (MAX_WEIGHT - MIN_WEIGHT)
    return np.where((whole == 0) | (number == 1) | (reading.clamp == "none"), 1.0, weight)


def _resolution(scene: Scene, window: TexelBuffer, viewpoint: Viewpoint, texel: np.ndarray, columns: int) -> np.ndarray:
    """The panorama's pixels per texel, (k,)."""
    share = np.empty(len(texel))
    for chart in window.writable.tolist():
        held = window.layout.texel_slice(scene.placement, chart)
        own = (texel >= held.start) & (texel < held.stop)
        row, column = np.divmod(texel[own] - held.start, int(scene.placement.width[chart]))
        step = 1 / scene.spec.texels_per_metre
        ray = scene.charts.points(chart, step * (column + 0.5), step * (row + 0.5)) - viewpoint.position
        facing = -ray @ scene.charts.normals()[chart]
        share[own] = columns * step * facing / (2 * np.pi * np.einsum("ij,ij->i", ray, ray))
    return share
