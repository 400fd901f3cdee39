"""Whether a longer or freer search of tiles improves street walls: `python -m benchmarks.synthesis.search --data DIR`.

Prints JSON: tiles that the search changes and its energy (Eq. 4) before and after, over walls made from ECP and CMP exemplars,
with the generations of retargeting, with 4 and 16 times as many, and with 16 times as many where ground floors and end bays,
which retargeting holds fixed, are searched too: each node among tiles of its place in a bay (`free`), and among all columns,
from random tilings (`full`, Algorithm 2). --to DIR draws pairs of ground floors and end bays, one by retargeting as it is and
one by another search, in random order, with answers.csv and key.json as `streetloom bench blind_pairs` has them;
--answers DIR/answers.csv counts which search was preferred.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.blind_answers import write_key
from benchmarks.blind_pairs import sheet
from facade_core.core.errors import FacadeError
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.facade.texture import retargeting
from facade_core.facade.texture.genetic import NodeConstraints, evolve_tilings
from facade_core.facade.texture.scale import exemplar_scale
from training.datasets.facades import CMP, ECP, read_dataset

WALLS = 16
# Exemplars of each set from which those of the walls are drawn.
POOL = 40
SIZES = (((14.0, 13.0), 4), ((17.0, 18.0), 5), ((19.0, 11.0), 6), ((15.0, 22.0), 4))
SEARCHES = {"now": 1, "4x": 4, "16x": 16, "free": 16, "full": 16}
COMPARED = ("16x", "free", "full")
PAIRS = 24
# Size of a drawn wall foot: its lower part across the whole wall, pixels.
VIEW = (276, 368)
FOOT_M = 8.0


def main() -> None:
    """Measure, and draw pairs."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")))
    parser.add_argument("--to", type=Path, help="folder for the pairs, the key and the answers")
    parser.add_argument("--seed", type=int, default=24, help="of the walls, and of which is A")
    parser.add_argument("--answers", type=Path, help="the CSV that was filled in, beside its key")
    options = parser.parse_args()
    if options.answers:
        print(json.dumps(count_answers(options.answers), indent=1))
        return
    print(json.dumps(measure(options.data, options.to, options.seed), indent=1))


def measure(data: Path, to: Path | None, seed: int) -> dict[str, Any]:
    """The figures of all searches, and the pairs."""
    found: dict[str, list[dict[str, float]]] = defaultdict(list)
    views: dict[str, list[np.ndarray]] = defaultdict(list)
    for image, labels, scale in _exemplars(data, seed):
        size, floors = SIZES[len(found["now"]) % len(SIZES)]
        for name in SEARCHES:
            with _searching(name, found[name]):
                (wall,) = retargeting.retarget(image, labels, size, floors=floors, metres_per_pixel=scale, seed=seed)
            views[name].append(_foot(wall.image, scale))
        if len(found["now"]) == WALLS:
            break
    if to:
        _draw(views, to, seed)
    names = ("changed", "before", "after")
    return {
        "benchmark": "search",
        "walls": len(found["now"]),
        "searches": {
            name: {key: round(float(np.mean([row[key] for row in rows])), 3) for key in names}
            | {"differs_from_now": _differing(found["now"], rows)}
            for name, rows in found.items()
        },
    }


def _exemplars(data: Path, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray, float]]:
    """Exemplars with windows in random order, in turn of both sets, with their metres per pixel."""
    rng = np.random.default_rng(seed)
    sets = [list(islice(read_dataset(one, data / "facades" / one.name), POOL)) for one in (ECP, CMP)]
    shuffled = [[facades[i] for i in rng.permutation(len(facades))] for facades in sets]
    for facade in (one for pair in zip(*shuffled, strict=False) for one in pair):
        labels = np.where(facade.labels == UNKNOWN, FacadeClass.WALL, facade.labels).astype(np.uint8)
        try:
            retargeting.analyse_exemplar(facade.image, labels)
        except FacadeError:
            continue
        yield facade.image, labels, exemplar_scale(facade.image, labels)


def count_answers(path: Path) -> dict[str, dict[str, int]]:
    """How often each search, retargeting as it is, and neither was preferred, by the search that was compared."""
    key = json.loads(path.with_name("key.json").read_text(encoding="utf-8"))["pairs"]
    found: dict[str, dict[str, int]] = {name: {"preferred": 0, "now": 0, "neither": 0} for name in COMPARED}
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            pair, said = key[row["pair"]], row["preferred"].strip().upper()
            (name,) = {*pair.values()} - {"now"}
            chosen = "neither" if not said else "now" if pair[said] == "now" else "preferred"
            found[name][chosen] += 1
    return found


@contextmanager
def _searching(name: str, rows: list[dict[str, Any]]) -> Iterator[None]:
    """Search as `name` says, and append what a search changed."""

    def search(
        tables: Any, population: np.ndarray, nodes: NodeConstraints, *, generations: int, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        first = population[0].copy()
        if name in ("free", "full"):
            nodes = nodes._replace(frozen=np.zeros_like(nodes.frozen))
        if name == "full":
            wide = nodes.columns.shape[1]
            fixed = population.copy()
            population = fixed // wide * wide + rng.integers(0, wide, population.shape).astype(fixed.dtype)
            nodes = nodes._replace(columns=np.ones_like(nodes.columns))
        tiles, lowest = evolve_tilings(tables, population, nodes, generations=generations * SEARCHES[name], rng=rng)
        before = evolve_tilings(tables, np.repeat(first[None], len(population), 0), nodes, generations=1, rng=rng)[1][0]
        row = {"changed": float((tiles != first).mean()), "before": float(before), "after": float(lowest[-1])}
        rows.append(row | {"tiles": tiles})
        return tiles, lowest

    with patch.object(retargeting, "evolve_tilings", search):
        yield


def _differing(now: list[dict[str, Any]], rows: list[dict[str, Any]]) -> float:
    """The mean share of tiles that differ from those of retargeting as it is."""
    return round(float(np.mean([(a["tiles"] != b["tiles"]).mean() for a, b in zip(now, rows, strict=True)])), 3)


def _foot(wall: np.ndarray, scale: float) -> np.ndarray:
    """The lower part of a wall (h, w, 3), fitted into VIEW."""
    import cv2

    part = wall[-round(FOOT_M / scale) :]
    share = min(VIEW[0] / part.shape[0], VIEW[1] / part.shape[1])
    small = cv2.resize(part, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)[: VIEW[0], : VIEW[1]]
    drawn = np.full((*VIEW, 3), 255, np.uint8)
    drawn[: small.shape[0], : small.shape[1]] = small
    return drawn


def _draw(views: dict[str, list[np.ndarray]], to: Path, seed: int) -> None:
    from PIL import Image

    rng = np.random.default_rng(seed)
    to.mkdir(parents=True, exist_ok=True)
    chosen = [(wall, name) for name in COMPARED for wall in rng.permutation(WALLS)[: PAIRS // len(COMPARED)].tolist()]
    chosen = [chosen[i] for i in rng.permutation(len(chosen))]
    turned = rng.random(len(chosen)) < 0.5
    sides = [(name, "now") if turn else ("now", name) for (_, name), turn in zip(chosen, turned, strict=True)]
    pairs = [(views[a][wall], views[b][wall]) for (wall, _), (a, b) in zip(chosen, sides, strict=True)]
    for first in range(0, len(pairs), 8):
        Image.fromarray(sheet(pairs[first : first + 8], first + 1)).save(to / f"sheet-{first // 8 + 1}.png")
    write_key(to, sides, seed=seed)


if __name__ == "__main__":
    main()
