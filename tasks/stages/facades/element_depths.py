"""Depths of the elements of a facade that several panoramas show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from facade_core.core.arrays import AnyArray
from facade_core.core.types import Element
from facade_core.export.bodies.settings import BALCONY_SHAPES
from facade_core.facade.evidence import Evidence
from facade_core.facade.facade import Facade, time_stage
from facade_core.imagery.rectify.element_parallax import GreyView, measure_element_depths
from facade_core.imagery.rectify.pictured_plane import camera_in_chart_frame
from facade_core.plan.plan import Plan


def measure_depths(plan: Plan, chart: int, facade: Facade, evidence: Evidence) -> Facade:
    """Return a facade whose elements have the depths that its panoramas measure.

    Parameters
    ----------
    facade : facade at the size of its chart.
    evidence : its pictures.
    """
    if len(evidence.grey) < 2 or evidence.picture is None or not facade.elements:
        return facade
    seconds = dict(facade.seconds)
    with time_stage(seconds, "depths"):
        density = float(plan.scene.placement.texels_per_metre[chart])
        metres = [
            replace(e, x0=e.x0 / density, y0=e.y0 / density, x1=e.x1 / density, y1=e.y1 / density)
            for e in facade.elements
        ]
        views = [
            GreyView(grey, camera_in_chart_frame(plan.scene, chart, pose))
            for grey, (_, pose) in zip(evidence.grey, evidence.pictures, strict=False)
        ]
        height_m = len(facade.labels) / density
        source = np.array([_shown_by(evidence.picture, len(evidence.picture) / height_m, e) for e in metres])
        measured = measure_element_depths(metres, views, source, len(views[0].grey) / height_m)
    elements = list(facade.elements)
    for one in measured:
        for k in one.members if one.is_reliable else ():
            elements[k] = replace(
                elements[k], depth_m=_stored_depth(elements[k].label, one.outward_m), depth_source="parallax"
            )
    return replace(facade, elements=tuple(elements), seconds=seconds)


def _stored_depth(label: str, outward_m: float) -> float:
    """Return a depth in whole centimetres; openings do not stand out, and a railing at the wall has none."""
    if label == "balcony":
        return round(outward_m, 2) if outward_m >= 2 * BALCONY_SHAPES.railing_thickness_m else 0.0
    return -round(max(-outward_m, 0.0), 2) + 0.0


def _shown_by(picture: AnyArray, density: float, element: Element) -> int:
    """Return the number of the panorama that most of an element is from; -1 if most is from none."""
    rows, columns = (
        slice(max(0, round(low * density)), max(0, round(high * density)))
        for low, high in ((element.y0, element.y1), (element.x0, element.x1))
    )
    part = picture[rows, columns]
    if not part.size:
        return -1
    return int(np.bincount(part.reshape(-1).astype(np.int64) + 1).argmax()) - 1
