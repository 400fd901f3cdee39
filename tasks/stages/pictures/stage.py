"""Stage `pictures`: the report's views of the block, and pictures of every facade."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import Record, latest_chart_digests, read_journal
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.export.pictures.views import (
    VIEW_SIZE,
    choose_cameras,
    photo_share,
    select_pictured_facades,
    view_names,
)
from facade_core.geometry.charts import CORNER_SHARES
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.pictures.worker import PictureInputs, process_pictures
from tasks.stages.shared.memory import DECODED_PIXEL, LIBRARY_BYTES
from tasks.stages.shared.scene_view import SceneView, StoredCharts, store_charts

# Bytes per ray of a view (measured: 30 to 40, where two in five meet the block).
VIEW_RAY = 60
# Bytes per texel of a facade whose stages are drawn, one after the other (measured: 66 to 80).
DRAWN_TEXEL = 90

# Facades of a street that are shown stage by stage, beside those from photos; of the others the report has the texture alone.
MAX_STAGED_PER_STREET = 4
# Facades in a piece: a commit for each would take as long as the pictures.
FACADES_PER_GROUP = 8


def list_picture_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[PictureInputs]]:
    """List the units of stage `pictures`: the views, then each facade's pictures."""
    digests = latest_chart_digests(read_journal(group, "surfaces"))
    records = read_journal(group, "facades", FacadeRecord)
    views = choose_cameras(plan, records, run.texture.sun)
    memory = view_memory(plan.scene.spec.page**2)
    units = [
        Unit(i, f"view {name}", inputs, memory)
        for i, (name, inputs) in enumerate(zip(view_names(plan), view_inputs(run, plan, views, digests), strict=True))
    ]
    texels, staged = plan.texel_counts(), facades_with_stage_pictures(plan, records)
    files = _file_names(plan)[len(views) :]
    for number, (facade, file) in enumerate(zip(select_pictured_facades(plan).tolist(), files, strict=True)):
        units.append(
            Unit(
                len(views) + number,
                plan.facades.id[facade],
                facade_picture_inputs(run, records[facade], facade, file, facade in staged),
                facade_pictures_memory(int(texels[plan.facades.chart[facade]])),
                group_id=number // FACADES_PER_GROUP,
            )
        )
    return units


def facades_with_stage_pictures(plan: Plan, records: Sequence[FacadeRecord | None]) -> set[int]:
    """Return the facades that are drawn stage by stage: those from photos, and the first of each street."""
    count: Counter[int] = Counter()
    staged = set()
    for facade in select_pictured_facades(plan).tolist():
        street, record = int(plan.facades.street[facade]), records[facade]
        photo = photo_share(record) > 0
        if photo or count[street] < MAX_STAGED_PER_STREET:
            staged.add(facade)
            count[street] += not photo
    return staged


def _file_names(plan: Plan) -> list[str]:
    """Return the file name of each unit: views by name, facades by the ids of their charts."""
    return [
        *view_names(plan),
        *(f"{number:016x}" for number in plan.ids[plan.facades.chart[select_pictured_facades(plan)]].tolist()),
    ]


def view_memory(page: int) -> int:
    """Return the memory of a view of the block, painted from pages of so many texels."""
    return (
        LIBRARY_BYTES
        + int(np.prod(VIEW_SIZE)) * BLOCK_VIEWS.samples_per_pixel_side**2 * VIEW_RAY
        + page * DECODED_PIXEL
    )


def facade_pictures_memory(texels: int) -> int:
    """Return the bytes that drawing the pictures of a facade takes at most."""
    return LIBRARY_BYTES + texels * DRAWN_TEXEL


def view_inputs(
    run: Run, plan: Plan, cameras: Sequence[PerspectiveCamera], digests: Mapping[str, str]
) -> list[PictureInputs]:
    """Return the inputs of views by some cameras: the visible geometry and its texels.

    Parameters
    ----------
    digests : digest of each chart, by id.
    """
    charts = plan.scene.charts
    corners = charts.points_at_shares(np.arange(len(charts)), CORNER_SHARES)
    drawn = (stage_code_digest("pages"), stage_code_digest("tiles"))
    found = []
    for camera, name in zip(cameras, view_names(plan), strict=True):
        sight = np.flatnonzero(camera.may_show(corners))
        things = plan.scene_objects.digest[np.unique(plan.scene_objects.chart_object[sight])]
        objects = SceneView(run, (), tuple(sorted(f"{digest:016x}" for digest in things.tolist())))
        by_id = sight[np.argsort(plan.ids[sight])].tolist()
        shown = store_charts(run, plan, by_id, digests, drawn)
        found.append(PictureInputs(camera, objects, shown, (), False, plan.surroundings_digest, name))
    return found


def facade_picture_inputs(run: Run, record: Record | None, facade: int, file: str, staged: bool) -> PictureInputs:
    """Return the inputs of the pictures of a facade.

    Parameters
    ----------
    staged : whether every stage is drawn, or the texture alone.
    """
    made = (record["key"], record["status"], record.get("digests", {})) if record else ()
    nothing = StoredCharts(run, (), ())
    return PictureInputs(None, nothing, nothing, made, staged, "", file, facade)


PICTURES = Stage(
    "pictures",
    "picture",
    outline=lambda block, plan: [
        *(UnitOutline(f"view {name}") for name in view_names(plan)),
        *(UnitOutline(plan.facades.id[facade]) for facade in select_pictured_facades(plan).tolist()),
    ],
    inputs=list_picture_units,
    process=process_pictures,
    forecast=None,
)
