"""Style of a building's best pictured facade, for its walls without a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from facade_core.atlas.rasters import read_chart_raster
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.provenance import Provenance
from facade_core.core.resizing import resize_image
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.texture.retargeting import ExemplarAnalysis, analyse_exemplar
from facade_core.plan.plan import Plan
from tasks.stages.shared.images import MAX_EXEMPLAR_SIDE

# Share of a facade that its pictures must show, for others to be made in its style, and of its last row: the rest is a guess.
MIN_PICTURED_SHARE = 0.6
# Smallest side of a facade whose style is taken, in metres.
MIN_STYLE_SIDE_M = 4.0


class PicturedStyle(NamedTuple):
    """Style of a pictured facade.

    Attributes
    ----------
    style : the analysed facade.
    metres_per_pixel : its scale.
    source : names of the pictures that it is made from.
    """

    style: ExemplarAnalysis
    metres_per_pixel: float
    source: str


def select_pictured_style(
    group: StoreGroup, plan: Plan, source_name: Callable[[int], str], facades: Sequence[int]
) -> PicturedStyle | None:
    """Return the style of the facade of which pictures show most square metres; None if none shows enough.

    It has no hidden foot: repeated storeys there are no evidence.

    Parameters
    ----------
    group : root of the store.
    plan : its plan.
    source_name : returns the names of the pictures of a facade.
    facades : facades of a building that are written; some may have been made without their pictures.
    """
    placement, chart_of = plan.scene.placement, plan.facades.chart
    shown: list[tuple[float, int, int]] = []
    for facade in facades:
        size_m = plan.scene.charts.size[chart_of[facade]]
        evidence = read_chart_raster(group, placement, int(chart_of[facade]), "atlas/seed_evidence")
        by_row = (evidence == Provenance.PHOTO).mean(axis=1)
        pictured = float(by_row.mean())
        if pictured >= MIN_PICTURED_SHARE and min(size_m) >= MIN_STYLE_SIDE_M:
            end = int(np.flatnonzero(by_row >= MIN_PICTURED_SHARE)[-1]) + 1  # a foot below may be a guess
            shown.append((pictured * float(size_m.prod()), facade, end))
    for _, facade, end in sorted(shown, reverse=True):
        image, labels = (
            read_chart_raster(group, placement, int(chart_of[facade]), name)[:end]
            for name in ("atlas/seed", "facade_maps/labels")
        )
        density = float(placement.texels_per_metre[chart_of[facade]])
        share = min(1.0, MAX_EXEMPLAR_SIDE / max(labels.shape))
        try:
            return PicturedStyle(_analyse(image, labels, share), 1 / (density * share), source_name(facade))
        except ImageError:  # without windows it has no style
            continue
    return None


def _analyse(image: UInt8Array, labels: UInt8Array, share: float) -> ExemplarAnalysis:
    import cv2

    if share < 1:
        size = (round(labels.shape[0] * share), round(labels.shape[1] * share))
        image = resize_image(image, size)
        labels = np.asarray(cv2.resize(labels, size[::-1], interpolation=cv2.INTER_NEAREST), np.uint8)
    return analyse_exemplar(image, labels)
