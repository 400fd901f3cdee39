"""Which walls a corrected material or colour does not reach: those that are textured from exemplars or pictures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from catalogs.block.corrections import BUILDING_CORRECTION_KINDS, Correction
from facade_core.geometry.charts import ChartKind
from tasks.publish.opened import Published

# What says of what walls are, beside what has a texture.
_WALL_KINDS = ("wall_material", "wall_colour")
# The source of a facade that has no texture of its own: it takes what its walls are of.
PLAIN_SOURCE = "translator"


class UnaffectedWalls(NamedTuple):
    """Of corrections that say what walls are of: a note, where walls stay as they are; and the buildings on which nothing
    changes, as all of their walls do."""

    notes: tuple[str, ...]
    buildings: frozenset[str]


def find_unaffected_walls(found: Published, new: Sequence[Correction]) -> UnaffectedWalls:
    """What `new` corrections of a block do not change of what was published of it."""
    plan = found.plan
    houses = {name: index for index, name in found.names.items()}
    none = {one.id for one in new if one.kind == "facade" and one.value is False}
    stated = sorted({one.id for one in new if one.kind in _WALL_KINDS and one.value is not None and one.id in houses})
    kept = {id: walls for id in stated if (walls := _count_textured_facades(found, houses[id], none))}
    if not kept:
        return UnaffectedWalls((), frozenset())
    others = {one.id for one in new if one.kind in BUILDING_CORRECTION_KINDS and one.kind not in _WALL_KINDS}
    whole = {
        id
        for id in kept
        if not any(plan.scene.charts.kind[chart] == ChartKind.WALL for chart in plan.textured_charts(houses[id]))
        and id not in others
    }
    names = ", ".join([*kept][:3]) + (", ..." if len(kept) > 3 else "")
    note = (
        f"{names}: {sum(kept.values())} walls are textured from exemplars or pictures, which no wall_material or "
        "wall_colour changes; give the building another exemplar"
    )
    return UnaffectedWalls((note,), frozenset(whole))


def _count_textured_facades(found: Published, building: int, none: Collection[str]) -> int:
    """How many facades of a building have a texture, those aside that are said now to be none."""
    facades = found.plan.facades
    return sum(
        of == building and id not in none and made["status"] == "done" and made["source"] != PLAIN_SOURCE
        for of, id, made in zip(facades.building.tolist(), facades.id, found.records, strict=True)
        if made is not None
    )
