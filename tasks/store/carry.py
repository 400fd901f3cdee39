"""What an ingest takes over from the one before it: places in the atlas, panoramas and records of units that are still there.

Whether a unit that was taken over is still good is for its key to say; what is here is only where its data lie now.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import icechunk
import numpy as np

from facade_core.atlas.arrays import FORMAT, clear_rasters, resize_arrays
from facade_core.atlas.journal import STAGES, forget_record, read_journal
from facade_core.atlas.plan_tables import read_plan
from facade_core.atlas.spec import AtlasSpec
from facade_core.atlas.store import BRANCH, commit, format_of, open_repository, open_root
from facade_core.atlas.zarr_types import StoreGroup, group_at
from facade_core.errors import StoreError
from facade_core.geometry.packing import Places
from facade_core.plan import Plan
from tasks.run import Run

Records = list[dict[str, Any] | None]
# Names and keys.
Units = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Last:
    """The ingest before this one: its store as it was, and its plan."""

    group: StoreGroup
    plan: Plan

    @property
    def places(self) -> Places:
        return Places(self.plan.ids, self.plan.scene.placement)


def made_for(run: Run) -> dict[str, Any]:
    """What a store is made for, in which nothing can be taken over from one for anything else."""
    return {
        "pages": [AtlasSpec.page, AtlasSpec.chunk, AtlasSpec.gutter],
        "crs": run.crs,
        "texels_per_metre": run.texels_per_metre,
    }


def why_anew(run: Run, group: StoreGroup) -> str | None:
    """Why nothing can be taken over of what a store holds, in words; None where it holds nothing."""
    if "key" not in group.attrs:
        return None
    held = group.attrs.get("made_for")
    if not isinstance(held, dict) or format_of(group) != FORMAT or held.get("pages") != made_for(run)["pages"]:
        return "another version of Streetloom made the store"
    changed = []
    if held["texels_per_metre"] != run.texels_per_metre:
        changed.append(f"texture.texels_per_metre was {held['texels_per_metre']:g} and is {run.texels_per_metre:g}")
    if held["crs"] != run.crs:
        changed.append(f"the block's frame was {held['crs']} and is {run.crs}")
    return " and ".join(changed) or "what the store holds cannot be read"


def last_ingest(run: Run, repository: icechunk.Repository) -> Last | None:
    """What the store holds, where it is of this format, in the same frame and density; None otherwise.

    Other code may have made it: what an ingest takes over stands by its own keys.
    """
    session = repository.readonly_session(BRANCH)
    try:
        group = open_root(session)
        held = group.attrs["made_for"]
        if any(held.get(name) != wanted for name, wanted in made_for(run).items()):
            return None
        return Last(group, read_plan(session))
    except (KeyError, FileNotFoundError, StoreError):
        return None


def carry_over(
    group: StoreGroup, last: Last, plan: Plan, *, panorama_width: int, poses: Units, exemplars: Units
) -> None:
    """Bring the arrays of `last` in line with a new plan, in place: charts that are gone, moved or written by others now are
    cleared, and what is known of units goes to the places where these stand now.

    poses, exemplars: names and keys of those units, by which they are found again; the others are found by their names. A
    facade whose chart is another now is known as stale, and due.
    """
    before = {stage: read_journal(last.group, stage) for stage in STAGES}
    stays = _staying(last.plan, plan)
    textures = _textures(last.plan, plan, stays)
    facades = _facades(last.plan, plan, stays)
    cleared = np.flatnonzero(~np.isin(np.arange(len(last.plan.ids)), list(stays.values())))
    spec, placement = last.plan.scene.spec, last.plan.scene.placement
    clear_rasters(group, spec, placement, cleared.tolist())
    resize_arrays(
        group,
        plan.scene.spec,
        {
            "poses": len(poses),
            "exemplars": len(exemplars),
            "textures": len(plan.textured_buildings()),
            "facades": len(plan.facades),
            "viewpoints": len(plan.viewpoints),
            "streets": len(plan.streets),
        },
        panorama_width=panorama_width,
    )
    streets = _streets(last.plan, plan)
    same_width = last.group["panoramas/rgb"].shape[2] == panorama_width
    viewpoints = _viewpoints(last.plan, plan, streets) if same_width else {}
    moved = {
        "poses": _by_key_or_name(before["poses"], poses),
        "exemplars": _by_key_or_name(before["exemplars"], exemplars),
        "textures": textures,
        "facades": facades,
        "viewpoints": viewpoints,
        "streets": streets,
    }
    for stage, units in moved.items():
        records = _moved(before[stage], units, group[f"journal/{stage}"].shape[0])
        if stage == "facades":
            _mark_stale(records, before[stage], plan)
        _rename(stage, records, plan)
        _write_changed(group[f"journal/{stage}"], last.group[f"journal/{stage}"], list(map(_text, records)))
    held = last.group["hierarchies/data"][:]
    hierarchies = [str(held[facades[i]]) if i in facades else "" for i in range(len(plan.facades))]
    _write_changed(group["hierarchies/data"], last.group["hierarchies/data"], hierarchies)
    for new, old in viewpoints.items():
        if new != old:
            group["panoramas/rgb"][new] = last.group["panoramas/rgb"][old]
    for new, old in moved["exemplars"].items():
        if new != old:
            _copy_exemplar(group, last.group, new, old)


def forget_units(run: Run, plan: Plan, stage: str, units: Mapping[int, Sequence[int]]) -> None:
    """Forget what is known of units that are due again, by index with the charts that they wrote.

    Whatever becomes of them, nothing of before is left.
    """
    if not units:
        return
    session = open_repository(run.store).writable_session(BRANCH)
    group = open_root(session)
    for index, charts in units.items():
        forget_record(group, stage, index)
        clear_rasters(group, plan.scene.spec, plan.scene.placement, charts)
    commit(session, f"{len(units)} {stage} are due again")


def _staying(old: Plan, new: Plan) -> dict[int, int]:
    """The charts that lie where they lay and are written by the same stages, new -> old."""
    at = {int(number): chart for chart, number in enumerate(old.ids.tolist())}
    roles = [_roles(plan) for plan in (old, new)]
    there, here = ((p.scene.placement.page, p.scene.placement.x, p.scene.placement.y) for p in (old, new))
    return {
        chart: o
        for chart, number in enumerate(new.ids.tolist())
        if (o := at.get(number)) is not None
        and all(a[o] == b[chart] for a, b in zip(there, here, strict=True))
        and (roles[0][o] == roles[1][chart]).all()
    }


def _roles(plan: Plan) -> np.ndarray:
    """Per chart: whether it is a facade, has a texture of its own, is written by streets, and is in sight of one."""
    roles = np.zeros((len(plan.ids), 4), bool)
    roles[plan.facades.chart, 0] = True
    roles[:, 1], roles[:, 2] = plan.textured, plan.writable
    roles[plan.views[:, 1], 3] = True
    return roles


def _facades(old: Plan, new: Plan, stays: dict[int, int]) -> dict[int, int]:
    """Facades with the same name on a chart that stays, new -> old; the charts of others stay no longer."""
    at = dict(zip(old.facades.id, range(len(old.facades)), strict=True))
    found = {}
    for facade, (name, chart) in enumerate(zip(new.facades.id, new.facades.chart.tolist(), strict=True)):
        if chart not in stays:
            continue
        if name in at and int(old.facades.chart[at[name]]) == stays[chart]:
            found[facade] = at[name]
        else:
            del stays[chart]
    return found


def _textures(old: Plan, new: Plan, stays: dict[int, int]) -> dict[int, int]:
    """Buildings with textures of their own whose textured charts all stay, new -> old; the charts of others stay no longer."""

    def units(plan: Plan) -> dict[str, tuple[int, list[int]]]:
        buildings = enumerate(plan.textured_buildings())
        return {plan.scene.names[one]: (unit, plan.own_charts(one)) for unit, one in buildings}

    before, found = units(old), {}
    for name, (unit, charts) in units(new).items():
        if name in before and [stays.get(chart) for chart in charts] == before[name][1]:
            found[unit] = before[name][0]
        else:
            for chart in charts:
                stays.pop(chart, None)
    return found


def _streets(old: Plan, new: Plan) -> dict[int, int]:
    """Streets with the same line, else the same id, new -> old."""
    lines = {street.line.wkb: i for i, street in reversed(list(enumerate(old.streets)))}
    names = {street.id: i for i, street in enumerate(old.streets)}
    found: dict[int, int] = {}
    for by in (lambda s: lines.get(s.line.wkb), lambda s: names.get(s.id)):
        for index, street in enumerate(new.streets):
            match = by(street)
            if index not in found and match is not None and match not in found.values():
                found[index] = match
    return found


def _viewpoints(old: Plan, new: Plan, streets: Mapping[int, int]) -> dict[int, int]:
    """The viewpoints of streets that are still there, by their number along the street, new -> old."""
    return {
        one.id: other.id
        for street, before in streets.items()
        for one, other in zip(new.of_street(street), old.of_street(before), strict=False)
    }


def _by_key_or_name(records: Records, units: Units) -> dict[int, int]:
    """Units, as (name, key), with the same key, else the same name, new -> old. The latter are due, and known for why."""
    keys = {record["key"]: i for i, record in enumerate(records) if record}
    found = {i: keys[key] for i, (_, key) in enumerate(units) if key in keys}
    names = {record["unit"]: i for i, record in enumerate(records) if record and i not in found.values()}
    return found | {i: names[name] for i, (name, _) in enumerate(units) if i not in found and name in names}


def _moved(records: Records, units: Mapping[int, int], count: int) -> Records:
    return [records[units[i]] if i in units else None for i in range(count)]


def _rename(stage: str, records: Records, plan: Plan) -> None:
    """Put what is known of streets under the names and waves that they have now."""
    for index, record in enumerate(records):
        if record and stage == "streets":
            records[index] = record | {"unit": plan.streets[index].id, "wave": int(plan.wave[index])}
        elif record and stage == "viewpoints":
            step = record["unit"].rpartition("/")[2]
            records[index] = record | {"unit": f"{plan.streets[plan.viewpoints[index].street].id}/{step}"}


def _mark_stale(facades: Records, before: Records, plan: Plan) -> None:
    """Say of facades that were not taken over, but known by their name, what they stood on."""
    keys = {record["unit"]: record["key"] for record in before if record}
    for index, name in enumerate(plan.facades.id):
        if facades[index] is None and name in keys:
            facades[index] = {"unit": name, "key": keys[name], "status": "stale", "reason": "its geometry changed"}


def _text(record: dict[str, Any] | None) -> str:
    return json.dumps(record, sort_keys=True, allow_nan=False) if record else ""


def _write_changed(array: Any, before: Any, texts: Sequence[str]) -> None:
    held = list(map(str, before[:]))
    for index, text in enumerate(texts):
        if index >= len(held) or held[index] != text:
            array[index] = text


def _copy_exemplar(group: StoreGroup, before: StoreGroup, new: int, old: int) -> None:
    for name, array in group_at(before, f"exemplars/{old}").arrays():
        group.create_array(
            f"exemplars/{new}/{name}",
            data=array[:],
            chunks=array.chunks,
            dimension_names=array.metadata.dimension_names,
            overwrite=True,
        )
