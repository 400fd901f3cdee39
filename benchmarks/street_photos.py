"""Photos of facades as a run reads them: `python -m benchmarks.street_photos --data DIR --out SHEET.jpg` draws a contact sheet.

Of each photo: the photo with the outline of the facade that was found in it, the rectified facade, its parse (white beside
the facade, black where something stands before it), what the run says of it, and the verdict by eye out of street_photos.json:
good, small flaws, visible flaws, unusable, refused. taken: photos as taken, of RueMonge, the Swiss street photos and
labelmefacade; rectified: rectified photos with trees and cars, of Art-Deco and ECP. Thresholds were chosen on the photos of
the halves `tuned`, `tuned_2` and `tuned_3`; those of `judged`, `judged_2` and `judged_3` were judged once. before and after:
the three changes of docs/decisions/0122, one of each pair of halves. The third halves are drawn by chance from the photos that
pass the check for daylight and, of labelmefacade, have a building in most of their middle; their verdicts are of the finished
texture.
--seconds: processor seconds and segmentations of photos that are used, from file to completed facade.
The sheet in docs/look is drawn with --licensed, of all judged halves.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, cast
from unittest import mock

import numpy as np

from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.labels import colourise
from facade_core.facade.photo_facade import build_facade_from_photo
from facade_core.parsing import network
from facade_core.parsing.segmentation import Segmentation
from facade_core.parsing.segmenter import parse
from facade_core.plan.plan import Plan
from tasks.stages.facades.evidence import read_evidence
from tasks.stages.facades.imagery import FacadeImagery
from tasks.stages.facades.photos import crop_facade_photo
from tasks.stages.shared.images import read_bounded_picture

HALVES = ("tuned", "judged", "tuned_2", "judged_2", "tuned_3", "judged_3")
VERDICTS = ("good", "small flaws", "visible flaws", "unusable", "refused")
# Folders of sets whose licence permits a copy of their pictures.
LICENSED = ("facades/ecp/", "streetphotos/swiss/")
CHOSEN = Path(__file__).with_suffix(".json")
ROW_PX, WIDEST_PX, TEXT_PX, GAP_PX = 210, 230, 30, 6
# Texels of a wall of 15 by 13 metres at 20 a metre.
TEXELS = 80_000


class PhotoCase(NamedTuple):
    """A photo of a half: its path below the data, whether it is rectified, and the verdicts before and after."""

    path: str
    rectified: bool
    before: str
    after: str


def read_cases(half: str) -> list[PhotoCase]:
    """Read the photos of a half of street_photos.json."""
    kinds = json.loads(CHOSEN.read_text(encoding="utf-8"))[half]
    return [PhotoCase(path, kind == "rectified", *said) for kind in kinds for path, said in kinds[kind].items()]


def count_verdicts(cases: Sequence[PhotoCase], verdict: str) -> dict[str, dict[str, int]]:
    """Count the verdicts of photos as taken and of rectified ones; verdict: "before" or "after"."""
    counts = {}
    for kind, rectified in (("taken", False), ("rectified", True)):
        said = [getattr(case, verdict) for case in cases if case.rectified == rectified]
        counts[kind] = {name: said.count(name) for name in VERDICTS}
    return counts


def draw_case(data: Path, case: PhotoCase) -> np.ndarray:
    """Draw a photo with its outline, its rectified facade and its parse: (ROW_PX + TEXT_PX, width, 3) uint8."""
    import cv2

    photo = read_bounded_picture(data / case.path).rgb.copy()
    said, pictures = "", [photo]
    try:
        cut = crop_facade_photo(data / case.path, case.rectified)
    except ImageError as refusal:
        said = str(refusal).split(": ", 1)[-1]
    else:
        thick = max(2, round(max(photo.shape) / 150))
        cv2.polylines(photo, [np.round(cut.corners).astype(np.int32)], True, (255, 40, 200), thick)
        parsing = parse(np.dstack([cut.image, np.where(cut.hidden, 0, 255).astype(np.uint8)]))
        classes = colourise(parsing.labels)
        classes[parsing.occluded] = 0
        classes[cut.outside] = 255
        pictures += [cut.image, classes]
        said = "; ".join(("" if cut.has_facade else "no facade found", *cut.notes)).strip("; ")
    row = np.full((ROW_PX + TEXT_PX, 3 * (WIDEST_PX + GAP_PX), 3), 255, np.uint8)
    for place, picture in enumerate(pictures):
        scale = min(ROW_PX / picture.shape[0], WIDEST_PX / picture.shape[1])
        size = (max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale)))
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        left = place * (WIDEST_PX + GAP_PX)
        row[TEXT_PX : TEXT_PX + size[1], left : left + size[0]] = small
    head = f"{Path(case.path).stem[:28]}: {case.before} -> {case.after}"
    for line, text in enumerate((head, said[:110])):
        cv2.putText(row, text, (0, 11 + 14 * line), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 1, cv2.LINE_AA)
    return row


def measure_seconds(data: Path, cases: Sequence[PhotoCase], repeats: int) -> dict[str, object]:
    """Measure the processor seconds, least of some repeats, and the segmentations of photos that are used, with one thread."""
    import cv2

    cv2.setNumThreads(1)
    segment, counts, rows = network.Network.segment, [0], []

    def count_segmentation(self: network.Network, image: UInt8Array) -> Segmentation:
        counts[0] += 1
        return segment(self, image)

    with mock.patch.object(network.Network, "segment", count_segmentation):
        for case in cases:
            imagery = FacadeImagery(photo=data / case.path, rectified=case.rectified)
            try:
                height, width = crop_facade_photo(data / case.path, case.rectified).hidden.shape
            except ImageError:
                continue
            share = math.sqrt(TEXELS / (height * width))
            size, seconds = (round(height * share), round(width * share)), []
            for _ in range(repeats + 1):  # the first compiles
                counts[0], start = 0, time.process_time()
                evidence = read_evidence("photo", cast(Plan, None), 0, size, imagery, {}, [])
                assert evidence is not None
                build_facade_from_photo(evidence)
                seconds.append(time.process_time() - start)
            rows.append((min(seconds[1:]), counts[0]))
    return {
        "photos": len(rows),
        "seconds": round(sum(spent for spent, _ in rows), 2),
        "median_seconds": round(float(np.median([spent for spent, _ in rows])), 3),
        "segmentations": [count for _, count in rows],
    }


def main(arguments: list[str] | None = None) -> None:
    """Draw the sheet of a half, and print the counts of its verdicts as JSON."""
    from PIL import Image

    parser = argparse.ArgumentParser(description="Draw photos with outline, rectified facade and parse.")
    default = Path(os.environ.get("STREETLOOM_DATA", "../shared/data"))
    parser.add_argument("--data", type=Path, default=default, help="folder with facades/ and streetphotos/")
    parser.add_argument("--half", nargs="+", choices=HALVES, default=["judged"])
    parser.add_argument("--out", type=Path, help="picture file of the sheet; none is drawn without it")
    parser.add_argument("--licensed", action="store_true", help="draw only photos of sets whose licence permits a copy")
    parser.add_argument("--seconds", type=int, metavar="PHOTOS", help="measure the processor seconds of so many photos")
    options = parser.parse_args(arguments)
    cases = [case for half in options.half for case in read_cases(half)]
    if options.out is not None:
        drawn = [case for case in cases if not options.licensed or case.path.startswith(LICENSED)]
        rows = [draw_case(options.data, case) for case in drawn]
        pairs = [np.concatenate(rows[k::2]) for k in (0, 1)]
        height = max(map(len, pairs))
        sheet = np.full((height, sum(column.shape[1] for column in pairs), 3), 255, np.uint8)
        for place, column in enumerate(pairs):
            sheet[: len(column), place * column.shape[1] : (place + 1) * column.shape[1]] = column
        Image.fromarray(sheet).save(options.out, quality=52)
    if options.seconds is not None:
        spent = measure_seconds(options.data, cases[:: max(1, len(cases) // options.seconds)], 1)
        print(json.dumps({"benchmark": "street_photos", "half": " ".join(options.half)} | spent))
        return
    counts = {verdict: count_verdicts(cases, verdict) for verdict in ("before", "after")}
    print(json.dumps({"benchmark": "street_photos", "half": " ".join(options.half)} | counts))


if __name__ == "__main__":
    main()
