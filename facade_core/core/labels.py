"""The seven facade classes and the colours they are drawn in."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from facade_core.core.arrays import UInt8Array

CLASSES = ("wall", "window", "balcony", "door", "roof", "shop", "sky")


class FacadeClass(IntEnum):
    """Class id of a label map: the index of its name in `CLASSES`."""

    WALL = 0
    WINDOW = 1
    BALCONY = 2
    DOOR = 3
    ROOF = 4
    SHOP = 5
    SKY = 6


# Label of a pixel whose class is not known.
UNKNOWN = 255
# CF attributes of label maps.
FLAGS = {"_FillValue": UNKNOWN, "flag_values": list(range(len(CLASSES))), "flag_meanings": " ".join(CLASSES)}

# Classes with a rectangle, in drawing order.
ELEMENT_CLASSES = ("window", "balcony", "door", "shop")
# Names of their counts in the journal and the catalogue.
ELEMENT_PLURALS = {"window": "windows", "door": "doors", "balcony": "balconies", "shop": "shops"}

# RGB by class id.
COLOURS = np.array(
    [[196, 186, 168], [70, 116, 178], [146, 92, 160], [222, 136, 60], [120, 76, 66], [78, 154, 96], [188, 220, 240]],
    np.uint8,
)
# Class name -> #rrggbb, for HTML pages.
PARSE_COLOURS = {name: "#" + bytes(colour.tolist()).hex() for name, colour in zip(CLASSES, COLOURS, strict=True)}


def colourise(labels: UInt8Array) -> UInt8Array:
    """Draw a label map in the class colours, with UNKNOWN in black.

    Parameters
    ----------
    labels : (height, width) class id per pixel.

    Returns
    -------
    (height, width, 3) RGB.
    """
    palette = np.zeros((256, 3), np.uint8)
    palette[: len(CLASSES)] = COLOURS
    return palette[labels]
