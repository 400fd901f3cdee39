"""Whether the names of shops are read: lines of signs in real photos, marked by eye in shop_signs.json, and on painted facades.

Of the lines that are to be read (name, trade; those that the photo's border cuts too), by their height in pixels: how many are
among the names told, letter by letter or but for one; capitals, accents, blanks and signs do not count. anywhere: how many are
read but for a letter at all, in a shop or not. Of the names told: how many are none of these.
"""

from __future__ import annotations

import json
import sys
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.imagery.detect.detection import find_plates_and_text
from facade_core.imagery.detect.signs import shop_names
from facade_core.parsing.segmenter import parse

# Pixels that a metre has on the marked photos, by the height of storeys, and the line's height from which it is large.
_PER_METRE, _LARGE = 40.0, 20

Sign = tuple[int, int, int, int, str]


def marked() -> dict[str, list[Sign]]:
    """Boxes (x0, y0, x1, y1) and texts of the lines on signs, by the photos' paths in the folder of data."""
    text = Path(__file__).with_suffix(".json").read_text(encoding="utf-8")
    return {name: [tuple(sign) for sign in signs] for name, signs in json.loads(text).items()}


def measure_photos(folder: Path) -> dict[str, Any]:
    from PIL import Image

    pictures = []
    for name, signs in marked().items():
        with Image.open(folder / name) as picture:
            pictures.append((np.asarray(picture.convert("RGB")), signs))
    return measure(pictures, _PER_METRE)


def measure(pictures: Iterable[tuple[np.ndarray, Sequence[Sign]]], texels_per_metre: float) -> dict[str, Any]:
    """Of pictures (H, W, 3) uint8 and the lines on each."""
    sizes = {size: dict.fromkeys(("lines", "exact", "within_one", "anywhere"), 0) for size in ("small", "large")}
    told = wrong = 0
    for image, signs in pictures:
        (plates, lines), parsing = find_plates_and_text(image), parse(image)
        names = shop_names(lines, parsing.labels, parsing.occluded, plates, texels_per_metre)
        for _, y0, _, y1, text in signs:
            counts = sizes["large" if y1 - y0 >= _LARGE else "small"]
            counts["lines"] += 1
            counts["exact"] += any(spelt(name) == spelt(text) for name in names)
            counts["within_one"] += any(nearly(name, text) for name in names)
            counts["anywhere"] += any(nearly(line.text, text) for line in lines)
        told += len(names)
        print([sign[4] for sign in signs], names, file=sys.stderr, flush=True)
        wrong += sum(not any(nearly(name, sign[4]) for sign in signs) for name in names)
    return {**sizes, "names": told, "none_of_these": wrong}


def spelt(text: str) -> str:
    """The letters and digits of a text, without case and accents."""
    return "".join(letter for letter in unicodedata.normalize("NFKD", text).casefold() if letter.isalnum())


def nearly(one: str, other: str) -> bool:
    """Whether two texts are spelt alike but for one letter: put in, left out or another."""
    a, b = sorted((spelt(one), spelt(other)), key=len)
    if len(b) - len(a) > 1:
        return False
    same = next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), len(a))
    return a[same:] == b[same + 1 :] or a[same + 1 :] == b[same + 1 :]
