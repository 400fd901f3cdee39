"""Worker of `tiles`: encode the model of a tile, and coarse rasters for distant views."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from facade_core.atlas.journal import read_records
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.stored_files import (
    digest_stored_file,
    read_stored_file,
    read_verified_array,
    tile_paths,
    write_stored_file,
)
from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.errors import StoreError
from facade_core.core.types import Element
from facade_core.core.zarr_types import COMPRESSORS, StoreGroup
from facade_core.export.bodies.textured_relief import add_relief
from facade_core.export.models.textured_mesh import TexturedMesh, build_textured_mesh
from facade_core.export.tiles.tile_model import EarlierTile, TileModel, build_tile_model
from tasks.engine.atlas import Atlas
from tasks.engine.context import load_run_plan
from tasks.engine.inputs import GEOMETRY_CHANGED, INPUTS_PENDING, SETTINGS_CHANGED, input_field
from tasks.engine.run import Run
from tasks.engine.unit import Unit
from tasks.stages.shared.scene_view import SceneView, StoredCharts
from tasks.stages.tiles.record import TileRecord


@dataclass(frozen=True)
class TileInputs:
    """Inputs of a tile.

    Attributes
    ----------
    names : names of its buildings.
    objects : shapes of its buildings and ground.
    charts : its charts with their texels.
    origin : origin of its model in the world.
    crs : frame of the block.
    elements : elements that are built in depth, metres, y down, by the chart's place in `charts`; none of flat walls.
    buildings : indices of its buildings, in the order of the names.
    layout : digest of the layout of its pictures, by which pictures of an earlier tile are taken over.
    path : its path in the quadtree.
    index : its index in the journal.
    """

    objects: SceneView = input_field(GEOMETRY_CHANGED)
    charts: StoredCharts = input_field(INPUTS_PENDING)
    names: tuple[str, ...] = input_field(GEOMETRY_CHANGED)
    origin: tuple[float, ...] = input_field(SETTINGS_CHANGED)
    crs: str = input_field(SETTINGS_CHANGED)
    elements: tuple[tuple[int, tuple[Element, ...]], ...] = input_field("elements of facades or texture.relief changed")
    buildings: tuple[int, ...] = field(default=())
    layout: str = field(default="")
    path: str = field(default="")
    index: int = field(default=0)


def compute_tile(inputs: TileInputs) -> TileModel:
    """Encode the model of a tile, and its coarse rasters."""
    scene, group, texels = inputs.objects.scene, inputs.charts.store, inputs.charts
    placement, colour = scene.placement, group["atlas/colour"]  # opening an array takes as long as reading a chunk

    def rasters(chosen: Int64Array) -> dict[int, UInt8Array]:
        held = TexelLayout.of_charts(placement, chosen)
        flat = read_rasters(colour, placement, held)
        return {
            chart: flat[held.texel_slice(placement, chart)].reshape(*placement.shape(chart), 3)
            for chart in chosen.tolist()
        }

    layouts = {texels.charts[place]: own for place, own in inputs.elements}
    return build_tile_model(
        add_relief(_textured_scene(inputs.objects.run), layouts, lambda chart: rasters(np.array([chart]))[chart]),
        np.array(texels.charts),
        texels.texel_digests,
        dict(zip(inputs.buildings, inputs.names, strict=True)),
        rasters,
        {"origin": list(inputs.origin), "crs": inputs.crs},
        _earlier_tile(group, inputs),
    )


def write_tile(atlas: Atlas, unit: Unit[TileInputs], tile: TileModel) -> dict[str, object]:
    """Write the model of a tile and its coarse rasters; returns the fields of its record."""
    model, coarse = tile_paths(unit.name)
    write_stored_file(atlas.group, model, tile.glb, f"tile {unit.name}, GLB")
    atlas.group.create_array(
        coarse,
        data=tile.coarse,
        chunks=tile.coarse.shape,
        compressors=COMPRESSORS,
        dimension_names=(f"texel_of_{unit.name}", "band"),
        attributes={"long_name": f"charts of tile {unit.name} made smaller, one after the other"},
        overwrite=True,
    )
    digests = digest_stored_file(tile.glb), digest_stored_file(tile.coarse.tobytes())
    return {
        "charts": len(unit.inputs.charts.charts),
        "shape": unit.inputs.layout,
        "made_of": list(tile.picture_digests),
        "bytes": len(tile.glb),
        "digest": digests[0],
        "box": tile.box.round(3).tolist(),
        "coarse": digests[1],
        "files": {model: digests[0], coarse: digests[1]},
    }


def _earlier_tile(group: StoreGroup, inputs: TileInputs) -> EarlierTile | None:
    """Return the stored tile if its pictures have the same layout and it is complete."""
    (record,) = read_records(group, "tiles", np.array([inputs.index]), TileRecord)
    if record is None or record["status"] != "done" or record.get("shape") != inputs.layout:
        return None
    model, path = tile_paths(inputs.path)
    try:
        glb = read_stored_file(group, model, record["digest"])
        coarse = read_verified_array(group, path, record["coarse"])
    except StoreError:
        return None
    return EarlierTile(glb, coarse, tuple(record["made_of"]))


@lru_cache(maxsize=1)
def _textured_scene(run: Run) -> TexturedMesh:
    """Return the textured scene of the block, without pages."""

    def nothing(page: int) -> UInt8Array:
        raise StoreError(f"page {page} is not read as a whole")

    return build_textured_mesh(load_run_plan(run).scene, nothing)
