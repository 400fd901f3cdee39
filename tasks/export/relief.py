"""Elements of facades as geometry in exported models."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from facade_core.core.arrays import IntArray
from facade_core.core.types import Element
from tasks.publish.published_run import PublishedBlock

if TYPE_CHECKING:
    from facade_core.export.models.textured_mesh import TexturedMesh

# Value of --relief for elements as geometry, and for flat walls.
ELEMENTS = "elements"
OFF = "off"


def facade_elements(results: PublishedBlock, buildings: IntArray) -> dict[int, list[Element]]:
    """Read the elements of finished facades by chart, in metres."""
    elements = {}
    for index in results.select_finished_facades(buildings):
        chart = int(results.plan.facades.chart[index])
        density = float(results.plan.scene.placement.texels_per_metre[chart])
        elements[chart] = [
            replace(e, **{side: getattr(e, side) / density for side in ("x0", "y0", "x1", "y1")})
            for e in results.elements(index)
        ]
    return elements


def add_requested_relief(
    results: PublishedBlock, source: TexturedMesh, buildings: IntArray, relief: str
) -> TexturedMesh:
    """Return the mesh of a block with the elements of some buildings in depth, if requested.

    Parameters
    ----------
    results : published results of a block.
    source : flat mesh.
    buildings : (n,) indices of buildings.
    relief : ELEMENTS or OFF.
    """
    from facade_core.export.bodies.textured_relief import add_relief

    return add_relief(source, facade_elements(results, buildings)) if relief == ELEMENTS else source
