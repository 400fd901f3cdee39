"""Detail of pictures on a facade that is finer than the raster in which it is parsed and completed."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, UInt8Array
from facade_core.core.resizing import resize_image
from facade_core.facade.evidence import Evidence
from facade_core.facade.facade import Facade
from facade_core.facade.sharpening import enlarge_classes, enlarge_image, picture_detail, sharpen_facade
from facade_core.geometry.charts import raster_sizes
from facade_core.imagery.rectify.crop import FacadeCrop
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.plan.plan import Plan
from tasks.stages.facades.evidence import read_sharp_panorama


def working_size(plan: Plan, chart: int, source: str) -> tuple[int, int]:
    """Return the height and width of the raster in which a facade is parsed and completed from a source.

    That of photos and panoramas has the density by the streets: what is hidden, and how it is completed, does not depend on
    how sharp the pictures are.
    """
    placement = plan.scene.placement
    if source in ("photo", "panoramas") and plan.street_density[chart] != placement.texels_per_metre[chart]:
        width, height = raster_sizes(plan.scene.charts.size[[chart]], plan.street_density[[chart]])[0].tolist()
        return height, width
    return placement.shape(chart)


def sharpen_from_pictures(plan: Plan, chart: int, facade: Facade, evidence: Evidence) -> tuple[Facade, UInt8Array]:
    """Bring a facade and its confidence to the chart's raster, with the detail of the picture that each texel is from.

    Parameters
    ----------
    facade : facade at its `working_size`.
    evidence : its pictures.

    Returns
    -------
    facade : the facade at the size of its chart.
    confidence : (h, w) uint8.
    """
    placement, coarse = plan.scene.placement, (facade.labels.shape[0], facade.labels.shape[1])
    size = placement.shape(chart)
    confidence = np.rint(255 * (~evidence.hidden if evidence.confidence is None else evidence.confidence)).astype(
        np.uint8
    )
    if size != coarse and not (evidence.photo is None and evidence.picture is None):
        scale = float(placement.texels_per_metre[chart] / plan.street_density[chart])
        if evidence.photo is not None:
            detail = _photo_detail(evidence.photo, size, coarse, scale)
        else:
            detail = _panorama_detail(plan, chart, evidence, size, coarse, scale)
        facade, confidence = sharpen_facade(facade, detail, scale), enlarge_image(confidence, size, scale)
    return facade, np.where(facade.occluded, 0, confidence).astype(np.uint8)


def _photo_detail(photo: FacadeCrop, size: tuple[int, int], coarse: tuple[int, int], scale: float) -> Float32Array:
    """Compute the detail of a photo at a size (height, width), (h, w, 3) float32."""
    height, width = shape = (round(coarse[0] * scale), round(coarse[1] * scale))
    hidden = resize_image(photo.hidden.astype(np.uint8), shape) > 0
    detail = np.ones((*np.maximum(size, shape), 3), np.float32)
    fine, low = (resize_image(photo.image, of) for of in (shape, coarse))
    detail[:height, :width] = picture_detail(fine, ~hidden, low, scale)
    return detail[: size[0], : size[1]]


def _panorama_detail(
    plan: Plan, chart: int, evidence: Evidence, size: tuple[int, int], coarse: tuple[int, int], scale: float
) -> Float32Array:
    """Compute the detail of the panorama that each texel is from at a size (height, width), (h, w, 3) float32."""
    detail = np.ones((*size, 3), np.float32)
    if evidence.picture is None:
        return detail
    source = enlarge_classes(evidence.picture + 1, size, scale)
    for number, (path, pose) in enumerate(evidence.pictures, 1):
        own = source == number
        if own.any():
            image = read_sharp_panorama(path, pose)
            view = rectify_chart_from_panorama(plan.scene, chart, image, pose, size)
            extent = np.array(coarse[::-1]) / plan.street_density[chart]
            low = rectify_chart_from_panorama(plan.scene, chart, image, pose, coarse, extent=extent)
            detail[own] = picture_detail(view.rgb, view.seen, low.rgb, scale)[own]
    return detail
