"""Worker of `pictures`: draw a view of the block, or the pictures of facades."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from io import BytesIO
from itertools import chain
from typing import NamedTuple, TypeVar, cast

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record, read_journal, read_records
from facade_core.atlas.store import open_root
from facade_core.atlas.stored_files import (
    digest_stored_file,
    page_picture_path,
    picture_path,
    read_stored_file,
    read_verified_array,
    tile_paths,
    write_stored_file,
)
from facade_core.core.arrays import Int32Array, IntArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import cast_smooth_view, encode_image
from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.export.pictures.stage_pictures import TEXTURE_STAGE, StoredFacade, iterate_stage_pictures
from facade_core.export.pictures.surroundings import SurroundingView
from facade_core.export.pictures.views import paint_view
from facade_core.export.tiles.block_tiles import plan_block_tiles
from facade_core.export.tiles.tile_model import coarse_rasters
from facade_core.plan.plan import Plan
from tasks.engine.atlas import Atlas
from tasks.engine.context import load_run_plan, reading_store
from tasks.engine.inputs import GEOMETRY_CHANGED, INPUTS_PENDING, SETTINGS_CHANGED, input_field
from tasks.engine.outcome import failure_record, is_machine_fault, is_store_fault
from tasks.engine.processing import process_unit
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.pages.record import PageRecord
from tasks.stages.pictures.record import ReportPictureRecord
from tasks.stages.shared.scene_view import SceneView, StoredCharts
from tasks.stages.tiles.record import TileRecord

R = TypeVar("R", bound=Record)

# Largest number of pages decoded for a view. A view of more pages is so distant that coarse rasters suffice.
MAX_DECODED_PAGES = 32
# What a view shows of the context of a part of a city.
CONTEXT_GREY = np.full((1, 1, 3), 176, np.uint8)


@dataclass(frozen=True)
class PictureInputs:
    """Inputs of a view of the block, or of the pictures of a facade.

    Attributes
    ----------
    camera : camera of a view; None of a facade.
    objects : shapes that a view shows.
    charts : charts that a view shows, with their texels and the codes that made the pages and tiles of these.
    made : key, status and digests of a facade.
    is_staged : whether all stages of a facade are drawn, or its texture alone.
    around : digest of the surroundings that a view shows.
    file : name of the file.
    facade : index of the facade.
    """

    camera: PerspectiveCamera | None = input_field(SETTINGS_CHANGED)
    objects: SceneView = input_field(GEOMETRY_CHANGED)
    charts: StoredCharts = input_field(INPUTS_PENDING)
    made: tuple[object, ...] = input_field(INPUTS_PENDING)
    is_staged: bool = input_field(SETTINGS_CHANGED)
    around: str = input_field(GEOMETRY_CHANGED)
    file: str = field(default="")
    facade: int = field(default=-1)


class ReportPictures(NamedTuple):
    """A file of pictures; name, title, offset and length of each picture in it, of a facade."""

    data: bytes
    listed: list[list[object]] | None = None


def process_pictures(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write a view, or the pictures of some facades, through the fork: one file per unit.

    A picture that cannot be drawn, also from an unreadable store, is recorded as failed: the block is published without it.
    """
    atlas = Atlas(run, open_root(fork))
    records: dict[int, Record] = {}
    for unit in units:
        try:
            with reading_store(atlas.group):
                records[unit.index] = process_unit(compute_pictures, write_pictures, atlas, unit)
        except Exception as error:
            if is_machine_fault(error) and not is_store_fault(error):
                raise
            about = cast(ReportPictureRecord, failure_record(unit.name, unit.key, error))
            about["unread"] = is_store_fault(error)
            records[unit.index] = about
    return fork, records


def compute_pictures(inputs: PictureInputs) -> ReportPictures:
    """Draw a view of the block, or the pictures of a facade."""
    camera = inputs.camera
    return _draw_facade(inputs) if camera is None else _draw_view(inputs, camera)


def _draw_view(inputs: PictureInputs, camera: PerspectiveCamera) -> ReportPictures:
    """Draw a view as JPEG from the pages that it shows, or from coarse rasters of tiles if these are too many."""
    plan, group = inputs.objects.plan, inputs.charts.store
    around = _surrounding_view(inputs.objects.run, inputs.around)
    picture = cast_smooth_view(plan.scene, camera, samples=BLOCK_VIEWS.samples_per_pixel_side, around=around)
    own = plan.in_core[picture.visible_charts]
    pages = np.unique(plan.scene.placement.page[picture.visible_charts[own]])
    parts = _read_page_rasters if len(pages) <= MAX_DECODED_PAGES else _read_coarse_rasters
    bare = {chart: CONTEXT_GREY for chart in picture.visible_charts[~own].tolist()}
    painted = paint_view(picture, chain([bare], parts(plan, group, picture.visible_charts[own])))
    return ReportPictures(encode_image(painted, "JPEG", quality=90))


@lru_cache(maxsize=1)
def _surrounding_view(run: Run, _digest: str) -> SurroundingView:
    plan = load_run_plan(run)
    return SurroundingView(plan.objects, plan.surroundings)


def _draw_facade(inputs: PictureInputs) -> ReportPictures:
    """Draw the stages of a facade, or its texture alone, as consecutive WebP files; nothing if it has none."""
    plan, group, facade = inputs.charts.plan, inputs.charts.store, inputs.facade
    (record,) = read_records(group, "facades", np.array([facade]), FacadeRecord)
    made = record if inputs.made else None
    stored = StoredFacade(group, plan.scene.placement, int(plan.facades.chart[facade]), made, exemplars={})
    joined, listed = BytesIO(), []
    for stage in iterate_stage_pictures(stored):
        if stage.report is None or not (inputs.is_staged or stage.report.name == TEXTURE_STAGE):
            continue
        data = encode_image(stage.draw(), "WEBP", quality=82, method=2)
        listed.append([stage.report.name, stage.report.title, joined.tell(), len(data)])
        joined.write(data)
    return ReportPictures(joined.getvalue(), listed)


def write_pictures(atlas: Atlas, unit: Unit[PictureInputs], result: ReportPictures) -> dict[str, object]:
    """Write the file of a unit; a facade without pictures has none. Returns the fields of its record."""
    name, data = unit.inputs.file, result.data
    told: dict[str, object] = {} if result.listed is None else {"pictures": result.listed}
    path = picture_path(name)
    if data:
        write_stored_file(atlas.group, path, data, f"picture of {unit.name}")
        digest = digest_stored_file(data)
        return told | {"file": name, "bytes": len(data), "digest": digest, "files": {path: digest}}
    if path in atlas.group:
        del atlas.group[path]
    return told


def _read_page_rasters(plan: Plan, group: StoreGroup, charts: Int32Array) -> Iterator[dict[int, UInt8Array]]:
    """Iterate over the rasters (h, w, 3) of some charts (k,) from encoded pages, by chart, a page at a time."""
    from PIL import Image

    place = plan.scene.placement
    pages = np.unique(place.page[charts])
    for page, record in zip(pages.tolist(), read_records(group, "pages", pages, PageRecord), strict=True):
        data = read_stored_file(group, page_picture_path(page), _require_done(record, f"page {page:04}")["digest"])
        with Image.open(BytesIO(data)) as image:
            colour = np.asarray(image.convert("RGB"))
        yield {
            c: colour[place.y[c] : place.y[c] + place.height[c], place.x[c] : place.x[c] + place.width[c]]
            for c in charts[place.page[charts] == page].tolist()
        }


def _read_coarse_rasters(plan: Plan, group: StoreGroup, charts: IntArray) -> Iterator[dict[int, UInt8Array]]:
    """Iterate over the coarse rasters of the tiles of some charts (k,), by chart, a tile at a time."""
    place = plan.scene.placement
    texels = np.column_stack([place.width, place.height]).astype(np.int64)
    for tile, record in zip(plan_block_tiles(plan), read_journal(group, "tiles", TileRecord), strict=True):
        if np.isin(tile.charts, charts).any():
            digest = _require_done(record, f"tile {tile.path}")["coarse"]
            yield coarse_rasters(texels, tile.charts, read_verified_array(group, tile_paths(tile.path)[1], digest))


def _require_done(record: R | None, what: str) -> R:
    if record is None or record["status"] != "done":
        raise ImageError(f"{what} failed")
    return record
