"""Stages `viewpoints` and `streets`: processed in the order of streets, not fanned out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from facade_core.atlas.journal import Record
from tasks.engine.stage import OrderedStage, Records, ReingestContext, UnitOutline
from tasks.stages.streets.forecast import forecast_pending_streets, forecast_pending_viewpoints
from tasks.stages.streets.integrity import (
    confirm_lost_streets,
    find_differing_panoramas,
    find_lost_streets,
    find_lost_viewpoints,
)


def _match_streets(change: ReingestContext) -> dict[int, int]:
    """Match streets with the same line, else the same id."""
    before, after = change.before.streets, change.after.streets
    lines = {street.line.wkb: i for i, street in reversed(list(enumerate(before)))}
    names = {street.id: i for i, street in enumerate(before)}
    again: dict[int, int] = {}
    taken: set[int] = set()
    for matches in ([lines.get(street.line.wkb) for street in after], [names.get(street.id) for street in after]):
        for index, match in enumerate(matches):
            if index not in again and match is not None and match not in taken:
                again[index] = match
                taken.add(match)
    return again


def _relocate_streets(change: ReingestContext, again: Mapping[int, int], records: Records) -> Records:
    """Update the names and waves of streets."""
    plan = change.after
    return [
        cast(Record, {**record, "unit": plan.streets[index].id, "wave": int(plan.wave[index])}) if record else None
        for index, record in enumerate(records)
    ]


def _match_viewpoints(change: ReingestContext) -> dict[int, int]:
    """Match viewpoints by their number along their street; none if the panorama width changed."""
    if change.last["panoramas/rgb"].shape[2] != change.run.texture.panorama_width:
        return {}
    return {
        viewpoint.id: earlier.id
        for street, before in _match_streets(change).items()
        for viewpoint, earlier in zip(
            change.after.street_viewpoints(street), change.before.street_viewpoints(before), strict=False
        )
    }


def _relocate_viewpoints(change: ReingestContext, again: Mapping[int, int], records: Records) -> Records:
    """Update the names of viewpoints, and move their panoramas."""
    plan = change.after
    for new, old in again.items():
        record = records[new]
        if new != old and record and "panorama" in record:
            change.group["panoramas/rgb"][new] = change.last["panoramas/rgb"][old]
    for index, record in enumerate(records):
        if record:
            step = record["unit"].rpartition("/")[2]
            records[index] = record | {"unit": f"{plan.streets[plan.viewpoints[index].street].id}/{step}"}
    return records


VIEWPOINTS = OrderedStage(
    "viewpoints",
    "viewpoint",
    outline=lambda block, plan: [UnitOutline(f"{plan.streets[one.street].id}, {one.id}") for one in plan.viewpoints],
    match=_match_viewpoints,
    relocate=_relocate_viewpoints,
    part_of="streets",
    array_folder="panoramas",
    find_lost=find_lost_viewpoints,
    find_differing=find_differing_panoramas,
    forecast=forecast_pending_viewpoints,
)
STREETS = OrderedStage(
    "streets",
    "street",
    outline=lambda block, plan: [UnitOutline(street.id) for street in plan.streets],
    match=_match_streets,
    relocate=_relocate_streets,
    find_lost=find_lost_streets,
    confirm_lost=confirm_lost_streets,
    forecast=forecast_pending_streets,
)
