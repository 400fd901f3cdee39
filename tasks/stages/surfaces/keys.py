"""Keys of surfaces: their base layer and street texels, those of neighbouring charts, and the sun."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from catalogs.file_digest import file_digest
from facade_core.geometry.charts import CORNER_SHARES, ChartKind
from facade_core.geometry.settings import DAYLIGHT
from facade_core.plan.plan import Plan
from facade_core.street.lighting.settings import SUNLIGHT
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code_digest
from tasks.engine.unit_key import join_key_parts
from tasks.stages.shared.key_parts import material_digests


def surface_key(
    run: Run,
    plan: Plan,
    charts: Sequence[int],
    beside: Sequence[int],
    seeds: Mapping[str, str],
    streets: Mapping[str, str],
) -> str:
    """Return the key of the charts of a unit.

    Parameters
    ----------
    charts : its charts.
    beside : neighbouring charts to which it is levelled.
    seeds : digests of the base layer of charts, by id.
    streets : digests of street texels of charts, by id.
    """
    known = [f"{number:016x}" for number in plan.ids[[*charts, *beside]].tolist()]
    corners = plan.scene.charts.points_at_shares(np.array(charts), CORNER_SHARES)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    reach = DAYLIGHT.max_occluder_m if run.texture.sun is None else SUNLIGHT.max_shadow_reach_m
    parts: dict[str, object] = {
        "settings": _settings(run),
        "geometry": [known[: len(charts)], sorted(known[len(charts) :])],
        "around": plan.scene_objects.digests_in_box(low - reach, high + reach),
        "seeds": [seeds.get(name) for name in known],
        "streets": [streets.get(name) for name in known],
    }
    if run.texture.translator == "neural":  # from where its pixels were seen
        views = np.unique(plan.select_view_rows(np.array(charts))[:, 0]).tolist()
        parts["views"] = [run.texture.panorama_width, [plan.viewpoints[v].position.tolist() for v in views]]
    if (plan.scene.charts.kind[list(charts)] == ChartKind.GROUND).any():
        parts["lines"] = plan.ground_digests(charts)
        if run.aerial is not None:
            parts["aerial"] = [run.aerial.content, run.aerial.crs, run.aerial.frame]
    return join_key_parts(stage_code_digest("surfaces"), **parts)


def _settings(run: Run) -> list[object]:
    texture = run.texture
    settings: list[object] = [run.seed, texture.texels_per_metre, texture.levelling, texture.translator]
    if run.roof_material is not None:
        path, metres_per_pixel = run.roof_material
        settings += [file_digest(path), metres_per_pixel]
    if run.materials:
        settings.append(material_digests(run))
    if texture.sun is not None:
        settings.append({"azimuth": texture.sun.azimuth, "elevation": texture.sun.elevation})
    return settings
