"""Worker of `streets`: continue what pictures show of a street's ground, and store what each viewpoint decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from catalogs.readers.pictures.materials import MaterialPicture
from facade_core.atlas.stored_files import street_view_path
from facade_core.street.continuation import StreetView, continue_street
from tasks.engine.atlas import Atlas
from tasks.engine.inputs import INPUTS_PENDING, SETTINGS_CHANGED, VIEW_CHANGED, input_field
from tasks.engine.unit import Unit
from tasks.stages.shared.materials import cached_material_field, read_pictured_ground
from tasks.stages.shared.scene_view import SceneView, StoredCharts
from tasks.stages.shared.street_views import write_street_view


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
    field = cached_material_field(inputs.view.run, inputs.seed, None, inputs.materials, inputs.pictured_ground)
    viewpoints = plan.street_viewpoints(inputs.street)
    own = np.array(inputs.view.charts)
    seen = [np.intersect1d(plan.charts_of_viewpoint(viewpoint.id), own) for viewpoint in viewpoints]
    shown = read_pictured_ground(plan, store, inputs.pictured.charts)
    return continue_street(plan.scene, field, viewpoints, seen, shown)


def write_street(atlas: Atlas, unit: Unit[StreetInputs], views: Mapping[int, StreetView]) -> dict[str, object]:
    """Write what the viewpoints of a street decided; returns the fields of its record."""
    paths = {street_view_path(unit.name, number): view for number, view in views.items()}
    return {"files": {path: write_street_view(atlas.group, atlas.plan, path, view) for path, view in paths.items()}}
