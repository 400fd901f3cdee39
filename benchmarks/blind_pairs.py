"""Two outputs of a block side by side in pairs of views, shuffled, to be judged without knowing which is which.

`streetloom bench blind_pairs --out DIR --against DIR --to DIR` draws the same views of both at eye height, one of each pair as
A and one as B by chance, on sheet-1.jpg and so on, and writes answers.csv to be filled in: pair, preferred (A, B, or nothing
where they are equal: which looks like a real street?), why. key.json says which is which; open it after judging.
`streetloom bench blind_pairs --answers DIR/answers.csv --key DIR/key.json` prints how often each was preferred, and why.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind_answers import count_answers, write_key

PAIRS = 24
# Pairs on a sheet, beside and below each other; a view's height and width.
_ACROSS, _DOWN, _SIZE = 2, 4, (276, 368)
_BAR, _GAP, _QUALITY = 18, 6, 72


def main() -> None:
    """Draw pairs, or count what was said of them."""
    parser = argparse.ArgumentParser(prog="streetloom bench blind_pairs", description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, help="folder of a run that has published")
    parser.add_argument("--against", type=Path, help="folder of another run of the same block")
    parser.add_argument("--to", type=Path, help="folder for the sheets, the key and the answers")
    parser.add_argument("--seed", type=int, default=24, help="of the places, and of which is A")
    parser.add_argument("--answers", type=Path, help="the CSV that was filled in")
    parser.add_argument("--key", type=Path, help="key.json of the same pairs")
    options = parser.parse_args()
    if options.answers and options.key:
        with options.answers.open(encoding="utf-8", newline="") as file:
            answers = list(csv.DictReader(file))
        print(json.dumps(count_answers(answers, json.loads(options.key.read_text(encoding="utf-8"))), indent=1))
    elif options.out and options.against and options.to:
        print(json.dumps(draw(options.out, options.against, options.to, options.seed)))
    else:
        parser.error("give --out, --against and --to to draw, or --answers and --key to count")


def draw(out: Path, against: Path, to: Path, seed: int) -> dict[str, Any]:
    """Write the sheets, answers.csv and key.json into a folder."""
    from PIL import Image

    from benchmarks.look.outputs import read_output
    from benchmarks.look.views import render, street_cameras

    outputs = [read_output(folder) for folder in (out, against)]
    places = street_cameras(outputs, PAIRS, seed)
    first, second = (
        [view.rgb for view in render(output, [replace(place[number], size=_SIZE) for place in places])]
        for number, output in enumerate(outputs)
    )
    turned = np.random.default_rng(seed).random(PAIRS) < 0.5
    pairs = [(b, a) if turn else (a, b) for a, b, turn in zip(first, second, turned, strict=True)]
    to.mkdir(parents=True, exist_ok=True)
    each = _ACROSS * _DOWN
    sheets = []
    for number in range(0, PAIRS, each):
        path = to / f"sheet-{number // each + 1}.jpg"
        Image.fromarray(sheet(pairs[number : number + each], number + 1)).save(path, quality=_QUALITY, optimize=True)
        sheets.append(str(path))
    sides = [("against", "out") if turn else ("out", "against") for turn in turned]
    write_key(to, sides, out=outputs[0].snapshot.id, against=outputs[1].snapshot.id, seed=seed)
    return {"benchmark": "blind_pairs", "sheets": sheets, "bytes": sum(Path(path).stat().st_size for path in sheets)}


def sheet(pairs: Sequence[tuple[np.ndarray, np.ndarray]], first: int) -> np.ndarray:
    """Pairs of views (h, w, 3) uint8 on one picture, numbered from `first`: A to the left, B to the right."""
    import cv2

    height, width = pairs[0][0].shape[:2]
    rows = -(-len(pairs) // _ACROSS)
    drawn = np.full((rows * (height + _BAR + _GAP), _ACROSS * (2 * width + 3 * _GAP), 3), 255, np.uint8)
    for i, pair in enumerate(pairs):
        row, column = divmod(i, _ACROSS)
        top = row * (height + _BAR + _GAP)
        for side, (name, view) in enumerate(zip("AB", pair, strict=True)):
            left = column * (2 * width + 3 * _GAP) + _GAP + side * (width + 2)
            label = f"{first + i} {name}"
            cv2.putText(drawn, label, (left, top + _BAR - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
            drawn[top + _BAR : top + _BAR + height, left : left + width] = view
    return drawn


if __name__ == "__main__":
    main()
