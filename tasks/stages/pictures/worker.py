"""Worker of `pictures`: draw a view of the block, or the pictures of facades."""

from __future__ import annotations

import time
from collections.abc import Iterator
from io import BytesIO
from itertools import chain
from typing import TypeVar, cast

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
from facade_core.export.pictures.settings import VIEW_SETTINGS
from facade_core.export.pictures.stage_pictures import TEXTURE_STAGE, StoredFacade, iterate_stage_pictures
from facade_core.export.pictures.views import paint_view
from facade_core.export.tiles.block_tiles import plan_block_tiles
from facade_core.export.tiles.tile_model import coarse_rasters
from facade_core.plan.plan import Plan
from tasks.engine.context import current_worker_name, load_run_plan
from tasks.engine.outcome import failure_record, is_machine_fault, is_store_fault
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.pages.record import PageRecord
from tasks.stages.pictures.record import ReportPictureRecord
from tasks.stages.tiles.record import TileRecord

R = TypeVar("R", bound=Record)

# Largest number of pages decoded for a view. A view of more pages is so distant that coarse rasters suffice.
MAX_DECODED_PAGES = 32
# What a view shows of the context of a part of a city.
CONTEXT_GREY = np.full((1, 1, 3), 176, np.uint8)


def process_pictures(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Write a view, or the pictures of some facades, through the fork: one file per unit.

    A picture that cannot be drawn, also from an unreadable store, is recorded as failed: the block is published without it.
    Unit arguments: of a view its name and camera; of a facade its file name, its index, and whether all stages are drawn.
    """
    plan, group = load_run_plan(run), open_root(fork)
    records: dict[int, Record] = {}
    for unit in units:
        start = time.time()
        try:
            data, drawn = (_draw_view if isinstance(unit.arguments[1], PerspectiveCamera) else _draw_facade)(
                plan, group, unit
            )
        except Exception as error:
            if is_machine_fault(error) and not is_store_fault(error):
                raise
            about = cast(ReportPictureRecord, failure_record(unit.name, unit.key, error))
            about["unread"] = is_store_fault(error)
        else:
            about = {"unit": unit.name, "key": unit.key, "status": "done"}
            about |= drawn | _write_file(group, unit, data)
        about |= {
            "worker": current_worker_name(),
            "started": start,
            "seconds": {"pictures": round(time.time() - start, 4)},
        }
        records[unit.index] = about
    return fork, records


def _draw_view(plan: Plan, group: StoreGroup, unit: Unit) -> tuple[bytes, ReportPictureRecord]:
    """Draw a view as JPEG from the pages that it shows, or from coarse rasters of tiles if these are too many."""
    _, camera = unit.arguments
    picture = cast_smooth_view(plan.scene, camera, samples=VIEW_SETTINGS.samples_per_pixel_side)
    own = plan.in_core[picture.visible_charts]
    pages = np.unique(plan.scene.placement.page[picture.visible_charts[own]])
    parts = _read_page_rasters if len(pages) <= MAX_DECODED_PAGES else _read_coarse_rasters
    bare = {chart: CONTEXT_GREY for chart in picture.visible_charts[~own].tolist()}
    painted = paint_view(picture, chain([bare], parts(plan, group, picture.visible_charts[own])))
    return encode_image(painted, "JPEG", quality=90), {}  # type: ignore[typeddict-item]


def _draw_facade(plan: Plan, group: StoreGroup, unit: Unit) -> tuple[bytes, ReportPictureRecord]:
    """Draw the stages of a facade, or its texture alone, as consecutive WebP files; nothing if it has none."""
    _, facade, staged = unit.arguments
    (made,) = read_records(group, "facades", np.array([facade]), FacadeRecord)
    stored = StoredFacade(group, plan.scene.placement, int(plan.facades.chart[facade]), made, exemplars=())
    joined, listed = BytesIO(), []
    for stage in iterate_stage_pictures(stored):
        if stage.report is None or not (staged or stage.report.name == TEXTURE_STAGE):
            continue
        data = encode_image(stage.draw(), "WEBP", quality=82, method=2)
        listed.append([stage.report.name, stage.report.title, joined.tell(), len(data)])
        joined.write(data)
    return joined.getvalue(), {"pictures": listed}  # type: ignore[typeddict-item]


def _write_file(group: StoreGroup, unit: Unit, data: bytes) -> ReportPictureRecord:
    """Write the file of a unit; a facade without pictures has none."""
    name = unit.arguments[0]
    path = picture_path(name)
    if data:
        write_stored_file(group, path, data, f"picture of {unit.name}")
        return {"file": name, "bytes": len(data), "digest": digest_stored_file(data)}  # type: ignore[typeddict-item]
    if path in group:
        del group[path]
    return {}  # type: ignore[typeddict-item]


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
