"""The report's pictures: views of the block, and those of every facade."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from catalogs.block import Block
from facade_core.atlas.journal import Record, latest_digests, read_journal
from facade_core.atlas.stored_files import PICTURES as FOLDER
from facade_core.atlas.stored_files import forget_encoded
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.views import cameras, photo_share, pictured, view_names
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Change, Records, Stage
from tasks.engine.unit import Unit
from tasks.stages.pictures.worker import pictures_unit
from tasks.stages.shared.memory import facade_pictures_memory, view_memory
from tasks.stages.shared.published_keys import facade_pictures_key, view_keys

# Facades of a street that are shown stage by stage, beside those from photos; of the others the report has the texture alone.
STAGED = 16
# Facades in a piece: a commit for each would take as long as the pictures.
TOGETHER = 8


def picture_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """As the journal stands: the views, then each facade's pictures."""
    digests = latest_digests(read_journal(group, "surfaces"), [])
    records = read_journal(group, "facades")
    views = cameras(plan, records, run.texture.sun)
    memory = view_memory(plan.scene.spec.page**2)
    units = [
        Unit(i, f"view {name}", (key,), (name, camera), memory)
        for i, (name, camera, key) in enumerate(
            zip(view_names(plan), views, view_keys(plan, views, digests), strict=True)
        )
    ]
    texels, staged = plan.texels(), staged_facades(plan, records)
    files = _files(plan)[len(views) :]
    for number, (facade, file) in enumerate(zip(pictured(plan).tolist(), files, strict=True)):
        units.append(
            Unit(
                len(views) + number,
                plan.facades.id[facade],
                (facade_pictures_key(records[facade], facade in staged),),
                (file, facade, facade in staged),
                facade_pictures_memory(int(texels[plan.facades.chart[facade]])),
                group_id=number // TOGETHER,
            )
        )
    return units


def staged_facades(plan: Plan, records: Sequence[Record | None]) -> set[int]:
    """The facades that are shown stage by stage, by their records: those from photos, and the first of each street."""
    count: Counter[int] = Counter()
    staged = set()
    for facade in pictured(plan).tolist():
        street, record = int(plan.facades.street[facade]), records[facade]
        photo = photo_share(record) > 0
        if photo or count[street] < STAGED:
            staged.add(facade)
            count[street] += not photo
    return staged


def _files(plan: Plan) -> list[str]:
    """What the store calls the file of each unit: views by name, facades by the ids of their charts, which stay."""
    return [*view_names(plan), *(f"{number:016x}" for number in plan.ids[plan.facades.chart[pictured(plan)]].tolist())]


def _again(change: Change) -> dict[int, int]:
    at = {file: unit for unit, file in enumerate(_files(change.before)[: len(change.records["pictures"])])}
    return {unit: at[file] for unit, file in enumerate(_files(change.after)) if file in at}


def _moved(change: Change, again: Mapping[int, int], records: Records) -> Records:
    """Files stay where they are; those of facades that are gone do not."""
    forget_encoded(change.group, FOLDER, set(_files(change.after)))
    return records


PICTURES = Stage(
    "pictures",
    "picture",
    count=lambda block, plan: len(_files(plan)),
    match_previous=_again,
    units=picture_units,
    function=pictures_unit,
    reads=("facades", "surfaces", "pages", "tiles"),
    in_every_block=True,
    relocate=_moved,
    derived_only=True,
)
