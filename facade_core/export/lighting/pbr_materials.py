"""Materials of surfaces with their roughness and relief, from facade labels and chart materials."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.street.materials.field_kernels import SurfaceMaterial


class PbrMaterialClass(IntEnum):
    """Material classes of texels in a relit model; all are dielectric."""

    PLASTER = 0
    BRICK = 1
    GLASS = 2
    FRAME = 3
    WOOD = 4
    RAILING = 5
    SHEET = 6
    TILE = 7
    SLATE = 8
    FELT = 9
    GRAVEL = 10
    ASPHALT = 11
    SLABS = 12
    SETTS = 13
    GRASS = 14
    WATER = 15
    PHOTOGRAPHED = 16


class RoughnessAndRelief(NamedTuple):
    """Roughness and relief of a material class.

    Attributes
    ----------
    roughness : 0 to 1, as in glTF and USD.
    relief : metres from the ground of joints or pores to the face, visible as dark on bright.
    """

    roughness: float
    relief: float


MATERIAL_PROPERTIES = {
    PbrMaterialClass.PLASTER: RoughnessAndRelief(0.92, 0.002),
    PbrMaterialClass.BRICK: RoughnessAndRelief(0.88, 0.006),
    PbrMaterialClass.GLASS: RoughnessAndRelief(0.06, 0.0),
    PbrMaterialClass.FRAME: RoughnessAndRelief(0.5, 0.0),
    PbrMaterialClass.WOOD: RoughnessAndRelief(0.6, 0.004),
    PbrMaterialClass.RAILING: RoughnessAndRelief(0.45, 0.006),
    PbrMaterialClass.SHEET: RoughnessAndRelief(0.5, 0.012),
    PbrMaterialClass.TILE: RoughnessAndRelief(0.75, 0.02),
    PbrMaterialClass.SLATE: RoughnessAndRelief(0.62, 0.008),
    PbrMaterialClass.FELT: RoughnessAndRelief(0.95, 0.004),
    PbrMaterialClass.GRAVEL: RoughnessAndRelief(0.98, 0.008),
    PbrMaterialClass.ASPHALT: RoughnessAndRelief(0.92, 0.003),
    PbrMaterialClass.SLABS: RoughnessAndRelief(0.84, 0.005),
    PbrMaterialClass.SETTS: RoughnessAndRelief(0.74, 0.012),
    PbrMaterialClass.GRASS: RoughnessAndRelief(1.0, 0.02),
    PbrMaterialClass.WATER: RoughnessAndRelief(0.04, 0.004),
    PbrMaterialClass.PHOTOGRAPHED: RoughnessAndRelief(0.9, 0.0),
}
# Roughness and relief in metres, indexed by PbrMaterial.
ROUGHNESS = np.array([MATERIAL_PROPERTIES[material].roughness for material in PbrMaterialClass], np.float32)
RELIEF = np.array([MATERIAL_PROPERTIES[material].relief for material in PbrMaterialClass], np.float32)

# Material of each facade class except walls; `glass_mask` separates panes from frames.
LABEL_MATERIALS = {
    FacadeClass.WINDOW: PbrMaterialClass.FRAME,
    FacadeClass.SHOP: PbrMaterialClass.FRAME,
    FacadeClass.DOOR: PbrMaterialClass.WOOD,
    FacadeClass.BALCONY: PbrMaterialClass.RAILING,
    FacadeClass.ROOF: PbrMaterialClass.SHEET,
}
# Material of a chart by the charts of its material field; ground charts use GROUND_MATERIALS.
CHART_MATERIALS = {
    SurfaceMaterial.GROUND: PbrMaterialClass.ASPHALT,
    SurfaceMaterial.SHEET_METAL: PbrMaterialClass.SHEET,
    SurfaceMaterial.ROOF_TILE: PbrMaterialClass.TILE,
    SurfaceMaterial.ROOF_PICTURE: PbrMaterialClass.TILE,
    SurfaceMaterial.PLASTER: PbrMaterialClass.PLASTER,
    SurfaceMaterial.GLASS: PbrMaterialClass.GLASS,
    SurfaceMaterial.BOARDS: PbrMaterialClass.WOOD,
    SurfaceMaterial.SOFFIT: PbrMaterialClass.PLASTER,
    SurfaceMaterial.BRICK: PbrMaterialClass.BRICK,
    SurfaceMaterial.SLATE: PbrMaterialClass.SLATE,
    SurfaceMaterial.FELT: PbrMaterialClass.FELT,
    SurfaceMaterial.ROOF_GRAVEL: PbrMaterialClass.GRAVEL,
    SurfaceMaterial.METAL_FIXTURE: PbrMaterialClass.SHEET,
}
# Material of ground by facade_core.core.types.SURFACES.
GROUND_MATERIALS = (
    PbrMaterialClass.GRAVEL,
    PbrMaterialClass.ASPHALT,
    PbrMaterialClass.SLABS,
    PbrMaterialClass.SETTS,
    PbrMaterialClass.GRASS,
    PbrMaterialClass.WATER,
    PbrMaterialClass.ASPHALT,
)


def classify_facade(labels: UInt8Array, wall: int, panes: BoolArray) -> UInt8Array:
    """Classify the surface materials of a facade.

    Parameters
    ----------
    labels : (h, w) facade classes.
    wall : material of the wall.
    panes : (h, w) bool, glass.

    Returns
    -------
    (h, w) uint8 PbrMaterial.
    """
    table = np.full(256, wall, np.uint8)
    for label, material in LABEL_MATERIALS.items():
        table[label] = material
    assert len(CLASSES) < len(table)
    found = table[labels]
    found[panes] = PbrMaterialClass.GLASS
    return found
