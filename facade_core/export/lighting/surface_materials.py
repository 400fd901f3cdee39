"""What a texel is of, by its label or by its chart's material, and how rough that is: for every model that is lit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.street.materials import field_kernels as field


class Substance(NamedTuple):
    """roughness, 0 to 1, as glTF and USD have it; relief, metres from the ground of its joints or pores to its face, that its
    picture shows as dark on bright. None is a bare metal: sheets and railings are painted, so all are dielectric."""

    name: str
    roughness: float
    relief: float


SUBSTANCES = (
    Substance("plaster", 0.92, 0.002),
    Substance("brick", 0.88, 0.006),
    Substance("glass", 0.06, 0.0),
    Substance("frame", 0.5, 0.0),
    Substance("wood", 0.6, 0.004),
    Substance("railing", 0.45, 0.006),
    Substance("sheet", 0.5, 0.012),
    Substance("tile", 0.75, 0.02),
    Substance("slate", 0.62, 0.008),
    Substance("felt", 0.95, 0.004),
    Substance("gravel", 0.98, 0.008),
    Substance("asphalt", 0.92, 0.003),
    Substance("slabs", 0.84, 0.005),
    Substance("setts", 0.74, 0.012),
    Substance("grass", 1.0, 0.02),
    Substance("water", 0.04, 0.004),
    Substance("photographed", 0.9, 0.0),
)
(
    PLASTER, BRICK, GLASS, FRAME, WOOD, RAILING, SHEET, TILE, SLATE, FELT, GRAVEL, ASPHALT, SLABS, SETTS, GRASS, WATER,
    PHOTOGRAPHED,
) = range(len(SUBSTANCES))  # fmt: skip
ROUGHNESS = np.array([one.roughness for one in SUBSTANCES], np.float32)
RELIEF = np.array([one.relief for one in SUBSTANCES], np.float32)

# Of what is a facade's label, its wall left out: panes lie in windows and shops, in the frames that `panes` leaves.
LABEL_MATERIALS = {
    FacadeClass.WINDOW: FRAME,
    FacadeClass.SHOP: FRAME,
    FacadeClass.DOOR: WOOD,
    FacadeClass.BALCONY: RAILING,
    FacadeClass.ROOF: SHEET,
}
# Of a chart by its material, as `GltfMaterials.field.charts.made` has it; ground is by its surfaces.
CHART_MATERIALS = {
    field.SurfaceMaterial.GROUND: ASPHALT,
    field.SurfaceMaterial.SHEET_METAL: SHEET,
    field.SurfaceMaterial.ROOF_TILE: TILE,
    field.SurfaceMaterial.ROOF_PICTURE: TILE,
    field.SurfaceMaterial.PLASTER: PLASTER,
    field.SurfaceMaterial.GLASS: GLASS,
    field.SurfaceMaterial.BOARDS: WOOD,
    field.SurfaceMaterial.SOFFIT: PLASTER,
    field.SurfaceMaterial.BRICK: BRICK,
    field.SurfaceMaterial.SLATE: SLATE,
    field.SurfaceMaterial.FELT: FELT,
    field.SurfaceMaterial.ROOF_GRAVEL: GRAVEL,
    field.SurfaceMaterial.METAL_FIXTURE: SHEET,
}
# Of ground, by facade_core.core.types.SURFACES.
GROUND_MATERIALS = (GRAVEL, ASPHALT, SLABS, SETTS, GRASS, WATER, ASPHALT)


def classify_facade(labels: np.ndarray, wall: int, panes: np.ndarray) -> np.ndarray:
    """The substances (h, w) uint8 of a facade with labels (h, w), a wall of substance `wall`, and panes (h, w) bool."""
    table = np.full(256, wall, np.uint8)
    for label, substance in LABEL_MATERIALS.items():
        table[label] = substance
    assert len(CLASSES) < len(table)
    found = table[labels]
    found[panes] = GLASS
    return found
