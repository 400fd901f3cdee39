"""Worker of `surfaces`: resolve colour and provenance of charts, fill unseen texels, level seams."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from functools import cache, lru_cache

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record
from facade_core.atlas.rasters import TexelLayout, chart_digests, write_rasters
from facade_core.atlas.store import open_root
from facade_core.atlas.surroundings import ChartReader
from facade_core.core.arrays import UInt8Array
from facade_core.core.provenance import merge_atlas_layers
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.wall_material import measure_wall_material
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.plan.plan import Plan
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import ChartSunlight, FinishSettings, KnownTexture, TranslatedViews, finish_chart
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.run import Run
from tasks.engine.unit import UnitGroup
from tasks.stages.shared.materials import aerial_sampler, material_field
from tasks.stages.surfaces.record import SurfaceColourRecord


@lru_cache(maxsize=2)
def _run_material_field(run: Run) -> MaterialField:
    return material_field(load_run_plan(run), run.seed, run.roof_material, run.materials)


def process_surface(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write colour and provenance of the charts of one building or piece of ground through the fork.

    Unit arguments: its charts; charts with a base layer of facades or textures; charts with street texels; and charts of walls
    and roofs from panoramas, in the unit and beside it.
    """
    start = time.time()
    (unit,) = units
    charts, seeded, written, pictured = unit.arguments
    plan = load_run_plan(run)
    scene, group = plan.scene, open_root(fork)
    field = _run_material_field(run)
    prepared = time.time()
    scene.daylight.compute(np.array(charts))  # all at once: each call casts rays of its own
    known = KnownTexture(_make_reader(group, scene.placement, seeded, written), seeded, written, pictured)
    above = aerial_sampler(run)
    field, own = _add_wall_material(group, plan, field, charts, seeded)
    rasters = TexelLayout.of_charts(scene.placement, charts)
    colour, provenance = np.empty((rasters.total, 3), np.uint8), np.empty(rasters.total, np.uint8)
    for chart in charts:
        rgb, rank = finish_chart(
            scene,
            field,
            chart,
            known,
            FinishSettings(
                is_neural=run.texture.translator == "neural",
                views=_network_pixels(run, plan, chart),
                levelling=run.texture.levelling,
                aerial=above,
                repaint=chart in own,
            ),
            None
            if run.texture.sun is None
            else ChartSunlight(run.texture.sun, _facade_labels(group, plan, chart) if chart in seeded else None),
        )
        texels = rasters.texel_slice(scene.placement, chart)
        colour[texels], provenance[texels] = rgb.reshape(-1, 3), rank.reshape(-1)
    painted = time.time()
    for name, flat in {"colour": colour, "provenance": provenance}.items():
        write_rasters(group[f"atlas/{name}"], scene.spec, scene.placement, rasters, flat)
    digests = chart_digests(colour, provenance, scene.placement, rasters, plan.ids)
    seconds = {"prepare": prepared - start, "paint": painted - prepared, "write": time.time() - painted}
    record: SurfaceColourRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "digests": digests,
        "texels": rasters.total,
        "worker": current_worker_name(),
        "started": start,
        "seconds": {step: round(s, 4) for step, s in seconds.items()},
    }
    return fork, {unit.index: record}


def _add_wall_material(
    group: StoreGroup, plan: Plan, field: MaterialField, charts: Sequence[int], seeded: Collection[int]
) -> tuple[MaterialField, set[int]]:
    """Return the material field with the wall of the building's largest facade, and the charts that take it."""
    placement = plan.scene.placement
    facades = [chart for chart in charts if chart in seeded and plan.is_facade(chart)]
    if not facades:
        return field, set()
    chart = max(facades, key=lambda one: (int(placement.height[one]) * int(placement.width[one]), -one))
    part = _chart_slices(placement, chart)
    image, labels = np.asarray(group["atlas/seed"][part]), np.asarray(group["facade_maps/labels"][part])
    wall = measure_wall_material(image, labels, float(placement.texels_per_metre[chart]))
    if wall is None:
        return field, set()
    changed, own = field.with_facade_material(charts, wall, chart)
    return changed, set(own.tolist())


def _chart_slices(placement: ChartPlacements, chart: int) -> tuple[int, slice, slice]:
    """Return the place of a chart in the arrays of the atlas."""
    y, x = int(placement.y[chart]), int(placement.x[chart])
    height, width = int(placement.height[chart]), int(placement.width[chart])
    return int(placement.page[chart]), slice(y, y + height), slice(x, x + width)


def _facade_labels(group: StoreGroup, plan: Plan, chart: int) -> UInt8Array | None:
    """Return the labels (h, w) uint8 of a facade; None of other charts."""
    return (
        np.asarray(group["facade_maps/labels"][_chart_slices(plan.scene.placement, chart)])
        if plan.is_facade(chart)
        else None
    )


def _network_pixels(run: Run, plan: Plan, chart: int) -> TranslatedViews | None:
    """Return the network pixels that a chart was translated from; None of facades, as windows have no grain."""
    seen = plan.select_view_rows(np.array([chart]))[:, 0]
    if run.texture.translator != "neural" or plan.is_facade(chart) or not len(seen):
        return None
    return TranslatedViews(np.array([plan.viewpoints[v].position for v in seen.tolist()]), run.texture.panorama_width)


def _make_reader(
    group: StoreGroup, placement: ChartPlacements, seeded: Collection[int], written: Collection[int]
) -> ChartReader:
    """Return a reader of base layer and street texels; charts without either read as empty."""
    array = cache(group.__getitem__)  # opening an array takes as long as reading a chunk

    def read(chart: int, rows: slice, columns: slice) -> tuple[UInt8Array, UInt8Array]:
        y, x = int(placement.y[chart]), int(placement.x[chart])
        part = (
            int(placement.page[chart]),
            slice(y + rows.start, y + rows.stop),
            slice(x + columns.start, x + columns.stop),
        )
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        seed, evidence = np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
        street, views = seed, np.zeros(shape, np.uint16)
        if chart in seeded:
            seed, evidence = np.asarray(array("atlas/seed")[part]), np.asarray(array("atlas/seed_evidence")[part])
        if chart in written:
            street, views = np.asarray(array("atlas/street")[part]), np.asarray(array("atlas/street_views")[part])
        return merge_atlas_layers(seed, evidence, street, views)

    return read
