"""Stage `pictures`: the report's views of the block, and pictures of every facade."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import Record, latest_chart_digests, read_journal
from facade_core.atlas.stored_files import PICTURES as FOLDER
from facade_core.atlas.stored_files import delete_stored_files_except
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.settings import VIEW_SETTINGS
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
from tasks.engine.stage import Records, ReingestContext, Stage
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.pictures.record import picture_file_digests
from tasks.stages.pictures.worker import process_pictures
from tasks.stages.shared.key_parts import all_hex_chart_ids
from tasks.stages.shared.memory import DECODED_PIXEL, LIBRARY_BYTES

# Bytes per ray of a view (measured: 30 to 40, where two in five meet the block).
VIEW_RAY = 60
# Bytes per texel of a facade whose stages are drawn, one after the other (measured: 66 to 80).
DRAWN_TEXEL = 90

# Facades of a street that are shown stage by stage, beside those from photos; of the others the report has the texture alone.
MAX_STAGED_PER_STREET = 4
# Facades in a piece: a commit for each would take as long as the pictures.
FACADES_PER_GROUP = 8


def list_picture_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `pictures`: the views, then each facade's pictures."""
    digests = latest_chart_digests(read_journal(group, "surfaces"), [])
    records = read_journal(group, "facades", FacadeRecord)
    views = choose_cameras(plan, records, run.texture.sun)
    memory = view_memory(plan.scene.spec.page**2)
    units = [
        Unit(i, f"view {name}", (key,), (name, camera), memory)
        for i, (name, camera, key) in enumerate(
            zip(view_names(plan), views, view_keys(plan, views, digests), strict=True)
        )
    ]
    texels, staged = plan.texel_counts(), facades_with_stage_pictures(plan, records)
    files = _file_names(plan)[len(views) :]
    for number, (facade, file) in enumerate(zip(select_pictured_facades(plan).tolist(), files, strict=True)):
        units.append(
            Unit(
                len(views) + number,
                plan.facades.id[facade],
                (facade_pictures_key(records[facade], facade in staged),),
                (file, facade, facade in staged),
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


def _match_previous(change: ReingestContext) -> dict[int, int]:
    at = {file: unit for unit, file in enumerate(_file_names(change.before)[: len(change.records["pictures"])])}
    return {unit: at[file] for unit, file in enumerate(_file_names(change.after)) if file in at}


def _relocate(change: ReingestContext, again: Mapping[int, int], records: Records) -> Records:
    """Delete the files of facades that are gone; the others keep their names."""
    delete_stored_files_except(change.group, FOLDER, set(_file_names(change.after)))
    return records


def view_memory(page: int) -> int:
    """Return the memory of a view of the block, painted from pages of so many texels."""
    return (
        LIBRARY_BYTES
        + int(np.prod(VIEW_SIZE)) * VIEW_SETTINGS.samples_per_pixel_side**2 * VIEW_RAY
        + page * DECODED_PIXEL
    )


def facade_pictures_memory(texels: int) -> int:
    """Return the bytes that drawing the pictures of a facade takes at most."""
    return LIBRARY_BYTES + texels * DRAWN_TEXEL


def view_keys(plan: Plan, cameras: Sequence[PerspectiveCamera], digests: Mapping[str, str]) -> list[str]:
    """Return the keys of views by some cameras: the visible geometry and its texels.

    Parameters
    ----------
    digests : digest of each chart, by id.
    """
    charts = plan.scene.charts
    corners = charts.points_at_shares(np.arange(len(charts)), CORNER_SHARES)
    code, drawn, names = (
        stage_code_digest("pictures"),
        [stage_code_digest("pages"), stage_code_digest("tiles")],
        all_hex_chart_ids(plan),
    )
    keys = []
    for camera in cameras:
        sight = np.flatnonzero(camera.may_show(corners))
        things = plan.scene_objects.digest[np.unique(plan.scene_objects.chart_object[sight])]
        keys.append(
            join_key_parts(
                code,
                settings=[camera.position.tolist(), camera.target.tolist(), camera.field_of_view, camera.size],
                geometry=sorted(f"{digest:016x}" for digest in things.tolist()),
                charts=sorted((names[chart], digests.get(names[chart])) for chart in sight.tolist()),
                drawn=drawn,
            )
        )
    return keys


def facade_pictures_key(record: Record | None, staged: bool) -> str:
    """Return the key of the pictures of a facade.

    Parameters
    ----------
    staged : whether every stage is drawn, or the texture alone.
    """
    made = [record["key"], record["status"], record.get("digests")] if record else None
    return join_key_parts(stage_code_digest("pictures"), settings=staged, facade=made)


PICTURES = Stage(
    "pictures",
    "picture",
    count=lambda block, plan: len(_file_names(plan)),
    match_previous=_match_previous,
    units=list_picture_units,
    function=process_pictures,
    reads=("facades", "surfaces", "pages", "tiles"),
    in_every_block=True,
    relocate=_relocate,
    derived_only=True,
    files=picture_file_digests,
)
