"""A case: a block of known truth in a folder, with its block file, by a seed and a number."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from benchmarks.generated_inputs.models import write_models
from benchmarks.generated_inputs.pictures import write_panoramas, write_photos
from benchmarks.generated_inputs.truth import Case, draw_truth
from benchmarks.generated_inputs.vectors import write_outlines, write_streets

_FILE_BREAKS: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda content: content[: len(content) * 2 // 3],
    "cut early": lambda content: content[:100],
    "empty": lambda content: b"",
    "mark of byte order": lambda content: b"\xef\xbb\xbf" + content,
    "gzip": gzip.compress,
    "zeros": lambda content: b"\0" * len(content),
    "utf-16": lambda content: content.decode("latin-1").encode("utf-16"),
}
_OTHER_SUFFIXES = (
    ".geojson",
    ".gpkg",
    ".shp",
    ".parquet",
    ".json",
    ".gml",
    ".obj",
    ".glb",
    ".npz",
    ".fgb",
    ".ply",
    ".pbf",
    ".zip",
    ".txt",
)


def write_case(seed: int, index: int, folder: Path) -> Case:
    """Draw a case and write it into a folder, with `block.yaml`."""
    draw = Random(f"{seed}-{index}")
    case = draw_truth(draw, index)
    case.plan = index % 10 == 0
    folder.mkdir(parents=True)
    buildings: dict[str, Any] = {}
    writer = write_outlines if draw.random() < 0.6 else write_models
    path = writer(draw, case, folder, buildings)
    keys: dict[str, Any] = {
        "name": "block",
        "buildings": buildings,
        "texture": {"walls": "translate", "panorama_width": 512},
    }
    if draw.random() < 0.3:
        keys["crs"] = case.place.frame
        case.made["crs key"] = True
    if draw.random() < 0.4:
        streets: dict[str, Any] = {}
        street_file = path if case.made["format"] == "pbf" else write_streets(draw, case, folder, streets)
        keys["streets"] = {"path": street_file.name} | streets
    else:
        case.streets = {}
    imagery: dict[str, Any] = {}
    if draw.random() < 0.35:
        imagery["panoramas"] = write_panoramas(draw, case, folder)
    else:
        case.cameras = []
    if draw.random() < 0.2:
        imagery["photos"] = write_photos(draw, case, folder)
    if imagery:
        keys["imagery"] = imagery
    if draw.random() < 0.1:
        path = _break_file(draw, case, path)
    buildings["path"] = path.name
    (folder / "block.yaml").write_text(json.dumps(keys, ensure_ascii=False), "utf-8")
    return case


def _break_file(draw: Random, case: Case, path: Path) -> Path:
    what = draw.choice((*_FILE_BREAKS, "suffix", "suffix", "companion"))
    case.break_with(f"file: {what}")
    if what == "suffix":
        suffix = draw.choice([one for one in _OTHER_SUFFIXES if not path.name.endswith(one)])
        return path.rename(path.with_suffix(suffix))
    if what == "companion":
        other = next(
            (
                one
                for one in (path.with_suffix(".dbf"), path.with_suffix(".bin"), path.with_suffix(".shx"))
                if one.exists()
            ),
            None,
        )
        if other is not None:
            other.unlink()
        return path
    path.write_bytes(_FILE_BREAKS[what](path.read_bytes()))
    return path
