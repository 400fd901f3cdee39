"""How far assumed storeys are from tagged ones that were held out: `python -m benchmarks.heights --data DIR` prints JSON.

The buildings of central Helsinki whose storeys or height are tagged (OpenStreetMap, ODbL) are hidden a fifth at a time, by
chance or by cells of 150 m, and assumed from the others, as a block's are. The numbers of `catalogs.buildings.settings` were
set by hand in view of such figures, so none of these buildings is apart from that choice; the eastern half is told beside all.
`constant` is the median of those left, for every building; `without step` the assumption before an id makes it one storey
less or more.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
import shapely

from catalogs.buildings import heights
from catalogs.buildings.assembly import assemble_buildings
from catalogs.buildings.settings import HEIGHTS
from catalogs.crs import parse_metric_crs
from catalogs.features import Footprint, Footprints
from catalogs.readers.vectors.osm import read_osm_footprints

STOREY_M = 3.2
CELL_M = 150.0
FOLDS = 5
FRAME = "EPSG:32635"


def measure(source: Footprints, folds: str) -> dict[str, Any]:
    """Errors over all, and over the eastern half."""
    frame = parse_metric_crs(FRAME)

    def storeys(footprints: tuple[Footprint, ...]) -> dict[str, float]:
        built = assemble_buildings([replace(source, items=footprints)], frame, area=None, floor_height=STOREY_M)
        return {building.id: building.height / STOREY_M for building in built.items}

    everything = assemble_buildings([source], frame, area=None, floor_height=STOREY_M).items
    tagged = {f.id for f in source.items if f.levels is not None or f.height is not None}
    # a part of an outline is not told apart here
    truth = {b.id: b.height / STOREY_M for b in everything if b.id in tagged and b.height_source != "default"}
    ids = sorted(truth)
    places = {b.id: shapely.get_coordinates(b.footprint.centroid)[0] for b in everything}
    centre = np.array([places[id] for id in ids])
    east = centre[:, 0] >= np.median(centre[:, 0])
    fold = _folds(centre, folds)
    assumed, constant = np.empty(len(ids)), np.empty(len(ids))
    for number in range(FOLDS):
        hidden = {id for id, own in zip(ids, fold.tolist(), strict=True) if own == number}
        items = tuple(replace(f, levels=None, height=None) if f.id in hidden else f for f in source.items)
        found, left = storeys(items), median(truth[id] for id in ids if id not in hidden)
        for row in np.flatnonzero(fold == number).tolist():
            assumed[row], constant[row] = found[ids[row]], left
    wanted = np.array([truth[id] for id in ids])
    return {
        part: {
            "buildings": int(chosen.sum()),
            "mean_error_storeys": round(float(np.abs(assumed - wanted)[chosen].mean()), 3),
            "mean_error_constant": round(float(np.abs(constant - wanted)[chosen].mean()), 3),
            "within_one_storey": round(float((np.abs(assumed - wanted) <= 1)[chosen].mean()), 3),
            "within_one_storey_constant": round(float((np.abs(constant - wanted) <= 1)[chosen].mean()), 3),
        }
        for part, chosen in (("all", np.ones(len(ids), bool)), ("eastern half", east))
    }


def _folds(centre: np.ndarray, by: str) -> np.ndarray:
    """The fold of each building, (n,)."""
    rng = np.random.default_rng(0)
    if by == "chance":
        return rng.permutation(len(centre)) % FOLDS
    _, cell = np.unique(np.floor(centre / CELL_M), axis=0, return_inverse=True)
    return (rng.permutation(cell.max() + 1) % FOLDS)[cell.reshape(-1)]


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Measure assumed storeys on tagged buildings that are held out.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with city/helsinki",
    )
    options = parser.parse_args(arguments)
    source = read_osm_footprints(options.data / "city" / "helsinki" / "Helsinki.osm.pbf")
    found = {by: measure(source, by) for by in ("chance", "cells")}
    with patch.object(heights, "HEIGHTS", replace(HEIGHTS, variation_share=0.0)):
        found |= {f"{by}, without step": measure(source, by) for by in ("chance", "cells")}
    print(json.dumps({"benchmark": "heights", "folds": found}, indent=1))


if __name__ == "__main__":
    main()
