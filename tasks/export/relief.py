"""Elements of facades as geometry in exported models."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import IntArray
from facade_core.core.types import Element
from facade_core.export.bodies.textured_relief import add_relief
from facade_core.export.models.textured_mesh import TexturedMesh
from tasks.publish.published_run import PublishedBlock
from tasks.stages.shared.chart_elements import elements_by_chart

# Values of --relief and of the block key `texture.relief`: elements as geometry, flat walls.
ELEMENTS = "elements"
OFF = "off"


def facade_elements(results: PublishedBlock, buildings: IntArray) -> dict[int, list[Element]]:
    """Read the elements of finished facades by chart, in metres."""
    elements = elements_by_chart(results.plan, results.records)
    is_chosen = np.isin(results.plan.scene.charts.building, buildings)
    return {chart: own for chart, own in elements.items() if is_chosen[chart]}


def is_relief_requested(results: PublishedBlock, relief: str | None) -> bool:
    """Return whether elements are geometry: by an option, ELEMENTS or OFF, or by the block key `texture.relief`."""
    return (results.group.attrs.get("relief", OFF) if relief is None else relief) == ELEMENTS


def add_requested_relief(
    results: PublishedBlock, source: TexturedMesh, buildings: IntArray, relief: str | None
) -> TexturedMesh:
    """Return the mesh of a block with the elements of some buildings in depth, if requested.

    Parameters
    ----------
    results : published results of a block.
    source : flat mesh.
    buildings : (n,) indices of buildings.
    relief : see `is_relief_requested`.
    """
    if not is_relief_requested(results, relief):
        return source
    # by the textures as published, so that lit and unlit models have the same geometry
    return add_relief(source, facade_elements(results, buildings), results.textured_mesh.raster)
