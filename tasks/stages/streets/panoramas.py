"""Panoramas where a material field decides the colours: no street reads them, so that few are stored."""

from __future__ import annotations

from facade_core.atlas.rasters import read_rasters
from facade_core.core.arrays import IntArray, UInt8Array
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.streets import Viewpoint
from facade_core.plan.plan import Plan
from facade_core.street.lighting.sky import add_sky
from facade_core.street.materials.field import MaterialField
from facade_core.street.propagation.render import render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.translator.translators import paint_bare_pixels


def is_panorama_in_report(plan: Plan, viewpoint: Viewpoint) -> bool:
    """Report whether the report may show a viewpoint's panorama: the middle one of each street."""
    own = plan.street_viewpoints(viewpoint.street)
    return viewpoint.id == own[len(own) // 2].id


def render_field_panorama(
    plan: Plan, buffer: TexelBuffer, materials: MaterialField, viewpoint: Viewpoint, width: int
) -> UInt8Array:
    """Render a viewpoint over the base layer, and paint all else with its material.

    Parameters
    ----------
    plan : plan of the run.
    buffer : base layer of the charts in view, at least.
    materials : material field of the block.
    viewpoint : position and direction of the panorama.
    width : pixels; the height is half of it.

    Returns
    -------
    (h, w, 3) uint8.
    """
    panorama = render_panorama(plan.scene, buffer, viewpoint, (width // 2, width))
    return add_sky(paint_bare_pixels(panorama, materials, plan.scene.charts.normals()), panorama.depth)


def read_base_layer(plan: Plan, group: StoreGroup, charts: IntArray) -> TexelBuffer:
    """Read the base layer of some charts (k,) into a buffer without any view."""
    scene = plan.scene
    layout, writable = TexelBuffer.plan_layout(scene.placement, charts[plan.writable[charts]], charts)
    colour, provenance = (
        read_rasters(group[f"atlas/{name}"], scene.placement, layout) for name in ("seed", "seed_evidence")
    )
    return TexelBuffer.allocate(
        scene.placement, layout, writable, colour, provenance, visibility_range=scene.visibility_range
    )
