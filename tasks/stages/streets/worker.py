"""Worker of `streets`: continue what pictures show of a street's ground, and store what each viewpoint decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from catalogs.readers.pictures.materials import MaterialPicture
from facade_core.atlas.stored_files import digest_stored_file, street_view_path
from facade_core.street.materials.field import MaterialField
from facade_core.street.continuation import StreetView, continue_street
from tasks.engine.atlas import Atlas
from tasks.engine.context import load_run_plan
from tasks.engine.inputs import INPUTS_PENDING, SETTINGS_CHANGED, VIEW_CHANGED, input_field
from tasks.engine.run import Run
from tasks.engine.unit import Unit
from tasks.stages.shared.materials import material_field, read_pictured_ground, with_pictured_ground
from tasks.stages.shared.scene_view import SceneView, StoredCharts


@dataclass(frozen=True)
class StreetInputs:
    """Inputs of a street that shows pictured ground; those of other streets are empty.

    Attributes
    ----------
    street : index of the street, which differs from ingest to ingest.
    view : the ground in its panoramas, and all that these show.
    pictured : that of it which panoramas show.
    pictured_ground : ground after which ground without a picture looks.
    materials : own pictures of materials.
    seed : seed of the block.
    """

    street: int
    view: SceneView = input_field(VIEW_CHANGED)
    pictured: StoredCharts = input_field(INPUTS_PENDING)
    pictured_ground: StoredCharts = input_field(INPUTS_PENDING)
    materials: tuple[MaterialPicture, ...] = input_field(SETTINGS_CHANGED)
    seed: int = input_field(SETTINGS_CHANGED)


def compute_street(inputs: StreetInputs) -> dict[int, StreetView]:
    """Continue pictures of ground along a street; returns what each viewpoint decided, by its number."""
    if not inputs.pictured.charts:
        return {}
    plan, store = inputs.view.plan, inputs.pictured.store
    field = _material_field(inputs.view.run, inputs.seed, inputs.materials, inputs.pictured_ground)
    viewpoints = plan.street_viewpoints(inputs.street)
    own = np.array(inputs.view.charts)
    seen = [np.intersect1d(plan.charts_of_viewpoint(viewpoint.id), own) for viewpoint in viewpoints]
    shown = read_pictured_ground(plan, store, inputs.pictured.charts)
    return continue_street(plan.scene, field, viewpoints, seen, shown)


@lru_cache(maxsize=2)
def _material_field(
    run: Run, seed: int, materials: tuple[MaterialPicture, ...], pictured: StoredCharts
) -> MaterialField:
    plan = load_run_plan(run)
    return with_pictured_ground(material_field(plan, seed, None, materials), plan, pictured.store, pictured.charts)


def write_street(atlas: Atlas, unit: Unit[StreetInputs], views: Mapping[int, StreetView]) -> dict[str, object]:
    """Write what the viewpoints of a street decided; returns the fields of its record."""
    ids = np.append(atlas.plan.ids, np.uint64(0))  # 0 for MISS, the last
    files = {}
    for number, view in views.items():
        path = street_view_path(unit.name, number)
        charts = np.ascontiguousarray(ids[view.chart]).view(np.uint8).reshape(*view.chart.shape, 8)
        data = np.concatenate([view.difference, view.kind[..., None], charts], axis=2)
        atlas.group.create_array(
            path,
            data=data,
            chunks=data.shape,
            dimension_names=("row", "column", "band"),
            attributes={
                "long_name": "difference of ground from its material, 128 for none, its kind, and the id of its chart"
            },
            overwrite=True,
        )
        files[path] = digest_stored_file(data.tobytes())
    return {"files": files}
