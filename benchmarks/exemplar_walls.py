"""Walls made from real exemplars: `python -m benchmarks.exemplar_walls --data DIR` prints one JSON object.

Exemplars are every twelfth ECP and every twelfth Art-Deco picture, without their labels; the walls are of a cut of Delfshaven.
--library large takes every fifth ECP and every 24th CMP picture instead, held-out as many others on another cut.
Those on streets are made as a run makes them, and counted: defects above detectors, and the largest share of one exemplar
(benchmarks/look/exemplar_walls.py says how), seconds of the processor a wall (median).
--sheet FILE keeps a contact sheet of at most 40 walls, evenly chosen; with --licensed, of those made from ECP and CMP pictures,
whose licences permit a copy. --prepared FOLDER keeps prepared exemplars for the next time.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import cv2
import numpy as np
import shapely
import yaml

from benchmarks.look.exemplar_walls import (
    ExemplarWall,
    count_defects,
    ground_proportions,
    has_roof_at_top,
    measure_wall,
    row_proportions,
)
from benchmarks.photo_walls import contact_sheet
from catalogs.block.reader import Block, read_block
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER
from facade_core.core.errors import ImageError
from facade_core.facade.exemplar_facade import BuildingPaint, ScaledStyle, build_facade_from_exemplar
from facade_core.facade.texture.retargeting import ExemplarAnalysis
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.geometry.walls import WallRole
from facade_core.plan.facade_walls import facade_wall
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.seeds import BUILDING_SEED, FACADE_SEED, unit_seed
from tasks.engine.unit import Unit
from tasks.stages.exemplars.record import ExemplarRecord
from tasks.stages.exemplars.shared import PreparedExemplar, read_shared_exemplar, write_shared_exemplar
from tasks.stages.exemplars.stage import exemplar_key
from tasks.stages.exemplars.worker import prepare_picture
from tasks.stages.facades.exemplar_facades import analyse_style
from tasks.stages.facades.stage import choose_facade_exemplars, exemplar_choice_walls, facade_shop_flags
from tasks.stages.ingest.planning import make_plan


class Library(NamedTuple):
    """Area of a cut, and its exemplars: data set, number of the first picture, step between pictures."""

    area: tuple[float, float, float, float]
    pictures: tuple[tuple[str, int, int], ...]


CUT = (4.45283, 51.90518, 4.45352, 51.90576)
LIBRARIES = {
    "small": Library(CUT, (("ecp", 0, 12), ("artdeco", 0, 12))),
    "large": Library(CUT, (("ecp", 0, 5), ("cmp", 0, 24))),
    "held-out": Library((4.45400, 51.90580, 4.45480, 51.90640), (("ecp", 2, 5), ("cmp", 12, 24))),
}
LICENSED = ("ecp", "cmp")
COVERED_MARGIN_M, GREY = 0.25, 225
SHEET_WALLS, MIN_SHEET_WIDTH_M, SHEET_HEIGHT_M = 40, 4.0, 15.0


def read_cut(data: Path, folder: Path, library: Library) -> Block:
    """Read the block of a cut, with its exemplars in a folder of their own."""
    exemplars = folder / "exemplars"
    exemplars.mkdir(parents=True)
    for name, first, step in library.pictures:
        for path in sorted((data / "facades" / name / "images").iterdir())[first::step]:
            (exemplars / f"{name}-{path.name}").write_bytes(path.read_bytes())
    os.environ["STREETLOOM_DATA"] = str(data)
    text = (EXAMPLE_BLOCKS_FOLDER / "delfshaven.yaml").read_text(encoding="utf-8")
    stated = yaml.safe_load(os.path.expandvars(text)) | {"area": list(library.area)}
    stated["imagery"] = {"exemplars": {"path": str(exemplars.resolve())}}
    file = folder / "block.yaml"
    file.write_text(yaml.safe_dump(stated), encoding="utf-8")
    return read_block(file)


def prepare_exemplars(run: Run, block: Block) -> dict[int, PreparedExemplar]:
    """Prepare the exemplars of a block, or read those that are; without those that cannot be."""
    (Path(run.shared) / "exemplars").mkdir(parents=True, exist_ok=True)
    found = {}
    for number, path in enumerate(block.exemplars):
        unit = Unit(number, path.stem, (exemplar_key(run, path),), (path,), 0)
        known = read_shared_exemplar(run, unit)
        try:
            found[number] = known or prepare_picture(run, unit)
        except ImageError:
            continue
        if known is None:
            write_shared_exemplar(run, unit, found[number])
    return found


def make_walls(
    run: Run, block: Block, plan: Plan, prepared: dict[int, PreparedExemplar]
) -> tuple[list[tuple[ExemplarWall, np.ndarray]], float]:
    """Make the street walls of a plan and measure them; with the median seconds of one."""
    facades, placement = plan.facades, plan.scene.placement
    records = [
        cast(ExemplarRecord, {"unit": path.stem, "key": "", "status": "done", **prepared[number].facts})
        if number in prepared
        else None
        for number, path in enumerate(block.exemplars)
    ]
    shops = facade_shop_flags(plan, block.shops)
    chosen = choose_facade_exemplars(plan, records, exemplar_choice_walls(plan, block, shops), seed=run.seed)
    proportions = {number: row_proportions(one.labels) for number, one in prepared.items()}
    grounds = {number: ground_proportions(one.labels) for number, one in prepared.items()}

    @cache
    def style(number: int, has_shops: bool, roof: bool) -> ExemplarAnalysis:
        return analyse_style(prepared[number].image, prepared[number].labels, shops=has_shops, roof=roof)

    found, seconds = [], []
    for facade in np.flatnonzero(facades.role == WallRole.STREET).tolist():
        number, name = chosen[facade]
        chart, roof = int(facades.chart[facade]), not facades.roofed[facade]
        along, density = float(facades.along[facade]), float(placement.texels_per_metre[chart])
        whole, own = style(number, True, roof), style(number, bool(shops[facade] != 0), roof)
        own_wall = facade_wall(plan.scene, facades, facade)
        begun = time.process_time()
        made = build_facade_from_exemplar(
            ScaledStyle(own, prepared[number].facts["metres_per_texel"], whole),
            own_wall,
            (int(placement.height[chart]), int(placement.width[chart])),
            span=(along, along + float(facades.width[facade])),
            paint=BuildingPaint(unit_seed(run, str(facades.house[facade]), BUILDING_SEED)),
            seed=unit_seed(run, facades.id[int(facades.run[facade])], FACADE_SEED),
        )
        seconds.append(time.process_time() - begun)
        roofed = has_roof_at_top(plan.scene.charts, plan.scene.mesh, chart)
        wall = measure_wall(
            facades.id[facade], name, made.labels, density, proportions[number], grounds[number], has_roof=roofed
        )
        found.append((wall, grey_covered(made.image, own_wall, along)))
    return found, float(np.median(seconds)) if seconds else 0.0


def grey_covered(image: np.ndarray, wall: FacadeWall, along: float) -> np.ndarray:
    """Return a wall's picture with the part grey that a neighbour covers, which nobody sees."""
    density = image.shape[0] / wall.height
    row, column = ((np.arange(side) + 0.5) / density for side in image.shape[:2])
    seen = shapely.contains_xy(wall.free.buffer(COVERED_MARGIN_M), *np.meshgrid(column + along, row))
    return np.where(seen[..., None], image, GREY).astype(np.uint8)


def draw_sheet(walls: Sequence[tuple[ExemplarWall, np.ndarray]]) -> np.ndarray:
    """Draw walls at one scale, each below its number and its defects."""
    tiles = []
    for wall, image in walls:
        density = float(np.sqrt(image.shape[0] * image.shape[1] / wall.square_metres))
        over = max(0, round(SHEET_HEIGHT_M * density) - image.shape[0])
        if image.shape[1] >= MIN_SHEET_WIDTH_M * density:
            tiles.append((wall, np.pad(image, ((over, 0), (0, 0), (0, 0)), constant_values=255)))
    chosen = [tiles[at] for at in np.unique(np.linspace(0, len(tiles) - 1, SHEET_WALLS).astype(int)).tolist()]
    return contact_sheet([(" ".join([str(n), *wall.defects]), image) for n, (wall, image) in enumerate(chosen, 1)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument(
        "--data", type=Path, required=True, help="folder with city/delfshaven, facades/ecp, artdeco and cmp"
    )
    parser.add_argument("--library", choices=LIBRARIES, default="small", help="exemplars and cut")
    parser.add_argument("--prepared", type=Path, help="folder that keeps prepared exemplars; none without")
    parser.add_argument("--sheet", type=Path, help="contact sheet of the walls, a JPEG")
    parser.add_argument("--licensed", action="store_true", help="draw only walls of which a copy is permitted")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="exemplar-walls-") as temporary:
        folder = Path(temporary)
        block = read_cut(options.data.resolve(), folder, LIBRARIES[options.library])
        run = replace(create_run(block, folder / "run"), shared=str(options.prepared or folder))
        prepared = prepare_exemplars(run, block)
        walls, seconds = make_walls(run, block, make_plan(block), prepared)
    if options.sheet is not None:
        drawn = [one for one in walls if not options.licensed or one[0].source.startswith(LICENSED)]
        cv2.imwrite(str(options.sheet), draw_sheet(drawn)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80])
    result: dict[str, Any] = {"benchmark": "exemplar_walls", **count_defects([wall for wall, _ in walls])}
    print(json.dumps(result | {"seconds_a_wall": round(seconds, 2)}, indent=1))


if __name__ == "__main__":
    main()
