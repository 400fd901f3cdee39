"""Ground after any viewpoint of a street, from what its viewpoints decided, which every snapshot retains."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facade_core.atlas.journal import read_records
from facade_core.atlas.rasters import read_chart_raster
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.core.arrays import Int64Array, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import ChartKind
from facade_core.plan.plan import Plan
from facade_core.plan.plan_tables import read_plan
from facade_core.street.continuation import StreetView, blend_street_views
from facade_core.street.materials.field import MaterialField
from facade_core.street.surfaces import paint_texels
from tasks.engine.stage import is_done_record
from tasks.stages.shared.materials import rebuild_material_field
from tasks.stages.shared.street_views import list_stored_views
from tasks.stages.streets.redo import find_streets


@dataclass(frozen=True, repr=False)
class StreetState:
    """Charts of a street after one of its viewpoints: base layer, and the ground that its views decided by then.

    Attributes
    ----------
    views : what these viewpoints decided.
    """

    plan: Plan
    group: StoreGroup
    field: MaterialField
    charts: Int64Array
    views: tuple[StreetView, ...]

    def visible_charts(self) -> list[int]:
        """List the charts that the street sees; all others did not change."""
        charts: list[int] = self.charts.tolist()
        return charts

    def read_chart(self, chart: int) -> tuple[UInt8Array, UInt8Array]:
        """Return colour (h, w, 3) and provenance (h, w), uint8, of one visible chart.

        Raises
        ------
        InputError : the street does not see the chart.
        """
        if chart not in self.charts:
            raise InputError(f"the street does not see chart {chart}; visible_charts() lists those that it sees")
        scene = self.plan.scene
        colour, provenance = (
            read_chart_raster(self.group, scene.placement, chart, f"atlas/{name}") for name in ("seed", "seed_evidence")
        )
        if self.views and scene.charts.kind[chart] == ChartKind.GROUND:
            differences = blend_street_views(scene, self.field, chart, self.views)
            texels = np.nonzero((provenance == Provenance.UNSEEN) & (differences.views > 0))
            colour[texels] = paint_texels(self.field, chart, differences, *texels)
            provenance[texels] = Provenance.TRANSLATED
        return colour, provenance


def after_viewpoint(out: Path | str, street: str, step: int) -> StreetState:
    """Return the charts of a street after one of its viewpoints, by the newest snapshot.

    Parameters
    ----------
    out : folder of the run.
    street : id of the street, or its name if that is unique.
    step : viewpoint of the street; 0 is the first.

    Raises
    ------
    InputError : the street or the viewpoint is unknown, or the street is not textured yet.
    StoreError : the folder has no run.
    """
    session = open_repository(Path(out) / "store").readonly_session(BRANCH)
    group, plan = open_root(session), read_plan(session)
    chosen = find_streets(plan, street)
    if len(chosen) != 1:
        known = ", ".join(plan.streets[index].id for index in chosen)
        raise InputError(f"{out}: several streets have the name {street!r}; give the id of one: {known}")
    count = len(plan.street_viewpoints(chosen[0]))
    if not 0 <= step < count:
        raise InputError(f"{out}: street {street} has {count} viewpoints; {step} is none of 0 to {count - 1}")
    if not is_done_record(read_records(group, "streets", np.array(chosen))[0]):
        raise InputError(f"{out}: street {street} is not textured yet; run the block on")
    return street_after(plan, group, rebuild_material_field(group, plan), chosen[0], step)


def street_after(plan: Plan, group: StoreGroup, field: MaterialField, street: int, step: int) -> StreetState:
    """Return the charts of a street after one of its viewpoints."""
    stored = list_stored_views(plan, group)
    own = [one.id for one in plan.street_viewpoints(street)[: step + 1] if one.id in stored]
    views = tuple(stored[viewpoint].read(group, plan).with_viewpoint_id(viewpoint) for viewpoint in own)
    return StreetState(plan, group, field, plan.charts_of_street(street), views)
