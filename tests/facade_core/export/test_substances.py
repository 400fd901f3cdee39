"""What texels are of, by labels and by materials."""

from __future__ import annotations

import numpy as np

from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from facade_core.core.types import SURFACES
from facade_core.export.lighting.pbr_materials import (
    CHART_MATERIALS,
    GROUND_MATERIALS,
    MATERIAL_PROPERTIES,
    ROUGHNESS,
    PbrMaterialClass,
    classify_facade,
)
from facade_core.street.materials import field_kernels as field


def test_every_label_material_and_surface_is_of_something() -> None:
    labels = np.array([[*range(len(CLASSES)), UNKNOWN]], np.uint8)
    found = classify_facade(labels, PbrMaterialClass.BRICK, np.zeros(labels.shape, bool))
    assert found[0, FacadeClass.WALL] == found[0, -1] == PbrMaterialClass.BRICK
    assert found[0, FacadeClass.WINDOW] == PbrMaterialClass.FRAME
    assert found[0, FacadeClass.BALCONY] == PbrMaterialClass.RAILING
    assert len(GROUND_MATERIALS) == len(SURFACES)
    assert set(CHART_MATERIALS) == set(range(field.SurfaceMaterial.METAL_FIXTURE + 1)), "all that charts are made of"
    assert set(MATERIAL_PROPERTIES) == set(PbrMaterialClass)


def test_panes_are_glass_and_smoother_than_all_but_water() -> None:
    labels = np.full((3, 3), FacadeClass.WINDOW, np.uint8)
    panes = np.zeros((3, 3), bool)
    panes[1, 1] = True
    found = classify_facade(labels, PbrMaterialClass.BRICK, panes)
    assert (found == PbrMaterialClass.GLASS).sum() == 1
    assert np.sort(ROUGHNESS)[1] == ROUGHNESS[PbrMaterialClass.GLASS]
