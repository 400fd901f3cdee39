"""Stage `pages`: encode each page of the atlas once all its charts are complete."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from catalogs.block.reader import Block
from facade_core.atlas.journal import latest_chart_digests, read_journal
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.pages.worker import PageInputs, compute_page, write_page
from tasks.stages.shared.memory import LIBRARY_BYTES
from tasks.stages.shared.scene_view import StoredCharts, store_charts

# Bytes per texel of a page: means of ever larger squares, as floats.
PAGE_TEXEL = 40


def list_page_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[PageInputs]]:
    """List the units of stage `pages`: one for each page of the atlas."""
    digests = latest_chart_digests(read_journal(group, "surfaces"))
    memory = page_memory(plan.scene.spec.page**2)
    names = _page_names(plan)
    return [
        Unit(page, names[page], PageInputs(charts, page), memory=memory)
        for page, charts in enumerate(charts_of_pages(run, plan, digests))
    ]


def _page_names(plan: Plan) -> list[str]:
    return [f"{page:04}" for page in range(plan.scene.spec.pages)]


def page_memory(texels: int) -> int:
    """Return the bytes that encoding a page takes at most."""
    return LIBRARY_BYTES + texels * PAGE_TEXEL


def charts_of_pages(run: Run, plan: Plan, digests: Mapping[str, str]) -> list[StoredCharts]:
    """Return the charts of every page, with their places.

    Parameters
    ----------
    digests : digest of each chart, by id.
    """
    placement, spec = plan.scene.placement, plan.scene.spec
    by_page: list[list[int]] = [[] for _ in range(spec.pages)]
    for chart in np.flatnonzero(plan.in_core).tolist():
        by_page[placement.page[chart]].append(chart)
    place = np.column_stack([placement.x, placement.y, placement.width, placement.height]).tolist()
    return [store_charts(run, plan, charts, digests, [place[chart] for chart in charts]) for charts in by_page]


PAGES = Stage(
    "pages",
    "page",
    outline=lambda block, plan: [UnitOutline(name) for name in _page_names(plan)],
    inputs=list_page_units,
    compute=compute_page,
    write=write_page,
    forecast=None,
)
