"""The pages of the atlas, each encoded once all charts on it are whole."""

from __future__ import annotations

from collections.abc import Mapping

from catalogs.block import Block
from facade_core.atlas.journal import latest_digests, read_journal
from facade_core.atlas.stored_files import PAGES as FOLDER
from facade_core.atlas.stored_files import forget_encoded
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Change, Records, Stage, same_name
from tasks.engine.unit import Unit
from tasks.stages.pages.worker import page_unit
from tasks.stages.shared.memory import page_memory
from tasks.stages.shared.published_keys import page_keys


def page_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    digests = latest_digests(read_journal(group, "surfaces"), [])
    memory = page_memory(plan.scene.spec.page**2)
    names = _names(plan)
    return [Unit(i, names[i], (key,), memory=memory) for i, key in enumerate(page_keys(plan, digests))]


def _names(plan: Plan) -> list[str]:
    return [f"{page:04}" for page in range(plan.scene.spec.pages)]


def _moved(change: Change, again: Mapping[int, int], records: Records) -> Records:
    """Pages stay where they are; those that are gone take their pictures along."""
    forget_encoded(change.group, FOLDER, {str(page) for page in range(change.after.scene.spec.pages)})
    return records


PAGES = Stage(
    "pages",
    "page",
    count=lambda block, plan: plan.scene.spec.pages,
    match_previous=lambda change: same_name(change.records["pages"], _names(change.after)),
    units=page_units,
    function=page_unit,
    reads=("surfaces",),
    in_every_block=True,
    relocate=_moved,
    derived_only=True,
)
