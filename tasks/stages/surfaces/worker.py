"""Worker of `surfaces`: resolve colour and provenance of charts, fill unseen texels, level seams."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import compress
from typing import NamedTuple

import numpy as np

from catalogs.readers.pictures.aerial import Orthophoto
from catalogs.readers.pictures.materials import MaterialPicture, RoofPicture
from facade_core.atlas.rasters import TexelLayout, chart_digests, describe_completeness, write_rasters
from facade_core.atlas.surroundings import ChartReader
from facade_core.core.arrays import AnyArray, UInt8Array, UInt16Array
from facade_core.core.provenance import Provenance
from facade_core.core.types import Sun
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.wall_material import measure_wall_material
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.plan.plan import Plan
from facade_core.street.continuation import StreetView, blend_street_views
from facade_core.street.lighting.light import SceneLight
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import ChartLight, FinishSettings, KnownTexture, finish_chart
from tasks.engine.atlas import Atlas
from tasks.engine.context import current_store, load_run_plan
from tasks.engine.inputs import (
    GEOMETRY_CHANGED,
    INPUTS_PENDING,
    SETTINGS_CHANGED,
    SURROUNDINGS_CHANGED,
    VIEW_CHANGED,
    input_field,
)
from tasks.engine.run import Run
from tasks.stages.shared.materials import cached_material_field
from tasks.stages.shared.scene_view import SceneView, StoredCharts
from tasks.stages.shared.street_views import StoredView

# Views of streets that a worker keeps between units: pieces of ground beside each other share most.
MAX_CACHED_VIEWS = 128


@dataclass(frozen=True)
class SurfaceInputs:
    """Inputs of the charts of a building or piece of ground.

    Attributes
    ----------
    view : its charts, and those beside them to which they are levelled.
    ground : streets and mapped ground near its charts, which decide their materials and markings.
    around : what may shade the charts.
    seeds : base layer of these charts: of walls and roofs from panoramas, facades and textures; with labels of its own facades.
    pictured : whether each of them shows camera pictures of a wall or roof.
    pictured_ground : ground that panoramas show, after which other ground looks; none for charts of buildings.
    views : what viewpoints of streets decided that see the charts, in the order of streets.
    aerial : picture of ground from above.
    roof_material, materials : own pictures of materials.
    light : whether generated colours are lit.
    sun : position of the sun.
    levelling : whether seams are levelled.
    seed : seed of the block.
    """

    view: SceneView = input_field(GEOMETRY_CHANGED)
    ground: SceneView = input_field("streets changed")
    around: SceneView = input_field(SURROUNDINGS_CHANGED)
    seeds: StoredCharts = input_field(INPUTS_PENDING)
    pictured: tuple[bool, ...] = input_field(INPUTS_PENDING)
    pictured_ground: StoredCharts = input_field(INPUTS_PENDING)
    views: tuple[StoredView, ...] = input_field(VIEW_CHANGED)
    aerial: Orthophoto | None = input_field("orthophoto changed")
    roof_material: RoofPicture | None = input_field(SETTINGS_CHANGED)
    materials: tuple[MaterialPicture, ...] = input_field(SETTINGS_CHANGED)
    light: bool = input_field(SETTINGS_CHANGED)
    sun: Sun | None = input_field(SETTINGS_CHANGED)
    levelling: bool = input_field(SETTINGS_CHANGED)
    seed: int = input_field(SETTINGS_CHANGED)


class FinishedSurfaces(NamedTuple):
    """Colour (t, 3) uint8, provenance (t,) uint8 and street views (t,) uint16 of some charts' texels, and seconds by step."""

    rasters: TexelLayout
    colour: UInt8Array
    provenance: UInt8Array
    street_views: UInt16Array
    seconds: dict[str, float]


@lru_cache(maxsize=MAX_CACHED_VIEWS)
def _read_view(run: Run, view: StoredView) -> StreetView:
    return view.read(current_store(), load_run_plan(run))


def compute_surface(inputs: SurfaceInputs) -> FinishedSurfaces:
    """Resolve colour and provenance of the charts of one building or piece of ground."""
    start = time.time()
    charts, scene = inputs.view.charts, inputs.around.scene
    group, plan = inputs.seeds.store, inputs.view.plan
    field = cached_material_field(
        inputs.ground.run, inputs.seed, inputs.roof_material, inputs.materials, inputs.pictured_ground
    ).without_light()
    prepared = time.time()
    light = SceneLight(scene, field.reflectance, inputs.sun) if inputs.light else None
    seeded = inputs.seeds.charts_with_texels
    pictured = frozenset(compress(inputs.seeds.charts, inputs.pictured))
    known = KnownTexture(_make_reader(group, scene.placement, seeded), seeded, pictured)
    field = _add_wall_material(group, plan, field, charts, seeded)
    views = [_read_view(inputs.view.run, one).with_viewpoint_id(number) for number, one in enumerate(inputs.views)]
    rasters = TexelLayout.of_charts(scene.placement, charts)
    colour, provenance = np.empty((rasters.total, 3), np.uint8), np.empty(rasters.total, np.uint8)
    street_views = np.zeros(rasters.total, np.uint16)
    for chart in charts:
        differences = blend_street_views(scene, field, chart, views) if views else None
        rgb, rank = finish_chart(
            scene,
            field,
            chart,
            known,
            FinishSettings(
                levelling=inputs.levelling,
                aerial=None if inputs.aerial is None else inputs.aerial.sample,
                differences=differences,
            ),
            None
            if light is None
            else ChartLight(light, _facade_labels(group, plan, chart) if chart in seeded else None),
        )
        texels = rasters.texel_slice(scene.placement, chart)
        colour[texels], provenance[texels] = rgb.reshape(-1, 3), rank.reshape(-1)
        if differences is not None:
            street_views[texels] = np.where(rank == Provenance.TRANSLATED, differences.views, 0).reshape(-1)
    seconds = {"prepare": prepared - start, "paint": time.time() - prepared}
    return FinishedSurfaces(rasters, colour, provenance, street_views, seconds)


def write_surface(atlas: Atlas, _unit: object, result: FinishedSurfaces) -> dict[str, object]:
    """Write colour and provenance of some charts; returns the fields of their record."""
    scene = atlas.plan.scene
    arrays: dict[str, AnyArray] = {
        "colour": result.colour,
        "provenance": result.provenance,
        "street_views": result.street_views,
    }
    for name, flat in arrays.items():
        write_rasters(atlas.group[f"atlas/{name}"], scene.spec, scene.placement, result.rasters, flat)
    digests = chart_digests(result.colour, result.provenance, scene.placement, result.rasters, atlas.plan.ids)
    fields = {"digests": digests, "texels": result.rasters.total, "seconds": result.seconds}
    return fields | describe_completeness([result.provenance])


def _add_wall_material(
    group: StoreGroup, plan: Plan, field: MaterialField, charts: Sequence[int], seeded: Collection[int]
) -> MaterialField:
    """Return the material field with the wall of the building's largest facade."""
    placement = plan.scene.placement
    facades = [chart for chart in charts if chart in seeded and plan.is_facade(chart)]
    if not facades:
        return field
    chart = max(facades, key=lambda one: (math.prod(placement.shape(one)), -one))
    part = placement.region(chart)
    image, labels = np.asarray(group["atlas/seed"][part]), np.asarray(group["facade_maps/labels"][part])
    wall = measure_wall_material(image, labels, float(placement.texels_per_metre[chart]))
    return field if wall is None else field.with_facade_material(charts, wall, chart)


def _facade_labels(group: StoreGroup, plan: Plan, chart: int) -> UInt8Array | None:
    """Return the labels (h, w) uint8 of a facade; None of other charts."""
    return (
        np.asarray(group["facade_maps/labels"][plan.scene.placement.region(chart)]) if plan.is_facade(chart) else None
    )


def _make_reader(group: StoreGroup, placement: ChartPlacements, seeded: Collection[int]) -> ChartReader:
    """Return a reader of the base layer; charts without it read as empty."""
    array = cache(group.__getitem__)  # opening an array takes as long as reading a chunk

    def read(chart: int, rows: slice, columns: slice) -> tuple[UInt8Array, UInt8Array]:
        y, x = int(placement.y[chart]), int(placement.x[chart])
        part = (
            int(placement.page[chart]),
            slice(y + rows.start, y + rows.stop),
            slice(x + columns.start, x + columns.stop),
        )
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        if chart not in seeded:
            return np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
        colour, provenance = np.asarray(array("atlas/seed")[part]), np.asarray(array("atlas/seed_evidence")[part])
        return np.where(provenance[..., None] > Provenance.UNSEEN, colour, np.uint8(0)), provenance

    return read
