"""Colours and materials of walls and roofs from OpenStreetMap tags."""

from __future__ import annotations

from collections.abc import Mapping

from catalogs.readers.settings import VECTORS
from facade_core.core.types import BuildingFinish

Colour = tuple[int, int, int]
# Building colours are less saturated than the CSS colours of the same name.
NAMED_COLOURS: dict[str, Colour] = {
    "red": (158, 66, 50), "darkred": (118, 46, 40), "maroon": (104, 48, 44), "brown": (112, 80, 60),
    "orange": (200, 128, 80), "yellow": (226, 198, 128), "green": (112, 142, 116), "darkgreen": (64, 90, 70),
    "lightgreen": (172, 192, 158), "blue": (98, 118, 150), "lightblue": (172, 190, 206), "pink": (218, 176, 168),
    "purple": (122, 92, 118), "white": (232, 230, 224), "black": (48, 48, 50), "cream": (236, 224, 196),
    "sand": (214, 194, 158), "silver": (172, 174, 176), "terracotta": (170, 96, 70), "copper": (122, 156, 138),
}  # fmt: skip
# Colour of a roof of a material without a stated colour.
ROOF_MATERIAL_COLOURS: dict[str, Colour] = {
    "copper": (122, 156, 138), "slate": (82, 86, 92), "tar_paper": (62, 62, 64), "asphalt": (70, 70, 72),
    "bitumen": (62, 62, 64), "zinc": (140, 146, 150), "concrete": (150, 148, 142), "thatch": (140, 118, 82),
    "grass": (96, 118, 66), "glass": (120, 140, 148),
}  # fmt: skip
WALL_MATERIAL_COLOURS: dict[str, Colour] = {
    "brick": (150, 84, 66), "concrete": (160, 158, 152), "cement_block": (154, 152, 146), "sandstone": (206, 182, 142),
    "limestone": (214, 206, 188), "granite": (142, 138, 136), "stone": (168, 162, 150), "wood": (150, 112, 78),
    "metal": (150, 154, 158), "glass": (130, 148, 156),
}  # fmt: skip


def parse_building_finish(tags: Mapping[str, str]) -> BuildingFinish:
    """Return the finish of walls and roof by the tags; unknown colours are None."""
    wall, roof = _material_name(tags.get("building:material", "")), _material_name(tags.get("roof:material", ""))
    return BuildingFinish(
        parse_colour(tags.get("building:colour") or tags.get("building:color") or "")
        or WALL_MATERIAL_COLOURS.get(wall or ""),
        parse_colour(tags.get("roof:colour") or tags.get("roof:color") or "") or ROOF_MATERIAL_COLOURS.get(roof or ""),
        wall,
        roof,
    )


def parse_colour(text: str) -> Colour | None:
    """Return RGB of "#a0522d", "a0522d", "#a52" or an English name, else None.

    Of a list the first colour counts.
    """
    from PIL import ImageColor

    text = (
        text[: VECTORS.max_colour_text_length]
        .partition(";")[0]
        .strip()
        .lower()
        .replace(" ", "")
        .replace("_", "")
        .replace("-", "")
    )
    if text in NAMED_COLOURS:
        return NAMED_COLOURS[text]
    if len(text) in (3, 6) and all(letter in "0123456789abcdef" for letter in text):
        text = f"#{text}"
    try:
        red, green, blue = ImageColor.getrgb(text)[:3]
    except ValueError:
        return None
    # paint is neither black nor white
    red, green, blue = (
        min(max(value, VECTORS.min_colour_channel), VECTORS.max_colour_channel) for value in (red, green, blue)
    )
    return red, green, blue


def _material_name(text: str) -> str | None:
    """Return a material as written, of a list the first."""
    text = text[: VECTORS.max_colour_text_length].partition(";")[0].strip().lower()
    return text if text and text not in ("yes", "no", "unknown") else None
