"""Styles of map layers in QGIS's format QML: colours by quality, height and kind, with human labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

STYLE_NAME = "streetloom"
# Version of QGIS whose format this is; newer ones read it.
_QGIS_VERSION = "3.28.0"
_OUTLINE = "90,90,90,255"


@dataclass(frozen=True)
class _Class:
    """Class of a style: a filter of QGIS's expressions, empty for all others, with its label and colour."""

    condition: str
    label: str
    colour: str


_QUALITY = (
    _Class("\"status\" = 'failed'", "failed", "150,150,150,255"),
    _Class("\"quality\" = 'good'", "good", "38,128,80,255"),
    _Class("", "to be checked: see the column quality", "217,111,20,255"),
)
_HEIGHTS = tuple(
    _Class(f'"height_m" {condition}', label, colour)
    for condition, label, colour in (
        ("< 6", "below 6 m", "255,245,214,255"),
        ('>= 6 AND "height_m" < 12', "6 to 12 m", "251,213,146,255"),
        ('>= 12 AND "height_m" < 18', "12 to 18 m", "242,168,94,255"),
        ('>= 18 AND "height_m" < 30', "18 to 30 m", "214,109,66,255"),
        (">= 30", "30 m and more", "153,52,40,255"),
    )
)
_SLOPES = (
    _Class('"slope_deg" < 5', "flat", "190,190,196,255"),
    _Class("", "pitched", "178,96,78,255"),
)
# Layer -> (kind of symbol, classes).
_STYLES: dict[str, tuple[str, Sequence[_Class]]] = {
    "facades": ("line", _QUALITY),
    "buildings": ("fill", _HEIGHTS),
    "roofs": ("fill", _SLOPES),
    "ground": ("fill", (_Class("", "ground", "226,222,212,255"),)),
    "streets": ("line", (_Class("", "street", "70,110,170,255"),)),
}


def build_qml(layer: str) -> str | None:
    """Build the QML document of a layer; None for a layer without geometry."""
    if layer not in _STYLES:
        return None
    kind, classes = _STYLES[layer]
    root = ET.Element("qgis", {"version": _QGIS_VERSION, "styleCategories": "Symbology"})
    renderer = ET.SubElement(root, "renderer-v2", {"type": "RuleRenderer", "enableorderby": "0", "forceraster": "0"})
    rules = ET.SubElement(renderer, "rules", {"key": "{streetloom}"})
    symbols = ET.SubElement(renderer, "symbols")
    for number, one in enumerate(classes):
        rule = {"key": f"{{streetloom-{number}}}", "symbol": str(number), "label": one.label}
        ET.SubElement(rules, "rule", rule | ({"filter": one.condition or "ELSE"} if len(classes) > 1 else {}))
        symbols.append(_symbol(kind, number, one.colour))
    return f"<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n{ET.tostring(root, encoding='unicode')}\n"


def _symbol(kind: str, number: int, colour: str) -> ET.Element:
    """Build the symbol of a class: a line or a filled area."""
    symbol = ET.Element("symbol", {"type": kind, "name": str(number), "alpha": "1", "clip_to_extent": "1"})
    if kind == "line":
        values = {"line_color": colour, "line_width": "0.8", "line_width_unit": "MM", "line_style": "solid"}
        name = "SimpleLine"
    else:
        values = {
            "color": colour,
            "style": "solid",
            "outline_color": _OUTLINE,
            "outline_width": "0.1",
            "outline_width_unit": "MM",
            "outline_style": "solid",
        }
        name = "SimpleFill"
    layer = ET.SubElement(symbol, "layer", {"class": name, "enabled": "1", "locked": "0", "pass": "0"})
    options = ET.SubElement(layer, "Option", {"type": "Map"})
    for key, value in values.items():
        ET.SubElement(options, "Option", {"type": "QString", "name": key, "value": value})
        ET.SubElement(layer, "prop", {"k": key, "v": value})
    return symbol
