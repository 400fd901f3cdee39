"""The keys of what is finished for publishing: pages, tiles and views stand on the charts that they show, as those who wrote
last left them, pictures of a facade on its record, and none on anything else of the block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from facade_core.atlas.journal import Record, unit_key
from facade_core.export.pictures.camera import Camera
from facade_core.geometry.charts import CORNERS
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code
from tasks.stages.shared.key_parts import parts_key


def page_keys(plan: Plan, digests: Mapping[str, str]) -> list[str]:
    """The key of every page. digests: those of charts, by their ids."""
    placement, spec = plan.scene.placement, plan.scene.spec
    by_page: list[list[int]] = [[] for _ in range(spec.pages)]
    for chart in np.flatnonzero(plan.own).tolist():
        by_page[placement.page[chart]].append(chart)
    code, names = stage_code("pages"), _names(plan)
    place = np.column_stack([placement.x, placement.y, placement.width, placement.height]).tolist()
    return [parts_key(code, charts=[[names[c], digests.get(names[c]), place[c]] for c in charts]) for charts in by_page]


def tile_key(
    run: Run,
    plan: Plan,
    charts: np.ndarray,
    buildings: np.ndarray,
    origin: tuple[float, ...],
    digests: Mapping[str, str],
) -> str:
    """The key of the tile with some charts (k,) of some buildings (b,), around a place in the world."""
    things = np.unique(plan.things.of_chart[charts])
    ids = [f"{number:016x}" for number in plan.ids[charts].tolist()]
    return parts_key(
        stage_code("tiles"),
        settings=[run.crs, run.texture.texels_per_metre, list(origin)],
        geometry=[f"{digest:016x}" for digest in plan.things.digest[things].tolist()],
        names=[plan.scene.names[building] for building in buildings.tolist()],
        charts=[[name, digests.get(name)] for name in ids],
    )


def tile_shape(plan: Plan, charts: np.ndarray) -> str:
    """What the pictures of a tile with some charts (k,) are laid out by: these, their texels, and the code that does it."""
    placement = plan.scene.placement
    sides = (placement.width[charts].tolist(), placement.height[charts].tolist())
    return unit_key(stage_code("tiles"), plan.ids[charts].tolist(), *sides)


def view_keys(plan: Plan, cameras: Sequence[Camera], digests: Mapping[str, str]) -> list[str]:
    """The keys of views by some cameras: whatever may be in sight, and its texels as pages and tiles have them."""
    charts = plan.scene.charts
    corners = charts.at_shares(np.arange(len(charts)), CORNERS)
    code, drawn, names = stage_code("pictures"), [stage_code("pages"), stage_code("tiles")], _names(plan)
    keys = []
    for camera in cameras:
        sight = np.flatnonzero(camera.may_show(corners))
        things = plan.things.digest[np.unique(plan.things.of_chart[sight])]
        keys.append(
            parts_key(
                code,
                settings=[camera.position.tolist(), camera.target.tolist(), camera.field_of_view, camera.size],
                geometry=sorted(f"{digest:016x}" for digest in things.tolist()),
                charts=sorted((names[chart], digests.get(names[chart])) for chart in sight.tolist()),
                drawn=drawn,
            )
        )
    return keys


def facade_pictures_key(record: Record | None, staged: bool) -> str:
    """The key of the pictures of a facade. staged: whether every stage is shown, or the texture alone."""
    made = [record["key"], record["status"], record.get("digests")] if record else None
    return parts_key(stage_code("pictures"), settings=staged, facade=made)


def _names(plan: Plan) -> list[str]:
    return [f"{number:016x}" for number in plan.ids.tolist()]
