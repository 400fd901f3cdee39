"""Whether faces and number plates before facades are found: pasted ones of known places, by their height in pixels.

Faces are those of some people of occluders/, most in profile, marked by eye in faces.json. Plates are painted with Pillow's own
letters on the cars of occluders/, turned, blurred and noisy.
Both stand at the foot of held-out facades, which no threshold was chosen on. Real ones, in photos of streets, are marked by eye
in faces_and_plates.json; how far what is hidden reaches beyond a face was chosen with these in view.

found: the box found and the true one share at least half of what they cover together. hidden: nine tenths of the true box are
hidden. Of each picture the part around is looked at. What the parser does is not counted here.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.core.types import Box
from facade_core.imagery.detect.detection import FacesPlatesAndText, detect_faces_plates_text, find_plates_and_text
from facade_core.imagery.detect.facade_detection import detect_on_facade
from facade_core.imagery.detect.faces import box_ious, find_faces
from facade_core.imagery.detect.settings import DETECTION
from facade_core.parsing.occluders import clean_occluder_mask
from facade_core.parsing.segmenter import parse
from training.datasets.facades import LabelledFacade

FACES, PLATES = "faces", "plates"
# Pixels that a face or a plate is high.
HEIGHTS = {FACES: (10, 16, 24, 40), PLATES: (10, 14, 20)}
# Rows of a picture that are looked at, and columns around what was pasted.
FOOT, BESIDE = 360, 480
FOUND, COVERED = 0.5, 0.9
# Metres that a car and a European plate are high, and how much longer than high a plate is.
_CAR_M, _PLATE_M, _LONG = 1.5, 0.11, 4.7
# Metres that a face and a plate are high, by which a part of a photo has the scale of a harvested facade.
_HEIGHTS_M = {FACES: 0.2, PLATES: _PLATE_M}
# Pixels that a plate is painted high, before it is turned and reduced.
_PAINTED = 110


def marked_faces() -> dict[str, list[Box]]:
    """Boxes (x0, y0, x1, y1) of the faces of some people of occluders/, by the names of their pictures."""
    text = Path(__file__).with_name("faces.json").read_text(encoding="utf-8")
    return {name: [tuple(box) for box in boxes] for name, boxes in json.loads(text).items()}


def measure(facades: Sequence[LabelledFacade], pieces: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Faces and plates pasted before facades; pieces: RGBA cut-outs by their names."""
    people = [(pieces[name], boxes) for name, boxes in marked_faces().items() if name in pieces]
    cars = [piece for name, piece in sorted(pieces.items()) if name.startswith("car")]
    result: dict[str, Any] = {FACES: {}, PLATES: {}}
    for kind, heights in HEIGHTS.items():
        for height in heights:
            pictures = _with_faces(facades, people, height) if kind == FACES else _with_plates(facades, cars, height)
            result[kind][str(height)] = _told(kind, pictures)
            print(kind, height, result[kind][str(height)], file=sys.stderr, flush=True)
    return result


def measure_panoramas(folder: Path) -> dict[str, int]:
    """The faces of at least ten pixels in parts of real panoramas, marked by eye in faces_in_panoramas.json; their makers
    blurred others, and not these."""
    from PIL import Image

    marked = json.loads(Path(__file__).with_name("faces_in_panoramas.json").read_text(encoding="utf-8"))
    counts = dict.fromkeys(("there", "found", "hidden"), 0)
    for name, boxes in marked.items():
        with Image.open(folder / name) as picture:
            image = np.asarray(picture.convert("RGB"))
        first, last = (
            round(share * len(image)) for share in (DETECTION.search_top_share, DETECTION.search_bottom_share)
        )
        seen = FacesPlatesAndText(faces=find_faces(image[first:last])[0]).translate(0, first)
        _count(counts, boxes, seen, image.shape[:2])
    return counts


def measure_photos(folder: Path) -> dict[str, Any]:
    """The faces and plates in real photos of streets, marked by eye in faces_and_plates.json, without those under some seven
    pixels of width or whose letters nobody reads; by_parser are those that are hidden by what the parser takes for in front,
    and harvested those that a harvest hides, at a scale by which each is of its true height."""
    from PIL import Image

    marked = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
    result = {
        kind: dict.fromkeys(("there", "found", "hidden", "harvested", "by_parser", "by_either"), 0)
        for kind in (FACES, PLATES)
    }
    for name, kinds in marked.items():
        with Image.open(folder / name) as picture:
            image = np.asarray(picture.convert("RGB"))
        in_front = clean_occluder_mask(parse(image).occluded)[0]
        for kind, boxes in kinds.items():
            for box in boxes:
                (part, place), counts = _around(image, [box]), result[kind]
                seen = _looked(kind, part)
                _count(counts, place, seen, part.shape[:2])
                behind = in_front[box[1] : box[3], box[0] : box[2]]
                counts["by_parser"] += bool(behind.mean() >= COVERED)
                x0, y0, x1, y1 = place[0]
                harvested = detect_on_facade(part, _HEIGHTS_M[kind] / (y1 - y0)).private_mask(part.shape[:2])
                counts["harvested"] += bool(harvested[y0:y1, x0:x1].mean() >= COVERED)
                counts["by_either"] += bool(
                    (behind | seen.private_mask(part.shape[:2])[y0:y1, x0:x1]).mean() >= COVERED
                )
        print(name, result, file=sys.stderr, flush=True)
    return result


def measure_clean(pictures: Sequence[np.ndarray]) -> dict[str, Any]:
    """What is found on pictures on which there is nothing: how many faces and plates, and the share of pixels they hide."""
    seen = [detect_faces_plates_text(picture) for picture in pictures]
    hidden = [one.private_mask(picture.shape[:2]).mean() for one, picture in zip(seen, pictures, strict=True)]
    return {
        "pictures": len(pictures),
        FACES: sum(len(one.faces) for one in seen),
        PLATES: sum(len(one.plates) for one in seen),
        "hidden": round(float(np.mean(hidden)), 5),
    }


def _told(kind: str, pictures: Iterator[tuple[np.ndarray, list[Box]]]) -> dict[str, Any]:
    counts = dict.fromkeys(("there", "found", "hidden"), 0)
    for whole, places in pictures:
        image, boxes = _around(whole, places)
        _count(counts, boxes, _looked(kind, image), image.shape[:2])
    return counts


def _looked(kind: str, image: np.ndarray) -> FacesPlatesAndText:
    return (
        FacesPlatesAndText(faces=find_faces(image)[0])
        if kind == FACES
        else FacesPlatesAndText(plates=find_plates_and_text(image, plates_top=0.0)[0])
    )


def _count(counts: dict[str, int], boxes: Sequence[Box], seen: FacesPlatesAndText, shape: tuple[int, int]) -> None:
    hidden = seen.private_mask(shape)
    for x0, y0, x1, y1 in boxes:
        overlaps = box_ious(np.array([x0, y0, x1, y1], float), np.concatenate([seen.faces, seen.plates]))
        counts["there"] += 1
        counts["found"] += bool((overlaps >= FOUND).any())
        counts["hidden"] += bool(hidden[y0:y1, x0:x1].mean() >= COVERED)


def _around(image: np.ndarray, boxes: Sequence[Box]) -> tuple[np.ndarray, list[Box]]:
    """The part of a picture around the first of some boxes, and the boxes in it."""
    height, width = image.shape[:2]
    x = min(max(0, boxes[0][0] - BESIDE // 2), max(0, width - BESIDE))
    y = min(max(0, boxes[0][1] - FOOT // 2), max(0, height - FOOT))
    return image[y : y + FOOT, x : x + BESIDE], [(x0 - x, y0 - y, x1 - x, y1 - y) for x0, y0, x1, y1 in boxes]


def _with_faces(
    facades: Sequence[LabelledFacade], people: Sequence[tuple[np.ndarray, list[Box]]], height: int
) -> Iterator[tuple[np.ndarray, list[Box]]]:
    """Facades, people at their feet so large that the first face is so high, and the boxes of all the faces."""
    for number, facade in enumerate(facades):
        rng = np.random.default_rng([number, height])
        piece, faces = people[number % len(people)]
        scale = height / (faces[0][3] - faces[0][1])
        made = _pasted(facade.image, piece, scale, rng)
        if made is not None:
            image, x, y = made
            yield image, [_scaled(face, scale, x, y) for face in faces]


def _with_plates(
    facades: Sequence[LabelledFacade], cars: Sequence[np.ndarray], height: int
) -> Iterator[tuple[np.ndarray, list[Box]]]:
    """Facades, a car at the foot of each so large that its plate is so high, and the plate's box."""
    import cv2

    for number, facade in enumerate(facades):
        rng = np.random.default_rng([number, height])
        car = cars[number % len(cars)]
        high = height / _PLATE_M * _CAR_M
        made = _pasted(facade.image, car, high / len(car), rng)
        if made is None:
            continue
        image, left, top = made
        long = round(_LONG * height * rng.uniform(0.6, 1.0))  # seen from aside
        x = left + round(rng.uniform(0.25, 0.75) * (car.shape[1] * high / len(car) - long))
        y = top + round(rng.uniform(0.5, 0.7) * high)
        plate = painted_plate(rng)
        # its corners on the picture: the far end is lower, and it leans
        lean, less = rng.uniform(-0.12, 0.12) * long, rng.uniform(0.0, 0.2) * height
        right = float(x + long)
        corners = np.array([[x, y], [right, y + lean + less], [right, y + lean + height - less], [x, y + height]])
        far = np.array([[0, 0], [plate.shape[1], 0], [plate.shape[1], len(plate)], [0, len(plate)]], np.float32)
        factor = 4  # drawn larger, then reduced: a camera's pixel is a mean
        turned = cv2.getPerspectiveTransform(far, (corners - np.array([x - 8, y - 40])).astype(np.float32) * factor)
        size = ((long + 16) * factor, (height + 80) * factor)
        alpha = cv2.warpPerspective(np.ones(plate.shape[:2], np.float32), turned, size, flags=cv2.INTER_AREA)
        drawn = cv2.warpPerspective(plate.astype(np.float32), turned, size, flags=cv2.INTER_AREA)
        small = (size[0] // factor, size[1] // factor)
        alpha, drawn = (cv2.resize(one, small, interpolation=cv2.INTER_AREA) for one in (alpha, drawn))
        inside = _inside(image, x - 8, y - 40, *small)
        if inside is None:
            continue
        part = image[inside].astype(np.float32)
        part = part * (1 - alpha[..., None]) + drawn * rng.uniform(0.6, 1.0)
        soft = cv2.GaussianBlur(part, (0, 0), float(rng.uniform(0.3, 0.8)))
        noisy = soft + rng.normal(0, 3, part.shape)
        image[inside] = np.clip(noisy, 0, 255).astype(np.uint8)
        low, upper = corners.min(axis=0), corners.max(axis=0)
        yield image, [(int(low[0]), int(low[1]), int(upper[0]) + 1, int(upper[1]) + 1)]


def painted_plate(rng: np.random.Generator) -> np.ndarray:
    """A number plate (h, w, 3) uint8 of one of three patterns: dark letters on white or yellow, a blue strip at its left."""
    from PIL import Image, ImageDraw, ImageFont

    letters, digits = "ABCDEFGHJKLMNPQRSTUVWXYZ", "0123456789"
    pattern = ("AA-000-AA", "AAA-000", "AA 000000")[rng.integers(3)]
    signs = {"A": letters, "0": digits}
    text = "".join(signs[sign][rng.integers(len(signs[sign]))] if sign in signs else sign for sign in pattern)
    width = round(_LONG * _PAINTED)
    plate = Image.new("RGB", (width, _PAINTED), ((245, 245, 240), (240, 200, 40))[rng.integers(2)])
    draw = ImageDraw.Draw(plate)
    draw.rectangle((0, 0, width - 1, _PAINTED - 1), outline=(20, 20, 20), width=4)
    draw.rectangle((4, 4, 44, _PAINTED - 5), fill=(20, 60, 160))
    draw.text(((width + 44) / 2, _PAINTED / 2), text, (15, 15, 20), ImageFont.load_default(82), "mm", stroke_width=2)
    return np.asarray(plate)


def _pasted(
    image: np.ndarray, piece: np.ndarray, scale: float, rng: np.random.Generator
) -> tuple[np.ndarray, int, int] | None:
    """A cut-out at the foot of an image, and where its upper left corner is; None where it is larger than that."""
    import cv2

    high, wide = (max(2, round(side * scale)) for side in piece.shape[:2])
    height, width = image.shape[:2]
    if high > height or wide >= width:
        return None
    x, y = int(rng.integers(width - wide)), height - high
    small = cv2.resize(piece, (wide, high), interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC)
    alpha = small[..., 3:] / 255.0
    result = image.copy()
    place = np.s_[y:height, x : x + wide]
    result[place] = np.rint(result[place] + alpha * (small[..., :3] - result[place].astype(float))).astype(np.uint8)
    return result, x, y


def _scaled(box: Box, scale: float, x: int, y: int) -> Box:
    x0, y0, x1, y1 = (value * scale for value in box)
    return round(x + x0), round(y + y0), round(x + x1), round(y + y1)


def _inside(image: np.ndarray, x: int, y: int, width: int, height: int) -> tuple[slice, slice] | None:
    if x < 0 or y < 0 or x + width > image.shape[1] or y + height > image.shape[0]:
        return None
    return np.s_[y : y + height, x : x + width]
