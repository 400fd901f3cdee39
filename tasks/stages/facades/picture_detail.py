"""Detail of posed pictures on a facade that is finer than the raster in which it is parsed and completed."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.facade.facade import Facade
from facade_core.facade.sharpening import enlarge_classes, enlarge_image, picture_detail, sharpen_facade
from facade_core.geometry.charts import raster_sizes
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.plan.plan import Plan
from tasks.stages.facades.evidence import FacadeEvidence, read_sharp_panorama


def working_size(plan: Plan, chart: int, source: str) -> tuple[int, int]:
    """Return the height and width of the raster in which a facade is parsed and completed from a source.

    That of panoramas has the density by the streets: what is hidden, and how it is completed, does not depend on how sharp
    the pictures are.
    """
    placement = plan.scene.placement
    if source == "panoramas" and plan.street_density[chart] != placement.texels_per_metre[chart]:
        width, height = raster_sizes(plan.scene.charts.size[[chart]], plan.street_density[[chart]])[0].tolist()
        return height, width
    return int(placement.height[chart]), int(placement.width[chart])


def sharpen_from_pictures(
    plan: Plan, chart: int, facade: Facade, evidence: FacadeEvidence
) -> tuple[Facade, UInt8Array]:
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
    size = (int(placement.height[chart]), int(placement.width[chart]))
    confidence = np.rint(255 * evidence.confidence).astype(np.uint8)
    if size != coarse and evidence.picture is not None:
        scale = float(placement.texels_per_metre[chart] / plan.street_density[chart])
        source = enlarge_classes(evidence.picture + 1, size, scale)
        detail = np.ones((*size, 3), np.float32)
        for number, (path, pose) in enumerate(evidence.pictures, 1):
            own = source == number
            if own.any():
                view = rectify_chart_from_panorama(plan.scene, chart, read_sharp_panorama(path, pose), pose, size)
                detail[own] = picture_detail(view.rgb, view.seen, coarse)[own]
        facade, confidence = sharpen_facade(facade, detail, scale), enlarge_image(confidence, size, scale)
    return facade, np.where(facade.occluded, 0, confidence).astype(np.uint8)
