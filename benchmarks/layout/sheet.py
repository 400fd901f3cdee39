"""Completions to be judged by eye: forty side by side, and fifty beside the truth without a word of which is which."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from benchmarks.blind_answers import write_key
from catalogs.readers.layouts import LayoutRecord
from facade_core.core.types import Element
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.facade_frame import Rectangle
from facade_core.facade.layout.model import LayoutModel
from training.layout import cases as training_cases

OF_A_KIND, COLUMNS, SIDE, GAP = 10, 8, 240, 10
# Pairs of the study of true against completed layouts, as many as the paper's.
PAIRS = 50
COLOURS = {"window": (52, 104, 196), "balcony": (222, 132, 32), "door": (36, 148, 66), "shop": (190, 52, 150)}


def sheet(records: Sequence[LayoutRecord], model: LayoutModel, out: Path) -> None:
    """Draw, row by row, ten completions each of right half, lower half and a region hidden, and of few elements seen, of
    facades spread over `records`, fronts: what was seen pale, on white; what was completed full, on grey."""
    tiles: list[Image.Image] = []
    for turn, kind in enumerate(training_cases.BENCHMARK_KINDS):
        usable = _usable_cases(records, kind)
        for k in range(OF_A_KIND):
            _, seen, domain, region = usable[((4 * k + turn) * len(usable) // (4 * OF_A_KIND))]
            made = complete(seen, domain, region, model=model, front=True)[0].elements[len(dict.fromkeys(seen)) :]
            tiles.append(_drawn(seen, made, domain, region, f"{len(tiles) + 1} {kind}"))
    _write_page(tiles, COLUMNS, out)


def draw_pairs(records: Sequence[LayoutRecord], model: LayoutModel, folder: Path) -> None:
    """Write pairs.png with PAIRS true and completed layouts, A and B by chance, answers.csv to be filled in, and key.json."""
    cases = [_usable_cases(records, kind) for kind in training_cases.BENCHMARK_KINDS]
    turned = np.random.default_rng(PAIRS).random(PAIRS) < 0.5
    tiles: list[Image.Image] = []
    for k in range(PAIRS):
        own = cases[k % len(cases)]
        elements, seen, domain, region = own[(k * len(own)) // PAIRS]
        made = complete(seen, domain, region, model=model, front=True)[0].elements
        pair = (made, elements) if turned[k] else (elements, made)
        tiles += [_drawn([], layout, domain, [], f"{k + 1} {name}") for name, layout in zip("AB", pair, strict=True)]
    folder.mkdir(parents=True, exist_ok=True)
    _write_page(tiles, COLUMNS, folder / "pairs.png")
    sides = [("out", "against") if turn else ("against", "out") for turn in turned]
    write_key(folder, sides, out="completed", against="true")


def _usable_cases(
    records: Sequence[LayoutRecord], kind: str
) -> list[tuple[list[Element], list[Element], Rectangle, list[Rectangle]]]:
    """Elements, those seen, domain and visible boxes of each facade of which something is hidden and something is seen."""
    usable = []
    for i, record in enumerate(records):
        elements, domain = list(record.elements), record.domain
        seen, region = training_cases.hide_part(kind, elements, domain, np.random.default_rng([0, i]))
        if seen and len(seen) < len(elements):
            usable.append((elements, seen, domain, region))
    return usable


def _write_page(tiles: Sequence[Image.Image], columns: int, out: Path) -> None:
    rows = [tiles[k : k + columns] for k in range(0, len(tiles), columns)]
    height = sum(max(tile.height for tile in row) + GAP for row in rows)
    page = Image.new("RGB", (columns * (SIDE + GAP), height), "white")
    top = 0
    for row in rows:
        for k, tile in enumerate(row):
            page.paste(tile, (k * (SIDE + GAP), top))
        top += max(tile.height for tile in row) + GAP
    page.quantize(64).save(out, optimize=True)


def _drawn(
    seen: Sequence[Element], made: Sequence[Element], domain: Rectangle, region: Sequence[Rectangle], name: str
) -> Image.Image:
    x0, y0, x1, y1 = domain
    scale = SIDE / max(x1 - x0, y1 - y0)
    tile = Image.new("RGB", (SIDE, 14 + round((y1 - y0) * scale)), "white")
    pen = ImageDraw.Draw(tile)

    def at(box: Rectangle) -> tuple[float, float, float, float]:
        return (
            (box[0] - x0) * scale,
            14 + (box[1] - y0) * scale,
            (box[2] - x0) * scale - 1,
            13 + (box[3] - y0) * scale,
        )

    pen.text((2, 1), name, fill="black")
    pen.rectangle(at(domain), fill=(226, 226, 226))
    for box in region:
        left, top, right, bottom = at(box)
        pen.rectangle((left, top, max(left, right), max(top, bottom)), fill="white")
    for elements, pale in ((seen, True), (made, False)):
        for label in ("shop", "window", "door", "balcony"):
            for e in elements:
                if e.label == label:
                    left, top, right, bottom = at((e.x0, e.y0, e.x1, e.y1))
                    colour = tuple((c + 2 * 255) // 3 if pale else c for c in COLOURS[label])
                    pen.rectangle((left, top, max(left, right), max(top, bottom)), fill=colour, outline=COLOURS[label])
    pen.rectangle(at(domain), outline="black")
    return tile
