"""Whether people and vehicles stay in textures: `python -m benchmarks.privacy --data DIR` prints one JSON object.

pasted: cut-outs of occluders/, which no model learnt from, stand at the foot of held-out facades of ecp and cmp, people 1.2 to
2 metres high and vehicles as high as they are, a storey taken for three metres and a half. A thing is gone where at least half
of its pixels are made anew, and `left` is the share of all their pixels that is not. found_again: how many parts of each eighth
picture, once finished, the parser takes for something in front again, by what they mostly show: what was made anew, which looks
like a thing and is none, or the photo itself, where something stays.
marked: the vehicles and people before ecp's held-out facades, marked by eye. second_opinion, where `make detect-setup` has been
run: the faces and plates of `benchmarks.faces_and_plates` before held-out facades of cmp, and what is found on painted facades,
on which there is nothing. panoramas, likewise: faces in a real one; photos: faces and plates in real photos of streets; signs:
the names of shops in such.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import faces_and_plates, in_front, shop_signs
from benchmarks.painter.exemplars import paint_exemplar_set
from facade_core.core.errors import ImageError
from facade_core.facade.evidence import Evidence
from facade_core.facade.photo_facade import build_facade_from_photo
from facade_core.facade.texture.scale import exemplar_scale
from facade_core.imagery.detect.detection import detectors_available
from facade_core.parsing.occluders import clean_occluder_mask
from facade_core.parsing.segmenter import parse
from training.datasets.facades import CMP, ECP, LabelledFacade, read_dataset, split_facades_for_training

_HEIGHTS_M = {"ppl": (1.2, 2.0), "car": (1.4, 1.7), "truck": (2.4, 3.2)}
_STOREY_M = 3.5
_THINGS = 3
_GONE, _MOSTLY = 0.5, 0.5
# Every so many facades one is finished.
_FINISHED = 8
# Held-out facades that faces and plates are pasted before, of each height, and painted ones on which there are none.
_OF_EACH, _PAINTED = 6, 3


def measure_pasted(facades: Sequence[LabelledFacade], pieces: Sequence[tuple[str, np.ndarray]]) -> dict[str, Any]:
    """By kind of things pasted before the facades: how many are gone of how many, and what share of their pixels is left."""
    gone: Counter[str] = Counter()
    there: Counter[str] = Counter()
    left: Counter[str] = Counter()
    pixels: Counter[str] = Counter()
    again = {"made_anew": 0, "of_the_photo": 0}
    images = finished = 0
    for number, facade in enumerate(facades):
        try:
            scale = exemplar_scale(facade.image, facade.labels, storey=_STOREY_M)
        except ImageError:
            continue  # neither windows nor a door tell its scale
        rng = np.random.default_rng(number)
        image, things = _with_things(facade.image, scale, pieces, rng)
        hidden = clean_occluder_mask(parse(image).occluded)[0]
        for kind, solid in things:
            share = float(hidden[solid].mean())
            there[kind] += 1
            gone[kind] += share >= _GONE
            left[kind] += round((1 - share) * int(solid.sum()))
            pixels[kind] += int(solid.sum())
        images += 1
        if number % _FINISHED:
            continue
        made = build_facade_from_photo(Evidence(image=image, hidden=np.zeros(facade.labels.shape, bool)), seed=number)
        finished += 1
        found = parse(made.image).occluded
        for x0, y0, x1, y1 in clean_occluder_mask(found)[1]:
            anew = made.occluded[y0:y1, x0:x1][found[y0:y1, x0:x1]].mean()
            again["made_anew" if anew >= _MOSTLY else "of_the_photo"] += 1
    return {
        "gone": {kind: [gone[kind], there[kind]] for kind in sorted(there)},
        "left": {kind: round(left[kind] / pixels[kind], 4) for kind in sorted(there)},
        "found_again": again,
        "images": images,
        "finished": finished,
    }


def _with_things(
    image: np.ndarray, metres_per_pixel: float, pieces: Sequence[tuple[str, np.ndarray]], rng: np.random.Generator
) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    """A facade with things at its foot that do not hide each other, and the mask of each."""
    import cv2

    image, things = image.copy(), []
    height, width = image.shape[:2]
    taken = np.zeros(width, bool)
    for choice in rng.choice(len(pieces), _THINGS, replace=False):
        kind, piece = pieces[choice]
        high = min(height, max(8, round(rng.uniform(*_HEIGHTS_M[kind]) / metres_per_pixel)))
        wide = max(4, round(piece.shape[1] * high / piece.shape[0]))
        if wide >= width:
            continue
        x = int(rng.integers(width - wide))
        if taken[x : x + wide].any():
            continue
        taken[x : x + wide] = True
        small = cv2.resize(piece, (wide, high), interpolation=cv2.INTER_AREA)
        place, alpha = np.s_[height - high :, x : x + wide], small[..., 3:] / 255.0
        image[place] = np.rint(image[place] + alpha * (small[..., :3] - image[place].astype(float))).astype(np.uint8)
        solid = np.zeros((height, width), bool)
        solid[place] = alpha[..., 0] > 0.5
        things.append((kind, solid))
    return image, things


def measure_second_opinion(facades: Sequence[LabelledFacade], pieces: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Faces and plates, by their height in pixels, before some of the facades, and on painted facades."""
    found = faces_and_plates.measure(facades[:_OF_EACH], pieces)
    painted = paint_exemplar_set(_PAINTED, seed=in_front.PAINTED_SEED)
    return found | {"painted": faces_and_plates.measure_clean([facade.image for facade in painted])}


def main(arguments: list[str] | None = None) -> None:
    from PIL import Image

    parser = argparse.ArgumentParser(description="Count the people and vehicles that stay in textures.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with facades/ and occluders/",
    )
    parser.add_argument("--only", choices=("pasted", "second_opinion", "photos", "signs"), help="this part alone")
    options = parser.parse_args(arguments)
    cut_outs = {
        path.stem: np.asarray(Image.open(path).convert("RGBA"))
        for path in sorted((options.data / "occluders").glob("*.png"))
        if path.stem.partition("_")[0] in _HEIGHTS_M
    }
    pieces = [(name.partition("_")[0], piece) for name, piece in cut_outs.items()]
    folder = options.data / "facades"
    held_out = {
        "ecp": split_facades_for_training(list(read_dataset(ECP, folder / "ecp")))[1],
        "cmp": split_facades_for_training(list(read_dataset(CMP, folder / "cmp")))[1],
    }
    told: dict[str, Any] = {}
    wanted = (options.only,) if options.only else ("pasted", "second_opinion", "photos", "signs")
    if wanted != ("pasted",) and not detectors_available():
        if options.only:
            parser.error("what looks for faces and plates is not installed; `make detect-setup` installs it")
        wanted = ("pasted",)
    if "pasted" in wanted:
        told["pasted"] = {name: measure_pasted(facades, pieces) for name, facades in held_out.items()}
        boxes = in_front.marked()
        told["marked"] = in_front.measure_things(held_out["ecp"], boxes, lambda image: parse(image).occluded)["recall"]
    if "second_opinion" in wanted:
        told["second_opinion"] = measure_second_opinion(held_out["cmp"], cut_outs)
        told["panoramas"] = faces_and_plates.measure_panoramas(options.data / "city" / "amsterdam" / "panoramas")
    if "photos" in wanted:
        told["photos"] = faces_and_plates.measure_photos(options.data)
    if "signs" in wanted:
        told["signs"] = shop_signs.measure_photos(options.data)
    print(json.dumps({"benchmark": "privacy"} | told))


if __name__ == "__main__":
    main()
