"""Plain colours of the buildings and the ground around a block."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.linear_light import srgb_to_linear
from facade_core.core.surrounding_mesh import SurroundingMaterial, SurroundingMesh
from facade_core.core.types import SURFACES
from facade_core.export.surroundings.models import sky_light
from facade_core.street.materials.procedural import MEAN_TONES, PLASTER_PALETTE, SURFACE_COLOURS

# Clay, slate, and zinc, by the number of a building.
_ROOF_PALETTE = np.array([[132, 82, 66], [96, 94, 96], [124, 128, 130], [118, 74, 60]], np.float64)
# Light of the sun from the south-west on walls, so that corners show.
_TO_SUN = np.array([-0.62, -0.5, 0.6])


def surrounding_colours(mesh: SurroundingMesh) -> Float64Array:
    """Return the colours (v, 3) of a mesh of surroundings, linear, 0 to 1: stated, else usual ones of the material."""
    colour = np.empty((len(mesh.vertices), 3))
    is_wall, is_roof = mesh.material == SurroundingMaterial.WALL, mesh.material == SurroundingMaterial.ROOF
    is_ground = mesh.material < len(SURFACES)
    surfaces = MEAN_TONES[: len(SURFACES), None] * SURFACE_COLOURS[: len(SURFACES)]
    colour[is_ground] = surfaces[mesh.material[is_ground]]
    colour[is_wall] = 0.88 * PLASTER_PALETTE[mesh.seed[is_wall] % len(PLASTER_PALETTE)]
    colour[is_roof] = _ROOF_PALETTE[mesh.seed[is_roof] // 7 % len(_ROOF_PALETTE)]
    is_window = mesh.material == SurroundingMaterial.WINDOW
    colour[is_window] = mesh.tint[is_window]
    is_stated = mesh.tint.any(axis=1) & ~is_window
    colour[is_stated] = (colour[is_stated] + mesh.tint[is_stated]) / 2  # maps name pure colours: orange, red
    light = sky_light(mesh.normal) * (0.86 + 0.14 * np.clip(mesh.normal @ _TO_SUN, -1, 1))
    light[is_ground] = 1.0  # as the block's ground, whose texture has the light of the sky
    shaded: Float64Array = srgb_to_linear(np.rint(np.clip(colour, 0, 255)).astype(np.uint8)) * light[:, None]
    return shaded
