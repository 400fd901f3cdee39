"""Stage `pages`: encode each page of the atlas once all its charts are complete."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import latest_chart_digests, read_journal
from facade_core.atlas.stored_files import PAGES as FOLDER
from facade_core.atlas.stored_files import delete_stored_files_except
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Records, ReingestContext, Stage, match_units_by_name
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit import Unit
from tasks.engine.unit_key import join_key_parts
from tasks.stages.pages.record import page_file_digests
from tasks.stages.pages.worker import process_page
from tasks.stages.shared.key_parts import all_hex_chart_ids
from tasks.stages.shared.memory import LIBRARY_BYTES

# Bytes per texel of a page: means of ever larger squares, as floats.
PAGE_TEXEL = 40


def list_page_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit]:
    """List the units of stage `pages`: one for each page of the atlas."""
    digests = latest_chart_digests(read_journal(group, "surfaces"), [])
    memory = page_memory(plan.scene.spec.page**2)
    names = _page_names(plan)
    return [Unit(i, names[i], (key,), memory=memory) for i, key in enumerate(page_keys(plan, digests))]


def _page_names(plan: Plan) -> list[str]:
    return [f"{page:04}" for page in range(plan.scene.spec.pages)]


def _relocate(change: ReingestContext, again: Mapping[int, int], records: Records) -> Records:
    """Delete the files of pages that are gone; the others keep their names."""
    delete_stored_files_except(change.group, FOLDER, {str(page) for page in range(change.after.scene.spec.pages)})
    return records


def page_memory(texels: int) -> int:
    """Return the bytes that encoding a page takes at most."""
    return LIBRARY_BYTES + texels * PAGE_TEXEL


def page_keys(plan: Plan, digests: Mapping[str, str]) -> list[str]:
    """Return the key of every page.

    Parameters
    ----------
    digests : digest of each chart, by id.
    """
    placement, spec = plan.scene.placement, plan.scene.spec
    by_page: list[list[int]] = [[] for _ in range(spec.pages)]
    for chart in np.flatnonzero(plan.in_core).tolist():
        by_page[placement.page[chart]].append(chart)
    code, names = stage_code_digest("pages"), all_hex_chart_ids(plan)
    place = np.column_stack([placement.x, placement.y, placement.width, placement.height]).tolist()
    return [
        join_key_parts(code, charts=[[names[c], digests.get(names[c]), place[c]] for c in charts]) for charts in by_page
    ]


PAGES = Stage(
    "pages",
    "page",
    count=lambda block, plan: plan.scene.spec.pages,
    match_previous=lambda change: match_units_by_name(change.records["pages"], _page_names(change.after)),
    units=list_page_units,
    function=process_page,
    reads=("surfaces",),
    in_every_block=True,
    relocate=_relocate,
    derived_only=True,
    files=page_file_digests,
)
