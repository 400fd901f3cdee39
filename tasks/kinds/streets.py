"""The viewpoints of streets, and the streets: one after the other, so they are not fanned out as the other kinds are."""

from __future__ import annotations

from collections.abc import Mapping

from catalogs.block import Block
from facade_core.atlas.journal import Record
from facade_core.plan import Plan
from tasks.kinds.kind import Change, Kind, Records, at_new_places


def _same_streets(change: Change) -> dict[int, int]:
    """Streets with the same line, else the same id."""
    before, after = change.before.streets, change.after.streets
    lines = {street.line.wkb: i for i, street in reversed(list(enumerate(before)))}
    names = {street.id: i for i, street in enumerate(before)}
    again: dict[int, int] = {}
    for by in (lambda s: lines.get(s.line.wkb), lambda s: names.get(s.id)):
        for index, street in enumerate(after):
            match = by(street)
            if index not in again and match is not None and match not in again.values():
                again[index] = match
    return again


def _carried_streets(change: Change, again: Mapping[int, int]) -> Records:
    """Under the names and waves that they have now."""
    plan = change.after
    records = at_new_places(change.records["streets"], again, len(plan.streets))
    return [
        record and Record(**(record | {"unit": plan.streets[index].id, "wave": int(plan.wave[index])}))
        for index, record in enumerate(records)
    ]


def _same_viewpoints(change: Change) -> dict[int, int]:
    """The viewpoints of streets that are still there, by their number along the street; none where panoramas begin anew."""
    if change.last["panoramas/rgb"].shape[2] != change.run.texture.panorama_width:
        return {}
    return {
        viewpoint.id: earlier.id
        for street, before in _same_streets(change).items()
        for viewpoint, earlier in zip(change.after.of_street(street), change.before.of_street(before), strict=False)
    }


def _carried_viewpoints(change: Change, again: Mapping[int, int]) -> Records:
    """Under the names that their streets have now, with their panoramas."""
    plan = change.after
    for new, old in again.items():
        if new != old:
            change.group["panoramas/rgb"][new] = change.last["panoramas/rgb"][old]
    records = at_new_places(change.records["viewpoints"], again, len(plan.viewpoints))
    for index, record in enumerate(records):
        if record:
            step = record["unit"].rpartition("/")[2]
            records[index] = record | {"unit": f"{plan.streets[plan.viewpoints[index].street].id}/{step}"}
    return records


def _count_viewpoints(block: Block, plan: Plan) -> int:
    return len(plan.viewpoints)


def _count_streets(block: Block, plan: Plan) -> int:
    return len(plan.streets)


VIEWPOINTS = Kind(
    "viewpoints",
    "viewpoint",
    _count_viewpoints,
    _same_viewpoints,
    _carried_viewpoints,
    always=True,
    part_of="streets",
)
STREETS = Kind("streets", "street", _count_streets, _same_streets, _carried_streets)
