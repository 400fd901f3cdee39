"""Keys of streets and viewpoints.

Where panoramas are blended, a viewpoint depends on the charts that it sees and on the viewpoint before it. Of a material field,
only a viewpoint with a stored panorama depends on those charts; others depend on which texels they see of charts that streets
paint, and on what these texels are made of. A street depends on all its viewpoints.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from catalogs.file_digest import file_digest
from facade_core.atlas.journal import Record, latest_chart_digests, read_records, unit_key
from facade_core.core.arrays import Int32Array, Int64Array, IntArray
from facade_core.core.zarr_types import StoreGroup
from facade_core.plan.plan import Plan
from tasks.engine.inputs import CODE, digest_values, join_key
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code_digest
from tasks.stages.shared.materials import pictured_ground
from tasks.stages.streets.panoramas import is_panorama_in_report
from tasks.stages.streets.record import ViewpointRecord

# The records of some units (n,) of a stage, in that order.
_Read = Callable[[str, IntArray], list[Record | None]]

# Settings that streets' texels depend on.
KEY_SETTINGS = ("texels_per_metre", "panorama_width", "translator")


@dataclass(frozen=True)
class StreetKeys:
    """Keys of a street.

    Attributes
    ----------
    street : key of its texels.
    viewpoints : keys of its viewpoints in order.
    chain : digest of the viewpoint keys if texels are blended from panoramas, else empty.
    """

    street: str
    viewpoints: tuple[str, ...]
    chain: str


def street_keys(
    run: Run, plan: Plan, group: StoreGroup, street: int, journals: Mapping[str, Sequence[Record | None]] | None = None
) -> StreetKeys:
    """Return the keys of a street by the journal, once earlier waves and the base layer are done.

    A translator that returns a material field gives the same texels for any panorama: a viewpoint then depends on no other, and
    the street not on base layers of charts that it does not write.

    Parameters
    ----------
    journals : those of base layer stages and viewpoints, if they were read for many streets.
    """

    def records(stage: str, units: IntArray) -> list[Record | None]:
        return [journals[stage][unit] for unit in units.tolist()] if journals else read_records(group, stage, units)

    viewpoints = plan.street_viewpoints(street)
    blends = run.texture.translator == "neural"
    code, settings = stage_code_digest("streets", neural=blends), _settings(run, plan, group)
    charts = plan.charts_of_street(street)
    seeds = _base_layer_records(plan, records, charts)
    shown = _camera_records(plan, records, charts)
    known = latest_chart_digests(seeds + shown, [])
    names = {chart: f"{number:016x}" for chart, number in zip(charts.tolist(), plan.ids[charts].tolist(), strict=True)}
    visible = [plan.charts_of_viewpoint(viewpoint.id) for viewpoint in viewpoints]
    earlier, passed = _earlier_views(plan, records, street, charts)

    key = first = unit_key(code, settings)
    keys: list[str] = []
    views, read, passes = [], [], []
    digests = plan.view_digests if blends else plan.painted_digests
    for viewpoint, seen in zip(viewpoints, visible, strict=True):
        views.append([digests[viewpoint.id], sorted(names[c] for c in seen[plan.writable[seen]].tolist())])
        read.append(sorted((names[c], known[names[c]]) for c in seen.tolist() if names[c] in known))
        blended = np.unique(earlier[np.isin(earlier[:, 1], seen), 0])
        passes.append([[digests[v], passed[v]] for v in blended.tolist()])
        if blends:
            key = unit_key(key, views[-1], read[-1], passes[-1])
        else:
            shows = [plan.view_digests[viewpoint.id], read[-1]] if is_panorama_in_report(plan, viewpoint) else None
            key = unit_key(first, views[-1], shows)
        keys.append(key)
    # also of those of which nothing is seen: a unit that comes or goes clears its charts
    photographed = [[one["unit"], one.get("digests")] for one in shown if one]
    return StreetKeys(
        join_key(
            {CODE: code}
            | digest_values(
                settings=settings,
                views=views,
                seeds=read if blends else [],
                earlier=passes,
                others=[_base_layer_keys(plan, seeds, charts), _charts_of_later_streets(plan, street, charts)],
                ground=photographed,
            )
        ),
        tuple(keys),
        unit_key(keys) if blends else "",
    )


def _settings(run: Run, plan: Plan, group: StoreGroup) -> dict[str, object]:
    settings: dict[str, object] = {"seed": run.seed} | {name: getattr(run.texture, name) for name in KEY_SETTINGS}
    if run.roof_material is not None:
        settings["roof_material"] = run.roof_material.digest_content()
    if run.materials:
        settings["materials"] = [one.digest_content() for one in run.materials]
    if run.texture.translator == "neural" and run.models.translator:
        settings["network"] = file_digest(run.models.translator)
    settings["pictured_ground"] = pictured_ground(run, plan, group).known
    return settings | {"spacing": plan.scene.spacing, "visibility_range": plan.scene.visibility_range}


def _base_layer_records(plan: Plan, records: _Read, charts: Int64Array) -> list[Record | None]:
    """Return the records of units that write the base layer of the buildings of some charts, in the order of writing."""
    buildings = np.unique(plan.scene.charts.building[charts])
    textures = np.flatnonzero(np.isin(plan.buildings_with_textures(), buildings))
    facades = np.flatnonzero(np.isin(plan.facades.building, buildings))
    return records("textures", textures) + records("facades", facades)


def _camera_records(plan: Plan, records: _Read, charts: Int64Array) -> list[Record | None]:
    """Return the records of ground and walls from panoramas, of some charts."""
    near, own = plan.ground_near_cameras(), np.unique(charts)
    at = np.searchsorted(near, own)
    buildings = np.array(list(plan.walls_near_cameras()), np.int64)
    walls = np.flatnonzero(np.isin(buildings, plan.scene.charts.building[own]))
    return records("grounds", at[np.append(near, -1)[at] == own]) + records("walls", walls)


def _earlier_views(
    plan: Plan, records: _Read, street: int, charts: Int64Array
) -> tuple[Int32Array, dict[int, str | None]]:
    """Return pairs (k, 2) of a viewpoint of an earlier wave and a chart that both see and this street writes.

    Also returns the digest of each such viewpoint's shared pixels, None if it is not done.
    """
    pairs = plan.select_view_rows(charts[plan.writable[charts]])
    pairs = pairs[plan.wave[plan.viewpoint_streets[pairs[:, 0]]] < plan.wave[street]]
    viewpoints = np.unique(pairs[:, 0]).astype(np.int64)
    earlier = cast(list[ViewpointRecord | None], records("viewpoints", viewpoints))
    return pairs, {
        viewpoint: record["passes"] if record and record["status"] == "done" else None
        for viewpoint, record in zip(viewpoints.tolist(), earlier, strict=True)
    }


def _base_layer_keys(plan: Plan, seeds: Sequence[Record | None], charts: Int64Array) -> list[str]:
    """Return the keys of units whose base layer the street writes too: it follows when they change."""
    if not plan.writable[np.concatenate([plan.facades.chart, np.flatnonzero(plan.textured)])].any():
        return []
    return [record["key"] for record in seeds if record and record["status"] == "done"]


def _charts_of_later_streets(plan: Plan, street: int, charts: Int64Array) -> list[list[str]]:
    """Return the charts of the street that later waves write, by street: charts that they give up are this street's again."""
    pairs = plan.select_street_chart_pairs(charts[plan.writable[charts]])
    found: dict[int, set[str]] = {}
    for other, chart in pairs[plan.wave[pairs[:, 0]] > plan.wave[street]].tolist():
        found.setdefault(other, set()).add(f"{plan.ids[chart]:016x}")
    return sorted(sorted(ids) for ids in found.values())
