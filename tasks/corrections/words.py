"""The words that are drawn of a building's roof and materials: what there is to correct them to."""

from __future__ import annotations

from catalogs.readers.vectors.colours import ROOF_MATERIALS, WALL_MATERIALS

# Roofs that are drawn, by OpenStreetMap's roof:shape; what walls are of, beside what has a colour.
ROOF_SHAPES = ("flat", "gabled", "hipped", "half-hipped", "pyramidal", "skillion", "gambrel", "mansard")
PLASTER = "plaster"


def words() -> dict[str, list[str]]:
    """By what is corrected, the words that it may be."""
    from facade_core.street.materials.field import ROOFING

    return {
        "roof_shape": list(ROOF_SHAPES),
        "wall_material": sorted({PLASTER, *WALL_MATERIALS}),
        "roof_material": sorted({*ROOF_MATERIALS, *(name for names in ROOFING.values() for name in names)}),
    }
