"""Materials of surfaces with their roughness and relief, from facade labels and chart materials."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.street.materials.field_kernels import SurfaceMaterial


class PbrMaterial(IntEnum):
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


class MaterialProperties(NamedTuple):
    """Roughness and relief of a material class.

    Attributes
    ----------
    roughness : 0 to 1, as in glTF and USD.
    relief : metres from the ground of joints or pores to the face, visible as dark on bright.
    """

    roughness: float
    relief: float


MATERIAL_PROPERTIES = {
    PbrMaterial.PLASTER: MaterialProperties(0.92, 0.002),
    PbrMaterial.BRICK: MaterialProperties(0.88, 0.006),
    PbrMaterial.GLASS: MaterialProperties(0.06, 0.0),
    PbrMaterial.FRAME: MaterialProperties(0.5, 0.0),
    PbrMaterial.WOOD: MaterialProperties(0.6, 0.004),
    PbrMaterial.RAILING: MaterialProperties(0.45, 0.006),
    PbrMaterial.SHEET: MaterialProperties(0.5, 0.012),
    PbrMaterial.TILE: MaterialProperties(0.75, 0.02),
    PbrMaterial.SLATE: MaterialProperties(0.62, 0.008),
    PbrMaterial.FELT: MaterialProperties(0.95, 0.004),
    PbrMaterial.GRAVEL: MaterialProperties(0.98, 0.008),
    PbrMaterial.ASPHALT: MaterialProperties(0.92, 0.003),
    PbrMaterial.SLABS: MaterialProperties(0.84, 0.005),
    PbrMaterial.SETTS: MaterialProperties(0.74, 0.012),
    PbrMaterial.GRASS: MaterialProperties(1.0, 0.02),
    PbrMaterial.WATER: MaterialProperties(0.04, 0.004),
    PbrMaterial.PHOTOGRAPHED: MaterialProperties(0.9, 0.0),
}
# Roughness and relief in metres, indexed by PbrMaterial.
ROUGHNESS = np.array([MATERIAL_PROPERTIES[material].roughness for material in PbrMaterial], np.float32)
RELIEF = np.array([MATERIAL_PROPERTIES[material].relief for material in PbrMaterial], np.float32)

# Material of each facade class except walls; `glass_mask` separates panes from frames.
LABEL_MATERIALS = {
    FacadeClass.WINDOW: PbrMaterial.FRAME,
    FacadeClass.SHOP: PbrMaterial.FRAME,
    FacadeClass.DOOR: PbrMaterial.WOOD,
    FacadeClass.BALCONY: PbrMaterial.RAILING,
    FacadeClass.ROOF: PbrMaterial.SHEET,
}
# Material of a chart by the charts of its material field; ground charts use GROUND_MATERIALS.
CHART_MATERIALS = {
    SurfaceMaterial.GROUND: PbrMaterial.ASPHALT,
    SurfaceMaterial.SHEET_METAL: PbrMaterial.SHEET,
    SurfaceMaterial.ROOF_TILE: PbrMaterial.TILE,
    SurfaceMaterial.ROOF_PICTURE: PbrMaterial.TILE,
    SurfaceMaterial.PLASTER: PbrMaterial.PLASTER,
    SurfaceMaterial.GLASS: PbrMaterial.GLASS,
    SurfaceMaterial.BOARDS: PbrMaterial.WOOD,
    SurfaceMaterial.SOFFIT: PbrMaterial.PLASTER,
    SurfaceMaterial.BRICK: PbrMaterial.BRICK,
    SurfaceMaterial.SLATE: PbrMaterial.SLATE,
    SurfaceMaterial.FELT: PbrMaterial.FELT,
    SurfaceMaterial.ROOF_GRAVEL: PbrMaterial.GRAVEL,
    SurfaceMaterial.METAL_FIXTURE: PbrMaterial.SHEET,
}
# Material of ground by facade_core.core.types.SURFACES.
GROUND_MATERIALS = (
    PbrMaterial.GRAVEL,
    PbrMaterial.ASPHALT,
    PbrMaterial.SLABS,
    PbrMaterial.SETTS,
    PbrMaterial.GRASS,
    PbrMaterial.WATER,
    PbrMaterial.ASPHALT,
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
    found[panes] = PbrMaterial.GLASS
    return found
