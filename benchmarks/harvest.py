"""Usable exemplars of a harvest: `python -m benchmarks.harvest --data DIR --out LIBRARY --sheet SHEET.jpg`.

Harvests the pictures of a set of harvest.json and counts the exemplars by their verdicts by eye: usable, or the flaw. No
threshold was chosen on the pictures of either set (--set first, second), but faults of the second led to rules (ADR 0165). An
exemplar without a verdict counts as unjudged: the code has changed since. The sheet shows only pictures whose licence permits
a copy.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from facade_core.export.pictures.contact_sheet import draw_contact_sheets
from tasks.harvest.library import harvest_style_library
from tasks.stages.shared.images import read_exemplar_picture

USABLE = "usable"
# Folders of sets whose licence permits a copy of their pictures.
LICENSED = ("facades/cmp/", "streetphotos/swiss/", "panoramas/")
SETS = ("first", "second")
VERDICTS = Path(__file__).with_suffix(".json")


class JudgedHarvest(NamedTuple):
    """Pictures to harvest, as paths below the data, and the verdicts on their exemplars by name."""

    pictures: list[str]
    verdicts: dict[str, str]


def read_judged_harvest(name: str) -> JudgedHarvest:
    """Read a set of harvest.json."""
    read = json.loads(VERDICTS.read_text(encoding="utf-8"))[name]
    pictures = [f"{folder}/{file}" for folder, files in read["pictures"].items() for file in files]
    return JudgedHarvest(pictures, read["exemplars"])


def count_verdicts(exemplars: Iterable[tuple[str, str]], verdicts: Mapping[str, str]) -> dict[str, dict[str, int]]:
    """Count exemplars, pairs of folder and name, by their verdicts, of each folder and of all."""
    counts: dict[str, Counter[str]] = {"all": Counter(usable=0, flawed=0, unjudged=0)}
    for folder, name in exemplars:
        verdict = verdicts.get(name)
        said = "unjudged" if verdict is None else "usable" if verdict == USABLE else "flawed"
        for each in ("all", folder):
            counts.setdefault(each, Counter(usable=0, flawed=0, unjudged=0))[said] += 1
    return {folder: dict(counted) for folder, counted in counts.items()}


def draw_sheet(library: Path, names: Iterable[str], verdicts: Mapping[str, str], path: Path) -> None:
    """Draw exemplars of a library with their verdicts, the pages one below the other."""
    entries = [
        (read_exemplar_picture(library / f"{name}.png").rgb, f"{name[:38]}\n{verdicts.get(name, 'unjudged')}")
        for name in names
    ]
    Image.fromarray(np.concatenate(list(draw_contact_sheets(entries)))).save(path, quality=60)


def main(arguments: list[str] | None = None) -> None:
    """Harvest the pictures and print the counts of the verdicts as JSON."""
    parser = argparse.ArgumentParser(description="Count the usable exemplars of a harvest.")
    default = Path(os.environ.get("STREETLOOM_DATA", "../shared/data"))
    parser.add_argument("--data", type=Path, default=default, help="folder with facades/ and streetphotos/")
    parser.add_argument("--out", type=Path, required=True, help="folder of the library; a second run goes on there")
    parser.add_argument("--sheet", type=Path, help="picture file of the exemplars; none is drawn without it")
    parser.add_argument("--set", choices=SETS, default="first", help="set of pictures")
    options = parser.parse_args(arguments)
    pictures, verdicts = read_judged_harvest(options.set)
    folders = {Path(picture).name: picture.rsplit("/", 1)[0] for picture in pictures}
    start = time.process_time()
    found = harvest_style_library(
        [options.data / picture for picture in pictures], options.out, most=len(pictures), workers=1
    )
    seconds, done = time.process_time() - start, found.pictures - found.earlier
    exemplars = [(folders[one.picture.path.name], one.record["name"]) for one in found.exemplars]
    if options.sheet is not None:
        draw_sheet(
            options.out,
            [name for folder, name in exemplars if f"{folder}/".startswith(LICENSED)],
            verdicts,
            options.sheet,
        )
    counts = count_verdicts(exemplars, verdicts)
    each = {"processor_seconds_per_picture": round(seconds / done, 1)} if done else {}
    print(json.dumps({"benchmark": "harvest", "set": options.set, "pictures": found.pictures} | each | counts))


if __name__ == "__main__":
    main()
