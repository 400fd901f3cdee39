"""Values of roof shapes and materials that can be drawn, the valid values of corrections."""

from __future__ import annotations

from catalogs.readers.vectors.colours import ROOF_MATERIAL_COLOURS, WALL_MATERIAL_COLOURS

# Values of OpenStreetMap's roof:shape that can be drawn.
ROOF_SHAPES = ("flat", "gabled", "hipped", "half-hipped", "pyramidal", "skillion", "gambrel", "mansard")
# Wall material without a colour of its own.
PLASTER = "plaster"


def valid_correction_values() -> dict[str, list[str]]:
    """List the valid roof shapes, wall materials and roof materials of corrections."""
    from facade_core.street.materials.field import ROOF_MATERIAL_TAGS

    return {
        "roof_shape": list(ROOF_SHAPES),
        "wall_material": sorted({PLASTER, *WALL_MATERIAL_COLOURS}),
        "roof_material": sorted(
            {*ROOF_MATERIAL_COLOURS, *(name for names in ROOF_MATERIAL_TAGS.values() for name in names)}
        ),
    }
