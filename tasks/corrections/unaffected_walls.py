"""Walls that keep their look after a correction of material or colour, because a picture textures them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from catalogs.block.corrections import BUILDING_CORRECTION_KINDS, Correction
from facade_core.geometry.charts import ChartKind
from tasks.publish.published_run import PublishedBlock

# Kinds of corrections that set the material or colour of walls.
_WALL_KINDS = ("wall_material", "wall_colour")
# Source in the record of a facade without a texture, which shows the material of its walls.
PLAIN_SOURCE = "translator"


class UnaffectedWalls(NamedTuple):
    """Effect of corrections of wall materials and colours.

    Attributes
    ----------
    notes : one line if some walls keep their look.
    buildings : buildings that do not change at all.
    """

    notes: tuple[str, ...]
    buildings: frozenset[str]


def find_unaffected_walls(results: PublishedBlock, new: Sequence[Correction]) -> UnaffectedWalls:
    """Find the walls and buildings that new corrections of materials and colours do not change."""
    plan = results.plan
    buildings = {name: index for index, name in results.names.items()}
    none = {one.id for one in new if one.kind == "facade" and one.value is False}
    stated = sorted(
        {one.id for one in new if one.kind in _WALL_KINDS and one.value is not None and one.id in buildings}
    )
    kept = {id: walls for id in stated if (walls := _count_textured_facades(results, buildings[id], none))}
    if not kept:
        return UnaffectedWalls((), frozenset())
    others = {one.id for one in new if one.kind in BUILDING_CORRECTION_KINDS and one.kind not in _WALL_KINDS}
    whole = {
        id
        for id in kept
        if not any(
            plan.scene.charts.kind[chart] == ChartKind.WALL for chart in plan.list_textured_charts(buildings[id])
        )
        and id not in others
    }
    names = ", ".join([*kept][:3]) + (", ..." if len(kept) > 3 else "")
    note = (
        f"{names}: {sum(kept.values())} walls are textured from exemplars or pictures, which no wall_material or "
        "wall_colour changes; give the building another exemplar"
    )
    return UnaffectedWalls((note,), frozenset(whole))


def _count_textured_facades(results: PublishedBlock, building: int, none: Collection[str]) -> int:
    """Count a building's facades with a texture, without those that are corrected to be none."""
    facades = results.plan.facades
    return sum(
        owner == building and id not in none and record["status"] == "done" and record["source"] != PLAIN_SOURCE
        for owner, id, record in zip(facades.building.tolist(), facades.id, results.records, strict=True)
        if record is not None
    )
