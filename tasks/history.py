"""Atlas after any viewpoint, replayed from the panoramas, which every snapshot retains."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from facade_core.atlas.journal import journal_path
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import InputError
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from facade_core.street.propagation.texel_buffer import TexelBuffer
from facade_core.street.surfaces import paint_visible_texels
from tasks.stages.shared.materials import rebuild_material_field
from tasks.stages.streets.worker import replay_street


@dataclass(frozen=True, repr=False)
class StreetState:
    """Charts of a street after one of its viewpoints, before colour levelling."""

    plan: Plan
    buffer: TexelBuffer

    def visible_charts(self) -> list[int]:
        """List the charts that the street sees; all others did not change."""
        return sorted(self.buffer.layout.charts.tolist())

    def read_chart(self, chart: int) -> tuple[UInt8Array, UInt8Array]:
        """Return colour (h, w, 3) and provenance (h, w), uint8, of one visible chart.

        Raises
        ------
        InputError : the street does not see the chart.
        """
        placement = self.plan.scene.placement
        if chart not in self.buffer.layout.charts:
            raise InputError(f"the street does not see chart {chart}; visible_charts() lists those that it sees")
        texels = self.buffer.layout.texel_slice(placement, chart)
        shape = (int(placement.height[chart]), int(placement.width[chart]))
        return self.buffer.colour[texels].reshape(*shape, 3), self.buffer.provenance[texels].reshape(shape)


def after_viewpoint(out: Path | str, street: str, step: int) -> StreetState:
    """Replay the charts of a street up to one of its viewpoints.

    Base layer and panoramas come from the newest snapshot; panoramas of streets of earlier waves are included.

    Parameters
    ----------
    out : folder of the run.
    street : id of the street, or its name if that is unique.
    step : viewpoint of the street; 0 is the first.

    Raises
    ------
    InputError : the street or the viewpoint is unknown, or the viewpoint is not textured yet.
    StoreError : the folder has no run.
    """
    session = open_repository(Path(out) / "store").readonly_session(BRANCH)
    group = open_root(session)
    plan = read_plan(session)
    chosen = [index for index, one in enumerate(plan.streets) if street in (one.id, one.name)]
    if len(chosen) != 1:
        problem = "several streets have the name" if chosen else "no street has the id or name"
        known = [plan.streets[index] for index in chosen or range(min(5, len(plan.streets)))]
        raise InputError(
            f"{out}: {problem} {street!r}; there are {', '.join(f'{o.id} ({o.name})' if o.name else o.id for o in known)}"
        )
    viewpoints = plan.street_viewpoints(chosen[0])
    if not 0 <= step < len(viewpoints):
        raise InputError(
            f"{out}: street {street} has {len(viewpoints)} viewpoints; {step} is none of 0 to {len(viewpoints) - 1}"
        )
    if not group[journal_path("viewpoints")][viewpoints[step].id].item():
        raise InputError(f"{out}: viewpoint {step} of street {street} is not textured yet; run the block on")
    field = rebuild_material_field(group, plan)
    window = replay_street(plan, group, chosen[0], step + 1, field=field is not None, threads=os.cpu_count() or 1)
    if field is not None:
        paint_visible_texels(window, plan.scene.placement, field)
    return StreetState(plan, window)
