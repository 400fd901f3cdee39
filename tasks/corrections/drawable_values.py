"""The words that are drawn of a building's roof and materials: what there is to correct them to."""

from __future__ import annotations

from catalogs.readers.vectors.colours import ROOF_MATERIAL_COLOURS, WALL_MATERIAL_COLOURS

# Roofs that are drawn, by OpenStreetMap's roof:shape; what walls are of, beside what has a colour.
ROOF_SHAPES = ("flat", "gabled", "hipped", "half-hipped", "pyramidal", "skillion", "gambrel", "mansard")
PLASTER = "plaster"


def drawable_values() -> dict[str, list[str]]:
    """By what is corrected, the words that it may be."""
    from facade_core.street.materials.field import ROOF_MATERIAL_TAGS

    return {
        "roof_shape": list(ROOF_SHAPES),
        "wall_material": sorted({PLASTER, *WALL_MATERIAL_COLOURS}),
        "roof_material": sorted(
            {*ROOF_MATERIAL_COLOURS, *(name for names in ROOF_MATERIAL_TAGS.values() for name in names)}
        ),
    }
